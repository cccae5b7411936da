"""Heidenhain Klartext: numbered blocks, moves as `L` blocks, all other blocks as the dialect's statements."""

import re
from collections.abc import Sequence

from bonecam.nc.reading.directions import turn_to
from bonecam.nc.reading.full_moves import axis_words, vector_move
from bonecam.nc.reading.line_error import line_error
from bonecam.nc.reading.modal_state import ModalState
from bonecam.nc.reading.statements import is_statement
from bonecam.nc.schema.code_meanings import remark_on
from bonecam.nc.schema.numbering import WHOLE, block_number
from bonecam.text.faults import shown


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
        block, at = _block(lines, at, block_number(state.dialect.numbering, ordinal))
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
    if directed:
        _run_vector_move(directed, state, line)
    elif match and any(match.groups()[:-2]):
        letters = state.machine.letters
        *numbers, uncompensated, feed = match.groups()
        words = {letter: float(text) for letter, text in zip(letters, numbers, strict=True) if text is not None}
        state.uncompensated |= uncompensated is not None
        if not state.uncompensated:
            raise line_error(line, "an axis moves before R0 is stated")
        state.move(words, feed == "MAX", None if feed in ("MAX", None) else float(feed), line)
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


def _run_vector_move(match: re.Match[str], state: ModalState, line: int) -> None:
    *numbers, feed = match.groups()[1:]
    values = [float(text) for text in numbers]
    turn_to(state, values[3:], line)
    words = dict(zip("XYZ", values, strict=False))
    state.move(words, feed == "MAX", None if feed in ("MAX", None) else float(feed), line)


def _block(lines: Sequence[str], at: int, number: int) -> tuple[str, int]:
    """The block from lines[at] on, without its number and with its continuation lines, and the index of the
    next."""
    stated, _, block = lines[at].partition(" ")
    if stated != str(number):
        raise line_error(at + 1, f"block number {number} expected, found {shown(stated)}")
    start = at
    while block.endswith("~"):
        at += 1
        if at == len(lines):
            raise line_error(start + 1, "the last block is continued by nothing")
        block = block[:-1].rstrip() + " " + lines[at].strip()
    return block, at + 1
