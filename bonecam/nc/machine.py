"""A machine is data: a chain of axes, read from a TOML file.

How to add a machine: copy a file of `bonecam/nc/machines/` (name it, or give its path instead of a name) and
fill in
- `title`, `chain`: from the part outward to the tool, rotary letters and "XYZ" for the linear axes together:
  ["C", "B", "XYZ"] table/table (C carries the part, B carries C), ["C", "XYZ", "B"] head/table, ["XYZ", "C",
  "B"] head/head;
- `part_zero` (mm): the program's zero in the machine's frame, all axes at zero; `programmed_point`: "tip" or
  "centre"; `tool_centre_control`: the dialect's name of it where the dialect has several; `spindle_speed`
  (1/min, optional): the highest;
- [X] [Y] [Z]: `speed` mm/min and either `limits` (lowest and highest mm of the spindle nose) or, where the
  place of the part on the machine is not known, `travel` (mm): then only the span of the program is checked;
- one table a rotary letter: `direction` (unit vector) and `pivot` (mm, any point on the axis; of a head axis:
  measured from the spindle nose), both with all axes at zero; `sign` (+1: a positive word turns what the axis
  carries by the right hand about `direction`, -1: the other way round, as most tilting tables do);
  `limits_deg`; `endless` (may wind); `speed_deg_s`.
No formula belongs to a machine: `kinematics.py` composes the chain.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from bonecam.errors import MachineError
from bonecam.nc.tables import names_in, read_table

FOLDER = Path(__file__).parent / "machines"
LINEAR = "XYZ"
_KEYS = {"title", "chain", "part_zero", "programmed_point", "tool_centre_control", "spindle_speed", *"XYZ"}
_LINEAR_KEYS = {"speed", "limits", "travel"}
_ROTARY_KEYS = {"direction", "pivot", "sign", "limits_deg", "endless", "speed_deg_s"}
Vector = tuple[float, float, float]


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


@dataclass(frozen=True)
class Machine:
    """A five-axis machine. Joint arrays are (n, 5): X, Y, Z in mm, then the rotary axes in alphabetical order
    in radians.

    `part_axes` carry the part, from the part outward; `tool_axes` carry the tool, from the base outward.
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
    return names_in(FOLDER)


def read_machine(name: str | Path) -> Machine:
    """The machine of a name, or of a path to a TOML file; MachineError names file and key."""
    path, values = read_table("machine", name, FOLDER)
    return _Reader(path).machine(values)


