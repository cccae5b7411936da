"""Steering the tool axis round the singularity of the rotary axes.

Near +Z the two rotary axes of tables and heads say the same, and a small turn of the tool is a large one of
the machine. An axis that would come within SINGULAR_CONE of +Z runs round it on that cone instead, its
azimuth turning evenly; so do axes between which a move would come within MIN_PASS_ANGLE of +Z.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.machine.limits import polar_angles, with_polar_angles

SINGULAR_CONE = np.radians(3.0)
"""Contacts get no axis with a smaller polar angle, radians."""
MIN_PASS_ANGLE = np.radians(1.0)
"""No move comes nearer to +Z, radians: an axis that passes at 1 degree turns the table by 10 degrees in 0.17
degrees of its own."""
SINGULAR_ANGLE = np.radians(0.1)
"""A cut that comes this near to +Z (radians), because collisions forbid all else, is broken there: the tool
retracts and comes back."""
MAX_ROUNDS = 8
"""Times that a stretch on the cone may grow until its moves keep MIN_PASS_ANGLE."""

Admissible = Callable[[Int[ndarray, " k"], Float[ndarray, "k 3"]], Bool[ndarray, " k"]]
"""Whether contacts (by index) may have the given axes."""


def avoid_singularity(
    axes: Float[ndarray, "n 3"], centres: Float[ndarray, "n 3"], passes: Int[ndarray, " n"]
) -> Float[ndarray, "n 3"]:
    """The axes with every stretch of a pass that lies within SINGULAR_CONE of +Z moved onto the cone.

    The azimuth turns the short way round, evenly over the path of the ball centre, from the axis before the
    stretch to the one behind it. Where the pass begins or ends with the stretch it stays that of the other
    side; where both are missing, that of the first axis. Ends of moves that pass too near to +Z become
    stretches too, which keep their polar angle, and grow until no move comes within MIN_PASS_ANGLE.
    """
    near = polar_angles(axes) < SINGULAR_CONE * (1 - 1e-9)
    same_pass = passes[1:] == passes[:-1]
    steered = axes
    for _ in range(MAX_ROUNDS):
        steered = _round_cone(axes, near, centres, passes) if near.any() else axes
        crossing = np.flatnonzero(same_pass & (least_polar_angles(steered) < MIN_PASS_ANGLE))
        if not len(crossing):
            break
        ends = np.r_[crossing, crossing + 1]
        if near[ends].all():
            near = near | np.r_[False, near[:-1] & same_pass] | np.r_[near[1:] & same_pass, False]
        near[ends] = True
    return steered


def avoid_singularity_where(
    axes: Float[ndarray, "n 3"], centres: Float[ndarray, "n 3"], passes: Int[ndarray, " n"], admissible: Admissible
) -> Float[ndarray, "n 3"]:
    """As `avoid_singularity`, but a stretch keeps its axes where one of its new axes is not admissible."""
    steered = avoid_singularity(axes, centres, passes)
    moved = np.flatnonzero((steered != axes).any(axis=1))
    stretch = np.cumsum(np.diff(moved, prepend=-2) > 1)
    blocked = np.bincount(stretch, ~admissible(moved, steered[moved]), len(moved) + 1) > 0
    taken = moved[~blocked[stretch]]
    result = axes.copy()
    result[taken] = steered[taken]
    return result


def least_polar_angles(axes: Float[ndarray, "n 3"]) -> Float[ndarray, " m"]:
    """The least polar angle on the great circle from each unit axis to the next, radians; m = n - 1."""
    a, b = axes[:-1], axes[1:]
    at_ends = np.minimum(polar_angles(a), polar_angles(b))
    cosine = dots(a, b)
    between = (b[:, 2] > cosine * a[:, 2]) & (a[:, 2] > cosine * b[:, 2])
    normal = np.cross(a, b)
    length = np.linalg.norm(normal, axis=1)
    sine = np.divide(np.abs(normal[:, 2]), length, out=np.ones(len(a)), where=length > 0)
    return np.where(between, np.minimum(np.arcsin(np.minimum(sine, 1.0)), at_ends), at_ends)


def _round_cone(
    axes: Float[ndarray, "n 3"], near: Bool[ndarray, " n"], centres: Float[ndarray, "n 3"], passes: Int[ndarray, " n"]
) -> Float[ndarray, "n 3"]:
    """The axes with the stretches that are `near` moved onto the cone, or out to it."""
    azimuth = np.arctan2(axes[:, 1], axes[:, 0])
    steered = axes.copy()
    for first, last in _stretches(near, passes):
        before = first - 1 if first > 0 and passes[first - 1] == passes[first] else first
        behind = last if last < len(axes) and passes[last] == passes[first] else last - 1
        has_before, has_behind = before < first, behind == last
        start = azimuth[behind] if has_behind and not has_before else azimuth[before]
        end = azimuth[behind] if has_behind else start

        # The share of the length of a polyline that lies before each of its points; all 0 where it has none
        points = centres[before : behind + 1]
        lengths = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
        share = (lengths / lengths[-1] if lengths[-1] > 0 else lengths)[first - before :][: last - first]
        turn = float(np.mod(end - start + np.pi, 2 * np.pi) - np.pi)
        angle = start + turn * share
        directions = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(last - first)])
        angles = np.maximum(polar_angles(axes[first:last]), SINGULAR_CONE)
        steered[first:last] = with_polar_angles(directions, angles)
    return steered


def _stretches(near: Bool[ndarray, " n"], passes: Int[ndarray, " n"]) -> list[tuple[int, int]]:
    """Ranges (first, behind the last) of neighbours on one pass that are all near."""
    changes = np.flatnonzero((near[1:] != near[:-1]) | (passes[1:] != passes[:-1])) + 1
    return [(a, b) for a, b in pairwise([0, *changes.tolist(), len(near)]) if near[a]]
