"""Skinning: one row-structured T-spline through closed section curves and two poles (Yang & Zheng 2012; Gan et al. 2014, section 4.1).

Every row of points is interpolated by a periodic C2 cubic on the same parameters. The n+1 sections (the poles are sections that
shrank to a point) are interpolated along t by a clamped cubic: n+3 control curves Q_j from one banded system,

    a_j Q_{j-1} + b_j Q_j + c_j Q_{j+1} = C_{j-1},   Q_1 = C_1,   Q_{n+3} = C_{n+1},

closed by an end condition at either pole. The published one is the natural end (S_tt = 0), which makes a cone of the pole. A
closed bone is smooth there: a meridian s runs on as the meridian s + 1/2. So the part of Q_2 that is even under s -> s + 1/2 lies
in the pole (S_t = 0), and only the odd part has S_tt = 0. Each control curve then keeps its own fewest knots; since the t-functions
are non-negative and sum to one, no point moves further than the worst control curve does.
"""

import numpy as np
import scipy.linalg as la
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.knots import span_functions
from bonecam.surface.periodic import interpolate, reduce
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline


def row_parameters(points: Float[ndarray, "m p 3"], poles: Float[ndarray, "2 3"]) -> Float[ndarray, " k"]:
    """t of pole, rows, pole in [0, 1]: the accumulated mean distance between neighbouring rows (k = m + 2)."""
    first, last = (np.broadcast_to(pole, points.shape[1:])[None] for pole in poles)
    steps = np.linalg.norm(np.diff(np.concatenate([first, points, last]), axis=0), axis=2).mean(axis=1)
    if (steps <= 0).any():
        raise ValueError(f"rows {int(np.argmin(steps)) - 1} and the next one coincide")
    t = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    t[-1] = 1.0
    return t


def point_parameters(points: Float[ndarray, "m p 3"]) -> Float[ndarray, " p"]:
    """s of the columns of points in [0, 1): the accumulated share of the row's length, averaged over the rows."""
    steps = np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=2)
    if (steps <= 0).any():
        raise ValueError(f"row {int(np.argmin(steps.min(axis=1)))} has two neighbouring points that coincide")
    share = (steps / steps.sum(axis=1, keepdims=True)).mean(axis=0)
    return np.concatenate([[0.0], np.cumsum(share)[:-1]])


def skin(points: Float[ndarray, "m p 3"], poles: Float[ndarray, "2 3"], tolerance: float) -> TSpline:
    """The T-spline that passes every row's interpolating curve within `tolerance` (mm) and both poles exactly.

    Rows run from the lower pole up, p points each (even, at least 8), counter-clockwise seen from the upper pole, starting on one
    seam; m >= 2.
    """
    rows, count = points.shape[:2]
    if rows < 2 or count < 8 or count % 2:
        raise ValueError(f"{rows} rows of {count} points: give two or more rows of an even number of points, at least eight")
    if not tolerance > 0:
        raise ValueError(f"tolerance {tolerance}: give a length above 0")
    s, t = point_parameters(points), row_parameters(points, poles)
    sections = np.concatenate([np.broadcast_to(poles[0], (1, count, 3)), points, np.broadcast_to(poles[1], (1, count, 3))])
    curves = np.array([interpolate(s, row) for row in control_curves(t, sections)])
    knots, control = [np.zeros(1)], [poles[:1]]
    for curve in curves[1:-1]:
        kept, found = reduce(s, curve, tolerance)
        knots.append(kept)
        control.append(found)
    tmesh = RowTMesh.from_rows(np.concatenate([np.zeros(3), t, np.ones(3)]), [*knots, np.zeros(1)])
    return TSpline(tmesh, np.vstack([*control, poles[1:]]), np.ones(tmesh.size))


def control_curves(t: Float[ndarray, " k"], sections: Float[ndarray, "k p 3"]) -> Float[ndarray, "k+2 p 3"]:
    """The values at the columns of the k + 2 control curves whose clamped cubic meets the k sections at t."""
    half = sections.shape[1] // 2
    opposite = np.roll(sections, half, axis=1)
    even, odd = (sections + opposite) / 2, (sections - opposite) / 2
    parts = [la.solve(_system(t, order), _padded(part).reshape(len(t) + 2, -1)) for part, order in ((even, 1), (odd, 2))]
    found: ndarray = (parts[0] + parts[1]).reshape(len(t) + 2, -1, 3)
    return found


def _padded(sections: ndarray) -> ndarray:
    """Right-hand side: sections, and a zero derivative behind the first and before the last."""
    zero = np.zeros_like(sections[:1])
    return np.concatenate([sections[:1], zero, sections[1:-1], zero, sections[-1:]])


def _system(t: ndarray, order: int) -> ndarray:
    """The banded system: values at all t, and the `order`-th derivative at both ends (second and last but one equation)."""
    knots = np.concatenate([np.zeros(3), t, np.ones(3)])
    x = np.concatenate([t[:1], t, t[-1:]])
    span = np.clip(np.searchsorted(knots, x, side="right") - 1, 3, len(knots) - 5)
    values = span_functions(knots[span[:, None] + np.arange(-3, 5)], x, 2)
    derivative = np.zeros(len(x), dtype=np.int64)
    derivative[[1, -2]] = order
    matrix = np.zeros((len(x), len(x)))
    for row in range(len(x)):
        matrix[row, span[row] - 3 : span[row] + 1] = values[derivative[row], row]
    return matrix
