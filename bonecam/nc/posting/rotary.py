"""Which of the two rotary solutions, and which turn, at every point of a path.

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

FULL = 2 * np.pi
REWIND_COST = 100 * FULL
MOST_TURNS = 4
SMALL_TURN = 0.5


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
    """The rotary joints for a sequence of unit tool axes; MachineError where no way exists within the limits.

    Row i's kind is the kind of the move that arrives there. `hold_cone` in rad. `before`: the joints the
    machine comes from; an endless axis starts within half a turn of them.
    """
    found, free = inverse_rotary(machine, axes, hold_cone)
    _check_reach(machine, found)
    fixed = np.flatnonzero(~free.any(1))
    angles, rewinds = np.zeros((len(axes), 2)), np.zeros(len(axes), dtype=bool)
    if len(fixed):
        states = _states(machine, found[fixed])
        angles[fixed], rewinds[fixed] = _travel(machine, states, axes, kinds, fixed)
    held = np.flatnonzero(free.any(1))
    if len(held):
        angles[held] = _nearest_zero(machine, found[held])
        for column in range(2):
            rows = held[free[held, column]]
            angles[rows, column] = np.interp(rows, fixed, angles[fixed, column]) if len(fixed) else 0.0
    for column, axis in enumerate(machine.rotary):
        if axis.endless:
            start = before[column] if before is not None else 0.0
            angles[:, column] += FULL * np.round((start - angles[0, column]) / FULL)
            _unwind(machine, column, angles, kinds, rewinds)
    return Choice(angles, rewinds)


def _check_reach(machine: Machine, found: ndarray) -> None:
    reached = within_limits(machine, found).any(1)
    if reached.all():
        return
    row = int(np.argmin(reached))
    solutions = found[row][np.isfinite(found[row]).all(1)]
    if not len(solutions):
        raise MachineError(
            f"point {row}: no rotary angles of {machine.title} reach this tool axis: tilt it less", row=row
        )
    bounds = np.array([axis.limits for axis in machine.rotary])
    excess = np.maximum(np.maximum(bounds[:, 0] - solutions, solutions - bounds[:, 1]), 0)
    solution = int(np.argmin(excess.max(1)))
    column = int(np.argmax(excess[solution]))
    letter, value = machine.rotary[column].letter, float(np.degrees(solutions[solution, column]))
    limit = float(
        np.degrees(bounds[column, 0] if np.radians(value) < bounds[column, 0] else bounds[column, 1])
    )
    raise MachineError(
        f"point {row}: {letter} {value:.3f} deg leaves the limit {limit:.3f} deg of {machine.title}: limit the tilt",
        row=row,
        axis=letter,
        value_deg=value,
        limit_deg=limit,
    )


def _nearest_zero(machine: Machine, found: ndarray) -> ndarray:
    """On the singular axis the bound joint has one angle up to rounding: of the solutions within limits, the
    first."""
    first = np.argmax(within_limits(machine, found), axis=1)
    return np.take_along_axis(found, first[:, None, None], axis=1)[:, 0]


def _turns(machine: Machine, column: int) -> ndarray:
    low, high = machine.rotary[column].limits
    if machine.rotary[column].endless or high - low > MOST_TURNS * FULL:
        return np.zeros(1)
    return FULL * np.arange(np.floor((low - np.pi) / FULL), np.ceil((high + np.pi) / FULL) + 1)


def _states(machine: Machine, found: ndarray) -> ndarray:
    """Solutions times turns, (n, k, 2), NaN outside the limits; states that no row can use are left out."""
    first, second = (_turns(machine, column) for column in range(2))
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
    """Signed turn of both joints between states; the short way where a joint is endless."""
    change = end - start
    for column, axis in enumerate(machine.rotary):
        if axis.endless:
            change[..., column] -= FULL * np.round(change[..., column] / FULL)
    return change


def _follows(
    machine: Machine, start: ndarray, change: ndarray, before: ndarray, after: ndarray
) -> Bool[ndarray, "n"]:
    """Whether the axis, halfway with linear angles, is near the way from `before` to `after`; False where a
    state is none.

    A turn of T in all bends the axis's way by at most T, so that it is within T^2 / 8 of the middle: that
    settles most of them.
    """
    turn, chord = np.abs(change).sum(1), lengths(after - before)
    near = (turn < SMALL_TURN) & (turn**2 / 8 <= 0.7 * chord)
    ask = np.flatnonzero(~near & np.isfinite(turn))
    middle, before, after = tool_axes(machine, start[ask] + change[ask] / 2), before[ask], after[ask]
    straight = before + after
    # opposite axes have no middle: then no linear way follows them
    straight = straight / np.maximum(np.linalg.norm(straight, axis=1), np.finfo(float).tiny)[:, None]
    between = np.arctan2(np.linalg.norm(np.cross(before, after), axis=1), dots(before, after))
    off = np.arctan2(np.linalg.norm(np.cross(middle, straight), axis=1), dots(middle, straight))
    near[ask] = off <= 0.75 * between + 1e-9
    return np.asarray(near)


def _travel(
    machine: Machine, states: ndarray, axes: ndarray, kinds: ndarray, fixed: ndarray
) -> tuple[Float[ndarray, "m 2"], Bool[ndarray, "m"]]:
    count, k = states.shape[:2]
    steps = np.full((count - 1, k, k), np.inf)
    jumps = np.zeros((count - 1, k, k), dtype=bool)
    gap, rapid = np.diff(fixed) > 1, kinds[fixed[1:]] == Kind.RAPID
    for a in range(k):
        for b in range(k):
            start, end = states[:-1, a], states[1:, b]
            change = _changes(machine, start, end)
            good = gap | _follows(machine, start, change, axes[fixed[:-1]], axes[fixed[1:]])
            cost = np.abs(change).sum(1) + np.where(good, 0.0, np.where(rapid, REWIND_COST, np.inf))
            steps[:, a, b] = np.where(np.isnan(cost), np.inf, cost)
            jumps[:, a, b] = ~good
    first = np.where(np.isnan(states[0, :, 0]), np.inf, 1e-3 * np.abs(states[0]).sum(1))
    chain = cheapest_chain(first, steps)
    if (chain < 0).any():
        row = int(fixed[np.argmax(chain < 0)])
        raise MachineError(
            f"point {row}: the rotary axes of {machine.title} reach their limits within a cut: limit the tilt",
            row=row,
        )
    picked = states[np.arange(count), chain]
    rewinds = np.r_[False, jumps[np.arange(count - 1), chain[:-1], chain[1:]]]
    for column, axis in enumerate(machine.rotary):
        if axis.endless:
            picked[:, column] = np.unwrap(picked[:, column])
    return picked, rewinds


def _unwind(machine: Machine, column: int, angles: ndarray, kinds: ndarray, rewinds: ndarray) -> None:
    """Turn an axis that winds back by whole turns at the last rapid before it reaches its limits; changes the
    working arrays."""
    axis, begin = machine.rotary[column], 0
    low, high = axis.limits
    while True:
        off = np.flatnonzero((angles[begin:, column] < low) | (angles[begin:, column] > high))
        if not len(off):
            return
        row = begin + int(off[0])
        rapids = begin + 1 + np.flatnonzero(kinds[begin + 1 : row + 1] == Kind.RAPID)
        turns = np.round(angles[rapids[-1], column] / FULL) if len(rapids) else 0.0
        if turns == 0:
            value, limit = (
                np.degrees(angles[row, column]),
                np.degrees(low if angles[row, column] < low else high),
            )
            raise MachineError(
                f"point {row}: {axis.letter} winds to {value:.3f} deg, limit {limit:.3f} deg of {machine.title}: split the pass by a rapid",
                row=row,
                axis=axis.letter,
                value_deg=float(value),
                limit_deg=float(limit),
            )
        begin = int(rapids[-1])
        angles[begin:, column] -= FULL * turns
        rewinds[begin] = True
