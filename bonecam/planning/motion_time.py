"""The time of moves as the axes drive them: no axis speeds up at once, and no control stops at every corner.

Of a polyline of joints q the path parameter s is the time at the feed: the speed v = ds/dt is 1 where nothing lowers
it, and an axis moves at the rate q' = dq/ds. A corner, at which the rate of an axis changes by c, is rounded by a
parabola over h before and behind it, which leaves the corner by c h / 4: within the tolerance e of each axis, and to
the middle of the shorter of the two moves, l, at most,

    h = min(4 e / c, l / 2),    q'' = c / (2 h),    v <= sqrt(a / q''),

the last for every axis with its acceleration a. For a path sampled finely that is the bound by its curvature, c / l.
What an axis does not need for q'' v^2 it has for q' dv/dt: one pass forwards and one backwards lower the speeds until
every axis can follow (Bobrow, Dubowsky and Gibson 1985; the time-optimal speed of theirs goes through corners faster
where the path slows down there). A control that looks ahead over N moves can still stop at the end of the Nth, at the
accelerations of lines: v^2 <= 2 sum(a l) over them.

LinuxCNC (2.9, `emc/tp`) is an instance with other numbers. Along the path it takes half of the acceleration, so that
two moves that overlap stay within it, and at round corners of X, Y, Z the share sqrt(3) / 2 that is left beside that
(BLEND_ACC_RATIO_NORMAL), whatever the speed changes by. Where a rotary axis turns it does not round: each move goes
from rest to rest, and the next one sets out while it slows down, below the speed

    b = 2 sqrt(a P / (L cos g)),

at which the corner stays within the tolerance P: L is the rate of X, Y and Z together, 2 g the angle between a move,
backwards, and the next one (tpComputeBlendVelocity). Both then move for min(v, b) / a.

Where the jerk of all axes is known, the ramps along the path are S-shaped (`kernels/motion.py`). Both passes then
heed how far each ramp has come: over many short moves it builds up one acceleration, with the least acceleration and
jerk that it has met. What that leaves out is that a control may overshoot a mean speed within a ramp; a move in the
middle of one is told at the mean of the speeds at its ends. The jerk of corners is left out.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import dots, frozen, largest, lengths, runs_of, unit
from bonecam.kernels.motion import ramped_times, rounded_times
from bonecam.machine.limits import MachineLimits, rotary_turns
from bonecam.machine.machine import Machine

ALONG, ACROSS = 0.5, 0.75**0.5
"""Shares of the acceleration that LinuxCNC takes along the path, and across it."""

STRAIGHT = 10.0
"""A corner that could be passed at so many times the feed takes a hundredth of an acceleration, and is not rounded."""


@dataclass(frozen=True)
class ControlRule:
    """How a control goes round corners: within a `tolerance` of linear axes (mm) and a `rotary_tolerance` (rad),
    knowing the next `look_ahead` moves; with `parabolic` blends as LinuxCNC. The default is that of samples of a smooth
    path."""

    tolerance: float = np.inf
    rotary_tolerance: float = np.inf
    look_ahead: int = 1_000_000
    parabolic: bool = False


def motion_minutes(
    machine: Machine, joints: Float[ndarray, "n 5"], at_feed: Float[ndarray, "m"], rule: ControlRule = ControlRule()
) -> Float[ndarray, "m"]:
    """Minutes of the n - 1 moves between successive joints (mm, rad) from rest to rest; `at_feed` are those that feed
    and axis speeds alone allow, which they are where the machine's accelerations are not known."""
    if not machine.knows_accelerations:
        return at_feed.copy()
    return _driven(joints, at_feed, machine.accelerations, machine.jerks, rule)


