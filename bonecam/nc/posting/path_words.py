"""Post one tool path: its words for one control, split into moves, rounded and timed."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots, largest
from bonecam.arrays import lengths as lengths_of
from bonecam.errors import MachineError
from bonecam.job import Job
from bonecam.machine.control import Control
from bonecam.machine.kinematics import inverse_linear
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.rows.split import ProgramMoves, split_moves
from bonecam.nc.posting.tolerances import contour_tolerance, rotary_tolerance_deg
from bonecam.planning.motion_time import ControlRule, motion_minutes
from bonecam.planning.passes.gouge_lifts import POSTING_SHARE, planned_tolerance
from bonecam.tool.path import MoveKind, ToolPath

APPROACH_HEIGHT = 10.0
"""A run is approached along the tool axis from this far above everything that is machined, mm."""
STILL = 0.001
"""A tip that moves by less (mm) stands: its feed says nothing."""

SLOW = 0.02
"""Without tool-centre control, a block on which the axes allow less than this share of the cutter's feed is timed by
its turn: it lasts as long as its slowest axis needs. At 900 mm/min that is 18 mm/min, 1 s on a row of 0.3 mm."""


@dataclass(frozen=True, eq=False)
class Posted:
    """A tool path ready to be written. `words` (n, 5) are mm and degrees, rounded as they are written; at them stand
    the `joints` (n, 5), mm and rad. `lengths` (n,) is how far the tip moves to arrive at each row, mm.

    `runs` are the ranges of rows (first, end) between two retracts.

    `approaches` (r, 5) are the words from which each run is approached along the tool axis, above everything
    machined. `minutes` (n,) is the time of the move that arrives at each row; where a run begins, the time in
    which the rotary axes get there. Rapids that the control drives as such are as fast as the axes. `axis_minutes` (n,)
    is what its slowest axis needs at least. The control follows the words by the `rule` of its dialect, within the
    tolerances that it is told.
    """

    path: ToolPath
    dialect: Dialect
    control: Control
    moves: ProgramMoves
    words: Float[ndarray, "n 5"]
    joints: Float[ndarray, "n 5"]
    lengths: Float[ndarray, "n"]
    runs: tuple[tuple[int, int], ...]
    approaches: Float[ndarray, "r 5"]
    minutes: Float[ndarray, "n"]
    axis_minutes: Float[ndarray, "n"]
    rule: ControlRule

    @property
    def largest_rotation_deg(self) -> float:
        """The largest turn of one rotary axis in a feed move, degrees."""
        turns = np.abs(np.diff(self.words[:, 3:], axis=0, prepend=self.words[:1, 3:])).max(1)
        turns[[run[0] for run in self.runs]] = 0.0
        return float(turns[self.moves.kinds != MoveKind.RAPID].max(initial=0.0))

    @property
    def rewinds(self) -> int:
        """How often rotary axes are rewound: by lifts, and at rapids."""
        begun = self.moves.rows[[run[0] for run in self.runs[1:]], None]
        lifts = self.path.lifts
        on_lift = ((begun >= lifts[:, 0]) & (begun <= lifts[:, 1])).any(axis=1)
        return len(lifts) + int((~on_lift).sum())

    @cached_property
    def driven_minutes(self) -> Float[ndarray, "n"]:
        """Minutes of the move that arrives at each row, as the axes drive it: `minutes` where the machine's
        accelerations are not known, and where a run starts, off the part."""
        minutes = self.minutes.copy()
        for first, end in self.runs:
            after = slice(first + 1, end)
            minutes[after] = motion_minutes(self.control.machine, self.joints[first:end], minutes[after], self.rule)
        return minutes

    @cached_property
    def by_turn(self) -> Bool[ndarray, "n"]:
        """Rows of a program in inverse time whose blocks are timed by their turns: the tip hardly moves meanwhile."""
        timed = self.dialect.feed_mode != "per-minute"
        slow = self.lengths < SLOW * self.path.cutter.feed * self.axis_minutes
        return timed & (slow | (self.lengths <= self.dialect.numbers.length.step))


def post_path(
    path: ToolPath,
    machine: Machine,
    dialect: Dialect,
    job: Job,
    around: Float[ndarray, "m 3"],
    before: Float[ndarray, "2"] | None = None,
) -> Posted:
    """The posted form of one path.

    `around` are the tips of the whole program: approaches begin above them. `before` are the rotary joints
    (rad) at the end of the path before. MachineError names level, pass, axis, value and limit.
    """
    cutter = path.cutter
    # the tool is as long as overhang and holder together
    control = Control(machine, dialect.tool_centre, cutter.envelope_radius, cutter.length, cutter.centre_height)
    # half of the chord tolerance, but no more than gouges allow
    tolerance = min(job.path.chord_tolerance / 2, POSTING_SHARE * planned_tolerance(job.path.gouge_tolerance))
    # a tilt below half the last decimal of its word is written as zero: the other angle is free there
    hold_cone = np.radians(dialect.numbers.angle.step) / 2
    try:
        moves = split_moves(path, control, tolerance, hold_cone, before)
    except MachineError as error:
        row = min(error.evidence.get("row", 0), len(path.tips) - 1)
        raise MachineError(
            f"level {path.level}, pass {int(path.pass_index[row])}, {error}", level=path.level, **error.evidence
        ) from error
    starts = np.r_[0, np.flatnonzero(moves.rewinds)]
    runs = tuple((int(a), int(b)) for a, b in zip(starts, np.r_[starts[1:], len(moves.tips)], strict=True))
    words = round_words(dialect, control, moves.tips, moves.angles)
    angles = np.radians(words[:, 3:])
    lift = (around @ moves.axes[starts].T).max(0) - dots(moves.tips[starts], moves.axes[starts]) + APPROACH_HEIGHT
    above = (
        moves.tips[starts] + np.maximum(lift, APPROACH_HEIGHT)[:, None] * control.poses(np.radians(words[starts]))[1]
    )
    approaches = round_words(dialect, control, above, angles[starts])
    joints, lengths = joints_and_lengths(control, words)
    fastest = axis_minutes(machine, joints, starts)
    finishing = job.is_finishing(path.level)
    rule = ControlRule(
        contour_tolerance(dialect, job, finishing),
        float(np.radians(rotary_tolerance_deg(dialect, job, finishing, cutter.radius))),
        look_ahead=dialect.look_ahead,
        parabolic=dialect.corners == "parabolic",
    )
    rapid = np.inf if dialect.straight_rapids else job.nc.rapid_feed
    feed = np.where(moves.kinds == MoveKind.RAPID, rapid, moves.feed_rates)
    minutes = np.maximum(fastest, lengths / feed)
    minutes[0] = 0.0
    minutes[starts] = fastest[starts]
    return Posted(
        path,
        dialect,
        control=control,
        moves=moves,
        words=words,
        joints=joints,
        lengths=lengths,
        runs=runs,
        approaches=approaches,
        minutes=minutes,
        axis_minutes=fastest,
        rule=rule,
    )


def round_words(
    dialect: Dialect, control: Control, tips: Float[ndarray, "n 3"], angles: Float[ndarray, "n 2"]
) -> Float[ndarray, "n 5"]:
    """Words (mm, deg) as written: angles are rounded first, and the linear words fit the rounded angles."""
    rounded_angles = dialect.numbers.angle.rounded(np.degrees(angles))
    linear = dialect.numbers.length.rounded(control.words(tips, np.radians(rounded_angles))[:, :3])
    return np.column_stack([linear, rounded_angles])


def in_radians(words: Float[ndarray, "n 5"]) -> Float[ndarray, "n 5"]:
    """Words (mm, deg) with their angles in radians."""
    return np.column_stack([words[:, :3], np.radians(words[:, 3:])])


def joints_and_lengths(
    control: Control, words: Float[ndarray, "n 5"]
) -> tuple[Float[ndarray, "n 5"], Float[ndarray, "n"]]:
    """The joints (mm, rad) at words (mm, deg), and how far the tip moves to arrive at each, mm in the part's frame."""
    radians = in_radians(words)
    tips, _ = control.poses(radians)
    lengths = lengths_of(np.diff(tips, axis=0, prepend=tips[:1]))
    if not control.tool_centre:
        return radians, lengths
    return inverse_linear(control.machine, tips, radians[:, 3:], control.tool_length), lengths


def drivable_rates(control: Control, words: Float[ndarray, "n 5"], highest: float) -> Float[ndarray, "m"]:
    """The feeds (mm/min) of the n - 1 moves from each row of words (mm, deg) to the next: `highest`, or what the
    slowest axis can follow."""
    joints, lengths = joints_and_lengths(control, words)
    minutes = axis_minutes(control.machine, joints)[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(lengths[1:] > STILL, np.minimum(highest, lengths[1:] / minutes), highest)


def axis_minutes(
    machine: Machine, joints: Float[ndarray, "n 5"], starts: Int[ndarray, " r"] | None = None
) -> Float[ndarray, "n"]:
    """Minutes that the slowest axis needs for the move that arrives at each row of joints (mm, rad); where a run
    `starts`, the slower rotary axis."""
    speeds = np.array([axis.speed for axis in machine.linear] + [axis.speed for axis in machine.rotary])
    slowest = np.r_[0.0, largest(np.abs(np.diff(joints, axis=0)) / speeds)]
    if starts is not None:
        rotary = np.abs(np.diff(joints[:, 3:], axis=0, prepend=joints[:1, 3:])) / speeds[3:]
        slowest[starts] = rotary[starts].max(1)
    return slowest
