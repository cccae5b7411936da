"""The error of a line of a program.

The moves of a program, as they were read from its text.

How a text names and describes its tools.

Numbers that a control does not take: its word is beyond what the dialect's file tells of it.

Full moves: successive blocks that have all five words, read at once as arrays.

The comments that tell links from cuts may stand between them. Blocks of any other form are left to the readers of
single blocks (`reading.py`, `reading.py`), which say what is wrong.

The state of a control while it reads a program, and the moves that it makes.

Control manuals call a word modal that holds until another word replaces it: the position of each axis, the
tool, tool-centre control, the way endless axes turn, and the meaning of F.

Words of endless axes: which way the control turns by them, and the angle that it reaches.

What holds as a program is read: what it must have stated before its axes move.

A control begins with what its machine's parameters choose, or with what the program before left on: inches, increments,
another plane, a tilted plane. A dialect lists what the proof takes for granted (`stated` of `nc.dialect`); a text that
leaves one of these out may be driven otherwise than it is read.

Words that turn the tool to a vector, in blocks that are read one by one.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import ProgramError
from bonecam.machine.control import Control
from bonecam.machine.machine import Machine
from bonecam.machine.machine_file import RotaryAxis
from bonecam.nc.dialect import Dialect
from bonecam.nc.program import angles_from, vector_patterns
from bonecam.nc.schema import (
    WHOLE,
    NumbersTable,
    VectorTable,
    block_number,
    block_numbers,
    has_number,
    numbered_pattern,
)
from bonecam.text.numbers import shown


def line_error(line: int, why: str) -> ProgramError:
    """The error of a line (from 1) of a program."""
    return ProgramError(f"line {line}: {why}", line=line)


@dataclass(frozen=True)
class Tool:
    """A ball-end cutter as the program's header describes it in a `line`: radius, and length from tip to spindle nose,
    mm."""

    number: int
    radius: float
    length: float
    line: int = 0


COLUMNS = 15
"""Columns of the table of moves: five words (mm, degrees), rapid, feed, inverse time, line, tool, known start, link,
speed of the spindle, coolant, tolerance."""


@dataclass(frozen=True)
class PartialMove:
    """A move after which not all axes are known: `joints`, X, Y, Z of the spindle nose in machine coordinates (mm)
    and the rotary axes (degrees), NaN where not known; or a `retract`."""

    line: int
    tool: int
    joints: tuple[float, ...]
    retract: bool = False


@dataclass(frozen=True, eq=False)
class Motions:
    """Moves to fully known positions, in order; row i is the move that arrives there.

    `words` (n, 5): X Y Z in mm and the rotary words in radians, unwound; `feed_rates` in mm/min, or 1/min
    where `inverse_time`, NaN for rapids; `lines` of the text (from 1); `known_start`: the position before the
    move is known too, so that all of it can be simulated; `links`: feed moves behind a comment LINK; `tips` (mm)
    and `axes` in the part's frame by forward kinematics. `blocks` counts every moving block, also those that
    leave the position partly unknown: these are `partial`. `spindle`: its speed in 1/min, 0 where it stands; `coolant`:
    it runs. `tolerances`: how far the control may leave the points, mm; infinite where the text leaves that to the
    control, NaN where the dialect has no words for it. `short_way`: endless axes turn the short way by their words.
    `controls` and `described`, the tools of the header, by tool number.
    """

    rapid: Bool[ndarray, "n"]
    words: Float[ndarray, "n 5"]
    feed_rates: Float[ndarray, "n"]
    inverse_time: Bool[ndarray, "n"]
    lines: Int[ndarray, "n"]
    tools: Int[ndarray, "n"]
    known_start: Bool[ndarray, "n"]
    links: Bool[ndarray, "n"]
    tips: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    blocks: int
    controls: dict[int, Control]
    spindle: Float[ndarray, "n"]
    coolant: Bool[ndarray, "n"]
    tolerances: Float[ndarray, "n"]
    partial: tuple[PartialMove, ...]
    short_way: bool
    described: dict[int, Tool]

    @cached_property
    def lengths(self) -> Float[ndarray, "n"]:
        """How far the tip goes in each move, mm, along the straight line between its ends; 0 in the first."""
        return np.r_[0.0, np.linalg.norm(np.diff(self.tips, axis=0), axis=1)]

    @property
    def tip_feeds(self) -> Float[ndarray, "n"]:
        """The feed of each move along that line, mm/min; NaN for rapids."""
        return np.where(self.inverse_time, self.feed_rates * self.lengths, self.feed_rates)


SIZE = rf"({WHOLE}\.[0-9]+)"
TOOL_COMMENT = re.compile(rf"\s*TOOL ({WHOLE}) BALL RADIUS {SIZE} LENGTH {SIZE}\s*")
"""The comment of the header that describes a cutter, as `posting.header.texts` writes it; mm."""


def described_tool(text: str, line: int) -> Tool | None:
    """The tool that a comment describes, if it does."""
    match = TOOL_COMMENT.fullmatch(text)
    return Tool(int(match[1]), float(match[2]), float(match[3]), line) if match else None


ZERO_COMMENT = re.compile(rf"\s*ZERO HEIGHT {SIZE} OVER .*")
"""The comment of the header that tells how high the program's zero is over that of the part's frame, mm; without it
they are the same."""


def zero_height_of(header: str) -> float:
    """How high (mm) the zero of a program is, by the lines of its header."""
    zero = ZERO_COMMENT.search(header)
    return float(zero[1]) if zero else 0.0


def tool_number(text: str, line: int) -> int:
    """The number of a tool call; ProgramError where it is none."""
    if not re.fullmatch(WHOLE, text):
        raise line_error(line, f"{shown(text)} is no number of a tool")
    return int(text)


def check_range(numbers: NumbersTable, words: dict[str, float], line: int) -> None:
    """ProgramError where a word of an axis or the feed F has a number outside the range of its kind."""
    for letter, value in words.items():
        kind = numbers.length if letter in "XYZ" else numbers.feed if letter == "F" else numbers.angle
        if not kind.lowest <= value <= kind.highest:
            bounds = f"{kind.lowest:g} .. {kind.highest:g}"
            raise line_error(line, f"{letter} {value:g} leaves the control's range {bounds}")


MAX_LINES = 50_000
"""Lines read at once: bounds the memory for long programs."""
ISO_NUMBER = rf"[+-]?{WHOLE}(?:\.[0-9]{{0,9}})?"
"""The pattern of a number of a word, as ISO 6983 writes it."""
POINTED_NUMBER = rf"[+-]?{WHOLE}\.[0-9]{{0,9}}"
"""The pattern of a number that must have its decimal point."""
MARKS = {"CUT": False, "LINK": True}
"""Comments, and whether the feed moves after them are links."""


class Blocks(NamedTuple):
    """Successive full moves. `words` (n, 5) in mm and degrees as written; `feeds` are NaN where `rapid`, or none is
    known; `modal` is the last feed that was written.

    `offsets` (n,): how many lines each is behind the first one; `ordinals`: how many numbered blocks there are before
    it in the program; `links`: it stands behind a comment LINK. `numbers` are the block numbers, -1 where blocks have
    none.
    """

    words: Float[ndarray, "n 5"]
    rapid: Bool[ndarray, "n"]
    feeds: Float[ndarray, "n"]
    numbers: Int[ndarray, "n"]
    offsets: Int[ndarray, "n"]
    ordinals: Int[ndarray, "n"]
    links: Bool[ndarray, "n"]
    modal: Float[ndarray, "n"]

    def first(self, count: int) -> "Blocks":
        """The first `count` blocks."""
        return Blocks(*(column[:count] for column in self))

    def outside(self, numbers: NumbersTable) -> Bool[ndarray, "n"]:
        """Which have a number that the control does not take, or no feed where they need one."""
        kinds = [numbers.length] * 3 + [numbers.angle] * 2
        lowest = [kind.lowest for kind in kinds]
        highest = [kind.highest for kind in kinds]
        fits = (self.feeds >= numbers.feed.lowest) & (self.feeds <= numbers.feed.highest) & (self.feeds > 0)
        within = (self.words >= lowest) & (self.words <= highest)
        return ~(self.rapid | fits) | ~within.all(axis=1)


def klartext_number(decimals: int) -> str:
    """The pattern of a number as it must be written: sign, digits, all decimals."""
    return rf"[+-]{WHOLE}\.[0-9]{{{decimals}}}"


def full_move(dialect: Dialect, machine: Machine, short_way: bool) -> re.Pattern[str]:
    """The pattern of a whole line with all five words: block number, G code, the words, any feed; the words of endless
    axes have the form of the dialect where they take the `short_way`."""
    letters = machine.letters
    if dialect.grammar == "klartext":
        if dialect.vector is not None:
            return re.compile(rf"({WHOLE}) {vector_move(dialect, dialect.vector)}")
        words = " ".join(axis_words(dialect, letters))
        return re.compile(rf"({WHOLE}) (L) {words}(?: R0)?(?: F(MAX|{WHOLE}))?")
    codes = "|".join(re.escape(code) for code, effect in dialect.effect_of.items() if effect in ("rapid", "feed"))
    endless = endless_letters(machine) if short_way else ""
    number = POINTED_NUMBER if dialect.decimal_point else ISO_NUMBER
    patterns = [
        endless_word_pattern(dialect, letter) if letter in endless else f"{letter}({number})" for letter in letters
    ]
    if dialect.vector is not None:
        patterns = patterns[:3] + vector_patterns(dialect.vector, number)
    words = "".join(f" {pattern}" for pattern in patterns)
    text = rf"({codes}){words}(?: F({number}))?"
    return re.compile(numbered_pattern(dialect.numbering, text))


def axis_words(dialect: Dialect, letters: str) -> list[str]:
    """The patterns of the words of an `L` block's axes, with their numbers in groups."""
    length, angle = (klartext_number(kind.decimals) for kind in (dialect.numbers.length, dialect.numbers.angle))
    return [f"{letter}({length if letter in 'XYZ' else angle})" for letter in letters]


