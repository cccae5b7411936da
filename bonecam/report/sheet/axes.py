"""What the axes of the machine travel in a program, read back from its text."""

from dataclasses import dataclass

import numpy as np

from bonecam.machine.axes import RotaryAxis
from bonecam.machine.kinematics import inverse_linear
from bonecam.machine.machine import Machine
from bonecam.nc.reading.motions import Motions


@dataclass(frozen=True)
class AxisRange:
    """Lowest and highest value of an axis: mm of the spindle nose with the planned tool lengths, degrees unwound; and
    the room there is, in words."""

    letter: str
    low: float
    high: float
    room: str


def axis_ranges(motions: Motions, machine: Machine) -> list[AxisRange]:
    """The range of every axis over all moves to known places."""
    lengths = {number: control.tool_length for number, control in motions.controls.items()}
    parts = []
    for number in np.unique(motions.tools).tolist():
        moves = motions.tools == number
        nose = inverse_linear(machine, motions.tips[moves], motions.words[moves, 3:], lengths[number])
        nose[:, 2] += lengths[number]
        parts.append(nose)
    joints = np.vstack(parts)
    joints[:, 3:] = np.degrees(joints[:, 3:])
    lows, highs = joints.min(axis=0), joints.max(axis=0)
    rooms = [*(f"{axis.travel:g} mm of travel" for axis in machine.linear), *map(_room, machine.own_rotary)]
    return [
        AxisRange(letter, float(low), float(high), room)
        for letter, low, high, room in zip(machine.letters, lows, highs, rooms, strict=False)
    ]


def _room(axis: RotaryAxis) -> str:
    """The limits of a rotary axis in words."""
    low, high = np.degrees(axis.limits)
    if axis.endless and not np.isfinite(low):
        return "endless"
    return f"{low:g} to {high:g} degrees"
