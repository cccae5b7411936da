"""Statements: blocks that a dialect knows by their whole text, and what they do."""

import numpy as np

from bonecam.nc.reading.line_error import line_error
from bonecam.nc.reading.modal_state import ModalState
from bonecam.nc.reading.tool_words import tool_number


def is_statement(block: str, state: ModalState, line: int) -> bool:
    """Run a block if it is one of the dialect's statements; whether it is."""
    for pattern, statement in state.dialect.patterns:
        match = pattern.match(block)
        if match is not None:
            _apply(statement.effect, match, state, line)
            state.stated.read(statement.states)
            return True
    return False


def _apply(effect: str, values: dict[str, str], state: ModalState, line: int) -> None:
    """Apply the effect of a statement (see `nc.dialect`) to the state."""
    state.spindle.apply(effect)
    if effect == "comment":
        state.read_comment(values["comment"], line)
    elif effect == "tool":
        state.change_tool(tool_number(values["tool"], line), line)
        if "spindle" in values:
            state.spindle.programmed = float(values["spindle"])
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
