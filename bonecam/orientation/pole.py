"""Steering the axis round the pole: near +Z, where the tables' and heads' two angles say the same, a small turn of the tool is a
large one of the machine. An axis that would pass within CONE of the pole runs round it on the cone instead, at an even pace.
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.orientation.limits import polar, with_polar

CONE = np.radians(3.0)


def round_pole(axes: Float[ndarray, "n 3"], centres: Float[ndarray, "n 3"], passes: Int[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """The axes with every stretch of a pass that lies within CONE of +Z laid on the cone.

    Its azimuth turns evenly with the way of the ball's centre from that before the stretch to that behind it, the short way round;
    where one of them is missing (the pass begins or ends there) it stays, where both are, it stays that of the first axis.
    """
    near = polar(axes) < CONE
    if not near.any():
        return axes
    azimuth = np.arctan2(axes[:, 1], axes[:, 0])
    steered = axes.copy()
    for first, last in _stretches(near, passes):
        before, behind = (i if 0 <= i < len(axes) and passes[i] == passes[first] else None for i in (first - 1, last))
        start = azimuth[first if before is None and behind is None else behind if before is None else before]
        end = start if behind is None else azimuth[behind]
        turn = float(np.mod(end - start + np.pi, 2 * np.pi) - np.pi)
        places = centres[first if before is None else before : last + (behind is not None)]
        way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))]
        share = (way / way[-1] if way[-1] > 0 else way)[before is not None :][: last - first]
        angle = start + turn * share
        steered[first:last] = with_polar(
            np.column_stack([np.cos(angle), np.sin(angle), np.zeros(last - first)]), np.full(last - first, CONE)
        )
    return steered


def _stretches(near: ndarray, passes: ndarray) -> list[tuple[int, int]]:
    """Ranges of neighbours on one pass that are all near."""
    changes = np.flatnonzero((near[1:] != near[:-1]) | (passes[1:] != passes[:-1])) + 1
    return [(a, b) for a, b in pairwise([0, *changes.tolist(), len(near)]) if near[a]]
