"""From the text of a program back to moves.

Statements: blocks that a dialect knows by their whole text, and what they do.

Heidenhain Klartext: numbered blocks, moves as `L` blocks, all other blocks as the dialect's statements.

ISO 6983 (G code): blocks of letter-number words, with codes of letters alone and whole statements besides.

Reading an NC text back: from the dialect's grammar to moves, strictly.

Nothing of the writer is used: only the text, the machine, the dialect's [[statements]] or [codes], and the
cutters as the comments of the header (or the caller) describe them. An unknown word, a number in another
form, a block out of sequence, or a move without tool, feed or known modes is a ProgramError with its line.
"""

import re
from collections.abc import Sequence

import numpy as np

from bonecam.machine.control import Control
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.motions import (
    COMPONENTS,
    ISO_NUMBER,
    DirectionWords,
    ModalState,
    Motions,
    Tool,
    axis_words,
    endless_letters,
    endless_word_pattern,
    line_error,
    tool_number,
    turn_to,
    vector_move,
)
from bonecam.nc.schema import WHOLE, block_number, has_number, numbered_pattern, remark_on
from bonecam.text.numbers import shown


def is_statement(block: str, state: ModalState, line: int) -> bool:
    """Run a block if it is one of the dialect's statements; whether it is."""
    for pattern, statement in state.dialect.patterns:
        values = pattern.match(block)
        if values is None:
            continue
        # apply its effect (see `nc.dialect`)
        effect = statement.effect
        state.switch_spindle_and_coolant(effect)
        if effect == "comment":
            state.read_comment(values["comment"], line)
        elif effect == "tool":
            state.change_tool(tool_number(values["tool"], line), line)
            if "spindle" in values:
                state.speed = float(values["spindle"])
        elif effect == "retract":
            state.retract(line)
        elif effect == "machine position":
            state.park(float(values["x"]), float(values["y"]), line)
        elif effect.startswith("tool-centre"):
            state.switch_tool_centre(effect.endswith("on"))
        elif effect.startswith("short way"):
            state.endless.short_way = effect.endswith("on")
        elif effect == "tolerance":
            state.tolerance = float(values.get("tolerance") or np.inf)
        elif effect == "program end":
            state.ended = True
        elif effect == "begin" and line != (2 if state.dialect.grammar == "iso" and state.dialect.frame else 1):
            raise line_error(line, "the program begins twice")
        elif effect == "end" and not state.ended:
            raise line_error(line, "END PGM before the program end")
        state.stated.read(statement.states)
        return True
    return False


def run_klartext(lines: Sequence[str], state: ModalState) -> None:
    """Run the blocks of a program; ProgramError names the line of a block that is unknown or out of order."""
    # any of the five words in their order, then R0 and the feed, which are modal
    move = re.compile("L" + "".join(f"(?: {word})?" for word in _word_patterns(state)))
    ordinal = 0
    at = 0
    while at < len(lines):
        count, ordinal = state.run_full_moves(lines, at, ordinal)
        if count:
            at += count
            continue
        line = at + 1
        # the block without its number and with its continuation lines
        stated, _, block = lines[at].partition(" ")
        number = block_number(state.dialect.numbering, ordinal)
        if stated != str(number):
            raise line_error(line, f"block number {number} expected, found {shown(stated)}")
        at += 1
        while block.endswith("~"):
            if at == len(lines):
                raise line_error(line, "the last block is continued by nothing")
            block = block[:-1].rstrip() + " " + lines[at].strip()
            at += 1
        ordinal += 1
        if state.ended and not block.startswith("END PGM"):
            raise line_error(line, "a block after the program's end")
        _run_block(block, move, state, line)
    if state.ended and "END PGM" not in lines[-1]:
        raise line_error(len(lines), "the program is not closed by END PGM: the file is cut off")


def _run_block(block: str, move: re.Pattern[str], state: ModalState, line: int) -> None:
    """Run a block: a move or a statement, with a remark behind it or without."""
    vector = state.dialect.vector
    directed = re.fullmatch(vector_move(state.dialect, vector), block) if vector else None
    match = move.fullmatch(block)
    moves = directed or match
    feed = moves[moves.re.groups] if moves else None
    rate = None if feed in ("MAX", None) else float(feed)
    if directed:
        values = [float(text) for text in directed.groups()[1:-1]]
        turn_to(state, values[3:], line)
        state.move(dict(zip("XYZ", values, strict=False)), feed == "MAX", rate, line)
    elif match and any(match.groups()[:-2]):
        letters = state.machine.letters
        *numbers, uncompensated, _ = match.groups()
        words = {letter: float(text) for letter, text in zip(letters, numbers, strict=True) if text is not None}
        state.uncompensated |= uncompensated is not None
        if not state.uncompensated:
            raise line_error(line, "an axis moves before R0 is stated")
        state.move(words, feed == "MAX", rate, line)
    elif not is_statement(block, state, line):
        bare = block.partition(";")[0].rstrip()
        if bare in ("", block):
            raise line_error(line, _unknown(block, state))
        _run_block(bare, move, state, line)


