"""What a control would refuse to run, or would run otherwise than the job means: judged on the text as it was read.

The error of the first move of a text that a control would not run, or would run otherwise than meant.

Where the spindle nose goes during the moves of a text, between their ends too.

Under tool-centre control the tip runs straight while the rotary axes turn, so a linear axis may go farther than at both
ends of a block. With the turns T of the rotary axes, each x -> pivot + Rot(x - pivot), and a point that is moved with
speed v and acceleration a at a distance d from the pivot, the turn by w a block leaves at most

    v' = w d + v,        a' = w^2 d + 2 w v + a,

so that an axis leaves the line between its ends by a / 8 at most. Moves whose bound reaches a value are sampled.

Whether every axis stays within its limits and travel in all that a text moves: cuts, approaches, tool starts,
retracts.

The verdict on a text as its control would run it: limits of axes, feeds, spindle; with its job also coolant, and
feeds, speeds and lengths of tools other than the job's.

Whether the feeds of a text are in the mode that its control needs, and no larger than machine and job allow.

Feeds are those of the tip. Links and rapids that are written as feeds may ask more than the axes can: the control
drives them as fast as it can. By the job a cut is no faster than the shallowest cut of its cutter
(`nc.posting.feeds.fastest_cut` where its feeds are not constant, or the plunge feed where that is more), and its chip
load no larger: a spindle that turns slower than in the job takes as much from the feed. Links may be as fast as links,
plunges and rapids of the job.

Whether the spindle turns and the coolant runs while a text cuts.

All cutters cut clockwise: what turns a spindle the other way is no word of any dialect.

A trial program before the first stage: whether a machine and a control's dialect fit one another and the job.

A few moves of every cutter at the height of the part, posted and read back as the program will be. What a dialect
cannot write (too few decimals, a range that the feeds leave), what its own grammar cannot read, and a machine that
it does not know show here in a few milliseconds instead of after all paths.

The text of a program in a file, judged for the machine, the control and the job that it is to run for.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import MachineError, ProgramError, VerifyError
from bonecam.job import Job
from bonecam.job.nc_section import LINK_FEED
from bonecam.machine.control import Control
from bonecam.machine.kinematics import UP, tool_axes
from bonecam.machine.machine import Machine
from bonecam.machine.machine_file import LinearAxis, RotaryAxis
from bonecam.nc.dialect import Dialect
from bonecam.nc.feeds import fastest_cut
from bonecam.nc.motions import Motions
from bonecam.nc.parts import joined
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.nc.words import comment, comments_of, contour_tolerance
from bonecam.text.numbers import shown, told_apart
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.verify.readback import FEED_TOLERANCE, MIN_LENGTH_STEPS, Tolerances, compare_moves, refuse_first
from bonecam.verify.removal import cutters_of
from bonecam.verify.sweeping import tools_of

SAMPLES = 65
"""Places that a doubtful move is sampled at: a bound of 1 mm is then kept within 0.3 um."""
MOST_AT_ONCE = 2000
"""Moves sampled at once: bounds the memory."""


@dataclass(frozen=True, eq=False)
class NoseMoves:
    """X, Y, Z of the spindle nose (machine coordinates, mm) at the `starts` and `ends` of moves; `bows`: what it may
    leave the line between them by. Where the start is not known it is the end."""

    machine: Machine
    motions: Motions
    starts: Float[ndarray, "n 3"]
    ends: Float[ndarray, "n 3"]
    bows: Float[ndarray, "n"]

    def reaching(self, column: int, sign: float, value: float) -> Int[ndarray, "k"]:
        """The moves that may bring `sign` times an axis above a `value`, mm."""
        highest = np.maximum(sign * self.starts[:, column], sign * self.ends[:, column]) + self.bows
        return np.flatnonzero(highest > value)

    def highest(self, column: int, sign: float, moves: Int[ndarray, "k"]) -> Float[ndarray, "k"]:
        """The largest value of `sign` times an axis in some moves, mm."""
        highest = [
            self._sampled(column, sign, moves[at : at + MOST_AT_ONCE]) for at in range(0, len(moves), MOST_AT_ONCE)
        ]
        return np.concatenate([np.zeros(0), *highest])

    def _sampled(self, column: int, sign: float, moves: Int[ndarray, "k"]) -> Float[ndarray, "k"]:
        before = np.where(self.motions.known_start[moves], moves - 1, moves)
        first, last = self.motions.words[before], self.motions.words[moves]
        fractions = np.linspace(0.0, 1.0, SAMPLES)[:, None, None]
        words = (first + fractions * (last - first)).reshape(-1, 5)
        tools = np.tile(self.motions.tools[moves], SAMPLES)
        noses = _noses(self.motions.controls, words, tools)
        return np.asarray((sign * noses[:, column]).reshape(SAMPLES, -1).max(axis=0))


def nose_moves(motions: Motions, machine: Machine) -> NoseMoves:
    """The moves of the spindle nose in a text."""
    ends = _noses(motions.controls, motions.words, motions.tools)
    known = motions.known_start
    starts = np.where(known[:, None], np.roll(ends, 1, axis=0), ends)
    # By how much (mm) the nose may leave the line between the ends of each move; the first has no start.
    bows = np.zeros(len(motions.words))
    steps = np.abs(np.diff(motions.words, axis=0, prepend=motions.words[:1]))
    for number, control in motions.controls.items():
        rows = motions.tools == number
        if not control.tool_centre:
            continue
        turns = steps[rows, 3:]
        # the programmed point runs straight: where it is the ball's centre, the tip turns about that
        lift = control.centre_height if control.programs_centre else 0.0
        turned = turns.sum(axis=1)
        speed = lengths(steps[rows, :3]) + lift * turned
        part = _accelerations(
            machine,
            machine.part_axes,
            turns=turns,
            points=machine.in_machine(motions.tips[rows]) + machine.part_zero,
            speed=speed,
            acceleration=lift * turned**2,
        )
        tip = np.tile(-control.tool_length * UP, (len(turns), 1))
        still = np.zeros(len(turns))
        bows[rows] = (
            part
            + _accelerations(machine, machine.tool_axes[::-1], turns=turns, points=tip, speed=still, acceleration=still)
        ) / 8
    return NoseMoves(machine, motions, starts, ends, np.where(known, bows, 0.0))


def _noses(
    controls: dict[int, Control], words: Float[ndarray, "n 5"], tools: Int[ndarray, "n"]
) -> Float[ndarray, "n 3"]:
    """X, Y, Z of the spindle nose (mm) where the control stands at words (mm, rad) with one of its tools."""
    noses = np.zeros((len(words), 3))
    for number, control in controls.items():
        rows = tools == number
        noses[rows] = control.joints(words[rows])[:, :3] + [0.0, 0.0, control.tool_length]
    return noses


def _accelerations(
    machine: Machine,
    axes: Sequence[RotaryAxis],
    turns: Float[ndarray, "n 2"],
    points: Float[ndarray, "n 3"],
    speed: Float[ndarray, "n"],
    acceleration: Float[ndarray, "n"],
) -> Float[ndarray, "n"]:
    """Bounds of the acceleration (mm a block squared) of points (at the end of each move) that the `axes` turn one
    after the other, from their own `speed` and `acceleration`."""
    farthest = np.zeros(len(points))
    for index, axis in enumerate(axes):
        pivot = np.array(axis.pivot)
        if index == 0:
            farthest = lengths(points - pivot) + speed
        else:
            farthest = farthest + float(np.linalg.norm(pivot - axes[index - 1].pivot))
        turn = turns[:, machine.column(axis) - 3]
        acceleration = turn**2 * farthest + 2 * turn * speed + acceleration
        speed = turn * farthest + speed
    return acceleration


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
    # Retracts to a height in machine coordinates; without limits of Z it is not known where that height is
    low, high = machine.linear[2].limits
    if not np.isfinite(high - low):
        return
    top = float(noses.ends[:, 2].max(initial=-np.inf))
    for move in motions.partial:
        height = move.joints[2]
        if not move.retract or not np.isfinite(height):
            continue
        if not low - GUARD <= height <= high + GUARD:
            raise _beyond("Z", height, low if height < low else high, "mm", move.line)
        if height < top - GUARD:
            what = f"the retract to Z {height:g} of the machine is below the spindle nose at its highest ({top:.1f} mm)"
            remedy = "correct the limits and part_zero of the machine's file, or the retract of the dialect's"
            raise VerifyError(f"line {move.line}: {what}: {remedy}", line=move.line, place=None, error=top - height)


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


def _beyond(letter: str, value: float, limit: float, unit: str, line: int) -> VerifyError:
    what = f"{letter} goes to {value:.3f} {unit}, its limit is {limit:g} {unit}"
    return VerifyError(f"line {line}: {what}: {LARGER}", line=line, place=None, error=abs(value - limit))


def check_spindle(motions: Motions, machine: Machine, dialect: Dialect) -> None:
    """VerifyError at the first feed move while the spindle stands, or turns faster than the machine or the words of
    the control allow."""
    feed = ~motions.rapid
    stands = "a feed move while the spindle stands: start it before (M3, with S)"
    refuse_first(motions, feed & (motions.spindle == 0), lambda _: stands)

    most = min(machine.spindle_speed, dialect.numbers.spindle.highest)
    bound = f"{machine.title} makes {most:g} 1/min at most: give less"
    refuse_first(motions, feed & (motions.spindle > most), lambda at: f"S{motions.spindle[at]:g}: {bound}")


def check_spindle_of_job(motions: Motions, dialect: Dialect, cutters: dict[int, Cutter]) -> None:
    """VerifyError at the first feed move with a spindle that turns faster than the job says for its cutter."""
    most = np.full(len(motions.tools), np.inf)
    for number, cutter in cutters.items():
        most[motions.tools == number] = cutter.spindle + dialect.numbers.spindle.step

    def why(at: int) -> str:
        cutter = cutters[int(motions.tools[at])]
        return f"S{motions.spindle[at]:g}: the job has {cutter.spindle:g} 1/min for {cutter.name}: give less"

    refuse_first(motions, ~motions.rapid & (motions.spindle > most), why)


def check_feeds_of_job(motions: Motions, dialect: Dialect, job: Job, cutters: dict[int, Cutter]) -> None:
    """VerifyError at the first feed beyond what a job allows for its cutter at the speed of the spindle, mm/min; the
    cutters have the feed of their shallowest cut."""
    speeds, known = tip_speeds(motions, dialect)
    step, spindle_step = dialect.numbers.feed.step, dialect.numbers.spindle.step
    allowed = np.full(len(speeds), np.inf)
    for number, cutter in cutters.items():
        cut = max(fastest_cut(cutter, job), job.nc.plunge_feed)
        link = max(cut, LINK_FEED, job.nc.rapid_feed)
        slower = np.minimum((motions.spindle + spindle_step) / cutter.spindle, 1.0)
        rates = np.where(motions.links, link, cut * slower)
        allowed = np.where(motions.tools == number, rates, allowed)
    # in inverse time the lengths are those between rounded words
    rounding = np.where(motions.inverse_time, FEED_TOLERANCE * allowed, step)

    def why(at: int) -> str:
        speed, most = told_apart(float(speeds[at]), float(allowed[at]))
        name = cutters[int(motions.tools[at])].name
        asked = f"a feed of {speed} mm/min at S{motions.spindle[at]:g}"
        return f"{asked}: the job allows {most} for {name}: give less, or give the job that feed"

    refuse_first(motions, known & (speeds > allowed + rounding), why)


def tip_speeds(motions: Motions, dialect: Dialect) -> tuple[Float[ndarray, "n"], Bool[ndarray, "n"]]:
    """The speed (mm/min) that the feed of each move asks of the tip, and whether it is known: of feed moves, in
    inverse time of those that are long beside the last decimal of their words."""
    long_enough = motions.known_start & (motions.lengths > MIN_LENGTH_STEPS * dialect.numbers.length.step)
    return motions.tip_feeds, ~motions.rapid & (~motions.inverse_time | long_enough)


SAME_SIZE = 1e-3
"""Sizes of a tool that differ by less (mm) are the same: headers tell ten times as much."""


def check_control(motions: Motions, machine: Machine, dialect: Dialect, job: Job | None = None) -> None:
    """VerifyError with the `line` of the first move of a kind that the control would refuse, or that would cut
    otherwise than meant, with the remedy; ProgramError where the text calls tools that the `job` has not."""
    check_limits(motions, machine)
    check_spindle(motions, machine, dialect)

    # feeds per minute where the dialect's are in inverse time, or the other way round
    inverse = dialect.feed_mode == "inverse-time"
    message = "per minute, where this control needs it in inverse time" if inverse else "in inverse time"
    wrong = ~motions.rapid & (motions.inverse_time != inverse)
    refuse_first(motions, wrong, lambda _: f"the feed is {message}: correct the mode in a line before")
    if job is None:
        # VerifyError at the first feed beyond what the linear axes of the machine make together, mm/min.
        most = float(np.linalg.norm([axis.speed for axis in machine.linear]))
        speeds, known = tip_speeds(motions, dialect)
        bound = f"the axes of {machine.title} make {most:.0f} at most: give less"
        refuse_first(motions, known & (speeds > most), lambda at: f"a feed of {speeds[at]:.0f} mm/min: {bound}")
        return
    cutters = {cutter.number: cutter for cutter in cutters_of(job, machine)}
    # VerifyError where the header describes a tool otherwise than the job.
    for number, reported in motions.described.items():
        if number not in cutters:
            continue
        meant = cutters[number]
        for name, value, wanted in (
            ("radius", reported.radius, meant.radius),
            ("length", reported.length, meant.length),
        ):
            if abs(value - wanted) > SAME_SIZE:
                what = f"tool {number} has a {name} of {value:g} mm here, of {wanted:g} mm in the job"
                remedy = "give the job that the program was made with"
                raise VerifyError(
                    f"line {reported.line}: {what}: {remedy}", line=reported.line, place=None, error=abs(value - wanted)
                )
    tools_of(motions, list(cutters.values()))
    check_spindle_of_job(motions, dialect, cutters)
    quick = {number: replace(one, feed=job.fastest_feed(one.name)) for number, one in cutters.items()}
    check_feeds_of_job(motions, dialect, job, quick)
    check_tolerance(motions, dialect, job)
    if job.nc.coolant:
        dry = ~motions.rapid & ~motions.links & ~motions.coolant
        why = "a cut without coolant, which the job asks for: switch it on before (M8), or nc.coolant = false"
        refuse_first(motions, dry, lambda _: why)


def check_tolerance(motions: Motions, dialect: Dialect, job: Job) -> None:
    """VerifyError at the first feed move under a contour tolerance (mm) larger than the job's for roughing, or left to
    the control. Nothing is known where the dialect has no words for it."""
    most = contour_tolerance(dialect, job, finishing=False)
    wide = ~motions.rapid & (motions.tolerances > most + dialect.numbers.length.step)

    def why(at: int) -> str:
        value = motions.tolerances[at]
        message = f"is {value:g} mm" if np.isfinite(value) else "is left to the control"
        return f"the contour tolerance {message}, the job allows {most:g} mm: correct it in a line before"

    refuse_first(motions, wide, why)


LEAN = np.radians(5.0)
"""Turn of both rotary axes between the two trial paths, rad."""
STEPS = np.array([[0.0, 0.0, 0.0], [1.2345, 0.4567, -0.7891], [2.6543, -0.3217, 0.1239]])
"""Cuts of the trial, mm from the first: with more decimals than a control needs."""
ABOVE = (12.3456, 2.3457)
"""Heights of the rapid and the link above the first and the last cut, mm along the tool axis."""


def check_posting(job: Job, machine: Machine, dialect: Dialect) -> None:
    """MachineError where no program of this job can be written for the machine in the dialect, or not be read back."""
    names = job.cutter_names
    # two tool axes that the machine reaches: at its zero, or the limits next to it, and a little further
    low, high = np.array([axis.limits for axis in machine.rotary]).T
    zero = np.clip(0.0, low, high)
    further = np.where(zero + LEAN <= high, zero + LEAN, np.maximum(zero - LEAN, low))
    axes = tool_axes(machine, np.array([zero, further]))
    cutters = [Cutter.from_job(number, name, job.tool(name)) for number, name in enumerate(names, 1)]
    paths = [
        _path(cutter, level, axis, job) for cutter, level, axis in zip(cutters, range(len(names))[::-1], cycle(axes))
    ]
    try:
        program = write_program(paths, machine, dialect, job, name="TRIAL", comments=["trial"])
        motions = read_program(program.text, machine, dialect)
        check_control(motions, machine, dialect, job)
        compare_moves(motions, paths, dialect, Tolerances())
    except (ProgramError, VerifyError) as error:
        what = f"a trial program of {machine.name} in the dialect {dialect.name} is wrong: {error}"
        remedy = "take a machine and a controller that fit one another and the job, or correct their files"
        raise MachineError(f"{what}: {remedy}", machine=machine.name, dialect=dialect.name) from error


def _path(cutter: Cutter, level: int, axis: Float[ndarray, "3"], job: Job) -> ToolPath:
    """Cuts beside the middle of the stock's lower end, with the rapids and links before and after them."""
    cuts = STEPS + np.array([0.1237, 0.2346, job.holding.length + 0.3459])
    above = [cuts[end] + height * axis for end in (0, -1) for height in ABOVE]
    tips = np.vstack([above[:2], cuts, above[:1:-1]])
    kinds = np.array(
        [MoveKind.RAPID, MoveKind.LINK, *[MoveKind.CUT] * len(cuts), MoveKind.LINK, MoveKind.RAPID], dtype=np.int64
    )
    nc = job.nc
    feeds = [nc.rapid_feed, nc.plunge_feed, *[cutter.feed] * len(cuts), LINK_FEED, nc.rapid_feed]
    unknown = np.full((len(tips), 3), np.nan)
    return ToolPath(
        level=level,
        cutter=cutter,
        kinds=kinds,
        pass_index=np.where(kinds == MoveKind.CUT, 0, -1),
        parameters=unknown[:, :2],
        contacts=unknown,
        tips=tips,
        axes=np.tile(axis, (len(tips), 1)),
        feed_rates=np.array(feeds),
        uncut=np.zeros((0, 3)),
        reasons=(),
    )


