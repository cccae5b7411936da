"""The time of a program on axes that need time to speed up.

Along the words of a run, the path speed v is bounded by the feed and the speed of every axis, and at each point by the
change of direction there: an axis whose share of the path changes by c from one move to the next changes its speed by
c v, which it does within BLEND. On a move an axis with the share q allows the path acceleration a / q. One pass
forwards and one backwards lower the speeds until no move speeds up or slows down faster: the time-optimal speed for
straight moves and constant bounds (Bobrow, Dubowsky and Gibson 1985).

A dialect whose `corners` are "parabolic" has another rule (`parabolic_blends.py`).

Where the jerk of all axes is known too, ramps are S-shaped (`kernels/motion/ramps.py`). Both passes then heed how far
each ramp has come: over many short moves it builds up one acceleration, with the least acceleration and jerk that it
has met. What that leaves out is that a control may overshoot a mean speed within a ramp; a move in the middle of one is
told at the mean of the speeds at its ends.
"""

import math

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import largest
from bonecam.kernels.motion.ramps import ramped_times
from bonecam.machine.axes import LinearAxis, RotaryAxis
from bonecam.machine.machine import Machine
from bonecam.nc.posting.feeds.parabolic_blends import blended_minutes
from bonecam.nc.posting.path_words import Posted

BLEND = 0.01 / 60
"""Time within which a control rounds the corner between two moves, min: ten cycles of 1 ms."""


def knows_accelerations(machine: Machine) -> bool:
    """Whether the accelerations of all axes of a machine are known."""
    axes: list[LinearAxis | RotaryAxis] = [*machine.linear, *machine.own_rotary]
    return all(math.isfinite(axis.acceleration) for axis in axes)


def knows_jerks(machine: Machine) -> bool:
    """Whether the accelerations and jerks of all axes of a machine are known."""
    axes: list[LinearAxis | RotaryAxis] = [*machine.linear, *machine.own_rotary]
    return knows_accelerations(machine) and all(math.isfinite(axis.jerk) for axis in axes)


def accelerated_minutes(posted: Posted) -> Float[ndarray, "n"]:
    """Minutes of the move that arrives at each row, with the accelerations of the axes, and their jerks where they are
    known; as without them where a run starts, off the part."""
    machine = posted.control.machine
    axes: list[LinearAxis | RotaryAxis] = [*machine.linear, *machine.rotary]
    most = np.array([axis.acceleration for axis in axes])
    jerks = np.array([axis.jerk if knows_jerks(machine) else math.inf for axis in axes])
    joints = posted.joints
    minutes = posted.minutes.copy()
    for first, end in posted.runs:
        if end - first > 1:
            run, at_feed = joints[first:end], posted.minutes[first + 1 : end]
            minutes[first + 1 : end] = (
                blended_minutes(run, at_feed, most, posted.tolerance)
                if posted.dialect.corners == "parabolic"
                else _minutes(run, at_feed, most, jerks)
            )
    return minutes


def _minutes(
    joints: Float[ndarray, "n 5"],
    at_feed: Float[ndarray, "m"],
    most: Float[ndarray, "5"],
    jerks: Float[ndarray, "5"],
) -> Float[ndarray, "m"]:
    """Minutes of the moves between successive joints that begin and end at rest; `at_feed` are those without
    accelerations, `most` the accelerations and `jerks` the jerks of the axes."""
    steps = np.diff(joints, axis=0)
    moving: Bool[ndarray, "m"] = (largest(np.abs(steps)) > 0) & (at_feed > 0)
    minutes = at_feed.copy()
    at_feed = at_feed[moving]
    if not len(at_feed):
        return minutes
    # path lengths are the times at the feed: the speed is 1 where nothing lowers it
    rates = steps[moving] / at_feed[:, None]
    with np.errstate(divide="ignore"):
        corner = BLEND / largest(np.abs(np.diff(rates, axis=0)) / most)
        acceleration, jerk = (1 / largest(np.abs(rates) / bound) for bound in (most, jerks))
    highest = np.r_[0.0, np.minimum(corner, 1.0), 0.0]
    minutes[moving] = ramped_times(highest, at_feed, acceleration, jerk)
    return minutes
