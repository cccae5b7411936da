"""Words that turn the tool to a vector, in blocks that are read one by one."""

import re
from collections.abc import Sequence

import numpy as np

from bonecam.nc.reading.full_moves import ISO_NUMBER, POINTED_NUMBER
from bonecam.nc.reading.line_error import line_error
from bonecam.nc.reading.modal_state import ModalState
from bonecam.nc.tool_vectors import angles_from, vector_patterns

COMPONENTS = "IJK"
"""The components of a tool vector, as the reader calls them."""


def turn_to(state: ModalState, vector: Sequence[float], line: int) -> None:
    """Turn the rotary axes of the next move to a tool vector; ProgramError where they do not reach it."""
    angles = angles_from(state.machine, state.position[3:])(np.array([vector]))[0]
    if not state.tool_centre or np.isnan(angles).any():
        why = "it must be a unit vector that the axes reach from known angles, under tool-centre control"
        raise line_error(line, f"the tool vector {' '.join(f'{value:g}' for value in vector)}: {why}")
    state.position[3:] = angles.tolist()


class DirectionWords:
    """The words of tool vectors in blocks of letter-number words."""

    def __init__(self, state: ModalState) -> None:
        self.state = state
        vector = state.dialect.vector
        number = POINTED_NUMBER if state.dialect.decimal_point else ISO_NUMBER
        self.patterns = [re.compile(each) for each in vector_patterns(vector, number)] if vector else []

    def component(self, item: str) -> tuple[str, str] | None:
        """The component of a word, I, J or K, and its number; None where it is another word."""
        for letter, pattern in zip(COMPONENTS, self.patterns, strict=False):
            match = pattern.fullmatch(item)
            if match:
                return letter, match[1]
        return None

    def turn(self, axes: Sequence[str], values: dict[str, str], line: int) -> set[str]:
        """Turn to the vector of a block that moves `axes`, if it has one; the letters of its components. ProgramError
        where one is missing, or an angle stands beside it."""
        given = values.keys() & {*COMPONENTS}
        if not self.patterns or not given:
            return set()
        angles = sorted({*axes} - {*"XYZ"})
        if angles or len(given) < len(COMPONENTS):
            what = f"{angles[0]} stands beside a tool vector" if angles else "a component of the tool vector is missing"
            raise line_error(line, f"{what}: give all three, and no angle")
        turn_to(self.state, [float(values[letter]) for letter in COMPONENTS], line)
        return given
