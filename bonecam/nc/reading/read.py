"""Reading an NC text back: from the dialect's grammar to moves, strictly.

Nothing of the writer is used: only the text, the machine, the dialect's [[statements]] or [codes], and the
cutters as the comments of the header (or the caller) describe them. An unknown word, a number in another
form, a block out of sequence, or a move without tool, feed or known modes is a ProgramError with its line.
"""

from collections.abc import Sequence

from bonecam.machine.control import Control
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.iso import run_iso
from bonecam.nc.reading.klartext import run_klartext
from bonecam.nc.reading.line_error import line_error
from bonecam.nc.reading.modal_state import ModalState
from bonecam.nc.reading.motions import Motions, Tool, motions_of


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
            state.machine, state.dialect.tool_centre, tool.envelope.radius, tool.length, tool.envelope.height
        )
        for tool in state.tools.values()
    }
    short_way = bool(state.endless.short_way)
    return motions_of(
        state.table, controls, blocks=state.blocks, partial=state.partial, short_way=short_way, described=state.tools
    )
