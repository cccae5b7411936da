"""Row-structured T-splines as text, bit for bit.

The half-edge records of a .tsm file cannot hold such a surface: rows that share no knot have no vertical edge
to bound their faces, and a pole is one control point where .tsm wants a vertex of valence n. So it has its
own form, one record a line, numbers in the shortest decimal that reads back as the same double:

    #bonecam-tspline 1
    degree 3
    units mm
    t-knots 0.0 0.0 0.0 0.0 0.25 ... 1.0        one clamped vector for all rows: number of rows + 4
    row 0 1                                     row number, number of control points; 1: a pole
    0.0 x y z w                                 knot in [0, 1), control point (not homogeneous), weight
    row 1 9                                     periodic cubic in s; the knots of this row only
    ...
    end

S(s, t) = sum_ji w_ji N_j(t) B_ji(s) P_ji / sum_ji w_ji N_j(t) B_ji(s); N_j is the cubic B-spline on t-knots[j
: j + 5], B_ji the periodic cubic B-spline whose middle knot is knot i of row j, 1 for a pole. Lines that
start with # and empty lines are comments.
"""

from pathlib import Path

import numpy as np

from bonecam.errors import FileError
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tspline import TSpline
from bonecam.text.numbers import number

HEADER = "#bonecam-tspline 1"


def rows_text(surface: TSpline) -> str:
    """The surface in the text form above."""
    mesh = surface.tmesh
    starts = mesh.row_starts
    lines = [HEADER, "degree 3", "units mm", "t-knots " + _words(mesh.t_knots)]
    for j, knots in enumerate(mesh.s_knots):
        lines.append(f"row {j} {len(knots)}")
        here = slice(starts[j], starts[j + 1])
        records = np.column_stack([knots, surface.control_points[here], surface.weights[here]])
        lines += [_words(record) for record in records]
    return "\n".join([*lines, "end", ""])


def read_rows(text: str, path: Path) -> TSpline:
    """The surface of the text form above. Raises FileError with the line where the text departs from it."""
    records = [
        (n, line.split())
        for n, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.startswith("#")
    ]
    return _RowsReader(path, records).surface()


def _words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


class _RowsReader:
    """Takes the records one by one; every complaint names the line."""

    def __init__(self, path: Path, records: list[tuple[int, list[str]]]) -> None:
        self.path = path
        self.records = records
        self.next = 0

    def surface(self) -> TSpline:
        self._expect(["degree", "3"])
        self._expect(["units", "mm"])
        line, words = self._take()
        if words[0] != "t-knots":
            raise self._error(line, "expected 't-knots'")
        t_knots = self._numbers(line, words[1:], None)
        rows: list[np.ndarray] = []
        line, words = self._take()
        while words != ["end"]:
            rows.append(self._row(line, words, len(rows)))
            line, words = self._take()
        try:
            mesh = RowTMesh.from_rows(t_knots, [row[:, 0] for row in rows])
            return TSpline(
                mesh, np.vstack([row[:, 1:4] for row in rows]), np.concatenate([row[:, 4] for row in rows])
            )
        except ValueError as error:
            raise self._error(self.records[-1][0], str(error)) from error

    def _row(self, line: int, words: list[str], expected: int) -> np.ndarray:
        if (
            len(words) != 3
            or words[:2] != ["row", str(expected)]
            or not words[2].isdigit()
            or words[2] == "0"
        ):
            raise self._error(line, f"expected 'row {expected} COUNT' or 'end'")
        return np.array([self._numbers(*self._take(), 5) for _ in range(int(words[2]))])

    def _numbers(self, line: int, words: list[str], count: int | None) -> np.ndarray:
        try:
            values = np.array([number(word) for word in words])
        except ValueError as error:
            raise self._error(line, str(error)) from error
        if (count is not None and len(values) != count) or not np.isfinite(values).all():
            raise self._error(line, f"expected {count or 'only'} finite numbers")
        return values

    def _expect(self, words: list[str]) -> None:
        line, line_words = self._take()
        if line_words != words:
            raise self._error(line, f"expected '{' '.join(words)}'")

    def _take(self) -> tuple[int, list[str]]:
        if self.next == len(self.records):
            raise self._error(self.records[-1][0] if self.records else 1, "the file ends before 'end'")
        self.next += 1
        return self.records[self.next - 1]

    def _error(self, line: int, message: str) -> FileError:
        return FileError(f"{self.path} line {line}: {message}", file=str(self.path), line=line)
