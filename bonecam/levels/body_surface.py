"""The T-spline of a smooth convex body: least squares to the points that the meridians of a capsule round it map onto it."""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.solve import factor
from bonecam.levels.stock import Capsule, Stock, smallest_capsule
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

CHORD, ROUND_ABOUT = 0.02, 0.03
ROW_STEP, LEAST_ROWS, MOST_ROWS = 0.4, 40, 160
AROUND_ROUND, AROUND_OTHER, SAMPLES = 32, 96, 3
POLE_WEIGHT = 100.0


def enclosing(stock: Stock) -> Capsule:
    """An upright capsule round the stock; a capsule is its own."""
    if isinstance(stock, Capsule):
        return stock
    axis = np.array([stock.middle[0], stock.middle[1], 0.0])
    found = smallest_capsule(stock.mesh(CHORD).vertices - axis, ROUND_ABOUT)
    return found.moved(axis)


def meridians(capsule: Capsule, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """Points of an upright capsule: s turns round the axis, t is the share of the arc from the lower to the upper pole."""
    quarter, straight = capsule.radius * np.pi / 2, capsule.length - 2 * capsule.radius
    arc = t * (2 * quarter + straight) - quarter
    rise = np.clip(arc, 0, straight)
    angle = (arc - rise) / capsule.radius
    across = capsule.radius * np.cos(angle)
    local = [across * np.cos(2 * np.pi * s), across * np.sin(2 * np.pi * s), rise + capsule.radius * np.sin(angle)]
    return np.asarray(capsule.start + np.column_stack(local))


def body_surfaces(bodies: Sequence[Stock]) -> list[TSpline]:
    """The surfaces of smooth convex bodies, lower pole first, within about 0.002 mm for the sizes of bones; all on one T-mesh."""
    around = AROUND_ROUND if all(isinstance(body, Capsule) for body in bodies) else AROUND_OTHER
    round_about = [enclosing(body) for body in bodies]
    arc = max(np.pi * capsule.radius + capsule.length for capsule in round_about)
    rows = int(np.clip(np.ceil(arc / ROW_STEP), LEAST_ROWS, MOST_ROWS))
    knots = np.concatenate([np.zeros(4), np.linspace(0, 1, rows - 2)[1:-1], np.ones(4)])
    tmesh = RowTMesh.from_rows(knots, [np.zeros(1), *[np.arange(around) / around] * (rows - 2), np.zeros(1)])
    spline = TSpline(tmesh, np.zeros((tmesh.size, 3)), np.ones(tmesh.size))
    t, s = np.linspace(0, 1, SAMPLES * rows), np.arange(SAMPLES * around) / (SAMPLES * around)
    ss, tt = (v.ravel() for v in np.meshgrid(s, t))
    R = spline.basis(ss, tt)[0]
    weighted = sp.csr_array(R.T @ sp.diags_array(np.where((tt == 0) | (tt == 1), POLE_WEIGHT, 1.0)))
    fit = factor(sp.csc_array(weighted @ R))
    targets = [body.nearest(meridians(capsule, ss, tt)) for body, capsule in zip(bodies, round_about)]
    return [spline.with_control_points(fit.solve(np.asarray(weighted @ target))) for target in targets]
