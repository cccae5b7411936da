"""The air check of a program: one small turn of each rotary axis and what must be seen, from the machine file alone.

A control that turns an axis the other way, counts it from another zero or takes one axis for the other shows something
else than these sentences tell, before anything is cut. Of an axis that carries the part a mark on the table is watched,
of one that carries the tool the tip. Directions are those of the machine; they are told as seen from the middle of the
table, or from the pivot of the head, so that they hold wherever the axes lie.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.machine.axes import RotaryAxis
from bonecam.machine.control import Control
from bonecam.machine.kinematics import inverse_linear, tool_axes
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.axis_words import word_texts

TILT_DEG = 30.0
"""The turn of an axis that tilts, degrees: plainly seen, and within what most axes can."""
QUARTER_DEG = 90.0
"""The turn of an axis along the spindle, degrees: a mark goes from one axis of the machine to another."""
ALONG_SPINDLE = 0.9
"""An axis with such a share of Z turns about the spindle; below it, it tilts."""
SHOWN = 0.35
"""Components of a direction that are told, as a share of the largest."""
SEEN = np.sin(np.radians(1.0))
"""A unit vector that moves less is taken to stand still."""
ABOVE = 50.0
"""The place over the program's zero, where the tip is held, is so far above the blank, mm."""


def air_check_texts(control: Control, dialect: Dialect, top: float) -> list[str]:
    """What must be seen with all rotary axes at zero and as each turns, and of a control that reads machine coordinates
    poses that keep the tip on one place; lines of header and sheet. `top` is the upper end of the blank, mm."""
    machine = control.machine
    # The rotary joints (rad) at which the check begins
    start = np.array([turn_of(axis)[0] for axis in machine.rotary])
    # that along the spindle last: on a head it is seen by the tilt of the other
    tilting_first = sorted(machine.own_rotary, key=lambda axis: abs(axis.direction[2]) > ALONG_SPINDLE)
    return [
        "tool in the spindle, retracted, tool-centre control off, each axis driven by hand and back",
        "X+, Y+, Z+ are where the tool goes over the table as X, Y, Z grow",
        "marks on the table are watched from its middle",
        _square_text(machine, start),
        *(text for axis in tilting_first for text in _turn_texts(machine, axis, start)),
        *([] if control.tool_centre else _place_texts(control, dialect, start, float(np.ceil(top + ABOVE)))),
    ]


def _place_texts(control: Control, dialect: Dialect, start: Float[ndarray, "2"], height: float) -> list[str]:
    """Words that keep the tip on one place, `height` (mm) over the program's zero, as each axis turns: a pivot or an
    offset that is not the machine file's shows as a way of the tip. Poses beyond a limit of the spindle nose are left
    out."""
    machine = control.machine
    angles = [start, *(_turned(machine, start, axis) for axis in machine.own_rotary)]
    words = control.words(np.tile([0.0, 0.0, height], (len(angles), 1)), np.array(angles))
    nose = words[:, :3] + [0.0, 0.0, control.tool_length]
    low, high = np.array([axis.limits for axis in machine.linear]).T
    reached = np.all((nose >= low) & (nose <= high), axis=1)
    words[:, 3:] = np.degrees(words[:, 3:])
    message = f"the tip must be at one and the same place, {height:.0f} mm over program zero, in each of these poses"
    return [message, *(" ".join(word_texts(machine, dialect, row)) for row in words[reached])]


def turn_of(axis: RotaryAxis) -> tuple[float, float]:
    """From where to where (rad) an axis turns in the check: from zero, or the limit next to it, up where there is
    room."""
    low, high = axis.limits
    start = min(max(0.0, low), high)
    turn = np.radians(QUARTER_DEG if abs(axis.direction[2]) > ALONG_SPINDLE else TILT_DEG)
    if start + turn <= high:
        return start, start + turn
    if start - turn >= low:
        return start, start - turn
    return start, high if high - start >= start - low else low


def _turned(machine: Machine, start: Float[ndarray, "2"], *axes: RotaryAxis) -> Float[ndarray, "2"]:
    """The joints with some axes at the end of their turns."""
    joints = start.copy()
    for axis in axes:
        joints[machine.column(axis) - 3] = turn_of(axis)[1]
    return joints


def _in_machine(machine: Machine, vectors: Float[ndarray, "n 3"], rotary: Float[ndarray, "2"]) -> Float[ndarray, "n 3"]:
    """Directions fixed to the part, in the machine's frame."""
    positions = inverse_linear(machine, np.vstack([np.zeros(3), vectors]), np.tile(rotary, (len(vectors) + 1, 1)))
    return positions[1:, :3] - positions[0, :3]


def _part_frame(machine: Machine, rotary: Float[ndarray, "2"]) -> Float[ndarray, "3 3"]:
    """X, Y and Z of the part in the machine's frame, a row each."""
    return _in_machine(machine, np.eye(3), rotary)


