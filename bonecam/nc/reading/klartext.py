"""Heidenhain Klartext: numbered blocks, moves as `L` blocks, all other blocks as the dialect's statements."""

import re
from collections.abc import Sequence

from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.full_moves import WHOLE, klartext_number
from bonecam.nc.reading.modal_state import ModalState, line_error, tool_number
from bonecam.text.faults import shown


def run_klartext(lines: Sequence[str], state: ModalState) -> None:
    """Run the blocks of a program; ProgramError names the line of a block that is unknown or out of order."""
    move = _move_pattern(state.dialect, state.machine.letters)
    number = state.dialect.numbering.first
    at = 0
    while at < len(lines):
        count = state.run_full_moves(lines, at, number)
        if count:
            at += count
            number += count
            continue
        line = at + 1
        block, at = _block(lines, at, number)
        number += 1
        if state.ended and not block.startswith("END PGM"):
            raise line_error(line, "a block after the program's end")
        found = move.fullmatch(block)
        if found and any(found.groups()[:5]):
            _run_move(found, state, line)
        else:
            _run_statement(block, state, line)
    if state.ended and "END PGM" not in lines[-1]:
        raise line_error(len(lines), "the program is not closed by END PGM: the file is cut off")


def _move_pattern(dialect: Dialect, letters: str) -> re.Pattern[str]:
    """The pattern of an `L` block: any of the five words in their order, then the feed."""
    length = klartext_number(dialect.numbers["length"].decimals)
    angle = klartext_number(dialect.numbers["angle"].decimals)
    words = "".join(f"(?: {letter}({length if letter in 'XYZ' else angle}))?" for letter in letters)
    return re.compile(rf"L{words} R0 F(MAX|{WHOLE})")


def _run_move(found: re.Match[str], state: ModalState, line: int) -> None:
    letters = state.machine.letters
    words = {
        letter: float(text) for letter, text in zip(letters, found.groups(), strict=False) if text is not None
    }
    rapid = found[6] == "MAX"
    state.move(words, rapid, 0.0 if rapid else float(found[6]), line)


def _block(lines: Sequence[str], at: int, number: int) -> tuple[str, int]:
    """The block from lines[at] on, without its number and with its continuation lines, and the index of the
    next."""
    found, _, block = lines[at].partition(" ")
    if found != str(number):
        raise line_error(at + 1, f"block number {number} expected, found {shown(found)}")
    start = at
    while block.endswith("~"):
        at += 1
        if at == len(lines):
            raise line_error(start + 1, "the last block is continued by nothing")
        block = block[:-1].rstrip() + " " + lines[at].strip()
    return block, at + 1


def _run_statement(block: str, state: ModalState, line: int) -> None:
    for pattern, effect in state.dialect.patterns:
        found = pattern.match(block)
        if found is not None:
            _apply(effect, found, state, line)
            return
    raise line_error(line, f"unknown block {shown(block)}")


def _apply(effect: str, values: dict[str, str], state: ModalState, line: int) -> None:
    """Apply the effect of a statement (see `nc.dialect`) to the state."""
    if effect == "comment":
        state.read_comment(values["comment"], line)
    elif effect == "tool":
        if state.tool_centre:
            raise line_error(line, "tool call while tool-centre control is on")
        state.change_tool(tool_number(values["tool"], line), line)
    elif effect == "retract":
        state.blocks += 1
        state.forget_tip()
    elif effect.startswith("tool-centre"):
        state.tool_centre = effect.endswith("on")
        state.forget_tip()
    elif effect.startswith("short way"):
        state.short_way = effect.endswith("on")
    elif effect == "program end":
        state.ended = True
    elif effect == "begin" and line != 1:
        raise line_error(line, "the program begins twice")
    elif effect == "end" and not state.ended:
        raise line_error(line, "END PGM before the program end")
