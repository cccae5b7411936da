"""The state of a control while it reads a program, and the moves that it makes.

Control manuals call a word modal that holds until another word replaces it: the position of each axis, the
tool, tool-centre control, the way endless axes turn, and the meaning of F.

Words of endless axes: which way the control turns by them, and the angle that it reaches.

What holds as a program is read: what it must have stated before its axes move, its spindle and coolant.

A control begins with what its machine's parameters choose, or with what the program before left on: inches, increments,
another plane, a tilted plane. A dialect lists what the proof takes for granted (`stated` of `nc.dialect`); a text that
leaves one of these out may be driven otherwise than it is read.
"""

from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from bonecam.machine.axes import RotaryAxis
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.full_moves import MARKS, Blocks, full_move, read_full_moves, unwound
from bonecam.nc.reading.line_error import line_error
from bonecam.nc.reading.motions import COLUMNS, PartialMove, Tool
from bonecam.nc.reading.number_range import check_range
from bonecam.nc.reading.tool_words import described_tool
from bonecam.nc.schema.numbering import block_numbers
from bonecam.nc.tool_vectors import angles_from


class Stated:
    """What a program has not stated yet, as it is read."""

    def __init__(self, dialect: Dialect) -> None:
        self._again = tuple(dialect.stated.tool_centre)
        self._missing = set(dialect.stated.moves)
        self._missing_within: set[str] = set()

    def read(self, name: str) -> None:
        """Take a code, or the name of what a statement states, as read."""
        self._missing.discard(name)
        self._missing_within.discard(name)

    def begin_tool_centre(self) -> None:
        """Await what is to be stated after the start of tool-centre control."""
        self._missing_within = set(self._again)

    def check(self, letters: str, tool_centre: bool, line: int) -> None:
        """ProgramError where the axes `letters` move before all was stated that they need."""
        if self._missing:
            raise line_error(line, f"an axis moves before {min(self._missing)} is stated")
        if tool_centre and self._missing_within and not {*letters}.isdisjoint("XYZ"):
            what = f"{min(self._missing_within)} is stated under tool-centre control"
            raise line_error(line, f"an axis moves before {what}")


class SpindleAndCoolant:
    """What spindle and coolant do: `programmed` is the last speed that was read (S, 1/min), `turns` whether the
    spindle has been started since the last tool change or stop."""

    def __init__(self) -> None:
        self.programmed = 0.0
        self.turns = False
        self.coolant = False

    @property
    def speed(self) -> float:
        """The speed of the spindle, 1/min; 0 where it stands."""
        return self.programmed if self.turns else 0.0

    def apply(self, effect: str) -> None:
        """Apply the effect of a code or a statement, if it is one of theirs (see `nc.dialect`)."""
        effect = effect.replace("_", " ")
        if effect in ("spindle on", "spindle stop", "halt"):
            self.turns = effect == "spindle on"
        if effect in ("coolant on", "coolant off", "halt"):
            self.coolant = effect == "coolant on"

    def change_tool(self) -> None:
        """A tool change: the spindle stands, its speed is kept."""
        self.turns = False


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
    `tolerance` is that of the contour, mm. `retracted`: a retract was the last that moved the tool along Z.
    `linking`: feed moves are links, as the last comment CUT or LINK says. Used for one program.
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
        self.tool_centre = False
        self.stated = Stated(dialect)
        self.endless = EndlessAxes(dialect)
        self.spindle = SpindleAndCoolant()
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
        """Take the tool that a comment of the header describes, unless the caller has given the tools; or the mark
        of links or cuts."""
        self.linking = MARKS.get(text.strip(), self.linking)
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
        self.spindle.change_tool()
        self.feed = np.nan
        self.forget_tip()

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
            self.position[column] = self._reached(column, value, line)
        self.blocks += 1
        if not self.tool:
            raise line_error(line, "a move before any tool call")
        if self.position[2] is None and not self.retracted:
            why = "an axis moves while it is not known how high the tool stands: retract it before"
            raise line_error(line, why)
        self.retracted &= self.position[2] is None
        self.partial.append(PartialMove(line, self.tool, self._joints(words)))
        if any(letter in "XYZ" for letter in words):
            self._check_linear(rapid and "Z" not in words and before[2] is None, line)
        if not rapid and not feed > 0:
            raise line_error(line, "a cutting move without feed")
        check_range(self.dialect.numbers, words if rapid else {**words, "F": feed}, line)
        if None not in self.position:
            self.partial.pop()
            known = None not in before
            numbers = [float(value or 0.0) for value in self.position]
            rate = np.nan if rapid else feed
            modes = self.inverse_time, line, self.tool, known, self.linking
            held = self.spindle.speed, self.spindle.coolant, self.tolerance
            self.rows.append((*numbers, rapid, rate, *modes, *held))

    def _reached(self, column: int, value: float, line: int) -> float:
        """Where an axis (mm, degrees) stands after its word."""
        if column < 3 or not self.machine.rotary[column - 3].endless:
            return value
        axis = self.machine.rotary[column - 3]
        moves_tip = None not in self.position[:3]
        return self.endless.reached(axis, value, self.position[column], moves_tip=moves_tip, line=line)

    def _joints(self, words: dict[str, float]) -> tuple[float, ...]:
        """The axes (mm of the spindle nose, degrees) that a move leads to known places by its words alone, NaN for
        others: under tool-centre control no linear one."""
        joints = [np.nan] * 3 + [np.nan if angle is None else angle for angle in self.position[3:]]
        if self.tool_centre:
            return tuple(joints)
        zero = self.machine.part_zero if self.dialect.tool_centre else (0.0, 0.0, 0.0)
        for column, letter in enumerate("XYZ"):
            joints[column] = words.get(letter, np.nan) + zero[column]
        joints[2] += self.tools[self.tool].length
        return tuple(joints)

    def _check_linear(self, across: bool, line: int) -> None:
        """ProgramError where X, Y or Z move without the modes that they need; `across`: rapid, and nothing but the
        retracted spindle is known. Then it is not known where the tip stands in the part."""
        if not across and self.length_of != self.tool:
            raise line_error(line, f"tool {self.tool} moves without its length")
        if self.dialect.tool_centre and not self.tool_centre:
            if not across:
                raise line_error(line, "X, Y, Z are programmed without tool-centre control")
            self.forget_tip()

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
        self._take(moves.first(count), start + 1)
        return int(moves.offsets[count - 1]) + 1, int(moves.ordinals[count - 1]) + 1

    def _take(self, blocks: Blocks, line: int) -> None:
        count = len(blocks.rapid)
        modes = self.tool, True, self.spindle.speed, self.spindle.coolant, self.tolerance
        tool, known, *held = (np.full(count, float(mode)) for mode in modes)
        moves = blocks.words, blocks.rapid, blocks.feeds, np.full(count, self.inverse_time)
        columns = [*moves, line + blocks.offsets, tool, known, blocks.links, *held]
        self.tables += [self._table(), np.column_stack(columns)]
        self.rows = []
        self.linking = bool(blocks.links[-1])
        self.feed = float(blocks.modal[-1])
        self.position = [float(value) for value in blocks.words[-1]]
        self.blocks += count

    def _table(self) -> ndarray:
        return np.array(self.rows, dtype=np.float64).reshape(-1, COLUMNS)

    @property
    def table(self) -> ndarray:
        """All moves to known positions so far, rows as `motions_of` takes them."""
        return np.vstack([*self.tables, self._table()])
