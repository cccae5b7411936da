"""The choice of rotary angles along a path: which of the two solutions, and how many whole turns.

Least rotary travel along the whole sequence inside the limits (dynamic programming over solution and turn). A
step that is not a rapid may only be taken where the axis, with both angles running linearly, stays near the
way between its two ends; so a path never flips to the other solution in the cut. Where that cannot be, the
angles jump at a rapid: a rewind, done off the part. Within the hold cone about the singular axis the free
angle is held, or runs evenly from the angle before the stretch to the angle after it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.errors import MachineError
from bonecam.kernels.chain import cheapest_chain
from bonecam.nc.kinematics import LIMIT_GUARD, inverse_rotary, tool_axes, within_limits
from bonecam.nc.machine import Machine
from bonecam.toolpath.path import Kind

FULL_TURN = 2 * np.pi
REWIND_COST = 100 * FULL_TURN
"""The cost of a rewind, as rotary travel in rad: so large that the fewest rewinds come first, and the least
travel second."""
MAX_TURNS = 4
"""An axis whose limits are more than this many turns apart keeps the turn it is in: the states of the dynamic
program grow with the number of turns."""
SMALL_ROTATION = 0.5
"""Rotation (rad) below which the bound T^2 / 8 of `_stays_near` is used."""


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
) -> Choice:
    """The rotary joints for a sequence of unit tool axes; MachineError where the limits allow none.

    Row i's kind is the kind of the move that arrives there. `hold_cone` in rad. `before`: the joints the
    machine comes from; an endless axis starts within half a turn of them.
    """
    found, free = inverse_rotary(machine, axes, hold_cone)
    _check_reach(machine, found)
    fixed = np.flatnonzero(~free.any(1))
    angles = np.zeros((len(axes), 2))
    rewinds = np.zeros(len(axes), dtype=bool)
    if len(fixed):
        states = _states(machine, found[fixed])
        angles[fixed], rewinds[fixed] = _least_travel(machine, states, axes, kinds, fixed)
    held = np.flatnonzero(free.any(1))
    if len(held):
        angles[held] = _first_within_limits(machine, found[held])
        for column in range(2):
            rows = held[free[held, column]]
            angles[rows, column] = np.interp(rows, fixed, angles[fixed, column]) if len(fixed) else 0.0
    for column, axis in enumerate(machine.rotary):
        if axis.endless:
            start = before[column] if before is not None else 0.0
            angles[:, column] += FULL_TURN * np.round((start - angles[0, column]) / FULL_TURN)
            angles, rewinds = _unwind(machine, column, angles, kinds, rewinds)
    return Choice(angles, rewinds)


def _check_reach(machine: Machine, found: ndarray) -> None:
    """MachineError for the first row with no solution within the limits of the rotary axes."""
    reached = within_limits(machine, found).any(1)
    if reached.all():
        return
    row = int(np.argmin(reached))
    solutions = found[row][np.isfinite(found[row]).all(1)]
    if not len(solutions):
        raise MachineError(
            f"point {row}: no rotary angles of {machine.title} reach this tool axis: make path.max_tilt_deg smaller",
            row=row,
        )
    bounds = np.array([axis.limits for axis in machine.rotary])
    excess = np.maximum(np.maximum(bounds[:, 0] - solutions, solutions - bounds[:, 1]), 0)
    solution = int(np.argmin(excess.max(1)))
    column = int(np.argmax(excess[solution]))
    letter = machine.rotary[column].letter
    value = float(np.degrees(solutions[solution, column]))
    limit = float(
        np.degrees(bounds[column, 0] if np.radians(value) < bounds[column, 0] else bounds[column, 1])
    )
    raise MachineError(
        f"point {row}: {letter} {value:.3f} deg leaves the limit {limit:.3f} deg of {machine.title}: "
        "make path.max_tilt_deg smaller",
        row=row,
        axis=letter,
        value_deg=value,
        limit_deg=limit,
    )


def _first_within_limits(machine: Machine, found: ndarray) -> ndarray:
    """The first solution within the limits, (n, 2): on the singular axis the solutions differ by rounding
    only."""
    first = np.argmax(within_limits(machine, found), axis=1)
    return np.take_along_axis(found, first[:, None, None], axis=1)[:, 0]


def _whole_turns(machine: Machine, column: int) -> ndarray:
    """The whole turns (rad) that may be added to the solutions of a rotary axis within its limits."""
    low, high = machine.rotary[column].limits
    if machine.rotary[column].endless or high - low > MAX_TURNS * FULL_TURN:
        return np.zeros(1)
    return FULL_TURN * np.arange(np.floor((low - np.pi) / FULL_TURN), np.ceil((high + np.pi) / FULL_TURN) + 1)


def _states(machine: Machine, found: ndarray) -> ndarray:
    """The states of each row, (n, k, 2): its solutions plus whole turns, NaN outside the limits.

    States that no row can use are left out.
    """
    first = _whole_turns(machine, 0)
    second = _whole_turns(machine, 1)
    shifts = np.array([[a, b] for a in first for b in second])
    states = (found[:, :, None, :] + shifts).reshape(len(found), -1, 2)
    for column, axis in enumerate(machine.rotary):
        if len((first, second)[column]) > 1 or not axis.endless:
            low, high = axis.limits
            states[
                ~((states[:, :, column] >= low - LIMIT_GUARD) & (states[:, :, column] <= high + LIMIT_GUARD))
            ] = np.nan
    return states[:, np.isfinite(states[:, :, 0]).any(0)]


def _changes(machine: Machine, start: ndarray, end: ndarray) -> ndarray:
    """The signed rotation (rad) of both joints between two states; the short way where a joint is endless."""
    change = end - start
    for column, axis in enumerate(machine.rotary):
        if axis.endless:
            change[..., column] -= FULL_TURN * np.round(change[..., column] / FULL_TURN)
    return change


def _stays_near(
    machine: Machine, start: ndarray, change: ndarray, before: ndarray, after: ndarray
) -> Bool[ndarray, "n"]:
    """Whether the tool axis halfway, with both joints running linearly from `start` by `change`, stays near
    the great circle between the tool axes `before` and `after`.

    A rotation by T (rad, the sum of both joints) leads the axis halfway off by at most T^2 / 8, which settles
    most moves. False where a state is NaN.
    """
    rotation = np.abs(change).sum(1)
    chord = lengths(after - before)
    near = (rotation < SMALL_ROTATION) & (rotation**2 / 8 <= 0.7 * chord)
    ask = np.flatnonzero(~near & np.isfinite(rotation))
    middle = tool_axes(machine, start[ask] + change[ask] / 2)
    before = before[ask]
    after = after[ask]
    straight = before + after
    # opposite axes have no middle: then no linear way follows them
    straight = straight / np.maximum(np.linalg.norm(straight, axis=1), np.finfo(float).tiny)[:, None]
    between = np.arctan2(np.linalg.norm(np.cross(before, after), axis=1), dots(before, after))
    off = np.arctan2(np.linalg.norm(np.cross(middle, straight), axis=1), dots(middle, straight))
    near[ask] = off <= 0.75 * between + 1e-9
    return np.asarray(near)


def _least_travel(
    machine: Machine, states: ndarray, axes: ndarray, kinds: ndarray, fixed: ndarray
) -> tuple[Float[ndarray, "m 2"], Bool[ndarray, "m"]]:
    """The angles (rad) of the rows `fixed` with the least rotary travel, by dynamic programming over their
    `states`; and which of these rows a rewind leads to. MachineError where no sequence stays within the
    limits."""
    count, k = states.shape[:2]
    steps = np.full((count - 1, k, k), np.inf)
    jumps = np.zeros((count - 1, k, k), dtype=bool)
    gap = np.diff(fixed) > 1
    rapid = kinds[fixed[1:]] == Kind.RAPID
    for a in range(k):
        for b in range(k):
            start = states[:-1, a]
            end = states[1:, b]
            change = _changes(machine, start, end)
            good = gap | _stays_near(machine, start, change, axes[fixed[:-1]], axes[fixed[1:]])
            cost = np.abs(change).sum(1) + np.where(good, 0.0, np.where(rapid, REWIND_COST, np.inf))
            steps[:, a, b] = np.where(np.isnan(cost), np.inf, cost)
            jumps[:, a, b] = ~good
    first = np.where(np.isnan(states[0, :, 0]), np.inf, 1e-3 * np.abs(states[0]).sum(1))
    chain = cheapest_chain(first, steps)
    if (chain < 0).any():
        row = int(fixed[np.argmax(chain < 0)])
        raise MachineError(
            f"point {row}: the rotary axes of {machine.title} reach their limits within a cut: "
            "make path.max_tilt_deg smaller",
            row=row,
        )
    picked = states[np.arange(count), chain]
    rewinds = np.r_[False, jumps[np.arange(count - 1), chain[:-1], chain[1:]]]
    for column, axis in enumerate(machine.rotary):
        if axis.endless:
            picked[:, column] = np.unwrap(picked[:, column])
    return picked, rewinds


def _unwind(
    machine: Machine, column: int, angles: ndarray, kinds: ndarray, rewinds: ndarray
) -> tuple[Float[ndarray, "n 2"], Bool[ndarray, "n"]]:
    """Angles (rad) and rewinds with an axis turned back by whole turns at the last rapid before its
    limits."""
    angles = angles.copy()
    rewinds = rewinds.copy()
    axis = machine.rotary[column]
    low, high = axis.limits
    begin = 0
    while True:
        off = np.flatnonzero((angles[begin:, column] < low) | (angles[begin:, column] > high))
        if not len(off):
            return angles, rewinds
        row = begin + int(off[0])
        rapids = begin + 1 + np.flatnonzero(kinds[begin + 1 : row + 1] == Kind.RAPID)
        turns = np.round(angles[rapids[-1], column] / FULL_TURN) if len(rapids) else 0.0
        if turns == 0:
            value = float(np.degrees(angles[row, column]))
            limit = float(np.degrees(low if angles[row, column] < low else high))
            bound = f"{axis.letter} winds to {value:.3f} deg, limit {limit:.3f} deg of {machine.title}"
            evidence = {"row": row, "axis": axis.letter, "value_deg": value, "limit_deg": limit}
            raise MachineError(
                f"point {row}: {bound}: make path.max_tilt_deg smaller, or change path.direction", **evidence
            )
        begin = int(rapids[-1])
        angles[begin:, column] -= FULL_TURN * turns
        rewinds[begin] = True
