"""Posting: from tool paths to the text of a program, the dialect's templates filled with the words of the posted
paths.

A program is one section for each tool on a level, which begins with all that a restart there needs: modes, datum, tool
call, spindle. In it are one or more runs: retract, turn the rotary axes off the part, tool-centre control on where the
control has it, approach along the tool axis, the moves, tool-centre control off, retract. The comments CUT and LINK
stand where feed moves begin to cut, or to lead from one pass to another. Before them stands the header: what must be
mounted, how the control must be set, and what the program will do, as comments; the blank; the safe start. Behind the
last retract the table is levelled and the spindle parked, where a job asks for it.

The time of a program is that at its feeds, as the axes drive it, and with what is between its runs.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import MachineError, ProgramError
from bonecam.job import Job, NcJob, field_error
from bonecam.job.nc_section import HOME, park_position
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.feeds import feed_figures
from bonecam.nc.header import (
    UNCHECKED,
    UNSIMULATED,
    ZeroWords,
    above,
    air_check_texts,
    axis_texts,
    check_at_zero,
    control_texts,
    lifted,
    over_zero,
    parting_texts,
    setup_texts,
    start_texts,
    tool_texts,
    travel_of,
    zero_text,
    zero_words,
)
from bonecam.nc.parts import Section, marked_parts
from bonecam.nc.path_words import Posted, axis_minutes, joints_and_lengths, post_path, row_blocks
from bonecam.nc.program import Program, ProgramTime, program_number
from bonecam.nc.words import (
    REWIND,
    comment,
    comments_of,
    contour_tolerance,
    number_blocks,
    plain_text,
    rotary_tolerance_deg,
    word_texts,
)
from bonecam.planning.blank import bar_of
from bonecam.planning.links import goes_on
from bonecam.planning.motion_time import ControlRule, motion_minutes
from bonecam.progress import Progress, report, silent
from bonecam.setup.stock import Stock
from bonecam.tool.path import BLANK, MoveKind, ToolPath

SetupTexts = Callable[[ZeroWords, float], list[str]]
"""What must be mounted, by the words of the program's zero and its height (mm) over that of the part's frame."""
EXACT_STOP = ControlRule(look_ahead=0)
"""Between two runs every block ends at rest."""


def program_time(posted: Sequence[Posted], start: Float[ndarray, "3"], job: Job) -> ProgramTime:
    """The minutes of posted paths in their order, whose tools `start` as in `travel_of`. The first tool is changed for
    too; the spindle stops for changes and for the stops that the job asks for (`nc.optional_stop`), whose length is
    left out."""
    machine = posted[0].control.machine
    tools = dict.fromkeys((one.path.cutter.number for one in posted), 0.0)
    for one in posted:
        tools[one.path.cutter.number] += float(one.driven_minutes.sum())
    feed, axes = sum(float(one.minutes.sum()) for one in posted), sum(tools.values())
    minutes = tuple(tools.values())
    blank = sum((float(one.driven_minutes.sum()) for one in posted if one.path.level == BLANK), 0.0)
    assumed = machine.time_assumed
    if not machine.knows_accelerations or machine.seconds is None:
        known = axes if machine.knows_accelerations else None
        return ProgramTime(feed, minutes, known, assumed=assumed, blank=blank)
    numbers = [one.path.cutter.number for one in posted]
    changes = 1 + sum(a != b for a, b in pairwise(numbers))
    starts = len(posted) if job.nc.optional_stop == "level" else changes
    runs = sum(len(one.runs) - _stays(before, one, job.nc) for before, one in zip([None, *posted], posted))
    by_hand = changes if job.nc.tool_change == "stop" else 0
    seconds = (changes - by_hand) * machine.seconds.tool_change + starts * machine.seconds.spindle_start
    if "{retract}" not in posted[0].dialect.templates.retract:
        seconds += runs * machine.seconds.retract
    # the turns of rotary axes to where runs begin are among these ways
    turns = sum(float(one.driven_minutes[[first for first, _ in one.runs]].sum()) for one in posted)
    ways = 0.0
    for one, way in _ways(posted, start, job.nc):
        # rapid moves between joints, each from rest to rest
        fastest = axis_minutes(machine, way)[1:]
        if not one.dialect.straight_rapids:
            fastest = np.maximum(fastest, lengths(np.diff(way[:, :3], axis=0)) / job.nc.rapid_feed)
        ways += float(motion_minutes(machine, way, fastest, EXACT_STOP).sum())
    return ProgramTime(feed, minutes, axes, axes - turns + ways + seconds / 60, by_hand, assumed, blank)


def _stays(before: Posted | None, posted: Posted, nc: NcJob) -> bool:
    """Whether the tool stays at the part from one path to the next: a level's rest paths and its own one are one
    section of the program, unless each has a file or a stop."""
    return nc.one_piece and before is not None and goes_on(before.path, posted.path)


def _ways(
    posted: Sequence[Posted], start: Float[ndarray, "3"], nc: NcJob
) -> Iterator[tuple[Posted, Float[ndarray, "k 5"]]]:
    """The joints between two runs: from the end of one up, to where tools start, the turn of the rotary axes, over the
    approach, down to it and to the first row of the next; behind the last run up alone. A path in which
    the tool stays at the part begins with its first row."""
    retract = float(start[2])
    at = [np.r_[start, _level(posted[0], posted[0].joints[0])]]
    for before, one in zip([None, *posted], posted):
        for run, (first, end) in enumerate(one.runs):
            words = (above(one, run, retract), one.approaches[run], lifted(one, run, retract))
            high, low, over = joints_and_lengths(one.control, np.array(words))[0]
            if not run and _stays(before, one, nc):
                yield one, np.array([at[0], one.joints[first]])
            else:
                if not run and "{over_zero}" in one.dialect.templates.tool:
                    at.append(np.r_[start, at[-1][3:]])
                if one.dialect.starts_at_zero:
                    at.append(np.r_[start, _level(one, at[-1])])
                turned = np.r_[at[-1][:3], low[3:]]
                yield one, np.array([*at, turned, high, low, one.joints[first]])
            at = [one.joints[end - 1], over]
    yield posted[-1], np.array(at)


def _level(posted: Posted, joints: Float[ndarray, "5"]) -> Float[ndarray, "2"]:
    """The angles (rad) nearest to those of the joints at which all rotary words are zero."""
    turns = [axis.endless and not axis.bounded for axis in posted.control.machine.rotary]
    return np.where(turns, 2 * np.pi * np.round(joints[3:] / (2 * np.pi)), 0.0)


def check_end(job: Job, machine: Machine) -> None:
    """JobError where the park position is outside the limits of X or Y, or these are not known; MachineError where a
    rotary axis that is to be levelled cannot stand at zero."""
    position = park_position(job.nc.park) or ()
    for axis, value in zip(machine.linear, position, strict=False):
        low, high = axis.limits
        if not math.isfinite(high - low):
            why = f"{machine.name} states the travel of {axis.letter}, not its limits: give these in a machine file"
            raise field_error("nc", "park", job.nc.park, why)
        if not low <= value <= high:
            why = f"{axis.letter} of {machine.name} runs from {low:g} to {high:g} mm: give a place within"
            raise field_error("nc", "park", job.nc.park, why)
    if job.nc.table_level:
        check_at_zero(machine, "nc.table_level")


def end_blocks(machine: Machine, dialect: Dialect, nc: NcJob) -> list[str]:
    """The blocks of the end, the tool being above everything: rotary axes to zero, then X and Y."""
    lines = list[str]()
    length = dialect.numbers.length
    if nc.table_level:
        rotary = word_texts(machine, dialect, np.zeros(5))[3:]
        lines += dialect.lines("position", rotary=" ".join(rotary))
    if nc.park.strip() == HOME:
        lines += dialect.lines("home")
    position = park_position(nc.park)
    if position is not None:
        x, y = map(length.text, position)
        lines += dialect.lines("park", linear=f"X{x} Y{y}")
    return lines


def write_program(
    paths: Sequence[ToolPath],
    machine: Machine,
    dialect: Dialect,
    job: Job,
    *,
    name: str = "BONE",
    comments: Sequence[str] = (),
    stock: Stock | None = None,
    setup: SetupTexts | None = None,
    touched: float | None = None,
    progress: Progress = silent,
) -> Program:
    """The program that machines `paths` in their order.

    `name` has letters, digits and underscores. The header describes the `stock`, whose box is the blank in the
    control's simulation; without it that is the box of the tips. `setup` tells another mounting than the job's,
    in which a probe reaches the height `touched` (mm).
    MachineError where an axis leaves its limits or cannot be written as the job says, ProgramError for a number.
    """
    if not paths:
        raise ValueError("no tool path: give at least one")
    if not name or not all(letter.isascii() and (letter.isalnum() or letter == "_") for letter in name):
        raise ProgramError(f"program name {name!r}: use letters, digits and _", name=name)
    dialect = dialect.writing_endless_words(job.nc.endless_words, machine)
    if job.nc.tool_change == "stop" and not dialect.templates.stop:
        remedy = 'take nc.tool_change = "changer", or add the template to its file'
        raise MachineError(f"{dialect.name} has no template stop: {remedy}", dialect=dialect.name)
    check_end(job, machine)
    around = np.vstack([path.tips for path in paths])
    bar = bar_of(stock, job.holding) if stock else None
    if stock is not None:
        touched = bar.top if bar else float(stock.bounds[1, 2])
    # whole steps of its words: they have the same rounding wherever the zero is
    on_bar = job.nc.part_zero == "bar" and touched is not None
    zero_height = float(dialect.numbers.length.rounded(np.array([touched]))[0]) if on_bar else 0.0
    posted = list[Posted]()
    for index, path in enumerate(paths):
        report(progress, index / len(paths), f"level {path.level}: angles and words")
        before = posted[-1].moves.angles[-1] if posted else None
        posted.append(post_path(path, machine, dialect, job, around, before=before, zero_height=zero_height))
    bounds = np.array([around.min(0), around.max(0)]) if stock is None else stock.bounds.copy()
    bounds[1, 2] = bar.top if bar else bounds[1, 2]
    told = setup or partial(setup_texts, job, stock)
    texts = [*comments, *told(zero_words(machine, dialect), zero_height)]
    texts += [zero_text(zero_height)] if zero_height else []
    air_check = air_check_texts(posted[0].control, dialect, float(bounds[1, 2]))
    ranges, start = travel_of(machine, job, posted)
    time = program_time(posted, start, job)
    facts = HeaderFacts(ranges, bounds, texts, air_check)
    return ProgramWriter(machine, dialect, job, name.upper(), posted, start=start, time=time, facts=facts).program()


class HeaderFacts(NamedTuple):
    """What the header tells besides: the `ranges` of the axes, the blank, which fills `bounds` (mm) in the control's
    simulation, `comments` and the `air_check`."""

    ranges: Float[ndarray, "5 2"]
    bounds: Float[ndarray, "2 3"]
    comments: Sequence[str]
    air_check: Sequence[str]


@dataclass(eq=False)
class ProgramWriter:
    """Writes the blocks of one program from its posted paths; every tool is to `start`, X, Y and Z of its tip in the
    machine's frame (mm). `moves` counts those written so far."""

    machine: Machine
    dialect: Dialect
    job: Job
    name: str
    posted: Sequence[Posted]
    start: Float[ndarray, "3"]
    time: ProgramTime
    facts: HeaderFacts
    moves: int = 0

    def __post_init__(self) -> None:
        self.length = self.dialect.numbers.length
        self.feed = self.dialect.numbers.feed
        switch = self.dialect.tool_centre_switch(self.machine)
        self.on, self.off = (switch.on, switch.off) if switch else ("", "")
        self.zero_shift = self.posted[0].control.zero_shift
        self.retract = self.length.text(float(self.start[2] - self.zero_shift[2]))
        rapid = np.clip(self.job.nc.rapid_feed, self.feed.lowest, self.feed.highest)
        self.rapid = self.feed.text(float(rapid))

    def program(self) -> Program:
        """The whole program, with its counts and its time."""
        lines = self._header()
        sections = list[Section]()
        tool = None
        on = [_stays(*pair, self.job.nc) for pair in zip([None, *self.posted], self.posted)]
        for posted, comes, goes in zip(self.posted, on, [*on[1:], False]):
            blocks = [comment(posted.path.title, self.dialect)] if comes else self._begin(posted, tool)
            tool = posted.path.cutter.number
            for index in range(len(posted.runs)):
                blocks += [] if comes and not index else self._approach(posted, index)
                blocks += row_blocks(posted, posted.runs[index], self.machine, self.dialect)
                self.moves += int(np.diff(posted.runs[index])[0])
                blocks += [] if goes and index == len(posted.runs) - 1 else self._retract(posted, index)
            sections.append(Section(posted.path.title, tool, blocks))
        if self.job.nc.is_split:
            lines += marked_parts(sections, self.name, self.dialect, self.job.nc)
        else:
            lines += [line for section in sections for line in section.lines]
        lines += self.dialect.lines("tool_end")
        lines += self._counted(end_blocks(self.machine, self.dialect, self.job.nc))
        lines += self.dialect.lines("footer", name=self.name)
        text, count = number_blocks(lines, self.dialect)
        return Program(
            text=text,
            name=self.name,
            number=self.job.nc.program_number or program_number(self.name),
            machine=self.machine.name,
            controller=self.dialect.name,
            extension=self.dialect.extension,
            blocks=count,
            moves=self.moves,
            split_moves=sum(len(posted.words) - len(posted.path.tips) for posted in self.posted),
            rewinds=sum(posted.rewinds for posted in self.posted),
            lifts=sum(len(posted.path.lifts) for posted in self.posted),
            tools=tuple(dict.fromkeys(posted.path.cutter.number for posted in self.posted)),
            time=self.time,
            feeds=feed_figures(self.posted),
            rotary_max_deg_per_block=max(posted.largest_rotation_deg for posted in self.posted),
            air_check=tuple(self.facts.air_check),
            zero_height=self.posted[0].control.zero_height,
        )

    def _header(self) -> list[str]:
        """The first blocks: comments, the blank, and the safe start with the finest tolerances."""
        machine, dialect, job, posted = self.machine, self.dialect, self.job, self.posted
        fields = "low_x low_y low_z high_x high_y high_z".split()
        blank = machine.in_machine(np.array(list(product(*self.facts.bounds.T)))) - self.zero_shift
        box = np.array([blank.min(axis=0), blank.max(axis=0)])
        corners = dict(zip(fields, map(self.length.text, box.ravel()), strict=True))
        texts = [
            f"machine {machine.title}",
            f"control {dialect.title}",
            *self.facts.comments,
            *parting_texts([one.path for one in posted], posted[0].control.zero_height),
            *tool_texts(job, posted, self.time),
            *control_texts(machine, dialect, posted),
            *axis_texts(machine, self.facts.ranges, dialect),
            *(f"time {text}" for text in self.time.texts),
            *(f"air check: {text}" for text in self.facts.air_check),
            *UNCHECKED,
            *UNSIMULATED,
        ]
        return dialect.lines(
            "header",
            name=self.name,
            number=job.nc.program_number or program_number(self.name),
            comments="\n".join(line for text in texts for line in comments_of(text, dialect)),
            tool_centre_off=self.off,
            **self._tolerances(True, min(one.path.cutter.radius for one in posted)),
            **corners,
        )

    def _tolerances(self, finishing: bool, radius: float) -> dict[str, str]:
        """How far the control may leave the points of a ball of `radius` (mm): mm, and degrees without a sign."""
        dialect = self.dialect
        turn = rotary_tolerance_deg(dialect, self.job, finishing, radius)
        return {
            "tolerance": self.length.text(contour_tolerance(dialect, self.job, finishing)),
            "rotary_tolerance": f"{turn:.{dialect.numbers.angle.decimals}f}",
        }

    def _begin(self, posted: Posted, tool: int | None) -> list[str]:
        """The blocks that begin a path, `tool` being in the spindle: all that a restart there needs, where the dialect
        has a template for it, else a tool call where the cutter is another."""
        cutter, title = posted.path.cutter, posted.path.title
        changes = cutter.number != tool
        stops = tool is not None and self.job.nc.optional_stop in (("level", "tool") if changes else ("level",))
        lines = self.dialect.lines("tool_end") if tool is not None and (changes or stops) else []
        lines += self.dialect.lines("optional_stop") if stops else []
        lines += [comment(title, self.dialect)]
        if tool is not None or self.job.nc.is_split:
            name = plain_text(title, self.dialect.comment_characters)
            lines += self.dialect.lines("restart", title=name, tool=cutter.number, tool_centre_off=self.off)
        finishing = self.job.is_finishing(posted.path.level)
        machining = self.dialect.machining
        lines += self.dialect.lines(
            "level",
            **self._tolerances(finishing, cutter.radius),
            hsc_mode=int(not finishing),
            machining=machining.finishing if finishing else machining.roughing,
        )
        if changes or stops or self.dialect.templates.restart:
            halts = changes and self.job.nc.tool_change == "stop"
            lines += self._moving(
                "tool",
                tool=cutter.number,
                spindle=self.dialect.numbers.spindle.text(cutter.spindle),
                retract=self.retract,
                endless=self.dialect.endless_block,
                over_zero=over_zero(self.machine, self.dialect, self.start - self.zero_shift),
                stop="\n".join(self.dialect.lines("stop", tool=cutter.number) if halts else []),
            )
        return lines

    def _moving(self, template: str, **fields: object) -> list[str]:
        """The blocks of a template, whose moves are counted."""
        return self._counted(self.dialect.lines(template, **fields))

    def _counted(self, lines: list[str]) -> list[str]:
        """Blocks, whose moves are counted."""
        self.moves += sum(line.startswith(tuple(self.dialect.moving_blocks)) for line in lines)
        return lines

    def _switch(self, blocks: str, posted: Posted, height: str) -> list[str]:
        """The blocks that switch tool-centre control, for the tool of a path and the `height` (Z) to start from."""
        text = blocks.format(tool=posted.path.cutter.number, height=height)
        return self._counted([line for line in text.split("\n") if line])

    def _approach(self, posted: Posted, index: int) -> list[str]:
        """The blocks before a run: turn the rotary axes, approach along the tool axis."""
        words = word_texts(self.machine, self.dialect, posted.approaches[index])
        high = word_texts(self.machine, self.dialect, above(posted, index, float(self.start[2])))
        lines = [comment(REWIND, self.dialect)] if index else []
        # the rotary axes to the run's angles and tool-centre control on: in this order, or where it starts at zero the
        # other way round
        if self.dialect.starts_at_zero:
            angles_deg, rapid = posted.approaches[index][3:], self.job.nc.rapid_feed
            rotary, height, turn = start_texts(self.dialect, posted.control, angles_deg, self.start, rapid)
            lines += self._moving("position", rotary=rotary) + self._switch(self.on, posted, height)
            lines += [comment(MoveKind.LINK.name, self.dialect), *self._counted(turn)]
        else:
            lines += self._moving("position", rotary=" ".join(words[3:]))
            lines += self._switch(self.on, posted, self.retract)
        approach = self.dialect.lines(
            "approach",
            linear=" ".join(words[:3]),
            plane=" ".join(words[:2]),
            above=" ".join(high[:3]),
            rapid=self.rapid,
        )
        # where the turn under tool-centre control ends above the approach, there is no way to there
        there = f" {' '.join(high[:3])} " in lines[-1]
        lines += self._counted(approach[1:] if there else approach)
        return lines + (self.dialect.lines("coolant_on") if self.job.nc.coolant else [])

    def _retract(self, posted: Posted, index: int) -> list[str]:
        """The blocks behind a run."""
        end = word_texts(self.machine, self.dialect, lifted(posted, index, float(self.start[2])))
        lines = self.dialect.lines("coolant_off") if self.job.nc.coolant else []
        lift = self._moving("lift", lifted=" ".join(end[:3]), rapid=self.rapid)
        lines += [comment(MoveKind.LINK.name, self.dialect), *lift] if lift else []
        return lines + self._switch(self.off, posted, "") + self._moving("retract", retract=self.retract)
