"""What a page shows of a machine: its rotary axes, where they stand in each move, and what they carry."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.machine.axes import RotaryAxis
from bonecam.machine.machine import Machine


def rotary_angles(machine: Machine, words: Float[ndarray, "n 5"]) -> dict[str, Float[ndarray, " n"]]:
    """`move_angle_B` and so on: the angles of the rotary axes that the machine has, degrees, from joints in radians."""
    return {
        f"move_angle_{axis.letter}": np.degrees(words[:, machine.column(axis)]) for axis in machine.own_rotary
    }


def machine_facts(machine: Machine) -> dict[str, Any]:
    """`rotary`: the letters of its axes; `kinematics`: those that carry the part, from the part outward, those of the
    head, from the base outward, and the place (mm) and the frame of the part in the machine, all axes at zero, as
    `bonecam.machine.kinematics` has them."""
    return {
        "rotary": [axis.letter for axis in machine.own_rotary],
        "kinematics": {
            "table": _axes(machine.part_axes),
            "head": _axes(machine.tool_axes),
            "zero": list(machine.part_zero),
            "frame": [list(row) for row in machine.part_frame],
        },
    }


def _axes(axes: Sequence[RotaryAxis]) -> list[list[Any]]:
    """Letter, direction and pivot (mm) of those that have a letter; the others stand at zero."""
    return [[axis.letter, list(axis.direction), list(axis.pivot)] for axis in axes if axis.letter]
