"""Whether every axis stays within its limits and travel in all that a text moves: cuts, approaches, tool starts,
retracts."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.errors import VerifyError
from bonecam.machine.axes import LinearAxis, RotaryAxis
from bonecam.machine.machine import Machine
from bonecam.nc.reading.motions import Motions
from bonecam.verify.control.nose_moves import NoseMoves, nose_moves

GUARD = 1e-6
"""A value beyond a limit by less (mm, degrees) is at the limit: far below the last decimal of any word."""
LARGER = "correct the word, or take a machine with larger limits"


def check_limits(motions: Motions, machine: Machine) -> None:
    """VerifyError with line, axis, value and limit where an axis leaves its limits or its travel, between the ends of
    a block too; where a retract to the zero of the machine's Z goes beyond them, or below what else the spindle nose
    does."""
    for column, rotary in enumerate(machine.rotary):
        _check_rotary(motions, column, rotary)
    noses = nose_moves(motions, machine)
    for column, linear in enumerate(machine.linear):
        _check_linear(noses, column, linear)
        _check_travel(noses, column, linear)
    _check_retracts(noses, machine.linear[2])


def _known(motions: Motions, column: int) -> tuple[Float[ndarray, "m"], Int[ndarray, "m"]]:
    """The values (mm, degrees) of an axis after partial moves by which it is known, and their lines."""
    reported = [(move.joints[column], move.line) for move in motions.partial if not move.retract]
    table = np.array([row for row in reported if np.isfinite(row[0])]).reshape(-1, 2)
    return table[:, 0], table[:, 1].astype(np.int64)


def _check_rotary(motions: Motions, column: int, axis: RotaryAxis) -> None:
    low, high = np.degrees(axis.limits)
    if not np.isfinite(high - low):
        return
    partial, partial_lines = _known(motions, 3 + column)
    values = np.r_[np.degrees(motions.words[:, 3 + column]), partial]
    lines = np.r_[motions.lines, partial_lines]
    if axis.endless and motions.short_way:
        # a word says where the axis stands but for whole turns: each stretch may begin in any
        # Angles (degrees) moved by whole turns, each stretch that goes on from known places alike, to lie within the
        # limits if they can
        values = values[: len(motions.lines)]
        starts = np.flatnonzero(~motions.known_start)
        moved = values.copy()
        for first, end in zip(starts, np.r_[starts[1:], len(values)], strict=True):
            stretch = values[first:end]
            moved[first:end] = stretch + 360.0 * np.ceil((low - GUARD - stretch.min()) / 360.0)
        values = moved

        lines = motions.lines
    off = (values < low - GUARD) | (values > high + GUARD)
    if off.any():
        at = int(np.flatnonzero(off)[np.argmin(lines[off])])
        raise _beyond(axis.letter, values[at], low if values[at] < low else high, "deg", int(lines[at]))


def _check_linear(noses: NoseMoves, column: int, axis: LinearAxis) -> None:
    """VerifyError at the first move of the spindle nose beyond the limits of an axis."""
    partial, partial_lines = _known(noses.motions, column)
    for sign, limit in ((-1.0, -axis.limits[0]), (1.0, axis.limits[1])):
        if not np.isfinite(limit):
            continue
        moves = noses.reaching(column, sign, limit + GUARD)
        values = np.r_[noses.highest(column, sign, moves), sign * partial]
        lines = np.r_[noses.motions.lines[moves], partial_lines]
        off = np.flatnonzero(values > limit + GUARD)
        if len(off):
            first = off[np.argmin(lines[off])]
            raise _beyond(axis.letter, sign * values[first], sign * limit, "mm", int(lines[first]))


def _check_travel(noses: NoseMoves, column: int, axis: LinearAxis) -> None:
    """VerifyError where the spindle nose runs over more than the travel of an axis, at the end that is farther from
    where the axis mostly is."""
    partial, partial_lines = _known(noses.motions, column)
    values = np.r_[noses.ends[:, column], partial]
    if not len(values):
        return
    lines = np.r_[noses.motions.lines, partial_lines]
    high, high_line = _extreme(noses, column, 1.0, values, lines)
    low, low_line = _extreme(noses, column, -1.0, values, lines)
    if high - low > axis.travel + GUARD:
        middle = float(np.median(values))
        line = high_line if high - middle > middle - low else low_line
        what = f"{axis.letter} runs over {high - low:.1f} mm in the program, its travel is {axis.travel:g} mm"
        raise VerifyError(f"line {line}: {what}: {LARGER}", line=line, place=None, error=high - low - axis.travel)


def _extreme(
    noses: NoseMoves, column: int, sign: float, values: Float[ndarray, "m"], lines: Int[ndarray, "m"]
) -> tuple[float, int]:
    """The highest (sign 1) or lowest (-1) value of an axis (mm) in the whole program, `values` being those at the
    ends of moves, and its line."""
    at = int(np.argmax(sign * values))
    moves = noses.reaching(column, sign, sign * values[at] + GUARD)
    extremes = noses.highest(column, sign, moves)
    if len(extremes) and extremes.max() > sign * values[at]:
        return sign * float(extremes.max()), int(noses.motions.lines[moves[np.argmax(extremes)]])
    return float(values[at]), int(lines[at])


def _check_retracts(noses: NoseMoves, axis: LinearAxis) -> None:
    """VerifyError where a retract to a height in machine coordinates is beyond the limits of Z, or below a move.
    Without limits it is not known where that height is."""
    low, high = axis.limits
    if not np.isfinite(high - low):
        return
    top = float(noses.ends[:, 2].max(initial=-np.inf))
    for move in noses.motions.partial:
        height = move.joints[2]
        if not move.retract or not np.isfinite(height):
            continue
        if not low - GUARD <= height <= high + GUARD:
            raise _beyond("Z", height, low if height < low else high, "mm", move.line)
        if height < top - GUARD:
            what = f"the retract to Z {height:g} of the machine is below the spindle nose at its highest ({top:.1f} mm)"
            remedy = "correct the limits and part_zero of the machine's file, or the retract of the dialect's"
            raise VerifyError(f"line {move.line}: {what}: {remedy}", line=move.line, place=None, error=top - height)


def _beyond(letter: str, value: float, limit: float, unit: str, line: int) -> VerifyError:
    what = f"{letter} goes to {value:.3f} {unit}, its limit is {limit:g} {unit}"
    return VerifyError(f"line {line}: {what}: {LARGER}", line=line, place=None, error=abs(value - limit))
