"""The state of a control while it reads a program, and the moves that it makes.

Control manuals call a word modal that holds until another word replaces it: the position of each axis, the
tool, tool-centre control, the way endless axes turn, and the meaning of F.
"""

import re
from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from bonecam.errors import ProgramError
from bonecam.nc.control import Control
from bonecam.nc.dialect import Dialect
from bonecam.nc.machine import Machine
from bonecam.nc.reading.full_moves import MARKS, Blocks, full_move, read_full_moves, unwound
from bonecam.nc.reading.line_error import line_error
from bonecam.nc.reading.motions import Motions, Tool, motions_of
from bonecam.nc.reading.stated import Stated
from bonecam.nc.schema.numbering import WHOLE, block_numbers
from bonecam.text.faults import shown

TOOL_COMMENT = re.compile(rf"\s*TOOL ({WHOLE}) BALL RADIUS ({WHOLE}\.[0-9]+) LENGTH ({WHOLE}\.[0-9]+)\s*")
"""The comment of the header that describes a cutter, as `posting.header.texts` writes it; mm."""
AMBIGUOUS_TURN_DEG = 179.0
"""A word that turns an endless axis by more than this in one block is refused: by half a turn, either way is
short, and an axis that is wound goes the wrong way round."""


def tool_number(text: str, line: int) -> int:
    """The number of a tool call; ProgramError where it is none."""
    if not re.fullmatch(WHOLE, text):
        raise line_error(line, f"{shown(text)} is no number of a tool")
    return int(text)


