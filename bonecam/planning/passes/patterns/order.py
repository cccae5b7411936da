"""The order and the directions in which the curves of a pattern are followed.

`zigzag`: each curve is entered at the end that is nearer to where the tool left the one before; rings are run to
and fro. `climb` and `conventional`: all curves in the one direction in which a cutter that turns clockwise climbs,
or in the other. Groups are followed in turn, and within a group the nearest curve is next, or of those that are hardly
farther the one that lies beside the last.
"""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.planning.passes.patterns.curves import Curves, curves_of
from bonecam.surface.tspline import TSpline

SIDE_STEP = 2.0
"""A curve farther away by this is preferred where it lies beside the one before, mm: 0.13 s at 900 mm/min."""
CLOSED = 1e-6
"""A curve whose ends are nearer to each other is a ring, mm."""


def order_curves(surface: TSpline, curves: Curves, direction: str) -> Curves:
    """The curves as they are followed. ValueError for an unknown direction."""
    if direction not in ("zigzag", "climb", "conventional"):
        raise ValueError(f"direction {direction!r}: give zigzag, climb or conventional")
    starts, ends = (surface.positions(*curves.knots[index].T) for index in (curves.first, curves.last))
    if direction == "conventional":
        starts, ends = ends, starts
    order, turned = _in_turn(curves.group, starts, ends, direction == "zigzag")
    if direction == "conventional":
        turned = ~turned

    pieces = np.split(curves.knots, curves.first[1:])
    followed = [pieces[k][::-1] if back else pieces[k] for k, back in zip(order, turned)]
    return curves_of(followed, curves.group[order])


def _in_turn(
    group: Int[ndarray, " c"], starts: Float[ndarray, "c 3"], ends: Float[ndarray, "c 3"], both_ways: bool
) -> tuple[Int[ndarray, " c"], ndarray]:
    """The order of the curves, and which of them are followed from their ends to their starts."""
    is_ring = np.linalg.norm(ends - starts, axis=1) < CLOSED
    order = [0]
    turned = [False]
    left = np.ones(len(group), dtype=bool)
    left[0] = False
    while left.any():
        here = (starts if turned[-1] else ends)[order[-1]]
        open_ = np.flatnonzero(left & (group == group[np.argmax(left)]))
        to_start = np.linalg.norm(starts[open_] - here, axis=1)
        to_end = np.linalg.norm(ends[open_] - here, axis=1) if both_ways else np.full(len(open_), np.inf)
        away = np.minimum(to_start, to_end)
        ahead = (open_ - order[-1]) % len(group)
        nearest = int(np.argmin(np.where(away <= away.min() + SIDE_STEP, ahead, len(group))))
        chosen = int(open_[nearest])
        back = not turned[-1] if is_ring[chosen] and both_ways else bool(to_end[nearest] < to_start[nearest])
        order.append(chosen)
        turned.append(back)
        left[chosen] = False
    return np.array(order), np.array(turned)
