"""A machine is data: a chain of axes, read from a TOML file.

How to add a machine: copy a file of `bonecam/machine/machines/` (name it, or give its path instead of a name) and
fill in
- `title`, `chain`: from the part outward to the tool, rotary letters and "XYZ" for the linear axes together:
  ["C", "B", "XYZ"] table/table (C carries the part, B carries C), ["C", "XYZ", "B"] head/table, ["XYZ", "C",
  "B"] head/head;
- `part_zero` (mm): the program's zero in the machine's frame, all axes at zero; `programmed_point`: "tip" or
  "centre"; `tool_centre_control`: the dialect's name of it where the dialect has several; `spindle_speed`
  (1/min, optional): the highest;
- [spindle]: `nose`, the cylinders and cones of the spindle behind the gauge line, where the holder ends, from there
  up: rows [length, diameter] or [length, diameter, upper diameter] (mm). What is farther up than the last row is
  taken to be out of reach: give as much of it as could come near table and chuck;
- [table] (optional): what the part stands on, z = 0 of the program being its top: `diameter` of a disc about the
  program's Z axis, or `width` and `depth` (along X and Y) of a plate in whose middle the program's zero is (mm);
  `beside`: "closed" (default), nothing of the tool goes below its plane, or "open", what is below the plane beside
  the table is free: only where no cradle, yoke or bed is in the way there; `standing`: what stands on the table
  round the Z axis all the time, rows as those of the nose, from the table up. Everything turns with the part; what
  does not (a cradle's cheek) must be inside a body of revolution given here, or below a closed plane;
- [X] [Y] [Z]: `speed` mm/min and either `limits` (lowest and highest mm of the spindle nose) or, where the
  place of the part on the machine is not known, `travel` (mm): then only the span of the program is checked;
- one table a rotary letter: `direction` (unit vector) and `pivot` (mm, any point on the axis; of a head axis:
  measured from the spindle nose), both with all axes at zero; `sign` (+1: a positive word turns what the axis
  carries by the right hand about `direction`, -1: the other way round, as most tilting tables do);
  `limits_deg`; `endless` (may wind, within limits_deg where they are given: then the words are those of the winding);
  `speed_deg_s`.
No formula belongs to a machine: `kinematics.py` composes the chain.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from bonecam.machine.bodies import MachineBodies, Table
from bonecam.machine.frustum import Frustum, stack_of
from bonecam.machine.machine_file import LINEAR, BodiesTable, LinearTable, MachineFile, RotaryTable
from bonecam.machine.tables import names_in, read_table

Vector = tuple[float, float, float]
MACHINES = Path(__file__).parent / "machines"


@dataclass(frozen=True)
class LinearAxis:
    """One of X, Y, Z: limits of the spindle nose in mm (infinite where unknown), travel in mm, speed in
    mm/min."""

    letter: str
    limits: tuple[float, float]
    travel: float
    speed: float


@dataclass(frozen=True)
class RotaryAxis:
    """A rotary axis; `direction` already carries the sign: a positive angle turns what it carries
    right-handed about it.

    Limits in radians, speed in rad/min. `endless`: the axis may wind; its limits, if any, bound the winding.
    """

    letter: str
    direction: Vector
    pivot: Vector
    limits: tuple[float, float]
    endless: bool
    speed: float

    @property
    def bounded(self) -> bool:
        """Whether it has limits."""
        return math.isfinite(self.limits[0])

    @property
    def has_choice(self) -> bool:
        """Whether its limits are a turn or more apart: it can stand in some direction in more than one turn."""
        return bool(self.bounded and self.limits[1] - self.limits[0] >= 2 * math.pi * (1 - 1e-9))


@dataclass(frozen=True)
class Machine:
    """A five-axis machine. Joint arrays are (n, 5): X, Y, Z in mm, then the rotary axes in alphabetical order
    in radians.

    `part_axes` carry the part, from the part outward; `tool_axes` carry the tool, from the base outward. `nose`
    is the spindle's stack behind the gauge line, empty where the file does not know it.
    """

    name: str
    title: str
    linear: tuple[LinearAxis, LinearAxis, LinearAxis]
    part_axes: tuple[RotaryAxis, ...]
    tool_axes: tuple[RotaryAxis, ...]
    part_zero: Vector
    programmed_point: str
    tool_centre_control: str
    spindle_speed: float = math.inf
    nose: tuple[Frustum, ...] = ()
    table: Table = field(default_factory=Table)

    @property
    def bodies(self) -> MachineBodies:
        """Spindle nose and table."""
        return MachineBodies(self.nose, self.table)

    @cached_property
    def rotary(self) -> tuple[RotaryAxis, RotaryAxis]:
        """The two rotary axes in alphabetical order: the order of joint columns 3 and 4 and of the words."""
        first, second = sorted(self.part_axes + self.tool_axes, key=lambda axis: axis.letter)
        return first, second

    @cached_property
    def letters(self) -> str:
        """The axis letters in the order of the joints, such as XYZBC."""
        return LINEAR + "".join(axis.letter for axis in self.rotary)

    def column(self, axis: RotaryAxis) -> int:
        """The joint column (3 or 4) of a rotary axis."""
        return 3 + self.rotary.index(axis)


def machine_names() -> tuple[str, ...]:
    """The machines that come with bonecam."""
    return names_in(MACHINES)


def read_machine(name: str | Path) -> Machine:
    """The machine of a name, or of a path to a TOML file; MachineError names file and every key that is wrong."""
    path, table = read_table("machine", name, MACHINES, MachineFile)
    chain: list[str] = list(table.chain)
    place = chain.index(LINEAR)
    x, y, z = (_linear(letter, getattr(table, letter)) for letter in LINEAR)
    part_axes, tool_axes = (
        tuple(_rotary(letter, getattr(table, letter)) for letter in side)
        for side in (chain[:place], chain[place + 1 :])
    )
    return Machine(
        name=path.stem,
        title=table.title,
        linear=(x, y, z),
        part_axes=part_axes,
        tool_axes=tool_axes,
        part_zero=_vector(table.part_zero),
        programmed_point=table.programmed_point,
        tool_centre_control=table.tool_centre_control,
        spindle_speed=math.inf if table.spindle_speed is None else table.spindle_speed,
        nose=stack_of(table.spindle.nose) if table.spindle else (),
        table=_table(table.table or BodiesTable()),
    )


def _vector(values: list[float]) -> Vector:
    x, y, z = values
    return x, y, z


def _table(table: BodiesTable) -> Table:
    def half(size: float | None) -> float:
        return math.inf if size is None else size / 2

    sides = half(table.diameter), half(table.width), half(table.depth)
    return Table(*sides, table.beside == "open", stack_of(table.standing))


def _linear(letter: str, table: LinearTable) -> LinearAxis:
    if table.limits is not None:
        low, high = table.limits
        return LinearAxis(letter, (low, high), high - low, table.speed)
    assert table.travel is not None  # the schema asks for one of both
    return LinearAxis(letter, (-math.inf, math.inf), table.travel, table.speed)


def _rotary(letter: str, table: RotaryTable) -> RotaryAxis:
    x, y, z = table.direction
    length = math.hypot(x, y, z)
    sign = table.sign
    low, high = table.limits_deg or (-math.inf, math.inf)
    return RotaryAxis(
        letter=letter,
        direction=(sign * x / length, sign * y / length, sign * z / length),
        pivot=_vector(table.pivot),
        limits=(math.radians(low), math.radians(high)),
        endless=table.endless,
        speed=math.radians(table.speed_deg_s) * 60,
    )
