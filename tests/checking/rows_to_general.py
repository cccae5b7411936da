"""A row-structured T-spline on a general T-mesh: rows become closed lines that no edge joins, poles rows of
equal control points."""

import numpy as np
from bonecam_plugins.tsplines import TMesh
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface import OpenRowTMesh, TSpline
from bonecam.surface.refinement import aligned

POLE_POINTS = 4
"""A closed row has four knots at least."""


def as_general(surface: TSpline) -> TSpline[TMesh]:
    """The row-structured surface over a general T-mesh, exactly equal to it. Raises SurfaceError where the
    t-knots are not clamped.
    """
    if isinstance(surface.tmesh, OpenRowTMesh):
        return _of_open_rows(surface)
    rows = surface.tmesh
    t = surface.tmesh.t_knots
    if not (t[:4] == t[0]).all() or not (t[-4:] == t[-1]).all():
        raise SurfaceError("the t-knots are not clamped: a general T-mesh repeats its end knots")
    closed = aligned([row if len(row) > 1 else np.arange(POLE_POINTS) / POLE_POINTS for row in rows.s_knots], 1.0)
    orders = [np.argsort(row) for row in closed]
    knots = [row[order] for row, order in zip(closed, orders)]
    lines = np.unique(np.concatenate(knots))
    place = [np.searchsorted(lines, row) for row in knots]
    vertices = np.column_stack([np.concatenate(place), np.repeat(np.arange(len(knots)), [len(row) for row in knots])])
    a, b = len(lines), len(knots)
    along_s = np.ones((a, b), dtype=bool)
    along_t = np.zeros((a, b - 1), dtype=bool)
    inside = np.ones((a, b - 1), dtype=bool)
    mesh = TMesh(lines, t[2:-2], vertices=vertices, along_s=along_s, along_t=along_t, inside=inside, period=(1.0, 0.0))
    index = np.concatenate(
        [start + order % count for order, start, count in zip(orders, rows.row_starts, np.diff(rows.row_starts))]
    )
    return TSpline(mesh, surface.control_points[index], surface.weights[index])


def _of_open_rows(surface: TSpline) -> TSpline[TMesh]:
    """Open rows: both ends of s are clamped, two lines each, and edges join the rows there."""
    rows = surface.tmesh
    knots = [row[2:-2] for row in aligned(rows.s_knots)]
    every = np.unique(np.concatenate(knots))
    lines = np.repeat(every, np.max([_times(row, every) for row in knots], axis=0))
    place = [np.searchsorted(lines, row) + np.arange(len(row)) - np.searchsorted(row, row) for row in knots]
    across = np.concatenate(place)
    vertices = np.column_stack([across, np.repeat(np.arange(len(place)), [len(p) for p in place])])
    a, b = len(lines), len(place)
    along_t = np.zeros((a, b - 1), dtype=bool)
    along_t[[0, 1, -2, -1]] = True
    along_s = np.ones((a - 1, b), dtype=bool)
    inside = np.ones((a - 1, b - 1), dtype=bool)
    return TSpline(
        TMesh(lines, rows.t_knots[2:-2], vertices=vertices, along_s=along_s, along_t=along_t, inside=inside),
        surface.control_points,
        surface.weights,
    )


def _times(row: ndarray, every: ndarray) -> ndarray:
    """How often a row has each knot."""
    return np.asarray(np.searchsorted(row, every, side="right") - np.searchsorted(row, every))