def vector_move(dialect: Dialect, vector: VectorTable) -> str:
    """The pattern of an `LN` block, which has X, Y, Z and the tool's direction."""
    length, component = (klartext_number(kind.decimals) for kind in (dialect.numbers.length, vector.number))
    words = [f"{letter}({length})" for letter in "XYZ"] + vector_patterns(vector, component)
    return rf"(LN) {' '.join(words)}(?: R0)?(?: F(MAX|{WHOLE}))?"


def endless_letters(machine: Machine) -> str:
    """The letters of the axes that turn without end."""
    return "".join(axis.letter for axis in machine.rotary if axis.endless)


def endless_word_pattern(dialect: Dialect, letter: str) -> str:
    """The pattern of a word that turns an endless axis the short way: its `letter`, which is a pattern, and in a group
    its number."""
    before, _, rest = dialect.endless_word.partition("{letter}")
    between, _, behind = rest.partition("{number}")
    number = POINTED_NUMBER if dialect.decimal_point else ISO_NUMBER
    return f"{re.escape(before)}{letter}{re.escape(between)}({number}){re.escape(behind)}"


def read_full_moves(
    lines: Sequence[str],
    start: int,
    ordinal: int,
    pattern: re.Pattern[str],
    dialect: Dialect,
    linking: bool,
    feed: float | None,
    solve: Callable[[Float[ndarray, "n 3"]], Float[ndarray, "n 2"]],
) -> Blocks | None:
    """The full moves from line `start` on, up to the first line of another form; None where there is no full
    move.

    `ordinal` numbered blocks stand before them; the first moves are links where `linking`. `feed` holds until
    another is written, None: every block needs its own. `solve` gives the rotary angles (degrees) of tool vectors.
    """
    groups: list[str] = []
    offsets: list[int] = []
    ordinals: list[int] = []
    links: list[bool] = []
    for offset, line in enumerate(islice(lines, start, start + MAX_LINES)):
        matched = pattern.fullmatch(line)
        if matched is None:
            mark = _mark(line, ordinal, dialect)
            if mark is None:
                break
            linking = mark
            ordinal += has_number(line, dialect.numbering)
            continue
        groups.extend(matched.groups())
        offsets.append(offset)
        ordinals.append(ordinal)
        ordinal += 1
        links.append(linking)
    if not groups:
        return None
    number, code, *words, written = (groups[k :: pattern.groups] for k in range(pattern.groups))
    if dialect.grammar == "klartext":
        rapid = np.array([value == "MAX" for value in written])
    else:
        rapid = np.array([dialect.effect_of[value] == "rapid" for value in code])
    modal = _modal([None if value == "MAX" else value for value in written], feed)
    table = np.array(words, dtype=np.float64).T
    # zeros for the second rotary axis of a machine that has only one
    rotary = np.pad(table[:, 3:], ((0, 0), (0, 5 - len(words)))) if dialect.vector is None else solve(table[:, 3:])
    return Blocks(
        words=np.column_stack([table[:, :3], rotary]),
        rapid=rapid,
        feeds=np.where(rapid, np.nan, modal),
        numbers=np.array([value or "-1" for value in number], dtype=np.int64),
        offsets=np.array(offsets),
        ordinals=np.array(ordinals),
        links=np.array(links),
        modal=modal,
    )


