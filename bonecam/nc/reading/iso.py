"""ISO 6983 (G code): blocks of letter-number words between two lines of %."""

import re
from collections.abc import Sequence

from bonecam.errors import ProgramError
from bonecam.nc.reading.full_moves import ISO_NUMBER
from bonecam.nc.reading.modal_state import ModalState, line_error, tool_number
from bonecam.text.faults import shown

COMMENT = re.compile(r"\(([^()]*)\)")
WORD = re.compile(rf"([A-Z])({ISO_NUMBER})")


def run_iso(lines: Sequence[str], state: ModalState) -> None:
    """Run the blocks of a program; ProgramError names the line of a word that is unknown or out of place."""
    if lines[0] != "%" or lines[-1] != "%":
        why = "the program is not between two lines of %: the file is cut off"
        raise ProgramError(why, line=len(lines))
    blocks = lines[:-1]
    at = 1
    while at < len(blocks):
        count = state.run_full_moves(blocks, at, -1)
        if count:
            at += count
            continue
        content = blocks[at]
        at += 1
        comment = COMMENT.fullmatch(content)
        if comment:
            state.read_comment(comment[1], at)
        else:
            _run_block(_words(content, at), state, at)


def _words(content: str, line: int) -> list[tuple[str, str]]:
    """Letter and number of each word of a block."""
    words = []
    for item in content.split():
        found = WORD.fullmatch(item)
        if not found:
            raise line_error(line, f"{shown(item)} is no word")
        words.append((found[1], found[2]))
    return words


def _run_block(words: list[tuple[str, str]], state: ModalState, line: int) -> None:
    if state.ended:
        raise line_error(line, "a block after the program's end")
    effects = [_effect(letter + number, state, line) for letter, number in words if letter in "GM"]
    values = _values(words, state.machine.letters, line)
    if "inverse_time" in effects or "per_minute" in effects:
        state.inverse_time = "inverse_time" in effects
    if "tool_change" in effects:
        state.change_tool(tool_number(values.get("T", "0"), line), line)
    if "tool_length" in effects or "tool_length_off" in effects:
        state.take_length(tool_number(values.get("H", "0"), line), line)

    axes = {letter: float(text) for letter, text in values.items() if letter in state.machine.letters}
    if axes:
        if ("rapid" in effects) == ("feed" in effects):
            raise line_error(line, "an axis moves without G0 or G1")
        state.move(axes, "rapid" in effects, float(values.get("F", "0")), line)
    state.ended = state.ended or "program_end" in effects


def _values(words: list[tuple[str, str]], letters: str, line: int) -> dict[str, str]:
    """The numbers of all words but G and M, by letter; `letters` are those of the axes."""
    rest = [(letter, number) for letter, number in words if letter not in "GM"]
    values = dict(rest)
    if len(values) != len(rest):
        raise line_error(line, "a letter stands twice in one block")
    for letter in values:
        if letter not in letters + "FHSTP":
            raise line_error(line, f"unknown word {letter}{values[letter]}")
    return values


def _effect(code: str, state: ModalState, line: int) -> str:
    """What a G or M code does (see `nc.dialect`)."""
    if code not in state.dialect.codes:
        raise line_error(line, f"unknown word {code}")
    return state.dialect.codes[code]
