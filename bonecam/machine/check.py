"""What a machine file says, and what is taken for granted where it says nothing: for someone who writes one."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bonecam.machine.limits import farthest_side, polar_angles, reached_axes, tilt_band
from bonecam.machine.machine import USUAL_SPINDLE, Machine, machine_files, read_machine
from bonecam.machine.machine_file import PARALLEL, LinearAxis, MachineFile, RotaryAxis, read_table

LEAST_SPINDLE = 1000.0
"""Spindles that drive ball-ends turn faster, 1/min."""
LEAST_TRAVEL = 30.0
"""Mills travel farther, mm; in inches 30 is a large one."""
LEAST_SPEED = 1000.0
"""Axes are faster, mm/min: that of LinuxCNC's samples, the slowest that ship, is 1200."""
LEAST_TURN_DEG = 2 * math.pi
"""Rotary axes turn farther, degrees: a whole turn in radians."""
LEAST_TURN_SPEED_DEG_S = math.pi
"""Rotary axes turn faster, deg/s: half a turn a second in radians."""

LEAST_LEAN_DEG = 15.0
"""The tool leans so far for the sides of a part, degrees: 90 less the path.max_tilt_deg of a job that does not say."""
IN_FRONT = 1.0
"""A head axis so far in front of the spindle nose is where holder and tool are, mm."""
HORIZONTAL_BAND_DEG = 181.0
"""Lowest and highest lean of a tool that reaches as far below the horizontal as above it sum to 180, degrees; with
rounding."""


@dataclass(frozen=True)
class MachineCheck:
    """The machine of a file, the `source` of its figures, what its axes and its tool can do (`told`), what looks like
    another unit (`doubtful`), and what is `assumed`: what the file says is not known, and what it does not say; a line
    each."""

    machine: Machine
    source: str
    told: tuple[str, ...]
    doubtful: tuple[str, ...]
    assumed: tuple[str, ...]

    def __str__(self) -> str:
        lines = [f"machine   {self.machine.title}", *([f"source    {self.source}"] if self.source else [])]
        for name in ("told", "doubtful", "assumed"):
            lines += [f"{name if not k else '':10}{text}" for k, text in enumerate(getattr(self, name))]
        return "\n".join(lines)


def check_machine(name: str | Path) -> MachineCheck:
    """What is told and what is assumed of the machine of a name, or of a path to a TOML file; MachineError names file
    and every key that is wrong, or why paths cannot be planned for it."""
    _, file = read_table("machine", name, machine_files(), MachineFile)
    machine = read_machine(name)
    carries = [axis.letter for axis in machine.part_axes]
    heads = [axis.letter for axis in machine.tool_axes if axis.letter]
    under = f"the part on {' on '.join(carries)}" if carries else "the part on a fixed table"
    chain = f"{under}, the tool on {' with '.join(['X Y Z', *heads])}"
    facts = [chain, *map(_axis_text, machine.own_rotary), reach_text(machine)]
    assumed = (*file.assumed, *_unsaid(machine, file))
    asked = *_doubtful_figures(machine), *_doubtful_frame(machine), *_doubtful_chain(machine)
    # sides that the tool is not leant to are a question where nothing else is
    doubtful = asked or tuple(_doubtful_sides(machine))
    return MachineCheck(machine, " ".join(file.source.split()), tuple(facts), doubtful, assumed)


def _doubtful_figures(machine: Machine) -> Iterator[str]:
    """Figures that are so small as those of mills are in other units, each with a question."""
    if machine.spindle_speed < LEAST_SPINDLE:
        yield f"spindle_speed: {machine.spindle_speed:g} 1/min at most: is it in 1/s?"
    for axis in machine.linear:
        if axis.travel < LEAST_TRAVEL:
            yield f"{axis.letter}: a travel of {axis.travel:g} mm: is it in m or inch?"
        if axis.speed < LEAST_SPEED:
            yield f"{axis.letter}: a speed of {axis.speed:g} mm/min: is it in mm/s or m/min?"
    for turned in machine.own_rotary:
        low, high = np.degrees(turned.limits)
        if turned.bounded and not turned.locked and high - low < LEAST_TURN_DEG:
            yield f"{turned.letter}: it turns from {low:g} to {high:g} deg: are limits_deg in radians?"
        degrees = np.degrees(turned.speed) / 60
        if degrees < LEAST_TURN_SPEED_DEG_S:
            yield f"{turned.letter}: a speed of {degrees:g} deg/s: is it in rad/s?"


def _doubtful_frame(machine: Machine) -> Iterator[str]:
    """Pivots beyond all travel of the axes, and a tool that reaches more from below the part than from above: a wrong
    sign or part_z turns the table over."""
    farthest = math.hypot(*(axis.travel for axis in machine.linear))
    for axis in machine.part_axes:
        # the place of a pivot along its axis does not matter
        off = np.linalg.norm(np.cross(np.asarray(axis.pivot) - machine.part_zero, axis.direction))
        if off > farthest:
            yield f"{axis.letter}: its pivot is {off:g} mm off part_zero, farther than X Y Z travel: is it in mm?"
    band = tilt_band(machine)
    if band is None:
        median = float(np.median(polar_angles(reached_axes(machine).samples)))
        band = median, median
    low, high = np.degrees(band)
    if low + high > HORIZONTAL_BAND_DEG:
        letters = " ".join(axis.letter for axis in machine.rotary if not axis.locked)
        yield f"part_z: the tool comes more from below the part than from above: is it right, and sign of {letters}?"


