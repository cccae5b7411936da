"""A machine is data: a chain of axes, read from a TOML file.

How to add a machine: copy a file of `bonecam/machine/machines/` (name it, or give its path instead of a name) and
fill in
- `title`, `chain`: from the part outward to the tool, rotary letters and "XYZ" for the linear axes together:
  ["C", "B", "XYZ"] table/table (C carries the part, B carries C), ["C", "XYZ", "B"] head/table, ["XYZ", "C",
  "B"] head/head; one rotary letter makes a mill of four axes, ["A", "XYZ"]. Z is along the spindle, also where it lies;
- `part_x`, `part_z` (unit vectors): how X and Z of the part, whose Z leads from the table through post and part, lie
  in the machine with all axes at zero; [1, 0, 0] and [0, 0, 1] where they are left out, which is refused where the
  axis next to the part does not turn about that Z: a bar in a rotary axis along X has part_z = [1, 0, 0];
- `part_zero` (mm): the program's zero in the machine's frame, all axes at zero; `programmed_point`: "tip" or
  "centre"; `controller`: the dialect of its usual control, or a .toml file beside
  this one (heidenhain where it is left out); `tool_centre_control`: the dialect's name of it where
  the dialect has several; `spindle_speed` (1/min, optional): the highest; `spindle_lowest`: the lowest;
- `source`: where the figures are from; `assumed`: what is not known but taken so, a line each: those that speak of
  `speeds`, `accelerations`, `jerk`, `seconds` or all `figures` are told beside the times;
- [spindle]: `nose`, the cylinders and cones of the spindle behind the gauge line, where the holder ends, from there
  up: rows [length, diameter] or [length, diameter, upper diameter] (mm). What is farther up than the last row is
  taken to be out of reach: give as much of it as could come near table and chuck;
- [seconds] (optional), for the time of programs: `tool_change`, from chip to chip; `spindle_start`, to the working
  speed; `retract`, to the top of Z and back (`L M140 MB MAX`, `SUPA Z0`, `G28`) beyond the height that the program
  knows;
- [table] (optional): what the part stands on, z = 0 of the program being its top: `diameter` of a disc about the
  program's Z axis, or `width` and `depth` (along X and Y) of a plate in whose middle the program's zero is (mm);
  `beside`: "closed" (default), nothing of the tool goes below its plane, or "open", what is below the plane beside
  the table is free: only where no cradle, yoke or bed is in the way there; `standing`: what stands on the table
  round the Z axis all the time, rows as those of the nose, from the table up. Everything turns with the part; what
  does not (a cradle's cheek) must be inside a body of revolution given here, or below a closed plane;
- [[bodies]] (optional, any number up to 12): a closed mesh of a link, which every program is held against: `name`;
  `link`, what it moves with: a rotary letter, "XYZ" (what the linear axes carry, spindle and head), or "bed"; `stl`,
  a file beside this one; `units` ("mm", "cm", "m" or "inch"). Its place is that in the machine's frame, all axes at
  zero, as of pivots; of what XYZ carries it is measured from the spindle nose. Paths are planned round nose and
  table alone: give those so that they hold what is near the part;
- [X] [Y] [Z]: `speed` mm/min and either `limits` (lowest and highest mm of the spindle nose) or, where the
  place of the part on the machine is not known, `travel` (mm): then only the span of the program is checked;
  `acceleration` mm/s^2 and `jerk` mm/s^3 (both optional, a jerk only beside an acceleration);
- one table a rotary letter: `direction` (unit vector) and `pivot` (mm, any point on the axis; of a head axis:
  measured from the spindle nose), both with all axes at zero; `sign` (+1: a positive word turns what the axis
  carries by the right hand about `direction`, -1: the other way round, as most tilting tables do);
  `limits_deg`; `endless` (may wind, within limits_deg where they are given: then the words are those of the winding);
  `locked_deg` in the place of both, where the axis is clamped at this word; `speed_deg_s`;
  `acceleration_deg_s2` and `jerk_deg_s3` (optional, as above).
No formula belongs to a machine: `kinematics.py` composes the chain.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.machine.bodies import Frustum, LinkBody, MachineBodies, Table, stack_of
from bonecam.machine.machine_file import (
    LINEAR,
    BodiesTable,
    LinearAxis,
    LinearTable,
    MachineFile,
    RotaryAxis,
    RotaryTable,
    SecondsTable,
    Vector,
    read_table,
)
from bonecam.plugins import named_files

UPRIGHT: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""X, Y and Z of a part whose frame is parallel to the machine's."""
SECONDS = 60
"""Of a minute."""
TIME_WORDS = ("speed", "acceleration", "jerk", "second", "figures")
"""Words of what is assumed of a machine that matters to times."""
USUAL_SPINDLE = 24000.0
"""Speeds of cutters that a job leaves open are at most this where the machine's file states none, 1/min: those of motor
spindles of mills for moulds. A ball of 2 mm asks for 111,000 in aluminium."""
MACHINES = Path(__file__).parent / "machines"