HEADER_LINES = 40
"""Lines of a program in which its header names the machine and the stock."""


def program_text(program: Path, machine: Machine, dialect: Dialect, job: Job) -> str:
    """The text of a program for this machine and job, and of the files it calls. ProgramError where it is for another
    machine or cannot be read, VerifyError where its control would refuse it, or run it otherwise than the job
    means."""
    whole = joined(program, dialect)
    text = whole.text
    # ProgramError where the text is for another kind of control, or the header names another machine.
    first = text.split("\n", 1)[0]
    begins = "BEGIN PGM" if "BEGIN PGM" in first else "%" if first.strip() == "%" else ""
    if begins and begins != ("BEGIN PGM" if dialect.grammar == "klartext" else dialect.frame):
        raise ProgramError(
            f"{program}: its first line ({shown(first)}) is of another control than {dialect.title}: give its "
            "--controller",
            line=1,
        )
    wanted = comments_of(f"machine {machine.title}", dialect)[0]
    start = comment("machine", dialect).rstrip(")")
    named = [line for line in header_of(text).split("\n") if start in line]
    if named and not any(wanted in line for line in named):
        reported = named[0].strip()
        raise ProgramError(
            f"{program}: it was made for another machine ({reported}), not for {machine.title}: give its --machine",
            line=0,
        )
    try:
        check_control(read_program(text, machine, dialect), machine, dialect, job)
    except (ProgramError, VerifyError) as error:
        place = str(program)
        line = error.evidence.get("line", 0)
        if line and {file for file, _ in whole.places} != {program}:
            place = f"{whole.place(line)} (of the whole program"
            raise type(error)(f"{place} {error})", **error.evidence) from error
        raise type(error)(f"{program}: {error}", **error.evidence) from error
    return text


def header_of(text: str) -> str:
    """The lines of a program in which its header tells what is mounted."""
    return "\n".join(text.split("\n")[:HEADER_LINES])
