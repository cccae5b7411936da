"""A surface that is machined alone, from a file: closed or open, in the parameters that its passes follow."""

from pathlib import Path

from bonecam.errors import FileError, SurfaceError
from bonecam.mesh.files.opencascade import IGES, STEP
from bonecam.mesh.files.point_files import POINTS
from bonecam.mesh.units import MM_OF
from bonecam.surface.files.bspline.to_tspline import from_bspline
from bonecam.surface.files.cad.read import read_bsplines
from bonecam.surface.files.save import TEXTS
from bonecam.surface.files.tspline_text import read_tsm
from bonecam.surface.skinning.point_rows import read_rows
from bonecam.surface.tspline import TSpline

KINDS = (*POINTS, *TEXTS, *STEP, *IGES)
"""Endings of the files that hold such a surface."""


def read_machined_surface(path: str | Path, units: str, tolerance: float) -> TSpline:
    """The surface in a file, mm: rows of points (in `units`), skinned within `tolerance` mm; a saved T-spline; or the
    B-spline of a STEP or IGES file with one face.

    FileError or SurfaceError where the file holds no such surface, or one that closes on itself in t.
    """
    file = Path(path)
    ending = file.suffix.lower()
    if ending in TEXTS:
        surface = read_tsm(file)
    elif ending in (*STEP, *IGES):
        surface = _only_face(file)
    elif ending in POINTS:
        try:
            surface = read_rows(file).scaled(MM_OF[units]).skin(tolerance)
        except ValueError as error:
            raise SurfaceError(f"{file}: {error}", file=str(file)) from error
    else:
        endings = ", ".join(KINDS)
        raise FileError(
            f"{file}: has the ending {ending!r}: give a surface that passes can follow ({endings})",
            file=str(file),
        )
    if surface.elements().period[1]:
        raise SurfaceError(f"{file}: closes on itself in t: cut it open there", file=str(file))
    return surface


def _only_face(file: Path) -> TSpline:
    """The surface under the only face of a CAD file."""
    faces = read_bsplines(file)
    if len(faces) != 1:
        raise FileError(f"{file}: has {len(faces)} faces: save the one to machine by itself", file=str(file))
    return from_bspline(faces[0])