class ModalState:
    """What a control knows after the blocks that it has read: position, tool, and the modes that are on.

    `position`: X, Y, Z in mm and the rotary axes in degrees, unwound; None where it is not known.
    `tool_centre`: tool-centre control (TCPM, RTCP) is on. `short_way`: endless axes turn the short way, or as
    their words say; None before the program has said which. `inverse_time`: F is in 1/min; `incremental`: words are
    increments. `length_of`: the tool whose length is compensated, `selected` the one that the next change brings.
    `linking`: feed moves are links, as the last comment CUT or LINK says. Used for one program.
    """

    def __init__(self, machine: Machine, dialect: Dialect, tools: Sequence[Tool]) -> None:
        self.machine = machine
        self.dialect = dialect
        self.given = bool(tools)
        self.tools = {tool.number: tool for tool in tools}
        self.position: list[float | None] = [None] * 5
        self.tool = 0
        self.selected = 0
        self.needs_length = not {"tool_length", "tool_centre_on"}.isdisjoint(dialect.codes.values())
        self.length_of = 0
        self.tool_centre = False
        self.stated = Stated(dialect)
        self.bounded_turns = dialect.chooses_way or dialect.endless_words == "wrapped"
        self.short_way: bool | None = None if dialect.chooses_way else dialect.endless_words == "wrapped"
        self.inverse_time = False
        self.incremental = False
        self.linking = False
        self.ended = False
        self.blocks = 0
        self.rows: list[tuple[float, ...]] = []
        self.tables: list[ndarray] = []
        self.full_moves = [full_move(dialect, machine, short_way) for short_way in (False, True)]

    def read_comment(self, text: str, line: int) -> None:
        """Take the tool that a comment of the header describes, unless the caller has given the tools; or the mark
        of links or cuts."""
        self.linking = MARKS.get(text.strip(), self.linking)
        found = TOOL_COMMENT.fullmatch(text)
        if found and not self.given:
            number = int(found[1])
            if number in self.tools:
                raise line_error(line, f"tool {number} is described twice")
            self.tools[number] = Tool(number, float(found[2]), float(found[3]))

    def change_tool(self, number: int, line: int) -> None:
        """Put a tool into the spindle; where its tip stands is known after the next move."""
        if self.tool_centre:
            raise line_error(line, "a tool change while tool-centre control is on")
        if number not in self.tools:
            raise line_error(line, f"tool {number} is called but not described: give its radius and length")
        self.tool = number
        self.selected = 0
        self.length_of = 0 if self.needs_length else number
        self.forget_tip()

    def take_length(self, number: int, line: int) -> None:
        """Compensate the length of a tool, 0: of none; it must be the tool in the spindle."""
        if number not in (0, self.tool):
            raise line_error(line, f"tool {self.tool} is in the spindle, not tool {number} of this length")
        self.length_of = number
        self.forget_tip()

    def switch_tool_centre(self, on: bool) -> None:
        """Switch tool-centre control on or off; where the tip stands is known after the next move."""
        self.tool_centre = on
        self.stated.begin_tool_centre()
        self.forget_tip()

    def forget_tip(self) -> None:
        """Take X, Y and Z as unknown until the next move."""
        self.position[:3] = [None] * 3

    def move(self, words: dict[str, float], rapid: bool, feed: float, line: int) -> None:
        """Run one block that moves axes; `words` in mm and degrees, `feed` in mm/min or 1/min."""
        before = list(self.position)
        if self.incremental:
            raise line_error(line, "an axis moves by increments: switch to absolute words before")
        self.stated.check("".join(words), self.tool_centre, line)
        for letter, value in words.items():
            column = self.machine.letters.index(letter)
            self.position[column] = value if column < 3 else self._unwound(column, value, line)
        self.blocks += 1
        if not self.tool:
            raise line_error(line, "a move before any tool call")
        if any(letter in "XYZ" for letter in words):
            self._check_linear(rapid and "Z" not in words and before[2] is None, line)
        if not rapid and not feed > 0:
            raise line_error(line, "a cutting move without feed")
        if None not in self.position:
            known = None not in before
            numbers = [float(value or 0.0) for value in self.position]
            rate = np.nan if rapid else feed
            modes = self.inverse_time, line, self.tool, known, self.linking
            self.rows.append((*numbers, rapid, rate, *modes))

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
        ):
            return 0, ordinal
        pattern = self.full_moves[bool(self.short_way)]
        found = read_full_moves(lines, start, ordinal, pattern, self.dialect, self.linking)
        if found is None:
            return 0, ordinal
        doubtful = ~found.rapid & ~(found.feeds > 0)
        if self.dialect.numbering.format:
            doubtful |= found.numbers != block_numbers(self.dialect.numbering, found.ordinals)
        for column, axis in enumerate(self.machine.rotary, start=3):
            if axis.endless:
                before = float(self.position[column] or 0.0)
                turns = np.diff(found.words[:, column], prepend=before)
                if self.short_way:
                    doubtful |= ~self._is_wrapped(found.words[:, column])
                    found.words[:, column], turns = unwound(before, found.words[:, column])
                too_far = self.bounded_turns & (np.abs(turns) > AMBIGUOUS_TURN_DEG)
                doubtful |= too_far | (self.short_way is None)
        count = int(np.argmax(doubtful)) if doubtful.any() else len(doubtful)
        if not count:
            return 0, ordinal
        self._take(found.first(count), start + 1)
        return int(found.offsets[count - 1]) + 1, int(found.ordinals[count - 1]) + 1

    def _is_wrapped(self, words: ndarray) -> ndarray:
        """Whether words of an endless axis (degrees) are among those that its form of the short way takes."""
        if not self.dialect.has_own_form:
            return np.ones(np.shape(words), dtype=bool)
        lowest = self.dialect.endless_from_deg
        return np.asarray((words >= lowest) & (words < lowest + 360.0))

    def _take(self, found: Blocks, line: int) -> None:
        count = len(found.rapid)
        inverse_time = np.full(count, self.inverse_time)
        lines = line + found.offsets
        tools = np.full(count, self.tool)
        known = np.ones(count)
        columns = [found.words, found.rapid, found.feeds, inverse_time, lines, tools, known, found.links]
        self.tables += [self._table(), np.column_stack(columns)]
        self.rows = []
        self.linking = bool(found.links[-1])
        self.position = [float(value) for value in found.words[-1]]
        self.blocks += count

    def _table(self) -> ndarray:
        return np.array(self.rows, dtype=np.float64).reshape(-1, 12)

    def _unwound(self, column: int, value: float, line: int) -> float:
        """The angle (degrees) that an axis reaches by its word: the short way where the axis is endless and
        the control turns it so."""
        before = self.position[column]
        axis = self.machine.rotary[column - 3]
        if not axis.endless:
            return value
        if self.short_way is None:
            raise line_error(line, f"{axis.letter} turns before the short way is switched on or off")
        if self.short_way and not self._is_wrapped(np.array(value)):
            lowest = self.dialect.endless_from_deg
            raise line_error(
                line, f"{axis.letter} {value:g}: give {lowest:g} or more, below {lowest + 360:g}"
            )
        if before is None:
            return value
        turn = value - before
        if self.short_way:
            turn = (turn + 180.0) % 360.0 - 180.0
        if self.bounded_turns and abs(turn) > AMBIGUOUS_TURN_DEG and self.position[0] is not None:
            why = "either way is possible" if self.short_way else "half a turn is allowed"
            raise line_error(line, f"{axis.letter} turns by {turn:.3f} deg in one block: {why}")
        # whole turns are added to the word, so that no rounding builds up over many turns
        return value + 360.0 * round((before + turn - value) / 360.0)

    def motions(self) -> Motions:
        """All moves so far; ProgramError where the program has not ended."""
        if not self.ended:
            raise ProgramError("the program has no end: its last blocks are missing")
        controls = {
            tool.number: Control(self.machine, self.dialect.tool_centre, tool.radius, tool.length)
            for tool in self.tools.values()
        }
        return motions_of(np.vstack([*self.tables, self._table()]), controls, self.blocks)
