"""The moves of a program: a tool path with its rotary angles, split where the control would leave the path.

Between two points of the path the ball centre runs straight and the tool axis turns evenly on the great
circle. The control interpolates its words instead (`machine/control.py`). A move is split evenly until tip and ball
centre stay within the tolerance at 1/4, 1/2 and 3/4 of it (the deviation is of second order in the move, so
its square root tells how often), no joint turns by more than 10 degrees in a feed move or a right angle in a
rapid or at the pole itself, and, without tool-centre control, no feed move is longer than 1 mm.

Post one tool path: its words for one control, split into moves, rounded and timed.

Rows of a tool path that would be blocks of no length: their words are those of the row before.

The blocks of the moves of one run, with their feeds where these change and the comments before them.

Where a path must be lifted so that the rotary axes of a machine can be rewound.

Between two cuts the axes must stand within their limits both before and after the rewind, as the tool leaves and comes
back to one place. That is a row of the path, or a place on the way between two rows where an axis is at its limit: with
limits just a turn apart there is no other.

What the planning of paths must know of a machine's rotary axes: which tool axes it has, how fast the axes are, and
where they come to their limits within a path.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, dots, largest, lengths, unit
from bonecam.arrays import lengths as lengths_of
from bonecam.errors import MachineError
from bonecam.job import Job
from bonecam.machine.control import Control
from bonecam.machine.kinematics import inverse_rotary, tool_axes
from bonecam.machine.limits import EVEN, MachineLimits, planned_band, polar_angles, reached_axes
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.rotary import FULL_TURN, choose_angles, clear_rapids
from bonecam.nc.words import MoveWords, axis_moves, contour_tolerance, move_words, rotary_tolerance_deg, with_marks
from bonecam.planning.contacts import POSTING_SHARE, planned_tolerance
from bonecam.planning.motion_time import ControlRule, motion_minutes
from bonecam.tool.path import MoveKind, ToolPath

MAX_ROUNDS = 40
"""A path that still needs splits after so many rounds passes through the singular axis."""
MAX_MOVE = 1.0
"""The longest feed move without tool-centre control, mm."""
MAX_TURN = np.radians(9.99)
"""The largest rotation of a joint in a feed move, rad: 10 degrees less the rounding of the words."""
MAX_RAPID_TURN = np.pi / 2
"""The largest rotation of a joint in a rapid, and in a feed move through the pole, rad."""
POLE_PASS = np.radians(0.01)
"""A feed move whose tool axis turns by less (rad) while a joint rotates passes the pole itself, where splits
do not lessen the rotation."""
RAPID_FACTOR = 20.0
"""Rapids may leave the path by this many times the tolerance of feed moves."""
AXIS_TOLERANCE = np.radians(1.0)
"""The largest angle between the tool axis of the path and that of the control, rad."""


@dataclass(frozen=True, eq=False)
class ProgramMoves:
    """The points of a program and the moves that arrive at them; `angles` in rad.

    `rows` are the points of the tool path that the moves belong to. Where `rewinds`, the rotary axes jump off
    the part.
    """

    kinds: Int[ndarray, "n"]
    tips: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    angles: Float[ndarray, "n 2"]
    feed_rates: Float[ndarray, "n"]
    rows: Int[ndarray, "n"]
    rewinds: Bool[ndarray, "n"]


def split_moves(
    path: ToolPath, control: Control, tolerance: float, hold_cone: float, before: Float[ndarray, "2"] | None = None
) -> ProgramMoves:
    """The moves of one tool path, fine enough for `control` to follow within `tolerance` (mm; rapids 20 times
    as much).

    `before`: the rotary joints (rad) the machine comes from.
    """
    kinds = np.asarray(path.kinds)
    tips = path.tips
    axes = path.axes
    rows = np.arange(len(path.tips))
    locked = any(axis.locked for axis in control.machine.rotary)
    known = np.full((len(tips), 2), np.nan)
    for _ in range(MAX_ROUNDS):
        choice = choose_angles(control.machine, axes, kinds, hold_cone, before)
        if locked:
            # the axes that the machine has, under the balls of the path
            balls = tips + control.centre_height * axes
            axes = tool_axes(control.machine, choice.angles)
            tips = balls - control.centre_height * axes
        # what was fine enough stays so while its angles do
        new = (choice.angles != known).any(1) | choice.rewinds
        asked = np.flatnonzero(new[1:] | new[:-1])
        pieces = np.ones(len(tips) - 1, dtype=np.int64)
        ends = asked[:, None] + [0, 1]
        pieces[asked] = _pieces(
            control, kinds[asked + 1], tips=tips[ends], axes=axes[ends], angles=choice.angles[ends], tolerance=tolerance
        )
        pieces[choice.rewinds[1:]] = 1
        if (pieces == 1).all():
            return ProgramMoves(
                kinds,
                tips,
                axes=axes,
                angles=choice.angles,
                feed_rates=np.asarray(path.feed_rates)[rows],
                rows=rows,
                rewinds=choice.rewinds,
            )
        # each new row: behind an old one, by a fraction of the move to the next
        move = np.repeat(np.arange(len(pieces)), pieces)
        place = np.arange(len(move)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        fractions = np.r_[0.0, (place + 1) / pieces[move]]
        after = np.r_[0, move + 1]
        tips, axes = between(tips, axes, control.centre_height, np.r_[0, move], fractions)
        known = np.where((fractions % 1 == 0)[:, None], choice.angles[after], np.nan)
        kinds = kinds[after]
        rows = rows[after]
    row = int(rows[1 + np.argmax(pieces)])
    raise MachineError(
        f"point {row}: the move passes too near the machine's singular axis to be split: "
        "change path.lead_deg or path.direction",
        row=row,
    )


def between(
    tips: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    radius: float,
    before: Int[ndarray, "m"],
    fractions: Float[ndarray, "m"],
) -> tuple[Float[ndarray, "m 3"], Float[ndarray, "m 3"]]:
    """Tips and axes of the path at fractions of the moves from the rows `before` to the next; exact at 0 and
    1."""
    after = np.minimum(before + 1, len(tips) - 1)
    a = axes[before]
    b = axes[after]
    part = fractions[:, None]
    angle = angles_between(a, b)[:, None]
    sine = np.sin(angle)
    small = sine < 1e-9
    weights = np.where(small, 1 - part, np.sin((1 - part) * angle) / np.where(small, 1, sine))
    weights_after = np.where(small, part, np.sin(part * angle) / np.where(small, 1, sine))
    turned = unit(weights * a + weights_after * b)
    centres = (1 - part) * (tips[before] + radius * a) + part * (tips[after] + radius * b)
    whole = fractions == 1
    start = fractions == 0
    turned = np.where(whole[:, None], b, np.where(start[:, None], a, turned))
    meant = np.where(whole[:, None], tips[after], np.where(start[:, None], tips[before], centres - radius * turned))
    return meant, turned


def _pieces(
    control: Control,
    kinds: Int[ndarray, " m"],
    tips: Float[ndarray, "m 2 3"],
    axes: Float[ndarray, "m 2 3"],
    angles: Float[ndarray, "m 2 2"],
    tolerance: float,
) -> Int[ndarray, " m"]:
    """The number of equal pieces that each move is split into; tips, axes and angles are those of its two ends."""
    first, last = (control.words(tips[:, end], angles[:, end]) for end in (0, 1))
    rapid = kinds == MoveKind.RAPID
    allowed = np.where(rapid, RAPID_FACTOR * tolerance, tolerance)
    worst = np.zeros(len(kinds))
    centres = tips + control.centre_height * axes
    middle = _axis_halfway(axes[:, 0], axes[:, 1])
    quarters = ((0.25, _axis_halfway(axes[:, 0], middle)), (0.5, middle), (0.75, _axis_halfway(middle, axes[:, 1])))
    for fraction, turned in quarters:
        tip, axis = control.between(first, last, fraction)
        tilted = axis - turned
        path = (1 - fraction) * centres[:, 0] + fraction * centres[:, 1]
        centre = tip + control.centre_height * axis - path
        off = np.maximum(lengths(centre), lengths(centre - control.centre_height * tilted))
        worst = np.maximum(worst, np.maximum(off / allowed, lengths(tilted) / AXIS_TOLERANCE))
    pieces = np.where(worst > 1, np.ceil(np.sqrt(1.1 * np.minimum(worst, 1e4))), 1)
    at_pole = lengths(axes[:, 1] - axes[:, 0]) < POLE_PASS
    rotation = largest(np.abs(angles[:, 1] - angles[:, 0])) / np.where(rapid | at_pole, MAX_RAPID_TURN, MAX_TURN)
    pieces = np.maximum(pieces, np.ceil(rotation - 1e-9))
    if not control.tool_centre:
        length = lengths(tips[:, 1] - tips[:, 0])
        pieces = np.maximum(pieces, np.where(rapid, 1, np.ceil(length / MAX_MOVE - 1e-9)))
    return np.maximum(pieces, 1).astype(np.int64)


def _axis_halfway(a: Float[ndarray, "n 3"], b: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """The unit vector halfway on the great circle; zero between opposite axes."""
    middle = a + b
    return middle / np.maximum(lengths(middle), np.finfo(float).tiny)[:, None]


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
    zero_height: float = 0.0,
) -> Posted:
    """The posted form of one path.

    `around` are the tips of the whole program: approaches begin above them. `before` are the rotary joints
    (rad) at the end of the path before, `zero_height` (mm) that of the program's zero. MachineError names level, pass,
    axis, value and limit.
    """
    cutter = path.cutter
    # the tool is as long as overhang and holder together
    control = Control(machine, dialect.tool_centre, cutter.radius, cutter.length, cutter.radius, zero_height)
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
    return control.joints(radians), lengths


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


ROWS = ("kinds", "pass_index", "parameters", "contacts", "tips", "axes", "feed_rates")
"""The columns of a tool path, a value a row."""


def moved_rows(posted: Posted) -> Bool[ndarray, "n"]:
    """Which rows of a path move an axis by their words, or must stay: rapids, the first row of a run, and the ends of
    ways on which rotary axes are rewound."""
    path, moves = posted.path, posted.moves
    moved = np.r_[True, np.any(np.diff(posted.words, axis=0) != 0, axis=1)]
    moved[[first for first, _ in posted.runs]] = True
    kept = np.zeros(len(path.tips), dtype=bool)
    np.logical_or.at(kept, moves.rows, moved)
    kept |= path.kinds == MoveKind.RAPID
    kept[path.lifts.ravel()] = True
    kept[-1] = True
    return kept


def with_rows(path: ToolPath, kept: Bool[ndarray, "n"]) -> ToolPath:
    """The path with these rows alone."""
    if kept.all():
        return path
    indices = np.cumsum(kept) - 1
    cones = path.cones and replace(path.cones, cone_of=path.cones.cone_of[kept])
    columns = {name: getattr(path, name)[kept] for name in ROWS}
    return replace(path, **columns, cones=cones, lifts=indices[path.lifts])


def row_blocks(posted: Posted, run: tuple[int, int], machine: Machine, dialect: Dialect) -> list[str]:
    """The blocks of the moves of a run, one a row of its words, and its marks."""
    rows = slice(*run)
    kinds = posted.moves.kinds[rows]
    # the feed of each move as the dialect writes it: mm/min, or 1/min (inverse time)
    feeds = posted.moves.feed_rates[rows]
    if posted.dialect.feed_mode != "per-minute":
        length = posted.lengths[rows].copy()
        length[0] = 0.0
        with np.errstate(divide="ignore"):
            by_length = feeds / length
            by_axes = 1 / posted.minutes[rows]
        feeds = np.where(posted.by_turn[rows] | (length == 0.0), np.minimum(by_length, by_axes), by_length)
    rates = dialect.numbers.feed.rounded_down(feeds)
    # the first row of a run is reached along the tool axis from the approach height
    fast = (kinds == MoveKind.RAPID) & dialect.straight_rapids
    fast[0] = dialect.straight_rapids or not dialect.tool_centre
    words, off = move_words(machine, dialect, posted.words[rows])
    lines = _blocks(words, rates, fast, dialect)
    if dialect.vector and off.any():
        by_angle = _blocks(axis_moves(machine, dialect, posted.words[rows]), rates, fast, dialect)
        for row in np.flatnonzero(off).tolist():
            lines[row] = by_angle[row]
            for start, own in dialect.vector.instead.items():
                lines[row] = own + lines[row].removeprefix(start) if lines[row].startswith(start) else lines[row]
    # the rows of the run that begin a way to the safe point and back to rewind rotary axes
    lifts = np.searchsorted(posted.moves.rows, posted.path.lifts[:, 0])
    lifted = lifts[(lifts >= run[0]) & (lifts < run[1])] - run[0]
    return with_marks(lines, kinds, fast, lifted, dialect)


def _blocks(words: MoveWords, rates: Float[ndarray, "n"], fast: Bool[ndarray, "n"], dialect: Dialect) -> list[str]:
    """The blocks of moves at their `rates` (feed words), rapids where they are `fast`."""
    form = " ".join(words.formats)
    rapid = "\n".join(dialect.move_lines("rapid", words=form))
    feed = "\n".join(dialect.move_lines("feed", words=form, feed=dialect.numbers.feed.spec))
    kept = "\n".join(dialect.move_lines("feed_kept", words=form))
    # behind a rapid, or behind a move of another feed
    changed = np.diff(np.where(fast, np.nan, rates), prepend=np.nan) != 0
    stated = ~fast & changed if kept else ~fast
    table = zip(words.numbers.tolist(), rates.tolist(), fast.tolist(), stated.tolist(), strict=True)
    return [
        feed % (*row, rate) if states else (rapid if quick else kept) % tuple(row) for row, rate, quick, states in table
    ]


FINE = np.radians(10.0)
"""A joint turns by no more between the places at which limits are asked, rad: as in the feed moves of a program."""
FINEST = 12
"""Times that moves are halved for it."""
HALVINGS = 50
"""Times that a move is halved to find where an axis is at its limit."""


def lift_places(
    machine: Machine, axes: Float[ndarray, "n 3"], kinds: Int[ndarray, "n"], blocked: Float[ndarray, " b"]
) -> tuple[Float[ndarray, " k"], Float[ndarray, "k 3"]]:
    """The places of a path from which it is lifted, as few as can be and none of those `blocked`, and the tool axes
    there: row i + f is f on the way from row i to the next. MachineError where the axes come to their limits and no
    lift helps."""
    is_cut = (kinds[:-1] == MoveKind.CUT) & (kinds[1:] == MoveKind.CUT)

    # The rows and, on the moves but rapids of a machine with limits on turns, so many places between them that no joint
    # turns by more than FINE: beside the pole the axes turn round between two rows
    fine = np.arange(len(axes), dtype=np.float64)
    bounded = np.array([axis.bounded for axis in machine.rotary])
    for _ in range(FINEST if any(axis.has_choice for axis in machine.rotary) else 0):
        turned = _axes_at(axes, fine)
        change = np.diff(inverse_rotary(machine, turned)[0][:, :, bounded], axis=0)
        wide = np.abs(_wrapped(change)).max(axis=(1, 2)) > FINE
        wide &= lengths(np.diff(turned, axis=0)) > POLE_PASS
        wide &= kinds[np.floor(fine[:-1]).astype(np.int64) + 1] != MoveKind.RAPID
        if not wide.any():
            break
        fine = np.sort(np.r_[fine, (fine[:-1] + fine[1:])[wide] / 2])

    at_limits = _at_limits(machine, axes, fine, is_cut)
    # where the tool comes back to the place that it leaves, the place follows itself
    twice = np.r_[np.flatnonzero(is_cut), at_limits]
    places = np.r_[fine, at_limits, twice]
    again = np.arange(len(places)) >= len(places) - len(twice)
    order = np.lexsort((again, places))
    places, again = places[order], again[order]
    turned = _axes_at(axes, places)

    row = np.ceil(places).astype(np.int64)
    left = np.where(again, places, row - 1.0)
    liftable = (again | ~is_cut[row - 1]) & (row > 0) & ~np.isin(left, blocked)
    try:
        choice = choose_angles(machine, turned, kinds[row], 0.0, liftable=liftable)
    except MachineError as error:
        at = int(row[error.evidence["row"]])
        what = str(error).partition(": ")[2]
        raise MachineError(f"point {at}: {what}", **{**error.evidence, "row": at}) from error
    lifts = choice.rewinds & ~clear_rapids(kinds[row], turned)
    back = np.where(again, places, row)[lifts]
    return left[lifts], _axes_at(axes, back)


def _axes_at(axes: Float[ndarray, "n 3"], places: Float[ndarray, " k"]) -> Float[ndarray, "k 3"]:
    """The unit axes at places of a path."""
    row = np.minimum(np.floor(places), len(axes) - 2).astype(np.int64)
    return between(axes, axes, 0.0, row, places - row)[1]


def _at_limits(
    machine: Machine, axes: Float[ndarray, "n 3"], fine: Float[ndarray, " m"], is_cut: Bool[ndarray, "n-1"]
) -> Float[ndarray, " k"]:
    """The places within cuts where a solution has an axis at a limit, in any turn, between two of `fine` ones."""
    cut = np.flatnonzero(is_cut[np.floor(fine[:-1]).astype(np.int64)])
    solutions, _ = inverse_rotary(machine, _axes_at(axes, fine))
    places = [np.zeros(0)]
    for column, axis in enumerate(machine.rotary):
        for limit in {round(limit % FULL_TURN, 12) for limit in axis.limits if axis.has_choice}:
            for solution in range(2):
                off = solutions[:, solution, column] - limit
                start = _wrapped(off[cut])
                end = start + _wrapped(off[cut + 1] - off[cut])
                crossing = cut[(start * end < 0) & (np.abs(start) + np.abs(end) < np.pi)]
                ends = fine[crossing], fine[crossing + 1]
                places.append(_halved(machine, axes, ends=ends, solution=solution, column=column, limit=limit))
    return np.unique(np.concatenate(places))


def _halved(
    machine: Machine,
    axes: Float[ndarray, "n 3"],
    ends: tuple[Float[ndarray, " k"], Float[ndarray, " k"]],
    solution: int,
    column: int,
    limit: float,
) -> Float[ndarray, " k"]:
    """The places between pairs of places at which a joint passes a limit (rad)."""

    def side(places: Float[ndarray, " k"]) -> Float[ndarray, " k"]:
        solutions, _ = inverse_rotary(machine, _axes_at(axes, places))
        return np.sign(_wrapped(solutions[:, solution, column] - limit))

    low, high = ends
    first = side(low)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        same = side(middle) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return high


def _wrapped(angles: ndarray) -> ndarray:
    """Angles (rad) within half a turn of zero."""
    return angles - FULL_TURN * np.round(angles / FULL_TURN)


@lru_cache(maxsize=8)
def machine_limits(machine: Machine) -> MachineLimits:
    """The tool axes that paths for the machine may use: polar angles within the band that it has all round, or else
    those that its joints reach. The rotary axis nearer to the part's Z changes the azimuth, the other one the polar
    angle. MachineError where the tool has a single direction."""
    turn, tilt = sorted(machine.rotary, key=lambda axis: -abs(machine.in_part(np.array([axis.direction]))[0, 2]))
    band = planned_band(machine)
    reached = None
    if band is None:
        reached = reached_axes(machine)
        angles = polar_angles(reached.samples)
        band = max(float(angles.min()) - EVEN, 0.0), min(float(angles.max()) + EVEN, np.pi)
    return MachineLimits(
        band[1],
        band[0],
        tilt_speed=tilt.speed,
        turn_speed=turn.speed,
        tilt_acceleration=tilt.acceleration,
        turn_acceleration=turn.acceleration,
        lift_places=partial(lift_places, machine),
        bodies=machine.bodies,
        reached=reached,
    )
