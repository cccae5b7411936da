"""A B-spline surface of a CAD system as a T-spline: the same surface, with all of its knots in every row.

CAD systems write a surface that closes on itself with repeated end knots (IGES knows no other way); where its
ends meet C2 it becomes periodic again. Rows that are one point with one weight become poles. Parameters are
moved to [0, 1].
"""

import numpy as np
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.basis.periodic import FEWEST
from bonecam.surface.files.bspline.bspline_surface import BSplineSurface, Knots
from bonecam.surface.files.bspline.from_tspline import join_elements
from bonecam.surface.tmesh.open_rows import OpenRowTMesh
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

SAME = 1e-12
"""Share of the size: control points and weights that differ by less are one."""


def from_bspline(spline: BSplineSurface) -> TSpline:
    """The B-spline surface as a row-structured T-spline with s and t in [0, 1], exactly equal to it.

    Raises SurfaceError where it is closed in t, or closed in s with repeated knots or fewer than four: no
    T-mesh here holds these.
    """
    if spline.t_knots.closed:
        raise SurfaceError("the surface is closed along t: exchange its parameters, or cut it open")
    t_knots = _unit(spline.t_knots, spline.t_knots.flat)
    if not spline.s_knots.closed:
        rows = [_unit(spline.s_knots, spline.s_knots.flat)] * spline.t_knots.poles
        surface = TSpline(OpenRowTMesh.from_rows(t_knots, rows), _by_rows(spline.poles), spline.weights.T.ravel())
        return _close_seam(spline, surface)
    if spline.s_knots.multiplicities.max() > 1 or spline.s_knots.poles < FEWEST:
        raise SurfaceError(
            "the surface is closed along s with repeated knots, or fewer than four: open it or smooth its knots first"
        )
    knots = _unit(spline.s_knots, spline.s_knots.values[:-1])
    points, weights = (np.roll(values, -1, axis=0) for values in (spline.poles, spline.weights))
    last = spline.t_knots.poles - 1
    single = [
        j in (0, last) and _near(points[:, j], spline.size) and _near(weights[:, j], weights.max())
        for j in range(last + 1)
    ]
    tmesh = RowTMesh.from_rows(t_knots, [knots[:1] * 0 if point else knots for point in single])
    kept = [slice(0, 1) if point else slice(None) for point in single]
    return TSpline(
        tmesh,
        np.vstack([points[here, j] for j, here in enumerate(kept)]),
        np.concatenate([weights[here, j] for j, here in enumerate(kept)]),
    )


def _close_seam(spline: BSplineSurface, surface: TSpline) -> TSpline:
    """The surface, periodic where its first and last columns meet C2."""
    if not (_near(spline.poles[[0, -1]], spline.size) and _near(spline.weights[[0, -1]], spline.weights.max())):
        return surface
    closed = join_elements(surface.elements(), surface.patches, (True, False))
    simple = closed.s_knots.multiplicities.max() == 1 and closed.s_knots.poles >= FEWEST
    return from_bspline(closed) if simple else surface


def _near(values: ndarray, size: float) -> bool:
    return bool(np.ptp(values, axis=0).max() <= SAME * size)


def _by_rows(poles: ndarray) -> ndarray:
    return poles.swapaxes(0, 1).reshape(-1, 3)


def _unit(knots: Knots, values: ndarray) -> ndarray:
    """Values moved so that the domain of the knots is [0, 1]."""
    low, high = knots.values[0], knots.values[-1]
    return (values - low) / (high - low)
