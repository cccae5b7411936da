"""Steering the axis round the pole: near +Z, where the tables' and heads' two angles say the same, a small
turn of the tool is a large one of the machine. An axis that would come within CONE of the pole runs round it
on the cone instead, at an even pace; so do axes between which a move would come within PASS of it.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.orientation.limits import polar, with_polar

CONE = np.radians(3.0)
PASS = np.radians(1.0)
"""No move comes nearer to the pole: an axis that passes it at 1 degree turns the table by 10 degrees in 0.17
degrees of its own."""
AT_POLE = np.radians(0.1)
"""A cut that comes this near to the pole, because collisions forbid all else, is broken there: the tool
leaves and comes back."""
ROUNDS = 8


def round_pole(
    axes: Float[ndarray, "n 3"], centres: Float[ndarray, "n 3"], passes: Int[ndarray, " n"]
) -> Float[ndarray, "n 3"]:
    """The axes with every stretch of a pass that lies within CONE of +Z laid on the cone.

    Its azimuth turns evenly with the way of the ball's centre from that before the stretch to that behind it,
    the short way round; where one of them is missing (the pass begins or ends there) it stays, where both
    are, it stays that of the first axis. Ends of moves past the pole are stretches too, which keep their
    angle from it, and grow until no move comes within PASS of it.
    """
    near, steered = polar(axes) < CONE * (1 - 1e-9), axes
    for _ in range(ROUNDS):
        steered = _laid_round(axes, near, centres, passes) if near.any() else axes
        crossing = np.flatnonzero((passes[1:] == passes[:-1]) & (nearest_to_pole(steered) < PASS))
        if not len(crossing):
            break
        beside = np.r_[crossing, crossing + 1]
        if near[beside].all():
            same = passes[1:] == passes[:-1]
            near = near | np.r_[False, near[:-1] & same] | np.r_[near[1:] & same, False]
        near[beside] = True
    return steered


def round_pole_where_free(
    axes: Float[ndarray, "n 3"],
    centres: Float[ndarray, "n 3"],
    passes: Int[ndarray, " n"],
    may: Callable[[Int[ndarray, " k"], Float[ndarray, "k 3"]], Bool[ndarray, " k"]],
) -> Float[ndarray, "n 3"]:
    """The same where `may` (of indices and axes) allows every new axis of a stretch; elsewhere the axes
    stay."""
    steered = round_pole(axes, centres, passes)
    moved = np.flatnonzero((steered != axes).any(axis=1))
    stretch = np.cumsum(np.diff(moved, prepend=-2) > 1)
    blocked = np.bincount(stretch, ~may(moved, steered[moved]), len(moved) + 1) > 0
    taken, result = moved[~blocked[stretch]], axes.copy()
    result[taken] = steered[taken]
    return result


def _laid_round(axes: ndarray, near: Bool[ndarray, " n"], centres: ndarray, passes: ndarray) -> ndarray:
    azimuth = np.arctan2(axes[:, 1], axes[:, 0])
    steered = axes.copy()
    for first, last in _stretches(near, passes):
        before, behind = (
            i if 0 <= i < len(axes) and passes[i] == passes[first] else None for i in (first - 1, last)
        )
        start = azimuth[first if before is None and behind is None else behind if before is None else before]
        end = start if behind is None else azimuth[behind]
        turn = float(np.mod(end - start + np.pi, 2 * np.pi) - np.pi)
        places = centres[first if before is None else before : last + (behind is not None)]
        way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))]
        share = (way / way[-1] if way[-1] > 0 else way)[before is not None :][: last - first]
        angle = start + turn * share
        level = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(last - first)])
        steered[first:last] = with_polar(level, np.maximum(polar(axes[first:last]), CONE))
    return steered


def nearest_to_pole(axes: Float[ndarray, "n 3"]) -> Float[ndarray, " m"]:
    """The least angle from +Z on the great circle from each axis to the next, radians; m = n - 1."""
    a, b = axes[:-1], axes[1:]
    ends = np.minimum(polar(a), polar(b))
    cosine = dots(a, b)
    between = (b[:, 2] > cosine * a[:, 2]) & (a[:, 2] > cosine * b[:, 2])
    normal = np.cross(a, b)
    length = np.linalg.norm(normal, axis=1)
    height = np.divide(np.abs(normal[:, 2]), length, out=np.ones(len(a)), where=length > 0)
    return np.where(between, np.minimum(np.arcsin(np.minimum(height, 1.0)), ends), ends)


def _stretches(near: ndarray, passes: ndarray) -> list[tuple[int, int]]:
    """Ranges of neighbours on one pass that are all near."""
    changes = np.flatnonzero((near[1:] != near[:-1]) | (passes[1:] != passes[:-1])) + 1
    return [(a, b) for a, b in pairwise([0, *changes.tolist(), len(near)]) if near[a]]
