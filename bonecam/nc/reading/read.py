"""Reading an NC text back: from the dialect's grammar to moves, strictly.

Nothing of the writer is used: the text, the machine, the dialect's [[statements]] or [codes], and the cutters
as the header's comments (or the caller) state them. An unknown word, a number in another form, a block out of
sequence, a move without tool, feed or known state is a ProgramError with its line. Two grammars: Klartext
(statements, `L` blocks) and ISO (letter-number words).
"""

import re
from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from bonecam.errors import ProgramError
from bonecam.nc.control import Control
from bonecam.nc.dialect import Dialect
from bonecam.nc.machine import Machine
from bonecam.nc.reading.bulk import ISO_NUMBER, Blocks, full_move, klartext_number, read_full_moves, unwound
from bonecam.nc.reading.motions import Motions, Tool

TOOL_COMMENT = re.compile(r"\s*TOOL (\d+) BALL RADIUS (\d+\.\d+) LENGTH (\d+\.\d+)\s*")
# a turn this near to half a turn could go either way
AMBIGUOUS_TURN_DEG = 179.0


def read_program(text: str, machine: Machine, dialect: Dialect, tools: Sequence[Tool] = ()) -> Motions:
    """The moves of a program; `tools` replace those in the header's comments. ProgramError names the line."""
    reader = _Reader(machine, dialect, tools)
    (reader.klartext if dialect.grammar == "klartext" else reader.iso)(text)
    return reader.motions()