@dataclass(frozen=True)
class Machine:
    """A machine of four or five axes. Joint arrays are (n, 5): X, Y, Z in mm, then the rotary axes in alphabetical
    order in radians, that without a letter last.

    `part_axes` carry the part, from the part outward; `tool_axes` carry the tool, from the base outward. `nose`
    is the spindle's stack behind the gauge line, empty where the file does not know it. The rows of `part_frame` are
    X, Y and Z of the part in the machine's frame, all axes at zero. Spindle speeds in 1/min. `seconds` are None where
    the file does not know them; `time_assumed` is what it assumes of figures that times are made of.
    """

    name: str
    title: str
    linear: tuple[LinearAxis, LinearAxis, LinearAxis]
    part_axes: tuple[RotaryAxis, ...]
    tool_axes: tuple[RotaryAxis, ...]
    part_zero: Vector
    programmed_point: str
    tool_centre_control: str
    controller: str = ""
    spindle_speed: float = math.inf
    nose: tuple[Frustum, ...] = ()
    table: Table = field(default_factory=Table)
    part_frame: tuple[Vector, Vector, Vector] = UPRIGHT
    spindle_lowest: float = 0.0
    link_bodies: tuple[LinkBody, ...] = ()
    seconds: SecondsTable | None = None
    time_assumed: tuple[str, ...] = ()

    @property
    def bodies(self) -> MachineBodies:
        """Spindle nose and table."""
        return MachineBodies(self.nose, self.table)

    @cached_property
    def rotary(self) -> tuple[RotaryAxis, RotaryAxis]:
        """The two rotary axes in alphabetical order: the order of joint columns 3 and 4 and of the words."""
        first, second = sorted(self.part_axes + self.tool_axes, key=lambda axis: (not axis.letter, axis.letter))
        return first, second

    @cached_property
    def accelerations(self) -> Float[ndarray, "5"]:
        """Of the joints, mm/min^2 and rad/min^2; infinite where they are not known."""
        return frozen([axis.acceleration for axis in (*self.linear, *self.rotary)])

    @property
    def knows_accelerations(self) -> bool:
        """Whether the accelerations of all its axes are known."""
        return bool(np.isfinite(self.accelerations[: len(self.letters)]).all())

    @cached_property
    def jerks(self) -> Float[ndarray, "5"]:
        """Of the joints, mm/min^3 and rad/min^3; infinite where not all of its axes' are known."""
        jerks = np.array([axis.jerk for axis in (*self.linear, *self.rotary)])
        return frozen(jerks if np.isfinite(jerks[: len(self.letters)]).all() else np.full(5, np.inf))

    @cached_property
    def own_rotary(self) -> tuple[RotaryAxis, ...]:
        """The rotary axes that the machine has, which are those with letters."""
        return tuple(axis for axis in self.rotary if axis.letter)

    @property
    def stands(self) -> bool:
        """Whether the part's frame is parallel to the machine's, all axes at zero."""
        return self.part_frame == UPRIGHT

    def in_machine(self, vectors: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Vectors of the part's frame in that of the machine, all axes at zero."""
        return vectors if self.stands else vectors @ np.array(self.part_frame)

    def in_part(self, vectors: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Vectors of the machine's frame in that of the part, all axes at zero."""
        return vectors if self.stands else vectors @ np.array(self.part_frame).T

    @cached_property
    def letters(self) -> str:
        """The axis letters in the order of the joints, such as XYZBC."""
        return LINEAR + "".join(axis.letter for axis in self.own_rotary)

    def column(self, axis: RotaryAxis) -> int:
        """The joint column (3 or 4) of a rotary axis."""
        return 3 + self.rotary.index(axis)


def machine_names() -> tuple[str, ...]:
    """The machines that come with bonecam, are the user's, or come with other packages."""
    return tuple(machine_files())


def machine_files() -> dict[str, Path]:
    """Their files by name."""
    return named_files("machines", MACHINES)


def read_machine(name: str | Path) -> Machine:
    """The machine of a name, or of a path to a TOML file; MachineError names file and every key that is wrong."""
    path, table = read_table("machine", name, machine_files(), MachineFile)
    chain: list[str] = list(table.chain)
    place = chain.index(LINEAR)
    x, y, z = (_linear(letter, getattr(table, letter)) for letter in LINEAR)
    part_axes, tool_axes = (
        tuple(_rotary(letter, getattr(table, letter)) for letter in side)
        for side in (chain[:place], chain[place + 1 :])
    )
    if len(part_axes) + len(tool_axes) == 1:
        tool_axes = (*tool_axes, _second_axis((*part_axes, *tool_axes)[0]))
    stand = table.table or BodiesTable()

    def half(size: float | None) -> float:
        return math.inf if size is None else size / 2

    return Machine(
        name=path.stem,
        title=table.title,
        linear=(x, y, z),
        part_axes=part_axes,
        tool_axes=tool_axes,
        part_zero=_vector(table.part_zero),
        programmed_point=table.programmed_point,
        tool_centre_control=table.tool_centre_control,
        controller=str(path.parent / table.controller) if table.controller.endswith(".toml") else table.controller,
        spindle_speed=math.inf if table.spindle_speed is None else table.spindle_speed,
        nose=stack_of(table.spindle.nose) if table.spindle else (),
        table=Table(
            half(stand.diameter), half(stand.width), half(stand.depth), stand.beside == "open", stack_of(stand.standing)
        ),
        part_frame=_part_frame(table),
        spindle_lowest=table.spindle_lowest,
        link_bodies=tuple(LinkBody(body.name, body.link, path.parent / body.stl, body.units) for body in table.bodies),
        seconds=table.seconds,
        time_assumed=tuple(text for text in table.assumed if any(word in text for word in TIME_WORDS)),
    )


def _second_axis(only: RotaryAxis) -> RotaryAxis:
    """The axis, locked at zero and without words, that turns the tool out of what the `only` one reaches."""
    across = np.cross(only.direction, UPRIGHT[2])
    length = float(np.linalg.norm(across))
    x, y, z = (across / length).tolist() if length > 1e-9 else UPRIGHT[0]
    return RotaryAxis("", (x, y, z), (0.0, 0.0, 0.0), (0.0, 0.0), endless=False, speed=math.inf)


def _part_frame(table: MachineFile) -> tuple[Vector, Vector, Vector]:
    """X, Y and Z of the part in the machine's frame."""
    if table.part_z is None or table.part_x is None:
        return UPRIGHT
    x, z = np.array(table.part_x), np.array(table.part_z)
    rows = [np.array(row) + 0.0 for row in (x, np.cross(z, x), z)]
    X, Y, Z = (_vector(row.tolist()) for row in rows)
    return X, Y, Z


def _vector(values: list[float]) -> Vector:
    x, y, z = values
    return x, y, z


def _linear(letter: str, table: LinearTable) -> LinearAxis:
    low, high = table.limits or (-math.inf, math.inf)
    travel = high - low if table.travel is None or table.limits else table.travel
    acceleration = _change(table.acceleration, 2)
    jerk = _change(table.jerk, 3)
    return LinearAxis(letter, (low, high), travel, table.speed, acceleration=acceleration, jerk=jerk)


def _rotary(letter: str, table: RotaryTable) -> RotaryAxis:
    x, y, z = table.direction
    length = math.hypot(x, y, z)
    sign = table.sign
    low, high = table.limits_deg or (-math.inf, math.inf)
    if table.locked_deg is not None:
        low = high = table.locked_deg
    return RotaryAxis(
        letter=letter,
        direction=(sign * x / length, sign * y / length, sign * z / length),
        pivot=_vector(table.pivot),
        limits=(math.radians(low), math.radians(high)),
        endless=table.endless,
        speed=math.radians(table.speed_deg_s) * SECONDS,
        acceleration=math.radians(_change(table.acceleration_deg_s2, 2)),
        jerk=math.radians(_change(table.jerk_deg_s3, 3)),
    )


def _change(per_second: float | None, power: int) -> float:
    """An acceleration or jerk per minute^power; infinite where it is not known."""
    return math.inf if per_second is None else per_second * SECONDS**power