def rotary_minutes(
    limits: MachineLimits, axes: Float[ndarray, "n 3"], at_feed: Float[ndarray, " m"], joined: Bool[ndarray, " m"]
) -> Float[ndarray, " m"]:
    """Minutes of the n - 1 moves between successive tool axes as the rotary axes drive them, each piece of moves that
    are `joined` from rest to rest; `at_feed` are those of the feed alone. An axis whose acceleration is not known, as
    one that is locked, holds up by its speed alone."""
    minutes = np.maximum(at_feed, limits.turning_minutes(axes))
    accelerations = np.array([limits.turn_acceleration, limits.tilt_acceleration])
    known = np.isfinite(accelerations)
    if not known.any():
        return minutes
    most = frozen(accelerations[known])
    angles = np.vstack([np.zeros(2), np.cumsum(rotary_turns(axes), axis=0)])[:, known]
    for first, end in runs_of(joined):
        piece = slice(first, end)
        jerks = np.full(len(most), np.inf)
        minutes[piece] = _driven(angles[first : end + 1], minutes[piece], most, jerks, ControlRule())
    return minutes


def _driven(
    joints: Float[ndarray, "n k"],
    at_feed: Float[ndarray, " m"],
    most: Float[ndarray, " k"],
    jerks: Float[ndarray, " k"],
    rule: ControlRule,
) -> Float[ndarray, " m"]:
    """`motion_minutes` of joints with these accelerations and jerks, the last two of them rotary."""
    minutes = at_feed.copy()
    steps = np.diff(joints, axis=0)
    moving = (largest(np.abs(steps)) > 0) & (at_feed > 0)
    if not moving.any():
        return minutes
    ways = at_feed[moving]
    rates = steps[moving] / ways[:, None]
    along, across = (ALONG, ACROSS) if rule.parabolic else (1.0, 1.0)
    tolerances = np.repeat([rule.tolerance, rule.rotary_tolerance], [3, 2])[-joints.shape[1] :]
    changes = np.diff(rates, axis=0)
    with np.errstate(divide="ignore"):
        acceleration = along / largest(np.abs(rates) / most)
        half = np.minimum(np.minimum(ways[1:], ways[:-1]) / 2, 4 / largest(np.abs(changes) / tolerances))
        bends = changes / (2 * half[:, None])
        corners = np.sqrt(across / largest(np.abs(bends) / most))
    overlaps = np.zeros(len(ways))
    if rule.parabolic:
        turns = largest(np.abs(rates[:, 3:])) > 0
        blended = turns[1:] | turns[:-1]
        corners[blended] = 0.0

        # Minutes before the end of each move but the last at which a parabolic blend lets the next one set out
        heading = unit(rates[:, :3])
        with np.errstate(divide="ignore"):
            cosine = np.sqrt(np.maximum(1 - dots(heading[:-1], heading[1:]), 0.0) / 2)
            blend = 2 * np.sqrt(acceleration[:-1] * rule.tolerance / (lengths(rates[:-1, :3]) * cosine))
        reached = np.minimum(np.sqrt(acceleration * ways), 1.0)[:-1]
        overlaps[:-1] = blended * (np.minimum(reached, blend) / acceleration[:-1])
    # it can stop at the end of what it looks ahead over
    stopping = np.r_[0.0, np.cumsum(2 * acceleration * ways)]
    known = np.minimum(np.arange(len(stopping)) + rule.look_ahead, len(ways))
    highest = np.minimum(np.r_[0.0, corners, 0.0], np.sqrt(stopping[known] - stopping))
    # stops, and corners that hardly take anything of an acceleration
    half[rule.parabolic | (highest[1:-1] == 0) | (corners > STRAIGHT)] = 0.0
    times, speeds = rounded_times(np.minimum(highest, 1.0), ways, acceleration, half, rates, bends, most)
    if np.isfinite(jerks[0]):
        jerk = 1 / largest(np.abs(rates) / jerks)
        times = np.maximum(times, ramped_times(speeds, ways, acceleration, jerk))
    minutes[moving] = times - overlaps
    return minutes
