"""B-spline surfaces from the faces of STEP and IGES files, through OpenCASCADE (optional extra `cad`)."""

from pathlib import Path
from typing import Any

import numpy as np

from bonecam.errors import FileError
from bonecam.mesh.files.cad_files import in_child
from bonecam.mesh.files.cad_shapes import faces_of, read_shape
from bonecam.mesh.files.opencascade import occ
from bonecam.progress import Progress, silent
from bonecam.surface.files.bspline.bspline_surface import BSplineSurface, Knots
from bonecam.surface.files.cad.shapes import EDGE


def read_bsplines(path: str | Path) -> tuple[BSplineSurface, ...]:
    """The bicubic (or lower) B-spline surfaces under the faces of a STEP or IGES file, in mm, untrimmed and
    in the file's order.

    Raises FileError as `mesh.files.cad_files` does, and where a face lies on another kind of surface: read such a
    part with `read_mesh`.
    """
    surfaces: tuple[BSplineSurface, ...] = in_child(f"{__name__}:bsplines_in", Path(path))
    return surfaces


def bsplines_in(file: str | Path, progress: Progress = silent) -> tuple[BSplineSurface, ...]:
    """As `read_bsplines`, in this process, which a damaged file may end."""
    return tuple(_bspline_of(face, Path(file)) for face in faces_of(read_shape(file)))


def _bspline_of(face: Any, file: Path) -> BSplineSurface:
    """The surface under a face; FileError where it is no B-spline of degree 3 or less."""
    lib = occ()
    spline = lib.BRep.BRep_Tool.Surface_s(face)
    if not isinstance(spline, lib.Geom.Geom_BSplineSurface) or max(spline.UDegree(), spline.VDegree()) > 3:
        kind = type(spline).__name__.removeprefix("Geom_")
        raise FileError(
            f"{file}: a face lies on a {kind}, no bicubic B-spline: read the part as a mesh", file=str(file), kind=kind
        )
    spline.IncreaseDegree(3, 3)
    loose = (not spline.IsUPeriodic() and spline.UMultiplicity(1) < 4) or (
        not spline.IsVPeriodic() and spline.VMultiplicity(1) < 4
    )
    if loose:
        spline.Segment(*spline.Bounds(), EDGE, EDGE)  # end knots four times, by knot insertion
    size = spline.NbUPoles(), spline.NbVPoles()
    poles = [[spline.Pole(i, j) for j in range(1, size[1] + 1)] for i in range(1, size[0] + 1)]
    weights = [[spline.Weight(i, j) for j in range(1, size[1] + 1)] for i in range(1, size[0] + 1)]
    s_knots, t_knots = (_knots_along(spline, way) for way in "UV")
    return BSplineSurface(
        s_knots, t_knots, np.array([[(p.X(), p.Y(), p.Z()) for p in row] for row in poles]), np.array(weights)
    )


def _knots_along(spline: Any, way: str) -> Knots:
    """The knots of OpenCASCADE's B-spline along "U" or "V"."""
    count, knot, multiplicity, closed = (
        getattr(spline, name) for name in (f"Nb{way}Knots", f"{way}Knot", f"{way}Multiplicity", f"Is{way}Periodic")
    )
    numbers = range(1, count() + 1)
    return Knots(np.array([knot(i) for i in numbers]), np.array([multiplicity(i) for i in numbers]), closed())
