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

from collections.abc import Iterable
from itertools import islice

import numpy as np

from bonecam.mesh.files.polygons import CUT_SHORT, ContentError, finite_numbers, numbered_words, whole_numbers
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

HEADER = "#bonecam-tspline 1"


def rows_text(surface: TSpline) -> str:
    """The surface in the text form above."""
    mesh = surface.tmesh
    starts = mesh.row_starts
    lines = [HEADER, "degree 3", "units mm", "t-knots " + number_words(mesh.t_knots)]
    for j, knots in enumerate(mesh.s_knots):
        lines.append(f"row {j} {len(knots)}")
        here = slice(starts[j], starts[j + 1])
        records = np.column_stack([knots, surface.control_points[here], surface.weights[here]])
        lines += [number_words(record) for record in records]
    return "\n".join([*lines, "end", ""])


def parse_rows(data: bytes) -> TSpline:
    """The surface in bytes of the text form above. ContentError with the line where they depart from it."""
    lines = numbered_words(data)
    end = (data.count(b"\n"), [""])
    for words in (["degree", "3"], ["units", "mm"]):
        line, given = next(lines, end)
        if given != words:
            raise ContentError(f"expected {' '.join(words)!r}", line=line)
    line, (word, *knots) = next(lines, end)
    if word != "t-knots":
        raise ContentError("expected 't-knots'", line=line)
    t_knots = finite_numbers(knots, line)
    rows: list[np.ndarray] = []
    line, words = next(lines, end)
    while words != ["end"]:
        count = max(whole_numbers(words[2:], line), default=0)
        if len(words) != 3 or words[:2] != ["row", str(len(rows))] or count < 1:
            raise ContentError(f"expected 'row {len(rows)} COUNT' or 'end'", line=line)
        rows.append(np.array([finite_numbers(row, n, 5) for n, row in islice(lines, count)]))
        line, words = next(lines, end)
    after = next(lines, None)
    if after:
        raise ContentError("goes on after 'end'", CUT_SHORT, after[0])
    try:
        mesh = RowTMesh.from_rows(t_knots, [row[:, 0] for row in rows])
        points = np.vstack(rows)
        return TSpline(mesh, points[:, 1:4], points[:, 4])
    except ValueError as error:
        raise ContentError(str(error), line=line) from error


def number_words(values: Iterable[float]) -> str:
    """Numbers in the shortest decimals that read back as the same doubles."""
    return " ".join(repr(float(value)) for value in values)
