"""T-splines in files: one reader and one writer of files of any kind, whose ending decides.

| ending | what is written |
|---|---|
| .tspline | bonecam's own text form of closed rows, bit for bit |
| .step, .stp, .iges, .igs | one exact B-spline face, or Bezier faces (`surface.files.cad`; extra `cad`) |
| others | what plugins write (`bonecam.plugins.Reader`) |

The text form has one record a line, numbers in the shortest decimal that reads back as the same double:

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

from itertools import islice
from pathlib import Path

import numpy as np

from bonecam.errors import FileError
from bonecam.files import write_whole
from bonecam.mesh.files.cad import IGES, STEP, occ
from bonecam.mesh.files.mesh_files import bytes_of, made_by, reader_of
from bonecam.mesh.files.polygons import CUT_SHORT, ContentError, finite_numbers, numbered_words, whole_numbers
from bonecam.plugins import Reader, reader_endings, run_added
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline
from bonecam.text.numbers import number_words

TSPLINE = ".tspline"
"""The ending of files in bonecam's own form."""
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


def _reader_of(path: str | Path) -> Reader | None:
    """What users or packages read a file with that is not in bonecam's own form."""
    return None if Path(path).suffix.lower() == TSPLINE else reader_of(path)


def holds_tspline(path: str | Path) -> bool:
    """Whether a file gives a T-spline, by its ending."""
    reader = _reader_of(path)
    return reader.holds == "surface" if reader else Path(path).suffix.lower() == TSPLINE


def load_surface(path: str | Path) -> TSpline:
    """The T-spline of a file, mm: in bonecam's own form, whatever its ending, or with one that a plugin reads surfaces
    from. FileError names the line where it is damaged."""
    path = Path(path)
    data = bytes_of(path)
    reader = _reader_of(path)
    if reader is not None and not data.startswith(HEADER.encode()):
        return made_by(reader, path, TSpline)
    first = data.split(b"\n", 1)[0].strip().decode(errors="replace")
    if first != HEADER:
        what = f"the first line must be '{HEADER}', not '{first[:40]}'"
        raise FileError(f"{path}: {what}", file=str(path), line=1)
    try:
        # The surface in bytes of the text form above. ContentError with the line where they depart from it.
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
    except ContentError as error:
        raise FileError(f"{path}: {error}", file=str(path), **error.evidence) from error


def check_target(path: str | Path) -> None:
    """FileError, before any work is done for it, where a surface cannot be saved under this name."""
    ending = Path(path).suffix.lower()
    if ending in (*STEP, *IGES):
        occ(f"{path}: writing {'STEP' if ending in STEP else 'IGES'}")
    elif ending != TSPLINE:
        reader = reader_of(path)
        if reader is None or reader.write is None:
            endings = ", ".join((TSPLINE, *reader_endings(), *STEP, *IGES))
            what = f"has the unknown ending {ending!r}" if reader is None else f"is no file to write: {ending} is read"
            raise FileError(f"{path}: {what}: end the name in one of {endings}", file=str(path))


def save_surface(surface: TSpline, path: str | Path) -> None:
    """Write the surface, whole or not at all. FileError where the ending is unknown, unfit for the T-mesh, or
    its writer is missing."""
    check_target(path)
    ending = Path(path).suffix.lower()
    reader = _reader_of(path)
    if reader is not None and reader.write is not None:
        with run_added("readers", ending.removeprefix(".")):
            reader.write(surface, Path(path))
    elif ending == TSPLINE:
        if not isinstance(surface.tmesh, RowTMesh):
            remedy = f"end the name in one of {', '.join((*reader_endings(), *STEP, *IGES))}"
            raise FileError(f"{path}: only closed rows have a {TSPLINE} form: {remedy}", file=str(path))
        write_whole(path, rows_text(surface))
    else:
        from bonecam.surface.files.cad import write_iges, write_step

        (write_step if ending in STEP else write_iges)(surface, path)
