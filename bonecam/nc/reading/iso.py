"""ISO 6983 (G code): blocks of letter-number words, with codes of letters alone and whole statements besides."""

import re
from collections.abc import Sequence

import numpy as np

from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.directions import COMPONENTS, DirectionWords
from bonecam.nc.reading.full_moves import ISO_NUMBER, endless_letters, endless_word_pattern
from bonecam.nc.reading.line_error import line_error
from bonecam.nc.reading.modal_state import ModalState
from bonecam.nc.reading.statements import is_statement
from bonecam.nc.reading.tool_words import tool_number
from bonecam.nc.schema.code_meanings import remark_on
from bonecam.nc.schema.numbering import block_number, has_number, numbered_pattern
from bonecam.text.faults import shown

WORD = re.compile(rf"([A-Z])({ISO_NUMBER})")
PARAMETERS = "FHSTP"
"""The letters of words that are neither axes nor codes."""
Words = list[tuple[str, str]]
"""Letter and number of each word of a block; a code of letters alone has no number."""


def run_iso(lines: Sequence[str], state: ModalState) -> None:
    """Run the blocks of a program; ProgramError names the line of a word that is unknown or out of place."""
    frame = state.dialect.frame
    if frame and lines[0] != frame:
        raise line_error(1, f"a line of {frame} is missing, with which a program of {state.dialect.title} begins")
    closed = not frame or (lines[-1] == frame and len(lines) > 1)
    blocks = lines[:-1] if frame and closed else lines
    reader = _BlockReader(state)
    at = 1 if frame else 0
    ordinal = 0
    while at < len(blocks):
        count, ordinal = state.run_full_moves(blocks, at, ordinal)
        if count:
            at += count
            continue
        at += 1
        ordinal = reader.run(blocks[at - 1], ordinal, at)
    if not closed:
        raise line_error(len(lines), f"the program does not end with a line of {frame}: the file is cut off")


