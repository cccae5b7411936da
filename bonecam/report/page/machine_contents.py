"""What a page shows of a machine: its rotary axes, where they stand in each move, and what turns with them."""

from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.machine.machine import Machine


def rotary_angles(machine: Machine, words: Float[ndarray, "n 5"]) -> dict[str, Float[ndarray, " n"]]:
    """`move_angle_B` and so on: the angles of the rotary axes that the machine has, degrees, from joints in radians."""
    return {
        f"move_angle_{axis.letter}": np.degrees(words[:, machine.column(axis)]) for axis in machine.own_rotary
    }


def machine_facts(machine: Machine) -> dict[str, Any]:
    """`rotary`: the letters of its axes; `turning`: those that carry the part, from the part outward, and the place
    (mm) and the frame of the part in the machine, all axes at zero, as `bonecam.machine.kinematics` has them."""
    carrying = [axis for axis in machine.part_axes if axis.letter]
    return {
        "rotary": [axis.letter for axis in machine.own_rotary],
        "turning": {
            "axes": [[axis.letter, list(axis.direction), list(axis.pivot)] for axis in carrying],
            "zero": list(machine.part_zero),
            "frame": [list(row) for row in machine.part_frame],
        },
    }
