"""The room that a program takes: the range of every axis, and the height above all that it does."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import MachineError
from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.nc.posting.path_words import APPROACH_HEIGHT, Posted, in_radians, joints_and_lengths, round_words
from bonecam.nc.posting.start import start_words
from bonecam.workholding.clamping import holding_columns
from bonecam.workholding.tailstock import tailstock_bodies


@dataclass(frozen=True, eq=False)
class Travel:
    """Lowest and highest value of every axis in a program, (5, 2): X, Y, Z of the spindle nose in mm, rotary axes in
    degrees, unwound; and where every tool is to `start`, X, Y and Z of its tip in the machine's frame (mm)."""

    ranges: Float[ndarray, "5 2"]
    start: Float[ndarray, "3"]

    @property
    def retract(self) -> float:
        """The machine Z (mm, of the tip) above everything that the program does."""
        return float(self.start[2])


def travel_of(machine: Machine, job: Job, paths: Sequence[Posted]) -> Travel:
    """The room that the posted paths take; MachineError with axis, value, limit and level where the spindle nose
    leaves its limits or the program its travel."""
    start = _start(machine, job, paths)
    retract = float(start[2])
    ranges = np.column_stack([np.full(5, np.inf), np.full(5, -np.inf)])
    for posted in paths:
        dialect, control = posted.dialect, posted.control
        starts = [
            start_words(dialect, control, words[3:], start) for words in posted.approaches if dialect.starts_at_zero
        ]
        more, _ = joints_and_lengths(control, np.vstack([posted.approaches, *starts]))
        # what the template that moves a tool over zero does not say is that of the first joints
        over = [[*start, *posted.joints[0, 3:]]] if "{over_zero}" in dialect.templates.tool else more[:0]
        nose = np.vstack([posted.joints, more, over])
        nose[:, 3:] = np.degrees(nose[:, 3:])
        nose[:, 2] += control.tool_length
        for column, axis in enumerate(machine.linear):
            _check_limits(axis.letter, axis.limits, nose[:, column], posted, machine)
        lift = control.tool_length if dialect.templates.lift else 0.0
        top = np.array([[-np.inf] * 2 + [retract + control.tool_length + lift] + [-np.inf] * 2])
        ranges[:, 0] = np.minimum(ranges[:, 0], nose.min(0))
        ranges[:, 1] = np.maximum(ranges[:, 1], np.vstack([nose, top]).max(0))
        _check_travel(machine, ranges, posted.path.level)
    return Travel(ranges, start)


def above(posted: Posted, run: int, retract: float) -> Float[ndarray, "5"]:
    """Words (mm, deg) of the place on the tool axis over the approach of a run, at the retract height."""
    return _raised(posted, posted.approaches[run][None], retract)


def lifted(posted: Posted, run: int, retract: float) -> Float[ndarray, "5"]:
    """Words (mm, deg) of the place on the tool axis over the end of a run at the retract height; above it by the length
    of the tool where the dialect lifts it, so that a control that drops the tool by its length leaves it above
    everything."""
    end = posted.runs[run][1] - 1
    more = posted.control.tool_length if posted.dialect.templates.lift else 0.0
    return _raised(posted, posted.words[end][None], retract, more)


def _raised(posted: Posted, words: Float[ndarray, "1 5"], height: float, more: float = 0.0) -> Float[ndarray, "5"]:
    """Words (mm, deg) moved along the tool axis until the tip is at a machine Z of `height`, and by `more`."""
    joints, _ = joints_and_lengths(posted.control, words)
    lift = max(height - float(joints[0, 2]), 0.0) + more
    radians = in_radians(words)
    if not posted.control.tool_centre:
        return np.asarray(words[0] + [0.0, 0.0, lift, 0.0, 0.0])
    tips, axes = posted.control.poses(radians)
    return np.asarray(round_words(posted.dialect, posted.control, tips + lift * axes, radians[:, 3:])[0])


