"""The time of a program on axes that need time to speed up.

Along the words of a run, the path speed v is bounded by the feed and the speed of every axis, and at each point by the
change of direction there: an axis whose share of the path changes by c from one move to the next changes its speed by
c v, which it does within BLEND. On a move an axis with the share q allows the path acceleration a / q. One pass
forwards and one backwards lower the speeds until no move speeds up or slows down faster: the time-optimal speed for
straight moves and constant bounds (Bobrow, Dubowsky and Gibson 1985). Jerk is left out.
"""

import math

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.machine.axes import LinearAxis, RotaryAxis
from bonecam.machine.machine import Machine
from bonecam.nc.posting.path_words import Posted, joints_of

BLEND = 0.01 / 60
"""Time within which a control rounds the corner between two moves, min: ten cycles of 1 ms."""


def knows_accelerations(machine: Machine) -> bool:
    """Whether the accelerations of all axes of a machine are known."""
    axes: list[LinearAxis | RotaryAxis] = [*machine.linear, *machine.own_rotary]
    return all(math.isfinite(axis.acceleration) for axis in axes)


def accelerated_minutes(posted: Posted) -> Float[ndarray, "n"]:
    """Minutes of the move that arrives at each row, with the accelerations of the axes; as without them where a run
    starts, off the part."""
    machine = posted.control.machine
    linear = [axis.acceleration for axis in machine.linear]
    most = np.array(linear + [axis.acceleration for axis in machine.rotary])
    joints = joints_of(posted, posted.words)
    minutes = posted.minutes.copy()
    for first, end in posted.runs:
        if end - first > 1:
            minutes[first + 1 : end] = _minutes(joints[first:end], posted.minutes[first + 1 : end], most)
    return minutes


def _minutes(
    joints: Float[ndarray, "n 5"], at_feed: Float[ndarray, "m"], most: Float[ndarray, "5"]
) -> Float[ndarray, "m"]:
    """Minutes of the moves between successive joints that begin and end at rest; `at_feed` are those without
    accelerations, `most` the accelerations. The path runs from 0 to 1 on each move, its speed in moves a minute."""
    steps = np.abs(np.diff(joints, axis=0))
    moving: Bool[ndarray, "m"] = (steps.max(axis=1) > 0) & (at_feed > 0)
    minutes = at_feed.copy()
    steps, signed = steps[moving], np.diff(joints, axis=0)[moving]
    at_feed = at_feed[moving]
    if not len(at_feed):
        return minutes
    # path lengths are the times at the feed: the speed is 1 where nothing lowers it
    rates = signed / at_feed[:, None]
    with np.errstate(divide="ignore"):
        corner = (most * BLEND / np.abs(np.diff(rates, axis=0))).min(axis=1, initial=np.inf)
        acceleration = (most / np.abs(rates)).min(axis=1)
    speeds = np.r_[0.0, np.minimum(corner, 1.0), 0.0].tolist()
    gains = (2 * acceleration * at_feed).tolist()
    for k in range(len(gains)):
        speeds[k + 1] = min(speeds[k + 1], (speeds[k] ** 2 + gains[k]) ** 0.5)
    for k in range(len(gains) - 1, -1, -1):
        speeds[k] = min(speeds[k], (speeds[k + 1] ** 2 + gains[k]) ** 0.5)
    start, end = np.array(speeds[:-1]), np.array(speeds[1:])
    minutes[moving] = _ramped(start, end, acceleration, at_feed)
    return minutes


def _ramped(
    start: Float[ndarray, "m"], end: Float[ndarray, "m"], a: Float[ndarray, "m"], way: Float[ndarray, "m"]
) -> Float[ndarray, "m"]:
    """Time of a move of length `way` from one speed to another at an acceleration, as fast as speed 1 allows."""
    peak = np.minimum(np.sqrt((start**2 + end**2) / 2 + a * way), 1.0)
    peak = np.maximum(peak, np.maximum(start, end))
    ramps = (2 * peak**2 - start**2 - end**2) / (2 * a)
    return (2 * peak - start - end) / a + np.maximum(way - ramps, 0.0) / peak