def _tip_direction(machine: Machine, rotary: Float[ndarray, "2"]) -> Float[ndarray, "3"]:
    """The direction from the spindle to the tip in the machine's frame."""
    return -_in_machine(machine, tool_axes(machine, rotary[None]), rotary)[0]


def _square_text(machine: Machine, start: Float[ndarray, "2"]) -> str:
    """How the tool stands to the table before an axis turns."""
    tilt = np.degrees(np.arccos(np.clip(tool_axes(machine, start[None])[0, 2], -1.0, 1.0)))
    stands = "square to the table" if tilt < 1e-3 else f"{tilt:.3f} degrees from square to the table"
    at = " and ".join(f"{axis.letter} {_degrees(turn_of(axis)[0])}" for axis in machine.own_rotary)
    along = ""
    frame = _part_frame(machine, start)
    if np.allclose(frame, np.eye(3), atol=1e-9):
        along = ", X+ of the blank towards X+"
    elif not machine.stands:
        along = f", X+ of the blank towards {_words_of(frame[0])}, its Z+ towards {_words_of(frame[2])}"
    return f"at {at} the tool must stand {stands}{along}"


def _turn_texts(machine: Machine, axis: RotaryAxis, start: Float[ndarray, "2"]) -> list[str]:
    """What must be seen as one axis turns, and how the tool then stands on the table, if it leans."""
    if axis in machine.part_axes:
        seen = f"{_to(axis)}: {_mark_text(machine, axis, start)}"
    else:
        seen = _tip_text(machine, axis, start)
    end = _turned(machine, start, axis)
    # sides of the table are those that lie so with all axes at zero
    lean = machine.in_machine(tool_axes(machine, end[None]) * [1.0, 1.0, 0.0])[0]
    if np.linalg.norm(lean) < SEEN:
        return [seen]
    return [seen, f"{_to(axis)}: the tool, from tip to spindle, leans to {_words_of(lean)} of the table"]


def _mark_text(machine: Machine, axis: RotaryAxis, start: Float[ndarray, "2"]) -> str:
    """Where a mark on the X+ or Y+ side of the table goes, whichever moves more, as an axis turns the table."""
    end = _turned(machine, start, axis)
    turn = np.linalg.inv(_part_frame(machine, start)) @ _part_frame(machine, end)
    sides = np.eye(3)[:2]
    ways = np.array([_across(side, side @ turn) for side in sides])
    # rounded: of two that move equally far the first
    side = int(np.argmax(np.round(np.linalg.norm(ways, axis=1), 6)))
    return f"a mark at {_words_of(sides[side])} of the table must go to {_words_of(ways[side])}"


def _tip_text(machine: Machine, axis: RotaryAxis, start: Float[ndarray, "2"]) -> str:
    """Where the tip swings as an axis turns the tool; about the tool itself nothing is seen, the other axis then tilts
    it first."""
    end = _turned(machine, start, axis)
    before, after = _tip_direction(machine, start), _tip_direction(machine, end)
    if np.linalg.norm(_across(before, after)) > SEEN:
        return f"{_to(axis)}: the tip of the tool must swing to {_words_of(_across(before, after))}"
    others = [one for one in machine.own_rotary if one != axis]
    if not others:
        return f"{_to(axis)}: the tip of the tool stays where it is"
    (other,) = others
    before, after = (
        _tip_direction(machine, joints) * [1.0, 1.0, 0.0]
        for joints in (_turned(machine, start, other), _turned(machine, start, other, axis))
    )
    held = f"{other.letter} at {_degrees(turn_of(other)[1])} and {_to(axis)}"
    return f"{held}: the tip of the tool must swing from {_words_of(before)} to {_words_of(after)}"


def _across(before: Float[ndarray, "3"], after: Float[ndarray, "3"]) -> Float[ndarray, "3"]:
    """The part of a unit vector across what it was."""
    return np.asarray(after - (after @ before) * before)


def _words_of(vector: Float[ndarray, "3"]) -> str:
    """A direction in words, its largest component first: X+, or Y- and Z+."""
    sizes = np.round(np.abs(unit(vector[None])[0]), 6)
    message = [k for k in np.argsort(-sizes, kind="stable") if sizes[k] > SHOWN * sizes.max()]
    return " and ".join("XYZ"[k] + ("+" if vector[k] > 0 else "-") for k in message)


def _to(axis: RotaryAxis) -> str:
    """The turn of an axis in words."""
    start, end = turn_of(axis)
    begun = f" from {_degrees(start)}" if start else ""
    return f"{axis.letter}{begun} to {_degrees(end)}"


def _degrees(angle: float) -> str:
    """An angle (rad) in degrees with its sign, zero without one."""
    value = round(float(np.degrees(angle)), 3)
    return f"{value:+g}" if value else "0"
