"""A surface that is machined alone, from a file or a mesh: closed or open, in the parameters that its passes follow."""

from pathlib import Path

from bonecam.errors import SurfaceError, file_error
from bonecam.mesh.files.mesh_files import MESHES, read_in_mm
from bonecam.mesh.files.opencascade import IGES, STEP
from bonecam.mesh.files.point_files import POINTS
from bonecam.mesh.triangle_mesh import MeshLike, mesh_from
from bonecam.mesh.units import mm_of, to_mm
from bonecam.surface.files.bspline.to_tspline import from_bspline
from bonecam.surface.files.cad.read import read_bsplines
from bonecam.surface.files.tspline_text import ENDINGS, read_tsm
from bonecam.surface.skinning.mesh_patch import patch_surface
from bonecam.surface.skinning.point_rows import read_rows
from bonecam.surface.tspline import TSpline

KINDS = (*POINTS, *ENDINGS, *STEP, *IGES, *MESHES)
"""Endings of the files that hold such a surface."""


def machined_surface(source: str | Path | MeshLike, units: str, tolerance: float) -> TSpline:
    """The surface in a file, mm: rows of points or an open mesh (in `units`), skinned within `tolerance` mm; a saved
    T-spline; or the B-spline of a STEP or IGES file with one face. Or that of an open mesh in memory.

    FileError or SurfaceError where the file holds no such surface, or one that closes on itself in t.
    """
    if not isinstance(source, str | Path):
        return patch_surface(to_mm(mesh_from(source), units), tolerance)
    file = Path(source)
    ending = file.suffix.lower()
    if ending in ENDINGS:
        surface = read_tsm(file)
    elif ending in (*STEP, *IGES):
        faces = read_bsplines(file)
        if len(faces) != 1:
            raise file_error(file, f"has {len(faces)} faces", "save the one to machine by itself")
        surface = from_bspline(faces[0])
    elif ending in (*POINTS, *MESHES):
        try:
            if ending in POINTS:
                surface = read_rows(file).scaled(mm_of(units)).skin(tolerance)
            else:
                surface = patch_surface(read_in_mm(file, units), tolerance)
        except (ValueError, SurfaceError) as error:
            raise SurfaceError(f"{file}: {error}", file=str(file)) from error
    else:
        endings = ", ".join(KINDS)
        remedy = f"give a surface that passes can follow ({endings})"
        raise file_error(file, f"has the ending {ending!r}", remedy)
    if surface.elements().period[1]:
        raise SurfaceError(f"{file}: closes on itself in t: cut it open there", file=str(file))
    return surface
