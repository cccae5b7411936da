"""T-splines as text files. One reader and one writer, `read_tsm` and `write_tsm`, for two forms, told apart
by the first line:

- `#TS0200`: half edges and control points, as Rhino's T-Splines and Fusion write them: general T-meshes
  (surface.tsm);
- `#bonecam-tspline 1`: row-structured T-splines, which half edges cannot hold (surface.rows_file).

Both come back bit for bit. Any other first line is a FileError.

One surface into a file of any kind: the ending decides.

| ending | what is written |
|---|---|
| .tspline | bonecam's own text form of row-structured T-splines, bit for bit (`surface.rows_file`) |
| .tsm | general T-meshes as Rhino writes them (`surface.files.tsm.write`) |
| .iga | the Bezier elements of any T-spline, bit for bit (`surface.iga`) |
| .step, .stp, .iges, .igs | one exact B-spline face, or Bezier faces (`surface.cad`; extra `cad`) |
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FileError, SurfaceError, file_error
from bonecam.files import write_whole
from bonecam.mesh.files.cad import IGES, STEP, occ
from bonecam.mesh.files.mesh_files import bytes_of
from bonecam.mesh.files.polygons import ContentError
from bonecam.surface.files import rows_file
from bonecam.surface.files.iga import write_iga
from bonecam.surface.files.tsm import (
    MIRRORED,
    TSM_HEADER,
    Records,
    parse_tsm,
    tmesh_of,
    tsm_text,
    with_mirrored_borders,
)
from bonecam.surface.tmesh import OpenRowTMesh, RowTMesh, TMesh
from bonecam.surface.tspline import TSpline

ENDINGS = (".tspline", ".tsm")
"""Endings of the files that `read_tsm` reads."""
MILLIMETRES = {"millimeters": 1.0, "centimeters": 10.0, "meters": 1000.0, "inches": 25.4, "feet": 304.8}


def read_tsm(path: str | Path, *, homogeneous: bool = False, to_mm: bool = False) -> TSpline:
    """The T-spline of a file of either form.

    A .tsm file does not say whether its control points are (x, y, z) or homogeneous (w x, w y, w z): they are
    taken as they stand, S = sum w P B / sum w B, unless `homogeneous`, which divides them by their weight
    first. `to_mm` converts them from the file's `units` (only the unit's name counts; the number before it is
    a tolerance). An open border without clamped control points needs `end-conditions SUBD_CREASES`
    (surface.files.tsm.borders). Raises FileError naming line and record.
    """
    path = Path(path)
    data = bytes_of(path)
    text = data.decode("utf-8", errors="replace")
    first = text.split("\n", 1)[0].strip()
    try:
        if first == rows_file.HEADER:
            return rows_file.parse_rows(data)
    except ContentError as error:
        raise FileError(f"{path}: {error}", file=str(path), **error.evidence) from error
    if first.split()[:1] != [TSM_HEADER]:
        raise FileError(
            f"{path}: the first line must be '{TSM_HEADER}' or '{rows_file.HEADER}', not '{first[:40]}'",
            file=str(path),
            line=1,
        )
    return _read_half_edges(parse_tsm(text, path), path, homogeneous, to_mm)


def _read_half_edges(records: Records, path: Path, homogeneous: bool, to_mm: bool) -> TSpline[TMesh]:
    try:
        tmesh, numbers = tmesh_of(records)
        values = _control_points(records, numbers)
        weights = values[:, 3:]
        points = values[:, :3] / weights if homogeneous else values[:, :3]
        points = points * (_scale(records.header, path) if to_mm else 1.0)
        stated = records.header.get("end-conditions") == [MIRRORED]
        if stated and not records.owners and not all(tmesh.period):
            tmesh, control_points = with_mirrored_borders(tmesh, np.column_stack([points * weights, weights]))
            added = control_points[len(points) :]
            points = np.vstack([points, added[:, :3] / added[:, 3:]])
            weights = control_points[:, 3:]
        assert len(tmesh.elements.boxes)
        return TSpline(tmesh, points, weights[:, 0])
    except (SurfaceError, ValueError) as error:
        raise FileError(f"{path}: {error}", file=str(path), **getattr(error, "evidence", {})) from error


def _control_points(records: Records, numbers: list[int]) -> Float[ndarray, "n 4"]:
    """x, y, z and weight of the control points with these numbers in the file."""
    points = []
    for k in numbers:
        point = records.grips[k]
        if point is None:
            raise records.error("0g", k, "a control point in use is deleted")
        if not point[3] > 0:
            raise records.error("0g", k, f"weight {point[3]} is not positive")
        points.append(point)
    return np.array(points)


def write_tsm(surface: TSpline, path: str | Path, *, homogeneous: bool = False) -> None:
    """Write the surface, row-structured ones as `#bonecam-tspline 1`, others as `#TS0200`; `read_tsm` gives
    every number back bit for bit.

    `homogeneous` as in `read_tsm`. Raises SurfaceError for a T-mesh that half edges cannot hold: some that
    were refined beside a corner of the domain that turns inwards. `write_iga` holds every surface.
    """
    if isinstance(surface.tmesh, OpenRowTMesh):
        raise SurfaceError("rows that are open have no text form: write_tsm takes closed rows and general T-meshes")
    if isinstance(surface.tmesh, RowTMesh):
        if homogeneous:
            raise ValueError("row-structured files hold points that are not homogeneous")
        write_whole(path, rows_file.rows_text(surface))
    else:
        text = tsm_text(surface, homogeneous)
        _prove(text, surface, Path(path))
        write_whole(path, text)


def _prove(text: str, surface: TSpline[TMesh], path: Path) -> None:
    """Read the text back: every vertex must see what it saw, else the file would hold another surface."""
    try:
        tmesh, numbers = tmesh_of(parse_tsm(text, path))
        same = numbers == list(range(surface.tmesh.size)) and all(
            np.array_equal(a, b) for a, b in zip(tmesh.local_knots, surface.tmesh.local_knots)
        )
    except (FileError, SurfaceError):
        same = False
    if not same:
        raise SurfaceError(
            "half edges cannot hold this T-mesh, whose lines with one knot part at a corner: write_iga can",
            file=str(path),
        )


def _scale(header: dict[str, list[str]], path: Path) -> float:
    unit = header.get("units", ["", "?"])[-1]
    if unit not in MILLIMETRES:
        raise file_error(path, f"its unit {unit!r} is not known", f"state one of {', '.join(MILLIMETRES)} (units)")
    return MILLIMETRES[unit]


TEXTS = (*ENDINGS, ".iga")


def check_target(path: str | Path) -> None:
    """FileError, before any work is done for it, where a surface cannot be saved under this name."""
    ending = Path(path).suffix.lower()
    if ending in (*STEP, *IGES):
        occ(f"{path}: writing {'STEP' if ending in STEP else 'IGES'}")
    elif ending not in TEXTS:
        endings = ", ".join((*TEXTS, *STEP, *IGES))
        raise FileError(f"{path}: has the unknown ending {ending!r}: end the name in one of {endings}", file=str(path))


def save_surface(surface: TSpline, path: str | Path) -> None:
    """Write the surface, whole or not at all. FileError where the ending is unknown, unfit for the T-mesh, or
    its writer is missing."""
    check_target(path)
    ending = Path(path).suffix.lower()
    if ending == ".iga":
        write_iga(surface, path)
    elif ending in TEXTS:
        rows = isinstance(surface.tmesh, RowTMesh)
        if rows != (ending == ".tspline"):
            what = "rows of control points have no .tsm form" if rows else "a general T-mesh has no .tspline form"
            raise FileError(f"{path}: {what}: end the name in {'.tspline' if rows else '.tsm'}", file=str(path))
        write_tsm(surface, path)
    else:
        from bonecam.surface.files.cad import write_iges, write_step

        (write_step if ending in STEP else write_iges)(surface, path)
