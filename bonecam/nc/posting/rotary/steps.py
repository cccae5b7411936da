"""The steps between the rotary solutions of successive tool axes: by the shorter way, near the way of the tool axis."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, unit
from bonecam.machine.kinematics import tool_axes
from bonecam.machine.machine import Machine

FULL_TURN = 2 * np.pi
SMALL_ROTATION = 0.5
"""Rotation (rad) below which the bound T^2 / 8 of `_stays_near` is used."""


def rotary_steps(
    machine: Machine, found: Float[ndarray, "m 2 2"], axes: Float[ndarray, "m 3"]
) -> tuple[Float[ndarray, "m-1 2 2"], Int[ndarray, "m-1 2 2 2"]]:
    """The rotary travel (rad) by the shorter way from each solution of a row to each of the next, infinite where the
    tool axis would not stay near its way; and the whole turns of the limited joints that this way leaves out."""
    travel = np.empty((len(found) - 1, 2, 2))
    wraps = np.zeros((len(found) - 1, 2, 2, 2), dtype=np.int64)
    bounded = np.array([axis.bounded for axis in machine.rotary])
    # opposite axes have no middle: then no linear way follows them
    middle = unit(axes[:-1] + axes[1:])
    apart = angles_between(axes[:-1], axes[1:])
    for a, b in np.ndindex(2, 2):
        change = found[1:, b] - found[:-1, a]
        turned = np.round(change / FULL_TURN)
        change -= FULL_TURN * turned
        near = np.flatnonzero(_stays_near(machine, found[:-1, a], change, middle, apart))
        travel[:, a, b] = np.inf
        travel[near, a, b] = _rotation(change[near])
        wraps[near, a, b] = np.where(bounded, turned[near], 0.0)
    return travel, wraps


def _stays_near(
    machine: Machine,
    start: Float[ndarray, "n 2"],
    change: Float[ndarray, "n 2"],
    middle: Float[ndarray, "n 3"],
    apart: Float[ndarray, " n"],
) -> Bool[ndarray, " n"]:
    """Whether the tool axis halfway, with both joints running linearly from `start` by `change`, stays near
    the great circle between two tool axes, their `middle` and the angle that they are `apart` (rad) given.

    A rotation by T (rad, the sum of both joints) leads the axis halfway off by at most T^2 / 8, which settles
    most moves. False where a state is NaN.
    """
    rotation = _rotation(change)
    near = (rotation < SMALL_ROTATION) & (rotation**2 / 8 <= 1.4 * np.sin(apart / 2))
    ask = np.flatnonzero(~near & np.isfinite(rotation))
    halfway = tool_axes(machine, start[ask] + change[ask] / 2)
    near[ask] = angles_between(halfway, middle[ask]) <= 0.75 * apart[ask] + 1e-9
    return np.asarray(near)


def _rotation(change: Float[ndarray, "n 2"]) -> Float[ndarray, "n"]:
    """How far both joints turn, rad."""
    return np.asarray(np.abs(change[:, 0]) + np.abs(change[:, 1]))
