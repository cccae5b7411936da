"""B-spline surfaces from the faces of STEP and IGES files, through OpenCASCADE (optional extra `cad`)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from bonecam.errors import FileError
from bonecam.mesh.files.cad_files import in_child
from bonecam.mesh.files.cad_shapes import faces_of, read_shape
from bonecam.mesh.files.opencascade import occ
from bonecam.surface.files.bspline.bspline_surface import BSplineSurface, Knots
from bonecam.surface.files.cad.shapes import EDGE


def read_bsplines(path: str | Path) -> tuple[BSplineSurface, ...]:
    """The bicubic (or lower) B-spline surfaces under the faces of a STEP or IGES file, in mm, untrimmed and
    in the file's order.

    Raises FileError as `mesh.files.cad_files` does, and where a face lies on another kind of surface: read such a
    part with `read_mesh`.
    """
    found = in_child(f"{__name__}:bspline_arrays", Path(path))
    return tuple(
        BSplineSurface(
            _knots_of(found, f"{n} s"), _knots_of(found, f"{n} t"), found[f"{n} poles"], found[f"{n} weights"]
        )
        for n in range(len(found) // 8)
    )


def bspline_arrays(file: Path) -> dict[str, ndarray]:
    """The B-spline surfaces of a file as arrays, eight a surface, which a child process returns to
    `read_bsplines`.
    """
    found: dict[str, ndarray] = {}
    for n, surface in enumerate(bsplines_in(file)):
        found |= {f"{n} poles": surface.poles, f"{n} weights": surface.weights}
        for way, knots in (("s", surface.s_knots), ("t", surface.t_knots)):
            found |= {
                f"{n} {way} values": knots.values,
                f"{n} {way} counts": knots.multiplicities,
                f"{n} {way} closed": np.array(knots.closed),
            }
    return found


def _knots_of(found: Mapping[str, ndarray], name: str) -> Knots:
    return Knots(found[f"{name} values"], found[f"{name} counts"], bool(found[f"{name} closed"]))


def bsplines_in(file: Path) -> tuple[BSplineSurface, ...]:
    """As `read_bsplines`, in this process, which a damaged file may end."""
    return tuple(_bspline_of(face, file) for face in faces_of(read_shape(file)))


def _bspline_of(face: Any, file: Path) -> BSplineSurface:
    """The surface under a face; FileError where it is no B-spline of degree 3 or less."""
    lib = occ()
    found = lib.BRep.BRep_Tool.Surface_s(face)
    if not isinstance(found, lib.Geom.Geom_BSplineSurface) or max(found.UDegree(), found.VDegree()) > 3:
        kind = type(found).__name__.removeprefix("Geom_")
        raise FileError(
            f"{file}: a face lies on a {kind}, no bicubic B-spline: read the part as a mesh",
            file=str(file),
            kind=kind,
        )
    found.IncreaseDegree(3, 3)
    loose = (not found.IsUPeriodic() and found.UMultiplicity(1) < 4) or (
        not found.IsVPeriodic() and found.VMultiplicity(1) < 4
    )
    if loose:
        found.Segment(*found.Bounds(), EDGE, EDGE)  # end knots four times, by knot insertion
    size = found.NbUPoles(), found.NbVPoles()
    poles = [[found.Pole(i, j) for j in range(1, size[1] + 1)] for i in range(1, size[0] + 1)]
    weights = [[found.Weight(i, j) for j in range(1, size[1] + 1)] for i in range(1, size[0] + 1)]
    s_knots, t_knots = (_knots_along(found, way) for way in "UV")
    return BSplineSurface(
        s_knots, t_knots, np.array([[(p.X(), p.Y(), p.Z()) for p in row] for row in poles]), np.array(weights)
    )


def _knots_along(spline: Any, way: str) -> Knots:
    """The knots of OpenCASCADE's B-spline along "U" or "V"."""
    count, knot, multiplicity, closed = (
        getattr(spline, name)
        for name in (f"Nb{way}Knots", f"{way}Knot", f"{way}Multiplicity", f"Is{way}Periodic")
    )
    numbers = range(1, count() + 1)
    return Knots(np.array([knot(i) for i in numbers]), np.array([multiplicity(i) for i in numbers]), closed())
