"""A row-structured T-spline on a general T-mesh: rows become closed lines that no edge joins, poles rows of equal control points."""

import numpy as np

from bonecam.errors import SurfaceError
from bonecam.surface.general_tmesh import TMesh
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

POLE_POINTS = 4  # a closed row has four knots at least


def as_general(surface: TSpline[RowTMesh]) -> TSpline[TMesh]:
    """The same surface, exactly. Raises SurfaceError where the t-knots are not clamped."""
    rows, t = surface.tmesh, surface.tmesh.t_knots
    if not (t[:4] == t[0]).all() or not (t[-4:] == t[-1]).all():
        raise SurfaceError("the t-knots are not clamped: a general T-mesh repeats its end knots")
    knots = [row if len(row) > 1 else np.arange(POLE_POINTS) / POLE_POINTS for row in rows.s_knots]
    lines = np.unique(np.concatenate(knots))
    place = [np.searchsorted(lines, row) for row in knots]
    vertices = np.column_stack([np.concatenate(place), np.repeat(np.arange(len(knots)), [len(row) for row in knots])])
    a, b = len(lines), len(knots)
    along_s, along_t, inside = np.ones((a, b), dtype=bool), np.zeros((a, b - 1), dtype=bool), np.ones((a, b - 1), dtype=bool)
    mesh = TMesh(lines, t[2:-2], vertices, along_s, along_t, inside, (1.0, 0.0))
    index = np.concatenate([np.full(len(row), start) if len(old) == 1 else np.arange(start, start + len(old))
                            for row, old, start in zip(knots, rows.s_knots, rows.row_starts)])  # fmt: skip
    return TSpline(mesh, surface.control_points[index], surface.weights[index])
