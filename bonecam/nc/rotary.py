"""The steps between the rotary solutions of successive tool axes: by the shorter way, near the way of the tool axis.

The choice of rotary angles along a path: which of the two solutions, and how many whole turns.

A stretch is what is driven between two rewinds. In it every joint takes the shorter way from row to row, and with both
running linearly the tool axis stays near the way between its two ends; so a path never flips to the other solution in
the cut. At a rewind, off the part, the joints go to any solution and turn. One dynamic program over solution and turns
finds for all stretches at once the fewest rewinds, and of these the least rotary travel within the limits. Rewinds are
done at rapids, or where the path may be lifted for them.

Within the hold cone about the singular axis the free angle is held, or runs evenly from the angle before the rows to
the angle after them.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, unit
from bonecam.errors import MachineError
from bonecam.kernels.motion import cheapest_chain
from bonecam.machine.kinematics import LIMIT_GUARD, inverse_rotary, tool_axes, within_limits
from bonecam.machine.machine import Machine
from bonecam.machine.machine_file import RotaryAxis
from bonecam.tool.path import MoveKind

FULL_TURN = 2 * np.pi
SMALL_ROTATION = 0.5
"""Rotation (rad) below which the bound T^2 / 8 of `rotary_steps` is used."""


def rotary_steps(
    machine: Machine, found: Float[ndarray, "m 2 2"], axes: Float[ndarray, "m 3"]
) -> tuple[Float[ndarray, "m-1 2 2"], Int[ndarray, "m-1 2 2 2"]]:
    """The rotary travel (rad) by the shorter way from each solution of a row to each of the next, infinite where the
    tool axis halfway, with both joints running linearly, would not stay near the great circle between its ends; and the
    whole turns of the limited joints that this way leaves out."""
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
        # a rotation by T (rad, the sum of both joints) leads the axis halfway off by at most T^2 / 8
        rotation = np.abs(change[:, 0]) + np.abs(change[:, 1])
        stays = (rotation < SMALL_ROTATION) & (rotation**2 / 8 <= 1.4 * np.sin(apart / 2))
        ask = np.flatnonzero(~stays & np.isfinite(rotation))
        halfway = tool_axes(machine, found[ask, a] + change[ask] / 2)
        stays[ask] = angles_between(halfway, middle[ask]) <= 0.75 * apart[ask] + 1e-9
        near = np.flatnonzero(stays)
        travel[:, a, b] = np.inf
        travel[near, a, b] = rotation[near]
        wraps[near, a, b] = np.where(bounded, turned[near], 0.0)
    return travel, wraps


REWIND_COST = 1e5
"""The cost of a rewind, as rotary travel in rad: more than the axes of a path travel, so that the fewest rewinds come
first."""
NEAR_COST = 1e3
"""Added to it (rad) at rapids that are not clear."""
LIFT_COST = 1e8
"""The cost of a rewind for which the path is lifted, as rotary travel in rad: more than the rewinds at rapids."""
CUT_COST = 1e6
"""Added to it (rad) where the path is lifted between two cuts: links are lifted first."""
MAX_TURNS = 200
"""No more turns of an axis are looked at; its limits, where they are farther apart, are taken as so many about zero."""
MAX_TURNS_OF_BOTH = 14
"""Turns that are looked at of each axis where both have more than so many: their turns multiply."""


@dataclass(frozen=True, eq=False)
class Choice:
    """Rotary joints (rad) of every row, continuous between rewinds; `rewinds` marks rows reached by a jump
    off the part."""

    angles: Float[ndarray, "n 2"]
    rewinds: Bool[ndarray, "n"]


def choose_angles(
    machine: Machine,
    axes: Float[ndarray, "n 3"],
    kinds: Int[ndarray, "n"],
    hold_cone: float,
    before: Float[ndarray, "2"] | None = None,
    liftable: Bool[ndarray, "n"] | None = None,
) -> Choice:
    """The rotary joints for a sequence of unit tool axes; MachineError where the limits allow none.

    Row i's kind is the kind of the move that arrives there. `hold_cone` in rad. `before`: the joints the
    machine comes from; an axis without limits starts within half a turn of them. `liftable`: rows before which the
    path may be lifted for a rewind, where it is being planned; else it may be at rapids only.
    """
    solutions, free = inverse_rotary(machine, axes, hold_cone)
    _check_reach(machine, solutions)
    fixed = np.flatnonzero(~free.any(1))
    angles = np.zeros((len(axes), 2))
    rewinds = np.zeros(len(axes), dtype=bool)
    if len(fixed):
        # What a rewind before each row costs as rotary travel, rad; infinite where there can be none
        cut = kinds == MoveKind.CUT
        rapid = kinds == MoveKind.RAPID
        lifted = np.where(cut & np.r_[False, cut[:-1]], LIFT_COST + CUT_COST, LIFT_COST)
        costs = np.where(rapid, REWIND_COST + NEAR_COST, lifted)
        costs[~(rapid if liftable is None else liftable)] = np.inf
        costs[clear_rapids(kinds, axes)] = REWIND_COST
        costs = costs[fixed[1:]]
        angles[fixed], rewinds[fixed] = _least_travel(
            machine, solutions[fixed], axes=axes, costs=costs, fixed=fixed, before=before
        )
    held = np.flatnonzero(free.any(1))
    if len(held):
        # The free angle between those of the rows `fixed`, the other one in their turn, of the first solution within
        # the limits: on the singular axis the solutions differ by rounding only
        first = np.argmax(within_limits(machine, solutions[held]), axis=1)
        chosen = np.take_along_axis(solutions[held], first[:, None, None], axis=1)[:, 0]
        for column, axis in enumerate(machine.rotary):
            rest = float(np.clip(0.0, *axis.limits))
            near = np.interp(held, fixed, angles[fixed, column]) if len(fixed) else np.full(len(held), rest)
            if axis.bounded:
                least, most = _turns_within(axis, chosen[:, column])
                turns = np.clip(np.round((near - chosen[:, column]) / FULL_TURN), least, most)
                chosen[:, column] += FULL_TURN * turns
            chosen[:, column] = np.where(free[held, column], near, chosen[:, column])
        angles[held] = chosen
    for column, axis in enumerate(machine.rotary):
        if not axis.bounded:
            start = before[column] if before is not None else 0.0
            angles[:, column] += FULL_TURN * np.round((start - angles[0, column]) / FULL_TURN)
    return Choice(angles, rewinds)


def clear_rapids(kinds: Int[ndarray, "n"], axes: Float[ndarray, "n 3"]) -> Bool[ndarray, "n"]:
    """Rows before which the rotary axes can be rewound as they are: rapids lead to and from both ends of the rewind,
    and no tool axis droops there, so that nothing is on the way out along it."""
    rapid = kinds == MoveKind.RAPID
    rising = axes[:, 2] >= 0
    return rapid & rising & np.r_[False, (rapid & rising)[:-1]] & np.r_[rapid[1:], True]


def _check_reach(machine: Machine, angles: ndarray) -> None:
    """MachineError for the first row with no solution within the limits of the rotary axes."""
    reached = within_limits(machine, angles).any(1)
    if reached.all():
        return
    row = int(np.argmin(reached))
    solutions = angles[row][np.isfinite(angles[row]).all(1)]
    if not len(solutions):
        raise MachineError(
            f"point {row}: no rotary angles of {machine.title} reach this tool axis: make path.max_tilt_deg smaller",
            row=row,
        )
    bounds = np.array([axis.limits for axis in machine.rotary])
    middle = np.array([sum(axis.limits) / 2 if axis.bounded else 0.0 for axis in machine.rotary])
    solutions = solutions + FULL_TURN * np.round((middle - solutions) / FULL_TURN)
    excess = np.maximum(np.maximum(bounds[:, 0] - solutions, solutions - bounds[:, 1]), 0)
    solution = int(np.argmin(excess.max(1)))
    column = int(np.argmax(excess[solution]))
    letter = machine.rotary[column].letter
    value = float(np.degrees(solutions[solution, column]))
    limit = float(np.degrees(bounds[column, 0] if np.radians(value) < bounds[column, 0] else bounds[column, 1]))
    raise MachineError(
        f"point {row}: {letter} {value:.3f} deg leaves the limit {limit:.3f} deg of {machine.title}: "
        "make path.max_tilt_deg smaller",
        row=row,
        axis=letter,
        value_deg=value,
        limit_deg=limit,
    )


def _turns_within(axis: RotaryAxis, angles: ndarray) -> tuple[ndarray, ndarray]:
    """The least and the most whole turns that can be added to angles (rad) within the limits of an axis."""
    low, high = axis.limits
    least = np.ceil((low - LIMIT_GUARD - angles) / FULL_TURN)
    return least, np.floor((high + LIMIT_GUARD - angles) / FULL_TURN)


def _turns(machine: Machine, solutions: ndarray) -> tuple[Int[ndarray, " a"], Int[ndarray, " b"]]:
    """The whole turns that may be added to the solutions of each rotary axis; 0 alone for one without limits."""
    turns = []
    for column, axis in enumerate(machine.rotary):
        if not axis.bounded:
            turns.append(np.zeros(1, dtype=np.int64))
            continue
        least, most = _turns_within(axis, solutions[:, :, column])
        turns.append(np.arange(np.nanmin(least), np.nanmax(most) + 1).astype(np.int64))
    limit = MAX_TURNS_OF_BOTH if min(map(len, turns)) > MAX_TURNS_OF_BOTH else MAX_TURNS
    first_turns, second_turns = (np.sort(some[np.argsort(np.abs(some))[:limit]]) for some in turns)
    return first_turns, second_turns


def _least_travel(
    machine: Machine,
    solutions: Float[ndarray, "m 2 2"],
    axes: Float[ndarray, "n 3"],
    costs: Float[ndarray, "m-1"],
    fixed: Int[ndarray, "m"],
    before: Float[ndarray, "2"] | None,
) -> tuple[Float[ndarray, "m 2"], Bool[ndarray, "m"]]:
    """The angles (rad) of the rows `fixed` with the fewest rewinds, whose `costs` are given, and the least travel; and
    which of these rows a rewind leads to. MachineError where no sequence stays within the limits."""
    first_turns, second_turns = _turns(machine, solutions)
    turns = np.array([[a, b] for a in first_turns for b in second_turns])
    values = (solutions[:, :, None, :] + FULL_TURN * turns).reshape(len(solutions), -1, 2)
    allowed = np.asarray(np.isfinite(values[:, :, 0] + values[:, :, 1]))
    start = np.zeros(values.shape[1])
    for column, axis in enumerate(machine.rotary):
        if axis.bounded:
            low, high = axis.limits
            allowed &= values[:, :, column] >= low - LIMIT_GUARD
            allowed &= values[:, :, column] <= high + LIMIT_GUARD
        if axis.has_choice and before is not None:
            start += np.abs(values[0, :, column] - before[column])
        else:
            start += 1e-3 * np.abs(values[0, :, column])
    # a solution beyond the limits in every turn is none
    usable = np.asarray(allowed.reshape(*solutions.shape[:2], -1).any(axis=2))
    travel, wraps = rotary_steps(machine, np.where(usable[:, :, None], solutions, np.nan), axes[fixed])
    bounded = np.array([axis.bounded for axis in machine.rotary])
    jumps = np.where(np.diff(fixed) > 1, 0.0, costs)
    size = len(first_turns), len(second_turns)
    chain, jumped = cheapest_chain(
        np.where(allowed[0], start, np.inf),
        travel,
        wraps=wraps,
        size=size,
        values=values,
        allowed=allowed,
        bounded=bounded,
        jumps=jumps,
    )
    if (chain < 0).any():
        row = int(fixed[np.argmax(chain < 0)])
        raise MachineError(
            f"point {row}: the rotary axes of {machine.title} reach their limits within a cut: "
            "make path.max_tilt_deg smaller",
            row=row,
        )
    picked = values[np.arange(len(values)), chain]
    picked[:, ~bounded] = np.unwrap(picked[:, ~bounded], axis=0)
    return picked, jumped & np.r_[False, jumps > 0]