def _start(machine: Machine, job: Job, paths: Sequence[Posted]) -> Float[ndarray, "3"]:
    """Where tools start: over the program's zero, or, where the part's Z does not stand upright with all rotary axes at
    zero, over its place as far from the table as any approach: over zero the spindle would stand across the table's
    plane. The height is above everything the program does, and above table and chuck, whatever the rotary axes do
    meanwhile."""
    tips = [posted.control.poses(in_radians(posted.approaches))[0] for posted in paths]
    farthest = max(float(each[:, 2].max()) for each in tips)
    over = machine.in_machine(np.array([[0.0, 0.0, farthest]]))[0] + machine.part_zero
    approaches = [joints_and_lengths(posted.control, posted.approaches)[0] for posted in paths]
    heights = [joints[:, 2].max() for joints in approaches]
    if machine.part_axes:
        pivot = np.array(machine.part_axes[-1].pivot)
        # while the table swings under the tool, the part sweeps at most this ball about the pivot
        reach = [lengths(posted.joints[:, :3] - pivot).max() for posted in paths]
        heights.append(pivot[2] + max(*reach, table_reach(machine, job)))
    return np.array([over[0], over[1], np.ceil(max(heights) + APPROACH_HEIGHT)])


def table_reach(machine: Machine, job: Job) -> float:
    """The farthest that table, chuck and what else stands there reach from the pivot about which they swing under the
    tool, mm, as far as they are known."""
    pivot = np.array(machine.part_axes[-1].pivot)
    table = machine.table
    edges = [(0.0, radius) for radius in (table.radius, np.hypot(table.half_width, table.half_depth))]
    edges.append((0.0, 0.0))
    held = [*holding_columns(job.holding).values(), *tailstock_bodies(job.holding)]
    edges += [(column.top, column.radius + float(np.hypot(column.x, column.y))) for column in held]
    height = 0.0
    for piece in table.standing:
        height += piece.length
        edges.append((height, max(piece.diameter, piece.top_diameter) / 2))
    zero = np.array(machine.part_zero) - pivot
    up = machine.in_machine(np.array([[0.0, 0.0, 1.0]]))[0]
    return max(float(np.linalg.norm(zero + high * up)) + radius for high, radius in edges if np.isfinite(radius))


def _check_travel(machine: Machine, ranges: Float[ndarray, "5 2"], level: int) -> None:
    """MachineError where a linear axis runs over more than its travel."""
    for axis, (low, high) in zip(machine.linear, ranges.tolist(), strict=False):
        if high - low > axis.travel:
            raise MachineError(
                f"level {level}: {axis.letter} runs over {high - low:.1f} mm, travel {axis.travel:.1f} mm "
                f"of {machine.title}: take a machine with more travel, a shorter tool, post or part",
                axis=axis.letter,
                value=high - low,
                limit=axis.travel,
                level=level,
            )


def _check_limits(letter: str, limits: tuple[float, float], nose: ndarray, posted: Posted, machine: Machine) -> None:
    """MachineError where the spindle nose (mm along one axis) leaves the limits of the axis."""
    for value, limit, off in (
        (nose.min(), limits[0], nose.min() < limits[0]),
        (nose.max(), limits[1], nose.max() > limits[1]),
    ):
        if not off:
            continue
        row = int(np.argmin(np.abs(nose - value)))
        rows = np.r_[np.arange(len(posted.words)), [first for first, _ in posted.runs]]
        where = "the start of its tool"
        if row < len(rows):
            where = f"pass {int(posted.path.pass_index[posted.moves.rows[rows[row]]])}"
        raise MachineError(
            f"level {posted.path.level}, {where}: {letter} {value:.1f} mm leaves the limit "
            f"{limit:.1f} mm of {machine.title}: take a machine with more travel, or move part_zero",
            axis=letter,
            value=float(value),
            limit=float(limit),
            level=posted.path.level,
        )