def _doubtful_chain(machine: Machine) -> Iterator[str]:
    """Rotary axes in another order than machines have them, axes in front of the spindle nose, and a part that the nose
    never stands over."""
    upright = machine.in_part(np.array([axis.direction for axis in machine.part_axes]).reshape(-1, 3))[:, 2]
    along = np.abs(upright) > 1 - PARALLEL
    letters = [axis.letter for axis in machine.part_axes]
    if len(letters) == 2 and along[1] and not along[0]:
        turned = f"{letters[1]}, which turns about the part's Z, carries {letters[0]}"
        yield f"chain: {turned}: is it from the part outward, not {letters[1]}, {letters[0]}?"
    if not letters and not machine.stands:
        yield "chain: both axes carry the tool, yet part_z is not upright: is it from the part outward?"
    for axis in machine.tool_axes:
        if axis.letter and (ahead := -_height_at_spindle(axis)) > IN_FRONT:
            where = f"{ahead:g} mm in front of the spindle nose, where the tool is"
            yield f"{axis.letter}: its pivot is {where}: is it measured from the nose, up?"
    for linear, zero in zip(machine.linear, machine.part_zero, strict=True):
        low, high = linear.limits
        beyond = f"end at {high:g}, below" if high < zero else f"begin at {low:g}, above"
        if high < zero or (low > zero and linear.letter != "Z"):
            asked = "are they of the spindle nose, and is part_zero right?"
            yield f"{linear.letter}: its limits {beyond} part_zero {zero:g}: {asked}"


def _doubtful_sides(machine: Machine) -> Iterator[str]:
    """Sides of a part that the tool cannot be leant to, as `convert` refuses them."""
    band = tilt_band(machine)
    bounded = [axis.letter for axis in machine.own_rotary if axis.bounded]
    asked = f"limits_deg of {' '.join(bounded)}" if bounded else "part_z and direction"
    if band is not None and np.degrees(band[1]) < LEAST_LEAN_DEG:
        lean = f"the tool leans by {np.degrees(band[1]):g} deg at most, the sides of a part need {LEAST_LEAN_DEG:g}"
        yield f"rotary axes: {lean}: are {asked} right?"
    if band is None and np.degrees(farthest_side(reached_axes(machine).samples)) > 90 - LEAST_LEAN_DEG:
        yield f"rotary axes: the tool leans to some sides of the part only: are {asked} right?"


def _height_at_spindle(axis: RotaryAxis) -> float:
    """How far above the spindle nose an axis of the head comes nearest to the spindle's, mm."""
    across = np.array(axis.direction[:2])
    length = float(across @ across)
    along = -float(across @ axis.pivot[:2]) / length if length > PARALLEL else 0.0
    return axis.pivot[2] + along * axis.direction[2]


def _axis_text(axis: RotaryAxis) -> str:
    """How far a rotary axis turns, and what a positive word does."""
    low, high = np.degrees(axis.limits)
    room = "endless" if not axis.bounded else f"{low:g} to {high:g} deg"
    if axis.locked:
        room = f"locked at {low:g} deg"
    x, y, z = (f"{value + 0.0:.4g}" for value in axis.direction)
    return f"{axis.letter}: {room}, a positive word turns what it carries by the right hand about ({x}, {y}, {z})"


def reach_text(machine: Machine) -> str:
    """The tool axes that a machine has, in words; MachineError where it has a single one."""
    band = tilt_band(machine)
    if band is not None:
        low, high = np.degrees(band)
        angles = f"{low:g} to {high:g} deg" if low < high else f"{low:g} deg"
        return f"the tool leans from the part's Z by {angles}, all round"
    samples = reached_axes(machine).samples
    low, high = np.degrees([polar_angles(samples).min(), polar_angles(samples).max()])
    free = sum(not axis.locked for axis in machine.rotary)
    kind = "a region" if free == 2 else "a curve"
    return f"the tool leans from the part's Z by {low:.4g} to {high:.4g} deg, not all round: {kind} of directions"


def _unsaid(machine: Machine, file: MachineFile) -> list[str]:
    """What a machine file leaves out, and what is taken in its place."""
    unknown = [axis.letter for axis in machine.linear if not math.isfinite(axis.limits[0])]
    axes: list[LinearAxis | RotaryAxis] = [*machine.linear, *machine.own_rotary]
    slow = [axis.letter for axis in axes if not math.isfinite(axis.acceleration)]
    texts = {
        "part_x, part_z: X and Z of the part lie along X and Z of the machine": file.part_x is None,
        "part_zero: the program's zero is the zero of the machine": "part_zero" not in file.model_fields_set,
        f"spindle_speed: cutters without a speed turn at {USUAL_SPINDLE:g} at most": file.spindle_speed is None,
        "spindle.nose: no spindle is kept clear of anything": file.spindle is None,
        "table: it has no edge, nothing of the tool goes below it": file.table is None,
        f"limits of {' '.join(unknown)}: only the span of a program is checked, not its place": bool(unknown),
        f"acceleration of {' '.join(slow)}: they start and stop at once": bool(slow),
        "seconds: tool changes, spindle starts and retracts take no time": file.seconds is None,
    }
    return [text for text, missing in texts.items() if missing]