def _unknown(block: str, state: ModalState) -> str:
    """What is not known in a block: of a move its first word that is none, or is out of its place."""
    name, *words = block.split(" ")
    if name != "L" or not words:
        return f"unknown block {shown(block)}{remark_on(block)}"
    parts = _word_patterns(state)
    for word in words:
        while parts and not re.fullmatch(parts[0], word):
            del parts[0]
        if not parts:
            return f"{shown(word)} in {shown(block)} is no word of this place, or not with the decimals that it needs"
        del parts[0]
    return f"{shown(block)} moves no axis"


def _word_patterns(state: ModalState) -> list[str]:
    """The patterns of the words of an `L` block, with their numbers in groups."""
    return [*axis_words(state.dialect, state.machine.letters), "(R0)", f"F(MAX|{WHOLE})"]


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
            letter, number = words[-1]
            word = letter + number
            if word not in self.dialect.effect_of:
                # the number of an axis or a parameter, as the control reads it
                if not number:
                    raise line_error(line, f"{shown(word)} is no word{remark_on(word)}")
                directed = letter in COMPONENTS and bool(self.directions.patterns)
                measured = letter in self.state.machine.letters + "F" or directed
                if not measured and letter not in PARAMETERS:
                    raise line_error(line, f"unknown word {word}{remark_on(word)}")
                if measured and self.point and "." not in number:
                    raise line_error(line, f"{word} has no decimal point: the control may read it as thousandths")
            if self.own_form and letter in self.endless:
                ways.add(short is not None)
        if len(ways) > 1:
            raise line_error(line, "one endless axis takes the short way, another one does not")
        self.state.endless.short_way = ways.pop() if ways else self.state.endless.short_way
        return words

    def _run_words(self, words: Words, line: int) -> None:
        state = self.state
        found = (self.dialect.effect_of.get(letter + number) for letter, number in words)
        effects = [effect for effect in found if effect]
        # the numbers of all words but codes, by letter
        rest = [(letter, number) for letter, number in words if letter + number not in self.dialect.effect_of]
        values = dict(rest)
        if len(values) != len(rest):
            raise line_error(line, "a letter stands twice in one block")
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
            state.speed = float(values["S"])
            if not state.speed > 0:
                raise line_error(line, f"S{values['S']} is no speed of the spindle")
        for effect in effects:
            state.switch_spindle_and_coolant(effect)
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
            machine = state.machine
            for axis in machine.part_axes:
                angle = state.position[machine.column(axis)]
                turned = None if angle is None else angle % 360.0 if axis.endless else angle
                if turned != 0.0:
                    where = "is not known" if angle is None else f"is {angle:.3f}"
                    why = f"{axis.letter} {where} where tool-centre control is switched on: it must stand at zero"
                    raise line_error(line, why)
        if "tool_length" not in self.dialect.effect_of.values():
            state.take_length(tool_number(values.get("H", "0"), line) if on else 0, line)
        state.switch_tool_centre(on)

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


def read_program(text: str, machine: Machine, dialect: Dialect, tools: Sequence[Tool] = ()) -> Motions:
    """The moves of a program; `tools` replace those in the header's comments. ProgramError names the line."""
    lines = text.removesuffix("\n").split("\n")
    longest = max(range(len(lines)), key=lambda at: len(lines[at]))
    if len(lines[longest]) > dialect.longest_line:
        why = f"it has {len(lines[longest])} characters, {dialect.name} loads {dialect.longest_line}: divide it"
        raise line_error(longest + 1, why)
    state = ModalState(machine, dialect, tools)
    if dialect.grammar == "klartext":
        run_klartext(lines, state)
    else:
        run_iso(lines, state)
    if not text.endswith("\n"):
        raise line_error(len(lines), "the last line is not ended: the file is cut off")
    return _motions(state, len(lines))


def _motions(state: ModalState, line: int) -> Motions:
    """All moves of a program; ProgramError where it has not ended in its last `line`."""
    if not state.ended:
        raise line_error(line, "the program has no end: its last blocks are missing")
    controls = {
        tool.number: Control(
            state.machine, state.dialect.tool_centre, tool.radius, tool.length, tool.radius, state.zero_height
        )
        for tool in state.tools.values()
    }
    table = state.table
    words = np.column_stack([table[:, :3], np.radians(table[:, 3:5])])
    numbers = table[:, 9].astype(np.int64)
    tips, axes = np.zeros((2, len(table), 3))
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
        links=(table[:, 11] == 1) & (table[:, 5] == 0),
        tips=tips,
        axes=axes,
        blocks=state.blocks,
        controls=controls,
        spindle=table[:, 12],
        coolant=table[:, 13] == 1,
        tolerances=table[:, 14],
        partial=tuple(state.partial),
        short_way=bool(state.endless.short_way),
        described=state.tools,
    )