class _Reader:
    """The state of a control while it reads; final, used once."""

    def __init__(self, machine: Machine, dialect: Dialect, tools: Sequence[Tool]) -> None:
        self.machine, self.dialect = machine, dialect
        self.given = bool(tools)
        self.tools = {tool.number: tool for tool in tools}
        self.position: list[float | None] = [None] * 5
        self.tool, self.tool_centre, self.short_way, self.inverse_time, self.ended = (
            0,
            False,
            False,
            False,
            False,
        )
        self.blocks = 0
        self.wraps = dialect.endless_words == "wrapped"
        self.rows: list[tuple[float, ...]] = []
        self.tables: list[ndarray] = []
        self.full_move = full_move(dialect, machine.letters)

    def wrong(self, line: int, why: str) -> ProgramError:
        return ProgramError(f"line {line}: {why}", line=line)

    def comment(self, text: str, line: int) -> None:
        found = TOOL_COMMENT.fullmatch(text)
        if found and not self.given:
            number = int(found[1])
            if number in self.tools:
                raise self.wrong(line, f"tool {number} is described twice")
            self.tools[number] = Tool(number, float(found[2]), float(found[3]))

    def change(self, number: int, line: int) -> None:
        if number not in self.tools:
            raise self.wrong(line, f"tool {number} is called but not described: give its radius and length")
        self.tool, self.position = number, [None, None, None, *self.position[3:]]

    def move(self, words: dict[str, float], rapid: bool, feed: float, line: int) -> None:
        """Run one moving block: words in mm and degrees."""
        before = list(self.position)
        for letter, value in words.items():
            column = self.machine.letters.index(letter)
            self.position[column] = value if column < 3 else self.unwound(column, value, line)
        self.blocks += 1
        if not self.tool:
            raise self.wrong(line, "a move before any tool call")
        linear = any(letter in "XYZ" for letter in words)
        if linear and self.dialect.tool_centre and not self.tool_centre:
            raise self.wrong(line, "X, Y, Z are programmed without tool-centre control")
        if not rapid and not feed > 0:
            raise self.wrong(line, "a cutting move without feed")
        if None not in self.position:
            known = None not in before
            numbers = [float(value or 0.0) for value in self.position]
            self.rows.append(
                (*numbers, rapid, np.nan if rapid else feed, self.inverse_time, line, self.tool, known)
            )

    def full_moves(self, lines: Sequence[str], start: int, number: int) -> int:
        """Run the plain full moves from lines[start] on; how many they are. `number`: of the block there, -1:
        no numbers.

        It stops before the first block that leaves any doubt: `move` says what is wrong with it.
        """
        if (
            None in self.position
            or not self.tool
            or self.ended
            or self.tool_centre != self.dialect.tool_centre
        ):
            return 0
        found = read_full_moves(lines, start, self.full_move, self.dialect)
        if found is None:
            return 0
        doubtful = ~found.rapid & ~(found.feeds > 0)
        if number >= 0:
            doubtful |= found.numbers != number + np.arange(len(found.numbers))
        if self.wraps:
            for column, axis in enumerate(self.machine.rotary, start=3):
                if axis.endless:
                    found.words[:, column], turns = unwound(
                        float(self.position[column] or 0.0), found.words[:, column]
                    )
                    doubtful |= (np.abs(turns) > AMBIGUOUS_TURN_DEG) | (not self.short_way)
        count = int(np.argmax(doubtful)) if doubtful.any() else len(doubtful)
        if count:
            self._take(found.first(count), start + 1)
        return count

    def _take(self, found: Blocks, line: int) -> None:
        count = len(found.rapid)
        same = np.column_stack(
            [
                np.full(count, self.inverse_time),
                line + np.arange(count),
                np.full(count, self.tool),
                np.ones(count),
            ]
        )
        self.tables += [self._table(), np.column_stack([found.words, found.rapid, found.feeds, same])]
        self.rows = []
        self.position = [float(value) for value in found.words[-1]]
        self.blocks += count

    def _table(self) -> ndarray:
        return np.array(self.rows, dtype=np.float64).reshape(-1, 11)

    def unwound(self, column: int, value: float, line: int) -> float:
        """Where a rotary word sends its axis, in degrees: the short way on an endless axis of a wrapping
        control."""
        before, axis = self.position[column], self.machine.rotary[column - 3]
        if not (axis.endless and self.wraps) or before is None:
            return value
        if not self.short_way:
            raise self.wrong(line, f"{axis.letter} turns without the short way switched on")
        turn = (value - before + 180.0) % 360.0 - 180.0
        if abs(turn) > AMBIGUOUS_TURN_DEG and self.position[0] is not None:
            raise self.wrong(
                line, f"{axis.letter} turns by {turn:.3f} deg in one block: either way is possible"
            )
        # whole thousandths in, whole thousandths out: no drift over many turns
        return value + 360.0 * round((before + turn - value) / 360.0)

    def motions(self) -> Motions:
        if not self.ended:
            raise ProgramError("the program has no end: its last blocks are missing")
        table = np.vstack([*self.tables, self._table()])
        words = np.column_stack([table[:, :3], np.radians(table[:, 3:5])])
        numbers = table[:, 9].astype(np.int64)
        tips, axes = np.zeros((len(table), 3)), np.zeros((len(table), 3))
        controls = {
            tool.number: Control(self.machine, self.dialect.tool_centre, tool.radius, tool.length)
            for tool in self.tools.values()
        }
        for number, control in controls.items():
            rows = numbers == number
            tips[rows], axes[rows] = control.poses(words[rows])
        return Motions(
            rapid=table[:, 5] == 1,
            words=words,
            feed_rates=table[:, 6],
            inverse_time=table[:, 7] == 1,
            lines=table[:, 8].astype(np.int64),
            tools=numbers,
            known_start=table[:, 10] == 1,
            tips=tips,
            axes=axes,
            blocks=self.blocks,
            controls=controls,
        )

    # Klartext

    def klartext(self, text: str) -> None:
        length, angle = (klartext_number(self.dialect.numbers[key].decimals) for key in ("length", "angle"))
        letters = self.machine.letters
        words = "".join(f"(?: {letter}({length if letter in 'XYZ' else angle}))?" for letter in letters)
        move = re.compile(rf"L{words} R0 F(MAX|\d+)")
        lines, at, number = _lines(text), 0, int(self.dialect.numbering.get("first", 0))
        while at < len(lines):
            count = self.full_moves(lines, at, number)
            if count:
                at, number = at + count, number + count
                continue
            line, (block, at) = at + 1, self._block(lines, at, number)
            number += 1
            found = move.fullmatch(block)
            if self.ended and not block.startswith("END PGM"):
                raise self.wrong(line, "a block after the program's end")
            if found and any(found.groups()[:5]):
                values = {
                    letter: float(value)
                    for letter, value in zip(letters, found.groups(), strict=False)
                    if value is not None
                }
                feed = found[6]
                self.move(values, feed == "MAX", 0.0 if feed == "MAX" else float(feed), line)
            else:
                self._statement(block, line)

    def _block(self, lines: Sequence[str], at: int, number: int) -> tuple[str, int]:
        """The block from lines[at] on without its number, continuation lines joined, and where the next one
        begins."""
        found, _, block = lines[at].partition(" ")
        if found != str(number):
            raise self.wrong(at + 1, f"block number {number} expected, found {found!r}")
        start = at
        while block.endswith("~"):
            at += 1
            if at == len(lines):
                raise self.wrong(start + 1, "the last block is continued by nothing")
            block = block[:-1].rstrip() + " " + lines[at].strip()
        return block, at + 1

    def _statement(self, block: str, line: int) -> None:
        for pattern, effect in self.dialect.patterns:
            found = pattern.fullmatch(block)
            if found:
                self._effect(effect, found.groupdict(), line)
                return
        raise self.wrong(line, f"unknown block {block!r}")

    def _effect(self, effect: str, values: dict[str, str], line: int) -> None:
        if effect == "comment":
            self.comment(values["comment"], line)
        elif effect == "tool":
            if self.tool_centre:
                raise self.wrong(line, "tool call while tool-centre control is on")
            self.change(int(values["tool"]), line)
        elif effect == "retract":
            self.blocks += 1
            self.position[:3] = [None] * 3
        elif effect.startswith("tool-centre"):
            self.tool_centre = effect.endswith("on")
            # where the tip stands is only known again after the next move
            self.position[:3] = [None] * 3
        elif effect.startswith("short way"):
            self.short_way = effect.endswith("on")
        elif effect == "program end":
            self.ended = True
        elif effect == "begin" and line != 1:
            raise self.wrong(line, "the program begins twice")
        elif effect == "end" and not self.ended:
            raise self.wrong(line, "END PGM before the program end")

    # ISO

    def iso(self, text: str) -> None:
        comment, word = re.compile(r"\(([^()]*)\)"), re.compile(rf"([A-Z])({ISO_NUMBER})")
        lines = _lines(text)
        if lines[0] != "%" or lines[-1] != "%":
            raise ProgramError(
                "the program is not between two lines of %: the file is cut off", line=len(lines)
            )
        lines.pop()
        at = 1
        while at < len(lines):
            count = self.full_moves(lines, at, -1)
            if count:
                at += count
                continue
            content, at = lines[at], at + 1
            line = at
            found = comment.fullmatch(content)
            if found:
                self.comment(found[1], line)
                continue
            words = []
            for item in content.split():
                matched = word.fullmatch(item)
                if not matched:
                    raise self.wrong(line, f"{item!r} is no word")
                words.append((matched[1], matched[2]))
            self._iso_block(words, line)

    def _iso_block(self, words: list[tuple[str, str]], line: int) -> None:
        if self.ended:
            raise self.wrong(line, "a block after the program's end")
        effects = [self._code(letter + number, line) for letter, number in words if letter in "GM"]
        rest = [(letter, number) for letter, number in words if letter not in "GM"]
        values = dict(rest)
        if len(values) != len(rest):
            raise self.wrong(line, "a letter stands twice in one block")
        for letter in values:
            if letter not in self.machine.letters + "FSTP":
                raise self.wrong(line, f"unknown word {letter}{values[letter]}")
        axes = {letter: float(number) for letter, number in values.items() if letter in self.machine.letters}
        if "inverse_time" in effects or "per_minute" in effects:
            self.inverse_time = "inverse_time" in effects
        if "tool_change" in effects:
            self.change(int(values.get("T", "0")), line)
        if axes:
            if ("rapid" in effects) == ("feed" in effects):
                raise self.wrong(line, "an axis moves without G0 or G1")
            self.move(axes, "rapid" in effects, float(values.get("F", "0")), line)
        self.ended = self.ended or "program_end" in effects

    def _code(self, code: str, line: int) -> str:
        if code not in self.dialect.codes:
            raise self.wrong(line, f"unknown word {code}")
        return self.dialect.codes[code]


def _lines(text: str) -> list[str]:
    if not text.endswith("\n"):
        raise ProgramError("the last line is not ended: the file is cut off")
    return text[:-1].split("\n")
