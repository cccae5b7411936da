"""A T-spline as a shape of OpenCASCADE: one face of its exact B-spline, or its Bezier elements sewn."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.mesh.files.cad_shapes import sew
from bonecam.mesh.files.opencascade import occ
from bonecam.surface.files.bspline.bspline_surface import BSplineSurface
from bonecam.surface.files.bspline.from_tspline import to_bspline
from bonecam.surface.tspline import TSpline

EDGE = 1e-7
"""Tolerance of the faces' edges, mm: OpenCASCADE's own."""


JOINED = 1e-9
"""Share of the size: Bezier faces whose edges are nearer than this are joined."""


def shape_of(surface: TSpline) -> Any:
    """The surface as a valid OpenCASCADE solid, or as a shell where it encloses no volume. Raises
    SurfaceError where it is not valid."""
    try:
        spline = to_bspline(surface)
    except SurfaceError:
        shape = _bezier_shell(surface)
    else:
        shell = _compose("Shell", [_face_of(_geometry(spline))])
        shape = _solid_in(shell) if spline.watertight else shell
    if not occ().BRepCheck.BRepCheck_Analyzer(shape).IsValid():
        raise SurfaceError(
            "OpenCASCADE finds the shape of the surface invalid: look for folds with its self-intersections"
        )
    return shape


def _geometry(spline: BSplineSurface) -> Any:
    """OpenCASCADE's B-spline surface with u = s and v = t."""
    lib = occ()
    knots = (spline.s_knots, spline.t_knots)
    values = [_list(lib.collections.Array1_double, k.values) for k in knots]
    counts = [_list(lib.collections.Array1_int, k.multiplicities) for k in knots]
    closed = [k.closed for k in knots]
    weights = (_grid(lib.collections.Array2_double, spline.weights.tolist()),) if spline.rational else ()
    return lib.Geom.Geom_BSplineSurface(_points(spline.poles), *weights, *values, *counts, 3, 3, *closed)


def _points(poles: Float[ndarray, "a b 3"]) -> Any:
    lib = occ()
    return _grid(lib.collections.Array2_gp_Pnt, [[lib.gp.gp_Pnt(*pole) for pole in row] for row in poles.tolist()])


def _list(kind: Any, values: ndarray) -> Any:
    array = kind(1, len(values))
    for i, value in enumerate(values.tolist(), 1):
        array.SetValue(i, value)
    return array


def _grid(kind: Any, rows: list[list[Any]]) -> Any:
    array = kind(1, len(rows), 1, len(rows[0]))
    for i, row in enumerate(rows, 1):
        for j, value in enumerate(row, 1):
            array.SetValue(i, j, value)
    return array


def _face_of(geometry: Any) -> Any:
    return occ().BRepBuilderAPI.BRepBuilderAPI_MakeFace(geometry, EDGE).Face()


def _compose(kind: str, parts: Iterable[Any]) -> Any:
    """The parts in a Compound, a Shell or a Solid."""
    lib = occ()
    build = lib.BRep.BRep_Builder()
    whole = getattr(lib.TopoDS, f"TopoDS_{kind}")()
    getattr(build, f"Make{kind}")(whole)
    for part in parts:
        build.Add(whole, part)
    return whole


def _solid_in(shell: Any) -> Any:
    """The solid inside a closed shell."""
    shell.Closed(True)
    return _compose("Solid", [shell])


def _bezier_shell(surface: TSpline) -> Any:
    """The Bezier elements as faces, sewn; a solid where no edge is free."""
    lib = occ()
    faces = []
    size = float(np.linalg.norm(np.ptp(surface.control_points, axis=0)))
    for patch in surface.patches.reshape(-1, 4, 4, 4).swapaxes(1, 2):
        weights = _grid(lib.collections.Array2_double, patch[..., 3].tolist())
        faces.append(_face_of(lib.Geom.Geom_BezierSurface(_points(patch[..., :3] / patch[..., 3:]), weights)))
    shape = sew(_compose("Compound", faces), max(EDGE, JOINED * size))
    if shape.ShapeType() != lib.TopAbs.TopAbs_ShapeEnum.TopAbs_SHELL or not lib.BRep.BRep_Tool.IsClosed_s(shape):
        return shape
    return _solid_in(lib.TopoDS.TopoDS.Shell(shape))