def _modal(written: Sequence[str | None], feed: float | None) -> Float[ndarray, "n"]:
    """The feed that holds at each block: the last one that was `written`, or the `feed` before; None: its own alone."""
    own = np.array([value or "nan" for value in written], dtype=np.float64)
    if feed is None:
        return own
    given = ~np.isnan(own)
    feeds = np.r_[feed, own]
    last = np.maximum.accumulate(np.where(given, np.arange(1, len(given) + 1), 0))
    return np.asarray(feeds[last])


def _mark(line: str, ordinal: int, dialect: Dialect) -> bool | None:
    """Whether links begin after a line that is a mark, with its block number if it has one; None where it is none."""
    form = dialect.numbering.format
    for text, linking in MARKS.items():
        comment = dialect.comment.format(text=text)
        if form and has_number(comment, dialect.numbering):
            comment = form.format(number=block_number(dialect.numbering, ordinal), text=comment)
        if line == comment:
            return linking
    return None


def unwound(before: float, words: Float[ndarray, "n"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n"]]:
    """Angles that an endless axis reaches from `before` by wrapped words, and the turn of each; degrees.

    Every turn is the short way, less than half a turn.
    """
    turns = (np.diff(words, prepend=before) + 180.0) % 360.0 - 180.0
    # whole turns are added to the words, so that no rounding builds up
    return words + 360.0 * np.round((before + np.cumsum(turns) - words) / 360.0), turns


class Stated:
    """What a program has not stated yet, as it is read."""

    def __init__(self, dialect: Dialect) -> None:
        self.stated = dialect.stated
        self._missing = set(dialect.stated.moves)
        self._missing_within: set[str] = set()

    def read(self, name: str) -> None:
        """Take a code, or the name of what a statement states, as read."""
        self._missing.discard(name)
        self._missing_within.discard(name)

    def begin_tool_centre(self) -> None:
        """Await what is to be stated after the start of tool-centre control."""
        self._missing_within = set(self.stated.tool_centre)

    def check(self, letters: str, tool_centre: bool, line: int) -> None:
        """ProgramError where the axes `letters` move before all was stated that they need."""
        if self._missing:
            raise line_error(line, f"an axis moves before {min(self._missing)} is stated")
        if tool_centre and self._missing_within and not {*letters}.isdisjoint("XYZ"):
            what = f"{min(self._missing_within)} is stated under tool-centre control"
            raise line_error(line, f"an axis moves before {what}")


AMBIGUOUS_TURN_DEG = 179.0
"""A word that turns an endless axis by more than this in one block is refused: by half a turn, either way is
short, and an axis that is wound goes the wrong way round."""


class EndlessAxes:
    """How a control reads the words of endless axes. `short_way`: they turn the short way, or as their words say; None
    before the program has said which."""

    def __init__(self, dialect: Dialect) -> None:
        self.dialect = dialect
        self.bounded_turns = dialect.chooses_way or dialect.endless_words == "wrapped"
        self.short_way: bool | None = None if dialect.chooses_way else dialect.endless_words == "wrapped"

    def are_wrapped(self, words: ndarray) -> ndarray:
        """Whether words (degrees) are among those that the dialect's form of the short way takes."""
        if not self.dialect.has_own_form:
            return np.ones(np.shape(words), dtype=bool)
        lowest = self.dialect.endless_from_deg
        return np.asarray((words >= lowest) & (words < lowest + 360.0))

    def reached(self, axis: RotaryAxis, word: float, before: float | None, *, moves_tip: bool, line: int) -> float:
        """The angle (degrees) that an endless axis reaches by its word from `before` (None: not known). ProgramError
        where the way is not known; where the tip moves with it, a turn of half a turn too."""
        if self.short_way is None:
            raise line_error(line, f"{axis.letter} turns before the short way is switched on or off")
        if self.short_way and not self.are_wrapped(np.array(word)):
            lowest = self.dialect.endless_from_deg
            why = f"{axis.letter} {word:g}: give {lowest:g} or more, below {lowest + 360:g}"
            raise line_error(line, why)
        if before is None:
            return word
        turn = word - before
        if self.short_way:
            turn = (turn + 180.0) % 360.0 - 180.0
        if self.bounded_turns and abs(turn) > AMBIGUOUS_TURN_DEG and moves_tip:
            why = "either way is possible" if self.short_way else "half a turn is allowed"
            raise line_error(line, f"{axis.letter} turns by {turn:.3f} deg in one block: {why}")
        # whole turns are added to the word, so that no rounding builds up over many turns
        return word + 360.0 * round((before + turn - word) / 360.0)

    def reached_in_turn(self, words: ndarray, before: float) -> tuple[ndarray, ndarray]:
        """The angles (degrees) that successive words of one endless axis reach from `before`, and whether each is
        doubtful: `reached` says what is wrong with it."""
        if self.short_way is None:
            return words, np.ones(len(words), dtype=bool)
        doubtful = np.zeros(len(words), dtype=bool)
        turns = np.diff(words, prepend=before)
        if self.short_way:
            doubtful = ~self.are_wrapped(words)
            words, turns = unwound(before, words)
        return words, doubtful | (self.bounded_turns & (np.abs(turns) > AMBIGUOUS_TURN_DEG))


class ModalState:
    """What a control knows after the blocks that it has read: position, tool, and the modes that are on.

    `position`: X, Y, Z in mm and the rotary axes in degrees, unwound; None where it is not known.
    `tool_centre`: tool-centre control (TCPM, RTCP) is on. `inverse_time`: F is in 1/min; `incremental`: words are
    increments. `length_of`: the tool whose length is compensated, `selected` the one that the next change brings.
    `feed` is the last F (mm/min), NaN where none holds; `uncompensated`: a Klartext program has stated R0.
    `speed` is the last one of the spindle that was read (S, 1/min), which `turns` where it has been started since the
    last tool change or stop. `tolerance` is that of the contour, mm. `retracted`: a retract was the last that moved the
    tool along Z. `linking`: feed moves are links, as the last comment CUT or LINK says. Used for one program.
    """

    def __init__(self, machine: Machine, dialect: Dialect, tools: Sequence[Tool]) -> None:
        self.machine = machine
        self.dialect = dialect
        self.given = bool(tools)
        self.tools = {tool.number: tool for tool in tools}
        unknown = len(machine.letters)
        self.position: list[float | None] = [None] * unknown + [0.0] * (5 - unknown)
        self.tool = self.selected = self.length_of = 0
        self.needs_length = not {"tool_length", "tool_centre_on"}.isdisjoint(dialect.effect_of.values())
        self.zero_height = 0.0
        self.tool_centre = False
        self.stated = Stated(dialect)
        self.endless = EndlessAxes(dialect)
        self.speed = 0.0
        self.turns = self.coolant = False
        self.tolerance = np.nan
        self.inverse_time = False
        self.feed = np.nan
        self.uncompensated = dialect.grammar != "klartext"
        self.incremental = False
        self.retracted = False
        self.linking = self.ended = False
        self.blocks = 0
        self.rows: list[tuple[float, ...]] = []
        self.partial: list[PartialMove] = []
        self.tables: list[ndarray] = []
        self.full_moves = [full_move(dialect, machine, short_way) for short_way in (False, True)]

    def read_comment(self, text: str, line: int) -> None:
        """Take the tool that a comment of the header describes, unless the caller has given the tools; the height of
        the program's zero; or the mark of links or cuts."""
        self.linking = MARKS.get(text.strip(), self.linking)
        zero = ZERO_COMMENT.fullmatch(text)
        if zero is not None:
            if self.blocks or self.zero_height:
                raise line_error(line, "the height of the program's zero stands twice, or behind a move")
            self.zero_height = float(zero[1])
        tool = described_tool(text, line)
        if tool is not None and not self.given:
            if tool.number in self.tools:
                raise line_error(line, f"tool {tool.number} is described twice")
            self.tools[tool.number] = tool

    def change_tool(self, number: int, line: int) -> None:
        """Put a tool into the spindle; where its tip stands is known after the next move."""
        if self.tool_centre:
            raise line_error(line, "a tool change while tool-centre control is on")
        if number not in self.tools:
            raise line_error(line, f"tool {number} is called but not described: give its radius and length")
        self.tool = number
        self.selected = 0
        self.length_of = 0 if self.needs_length else number
        self.turns = False
        self.feed = np.nan
        self.forget_tip()

    def switch_spindle_and_coolant(self, effect: str) -> None:
        """Apply the effect of a code or a statement, if it is one of theirs (see `nc.dialect`)."""
        effect = effect.replace("_", " ")
        if effect in ("spindle on", "spindle stop", "halt"):
            self.turns = effect == "spindle on"
        if effect in ("coolant on", "coolant off", "halt"):
            self.coolant = effect == "coolant on"

    def take_length(self, number: int, line: int) -> None:
        """Compensate the length of a tool, that in the spindle, 0: of none."""
        if number not in (0, self.tool):
            raise line_error(line, f"tool {self.tool} is in the spindle, not tool {number} of this length")
        self.length_of = number
        self.forget_tip()

    def switch_tool_centre(self, on: bool) -> None:
        """Switch tool-centre control on or off; where the tip stands is known after the next move."""
        self.tool_centre = on
        self.stated.begin_tool_centre()
        self.feed = np.nan
        self.forget_tip()

    def forget_tip(self) -> None:
        """Take X, Y and Z as unknown until the next move."""
        self.position[:3] = [None] * 3

    def retract(self, line: int, height: float = np.nan) -> None:
        """Take the tool above everything: where its tip is in the part is not known, only, where it is given, the
        `height` (mm) of the spindle nose in machine coordinates."""
        self.blocks += 1
        self.forget_tip()
        self.retracted = True
        joints = (np.nan, np.nan, height, np.nan, np.nan)
        self.partial.append(PartialMove(line, self.tool, joints, retract=True))

    def park(self, x: float, y: float, line: int) -> None:
        """A rapid of the spindle nose, retracted or as high as it ever was, to X and Y (mm) in machine coordinates."""
        self.stated.check("XY", self.tool_centre, line)
        height = None if self.dialect.tool_centre else self.position[2]
        high = height is not None and height >= self.table[:, 2].max(initial=-np.inf)
        if self.tool_centre or not (self.retracted or high):
            why = "X and Y of the machine before a retract: the tool may stand beside the part"
            raise line_error(line, why)
        self.blocks += 1
        self.forget_tip()
        self.retracted = True
        rotary = (np.nan if angle is None else angle for angle in self.position[3:])
        self.partial.append(PartialMove(line, self.tool, (x, y, np.nan, *rotary)))

    def move(self, words: dict[str, float], rapid: bool, feed: float | None, line: int) -> None:
        """Run one block that moves axes; `words` in mm and degrees, `feed` in mm/min or 1/min. None: the feed before
        holds, but that of inverse time."""
        before = list(self.position)
        if feed is None and self.inverse_time:
            feed = np.nan
        feed = self.feed if feed is None else feed
        self.feed = feed
        if self.incremental:
            raise line_error(line, "an axis moves by increments: switch to absolute words before")
        self.stated.check("".join(words), self.tool_centre, line)
        for letter, value in words.items():
            column = self.machine.letters.index(letter)
            if column >= 3 and self.machine.rotary[column - 3].endless:
                axis, stood, placed = (
                    self.machine.rotary[column - 3],
                    self.position[column],
                    None not in self.position[:3],
                )
                value = self.endless.reached(axis, value, stood, moves_tip=placed, line=line)
            self.position[column] = value
        self.blocks += 1
        if not self.tool:
            raise line_error(line, "a move before any tool call")
        if self.position[2] is None and not self.retracted:
            why = "an axis moves while it is not known how high the tool stands: retract it before"
            raise line_error(line, why)
        self.retracted &= self.position[2] is None
        self.partial.append(PartialMove(line, self.tool, self._joints(words)))
        if any(letter in "XYZ" for letter in words):
            # a rapid, and nothing but the retracted spindle is known: then it is not known where the tip stands
            across = rapid and "Z" not in words and before[2] is None
            if not across and self.length_of != self.tool:
                raise line_error(line, f"tool {self.tool} moves without its length")
            if self.dialect.tool_centre and not self.tool_centre:
                if not across:
                    raise line_error(line, "X, Y, Z are programmed without tool-centre control")
                self.forget_tip()
        if not rapid and not feed > 0:
            raise line_error(line, "a cutting move without feed")
        check_range(self.dialect.numbers, words if rapid else {**words, "F": feed}, line)
        if None not in self.position:
            self.partial.pop()
            known = None not in before
            numbers = [float(value or 0.0) for value in self.position]
            rate = np.nan if rapid else feed
            modes = self.inverse_time, line, self.tool, known, self.linking
            held = self.turns * self.speed, self.coolant, self.tolerance
            self.rows.append((*numbers, rapid, rate, *modes, *held))

    def _joints(self, words: dict[str, float]) -> tuple[float, ...]:
        """The axes (mm of the spindle nose, degrees) that a move leads to known places by its words alone, NaN for
        others: under tool-centre control no linear one."""
        joints = [np.nan] * 3 + [np.nan if angle is None else angle for angle in self.position[3:]]
        if self.tool_centre:
            return tuple(joints)
        zero = self.machine.in_machine(np.array([[0.0, 0.0, self.zero_height]]))[0]
        zero = zero + self.machine.part_zero if self.dialect.tool_centre else zero
        for column, letter in enumerate("XYZ"):
            joints[column] = words.get(letter, np.nan) + float(zero[column])
        joints[2] += self.tools[self.tool].length
        return tuple(joints)

    def run_full_moves(self, lines: Sequence[str], start: int, ordinal: int) -> tuple[int, int]:
        """Run the blocks from lines[start] on that have all five words, all at once, and the marks between them;
        returns how many lines it has run, and how many numbered blocks there are before the next line.

        `ordinal` numbered blocks stand before lines[start]. It stops before the first block that is not plain or
        may be wrong: `move` then says what is wrong with it.
        """
        if (
            None in self.position
            or not self.tool
            or self.ended
            or self.incremental
            or self.length_of != self.tool
            or self.tool_centre != self.dialect.tool_centre
            or not self.uncompensated
        ):
            return 0, ordinal
        pattern = self.full_moves[bool(self.endless.short_way)]
        solve = angles_from(self.machine, self.position[3:])
        feed = None if self.inverse_time else self.feed
        moves = read_full_moves(
            lines, start, ordinal, pattern, self.dialect, linking=self.linking, feed=feed, solve=solve
        )
        if moves is None:
            return 0, ordinal
        doubtful = moves.outside(self.dialect.numbers)
        if self.dialect.numbering.format:
            doubtful |= moves.numbers != block_numbers(self.dialect.numbering, moves.ordinals)
        for column, axis in enumerate(self.machine.rotary, start=3):
            if axis.endless and self.dialect.vector is None:
                before = float(self.position[column] or 0.0)
                moves.words[:, column], unclear = self.endless.reached_in_turn(moves.words[:, column], before)
                doubtful |= unclear
        count = int(np.argmax(doubtful)) if doubtful.any() else len(doubtful)
        if not count:
            return 0, ordinal
        blocks = moves.first(count)
        modes = self.tool, True, self.turns * self.speed, self.coolant, self.tolerance
        tool, known, *held = (np.full(count, float(mode)) for mode in modes)
        first = blocks.words, blocks.rapid, blocks.feeds, np.full(count, self.inverse_time)
        columns = [*first, start + 1 + blocks.offsets, tool, known, blocks.links, *held]
        self.tables += [self._table(), np.column_stack(columns)]
        self.rows = []
        self.linking = bool(blocks.links[-1])
        self.feed = float(blocks.modal[-1])
        self.position = [float(value) for value in blocks.words[-1]]
        self.blocks += count
        return int(blocks.offsets[-1]) + 1, int(blocks.ordinals[-1]) + 1

    def _table(self) -> ndarray:
        return np.array(self.rows, dtype=np.float64).reshape(-1, COLUMNS)

    @property
    def table(self) -> ndarray:
        """All moves to known positions so far, a row of COLUMNS each."""
        return np.vstack([*self.tables, self._table()])


COMPONENTS = "IJK"
"""The components of a tool vector, as the reader calls them."""


def turn_to(state: ModalState, vector: Sequence[float], line: int) -> None:
    """Turn the rotary axes of the next move to a tool vector; ProgramError where they do not reach it."""
    angles = angles_from(state.machine, state.position[3:])(np.array([vector]))[0]
    if not state.tool_centre or np.isnan(angles).any():
        why = "it must be a unit vector that the axes reach from known angles, under tool-centre control"
        raise line_error(line, f"the tool vector {' '.join(f'{value:g}' for value in vector)}: {why}")
    state.position[3:] = angles.tolist()


class DirectionWords:
    """The words of tool vectors in blocks of letter-number words."""

    def __init__(self, state: ModalState) -> None:
        self.state = state
        vector = state.dialect.vector
        number = POINTED_NUMBER if state.dialect.decimal_point else ISO_NUMBER
        self.patterns = [re.compile(each) for each in vector_patterns(vector, number)] if vector else []

    def component(self, item: str) -> tuple[str, str] | None:
        """The component of a word, I, J or K, and its number; None where it is another word."""
        for letter, pattern in zip(COMPONENTS, self.patterns, strict=False):
            match = pattern.fullmatch(item)
            if match:
                return letter, match[1]
        return None

    def turn(self, axes: Sequence[str], values: dict[str, str], line: int) -> set[str]:
        """Turn to the vector of a block that moves `axes`, if it has one; the letters of its components. ProgramError
        where one is missing, or an angle stands beside it."""
        given = values.keys() & {*COMPONENTS}
        if not self.patterns or not given:
            return set()
        angles = sorted({*axes} - {*"XYZ"})
        if angles or len(given) < len(COMPONENTS):
            what = f"{angles[0]} stands beside a tool vector" if angles else "a component of the tool vector is missing"
            raise line_error(line, f"{what}: give all three, and no angle")
        turn_to(self.state, [float(values[letter]) for letter in COMPONENTS], line)
        return given