class _Reader:
    """Reads the values of a machine file; errors name the file and the key."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def wrong(self, key: str, why: str) -> MachineError:
        return MachineError(f"{self.path}: {key}: {why}", file=str(self.path), key=key)

    def machine(self, values: dict[str, Any]) -> Machine:
        before, after = self.chain(values)
        self.known("", values, _KEYS | set(before) | set(after))
        point = values.get("programmed_point", "tip")
        if point not in ("tip", "centre"):
            raise self.wrong("programmed_point", f"{point!r}: choose tip or centre")
        x, y, z = (self.linear(letter, self.table(values, letter)) for letter in LINEAR)
        part_axes, tool_axes = (
            tuple(self.rotary(letter, self.table(values, letter)) for letter in side)
            for side in (before, after)
        )
        first, second = (axis.direction for axis in part_axes + tool_axes)
        if abs(sum(a * b for a, b in zip(first, second, strict=True))) > 1 - 1e-9:
            raise self.wrong("chain", "the two rotary axes are parallel: give different directions")
        return Machine(
            name=self.path.stem,
            title=self.text(values, "title"),
            linear=(x, y, z),
            part_axes=part_axes,
            tool_axes=tool_axes,
            part_zero=self.vector("part_zero", values.get("part_zero", [0.0, 0.0, 0.0])),
            programmed_point=point,
            tool_centre_control=values.get("tool_centre_control", ""),
            spindle_speed=self.number("spindle_speed", values["spindle_speed"], 0.0)
            if "spindle_speed" in values
            else math.inf,
        )

    def chain(self, values: dict[str, Any]) -> tuple[list[str], list[str]]:
        chain = values.get("chain")
        if (
            not isinstance(chain, list)
            or len(chain) != 3
            or chain.count(LINEAR) != 1
            or not set(chain) - {LINEAR} <= set("ABC")
        ):
            raise self.wrong("chain", 'give three items from the part to the tool, such as ["C", "B", "XYZ"]')
        if len(set(chain)) != 3:
            raise self.wrong("chain", "an axis stands there twice: name two different rotary axes")
        place = chain.index(LINEAR)
        return chain[:place], chain[place + 1 :]

    def table(self, values: dict[str, Any], letter: str) -> dict[str, Any]:
        if not isinstance(values.get(letter), dict):
            raise self.wrong(f"[{letter}]", "the axis is missing: add its table")
        table: dict[str, Any] = values[letter]
        return table

    def known(self, where: str, values: dict[str, Any], keys: set[str]) -> None:
        for key in values:
            if key not in keys:
                raise self.wrong(f"{where}{key}", f"unknown key: use one of {', '.join(sorted(keys))}")

    def text(self, values: dict[str, Any], key: str) -> str:
        if not isinstance(values.get(key), str):
            raise self.wrong(key, "give a text")
        return str(values[key])

    def number(self, key: str, value: Any, low: float = -math.inf) -> float:
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
            or value <= low
        ):
            raise self.wrong(
                key, f"{value!r}: give a number" + (f" above {low:g}" if math.isfinite(low) else "")
            )
        return float(value)

    def vector(self, key: str, value: Any) -> Vector:
        if not isinstance(value, list) or len(value) != 3:
            raise self.wrong(key, "give three numbers")
        x, y, z = (self.number(key, item) for item in value)
        return x, y, z

    def limits(self, key: str, value: Any) -> tuple[float, float]:
        if not isinstance(value, list) or len(value) != 2:
            raise self.wrong(key, "give the lowest and the highest value")
        low, high = (self.number(key, item) for item in value)
        if low >= high:
            raise self.wrong(key, f"{low:g} is not below {high:g}")
        return low, high

    def linear(self, letter: str, values: dict[str, Any]) -> LinearAxis:
        self.known(f"{letter}.", values, _LINEAR_KEYS)
        speed = self.number(f"{letter}.speed", values.get("speed"), 0.0)
        if "limits" in values:
            low, high = self.limits(f"{letter}.limits", values["limits"])
            return LinearAxis(letter, (low, high), high - low, speed)
        return LinearAxis(
            letter, (-math.inf, math.inf), self.number(f"{letter}.travel", values.get("travel"), 0.0), speed
        )

    def rotary(self, letter: str, values: dict[str, Any]) -> RotaryAxis:
        self.known(f"{letter}.", values, _ROTARY_KEYS)
        x, y, z = self.vector(f"{letter}.direction", values.get("direction"))
        length = math.hypot(x, y, z)
        sign = values.get("sign")
        if abs(length - 1) > 1e-6:
            raise self.wrong(f"{letter}.direction", f"has length {length:g}: give a unit vector")
        if sign not in (1, -1):
            raise self.wrong(f"{letter}.sign", f"{sign!r}: give 1 or -1")
        endless = values.get("endless", False)
        if not isinstance(endless, bool):
            raise self.wrong(f"{letter}.endless", "give true or false")
        if not endless and "limits_deg" not in values:
            raise self.wrong(f"{letter}.limits_deg", "missing: give limits, or endless = true")
        low, high = (
            self.limits(f"{letter}.limits_deg", values["limits_deg"])
            if "limits_deg" in values
            else (-math.inf, math.inf)
        )
        return RotaryAxis(
            letter=letter,
            direction=(sign * x / length, sign * y / length, sign * z / length),
            pivot=self.vector(f"{letter}.pivot", values.get("pivot")),
            limits=(math.radians(low), math.radians(high)),
            endless=endless,
            speed=math.radians(self.number(f"{letter}.speed_deg_s", values.get("speed_deg_s"), 0.0)) * 60,
        )