class _BlockReader:
    """Reads blocks one at a time, into a `state`."""

    def __init__(self, state: ModalState) -> None:
        self.state = state
        self.dialect: Dialect = state.dialect
        self.numbered = re.compile(numbered_pattern(self.dialect.numbering, "(.*)"))
        before, _, behind = self.dialect.comment.partition("{text}")
        inner = "[^()]*" if behind else ".*"
        self.comment = re.compile(f"{re.escape(before)}({inner}){re.escape(behind)}")
        self.remark = re.compile(f"(.*?) *{re.escape(before.rstrip())}{inner}{re.escape(behind)}")
        self.point = self.dialect.decimal_point
        lengths = [code for code, effect in self.dialect.effect_of.items() if effect == "tool_length"]
        self.by_edge = any(code.startswith("D") for code in lengths)
        self.directions = DirectionWords(state)
        self.endless = endless_letters(state.machine)
        self.own_form = self.dialect.has_own_form and bool(self.endless)
        self.short_word = re.compile(endless_word_pattern(self.dialect, f"([{self.endless or 'C'}])"))

    def run(self, content: str, ordinal: int, line: int) -> int:
        """Run one line; returns how many numbered blocks there are before the next."""
        if has_number(content, self.dialect.numbering):
            number = str(block_number(self.dialect.numbering, ordinal))
            match = self.numbered.fullmatch(content)
            if match is None or match[1] != number:
                wanted = (self.dialect.numbering.format or "").format(number=number, text="").strip()
                stated = shown(content.split(" ")[0])
                raise line_error(line, f"block number {wanted} expected, found {stated}")
            content = match[2]
            ordinal += 1
        comment = self.comment.fullmatch(content)
        if comment:
            self.state.read_comment(comment[1], line)
            return ordinal
        remarked = self.remark.fullmatch(content)
        content = remarked[1] if remarked else content
        if self.state.ended:
            raise line_error(line, "a block after the program's end")
        if not is_statement(content, self.state, line):
            self._run_words(self._words(content, line), line)
        return ordinal

    def _words(self, content: str, line: int) -> Words:
        """The words of a block. The form of the words of endless axes says which way they turn."""
        words: Words = []
        ways = set()
        for item in content.split():
            short = self.short_word.fullmatch(item) if self.own_form else None
            match = short or WORD.fullmatch(item)
            words.append(self.directions.component(item) or ((match[1], match[2]) if match else (item, "")))
            self._check_known(*words[-1], line)
            if self.own_form and words[-1][0] in self.endless:
                ways.add(short is not None)
        if len(ways) > 1:
            raise line_error(line, "one endless axis takes the short way, another one does not")
        self.state.endless.short_way = ways.pop() if ways else self.state.endless.short_way
        return words

    def _check_known(self, letter: str, number: str, line: int) -> None:
        """ProgramError where a word is neither a code of the dialect, nor one of an axis or parameter with a number
        as the control reads it."""
        word = letter + number
        if word in self.dialect.effect_of:
            return
        if not number:
            raise line_error(line, f"{shown(word)} is no word{remark_on(word)}")
        directed = letter in COMPONENTS and bool(self.directions.patterns)
        measured = letter in self.state.machine.letters + "F" or directed
        if not measured and letter not in PARAMETERS:
            raise line_error(line, f"unknown word {word}{remark_on(word)}")
        if measured and self.point and "." not in number:
            raise line_error(line, f"{word} has no decimal point: the control may read it as thousandths")

    def _run_words(self, words: Words, line: int) -> None:
        state = self.state
        found = (self.dialect.effect_of.get(letter + number) for letter, number in words)
        effects = [effect for effect in found if effect]
        values = self._values(words, line)
        if "inverse_time" in effects or "per_minute" in effects:
            state.inverse_time = "inverse_time" in effects
            state.feed = np.nan
        if "incremental" in effects or "absolute" in effects:
            state.incremental = "incremental" in effects
        if "T" in values:
            state.selected = tool_number(values["T"], line)
        if "tool_change" in effects:
            state.change_tool(state.selected, line)
        if "tool_length" in effects or "tool_length_off" in effects:
            # by H of the tool, or by D of the one in the spindle
            by_edge = self.by_edge and "tool_length" in effects
            state.take_length(state.tool if by_edge else tool_number(values.get("H", "0"), line), line)
        if "S" in values:
            state.spindle.programmed = float(values["S"])
            if not state.spindle.programmed > 0:
                raise line_error(line, f"S{values['S']} is no speed of the spindle")
        for effect in effects:
            state.spindle.apply(effect)
        if "tolerance" in effects:
            state.tolerance = float(values.get("P", "inf"))
        self._switch_tool_centre(effects, values, line)
        for letter, number in words:
            state.stated.read(letter + number)

        takes_length = not {"tool_length", "tool_centre_on"}.isdisjoint(effects)
        axes = {letter: float(text) for letter, text in values.items() if letter in state.machine.letters}
        if "machine_coordinates" in effects or "reference_return" in effects:
            self._retract(effects, axes, line)
        elif not axes:
            taken = {"H": takes_length, "P": any(letter == "G" for letter, _ in words)}
            for letter, known in taken.items():
                if letter in values and not known:
                    raise line_error(line, f"{letter}{values[letter]} stands without a code that takes it")
        else:
            if ("rapid" in effects) == ("feed" in effects):
                raise line_error(line, "an axis moves without G0 or G1")
            turned = self.directions.turn(list(axes), values, line)
            stray = values.keys() - axes.keys() - turned - {"F", *"H" * takes_length}
            if stray:
                raise line_error(line, f"{min(stray)} stands in a block that moves axes")
            state.move(axes, "rapid" in effects, float(values["F"]) if "F" in values else None, line)
        state.ended = "program_end" in effects

    def _switch_tool_centre(self, effects: list[str], values: dict[str, str], line: int) -> None:
        """Switch tool-centre control; where no other code does it, that takes the length of a tool, by H, or drops
        it."""
        state = self.state
        on, off = "tool_centre_on" in effects, "tool_centre_off" in effects
        if on and off:
            raise line_error(line, "tool-centre control is switched on and off in one block")
        if not on and not off:
            return
        if on and self.dialect.starts_at_zero:
            self._check_zero(line)
        if "tool_length" not in self.dialect.effect_of.values():
            state.take_length(tool_number(values.get("H", "0"), line) if on else 0, line)
        state.switch_tool_centre(on)

    def _check_zero(self, line: int) -> None:
        """ProgramError where a rotary axis that carries the part does not stand at zero, or it is not known where."""
        machine = self.state.machine
        for axis in machine.part_axes:
            angle = self.state.position[machine.column(axis)]
            turned = None if angle is None else angle % 360.0 if axis.endless else angle
            if turned != 0.0:
                where = "is not known" if angle is None else f"is {angle:.3f}"
                why = f"{axis.letter} {where} where tool-centre control is switched on: it must stand at zero"
                raise line_error(line, why)

    def _retract(self, effects: list[str], axes: dict[str, float], line: int) -> None:
        """A rapid to the machine's zero of Z, or to its reference position: the tool is above everything, where its tip
        is in the part is not known. Or one of the retracted tool to X and Y of the machine."""
        state = self.state
        if "machine_coordinates" in effects and state.incremental:
            raise line_error(line, "machine coordinates by increments: switch to absolute words before")
        if axes.keys() == {"X", "Y"} and {"machine_coordinates", "rapid"} <= {*effects}:
            state.park(axes["X"], axes["Y"], line)
            return
        if axes == {"X": 0.0, "Y": 0.0} and "reference_return" in effects and state.incremental:
            state.park(np.nan, np.nan, line)
            return
        if state.tool_centre:
            raise line_error(line, "machine coordinates while tool-centre control is on")
        by_reference = "reference_return" in effects
        allowed = state.incremental if by_reference else self.by_edge and "rapid" in effects
        if not allowed or "feed" in effects or axes != {"Z": 0.0}:
            known = "a rapid of the retracted tool to X and Y" + (" or to Z0" if self.by_edge else "")
            known = "a return of Z0 by increments" if by_reference else known
            raise line_error(line, f"in machine coordinates nothing but {known} is known")
        if self.by_edge and state.length_of:
            raise line_error(line, f"a retract with the length of tool {state.length_of}: switch it off (D0)")
        state.retract(line, np.nan if by_reference else 0.0)

    def _values(self, words: Words, line: int) -> dict[str, str]:
        """The numbers of all words but codes, by letter."""
        rest = [(letter, number) for letter, number in words if letter + number not in self.dialect.effect_of]
        values = dict(rest)
        if len(values) != len(rest):
            raise line_error(line, "a letter stands twice in one block")
        return values
