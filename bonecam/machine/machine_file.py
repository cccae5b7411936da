"""The axes of a machine, and its file: TOML files of machines and dialects, by name or by path, are checked against a
schema. That of a machine has keys, types and ranges; the text of `machine.machine` says what they mean.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from bonecam.errors import MachineError, counted, did_you_mean
from bonecam.files import input_text
from bonecam.machine.bodies import MOST_FRUSTUMS
from bonecam.text.numbers import Faults, check_printable, shown
from bonecam.text.record import KeyFault, Record, checked
from bonecam.text.toml import parse_toml

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class LinearAxis:
    """One of X, Y, Z: limits of the spindle nose in mm (infinite where unknown), travel in mm, speed in mm/min,
    acceleration in mm/min^2 and jerk in mm/min^3, infinite where they are not known."""

    letter: str
    limits: tuple[float, float]
    travel: float
    speed: float
    acceleration: float = math.inf
    jerk: float = math.inf


@dataclass(frozen=True)
class RotaryAxis:
    """A rotary axis; `direction` already carries the sign: a positive angle turns what it carries
    right-handed about it.

    Limits in radians, speed in rad/min; acceleration in rad/min^2 and jerk in rad/min^3, infinite where not known.
    `endless`: the axis may wind; its limits, if any, bound the winding. One without a letter stands for the second axis
    of a machine that has one: it has no words.
    """

    letter: str
    direction: Vector
    pivot: Vector
    limits: tuple[float, float]
    endless: bool
    speed: float
    acceleration: float = math.inf
    jerk: float = math.inf

    @property
    def bounded(self) -> bool:
        """Whether it has limits."""
        return math.isfinite(self.limits[0])

    @property
    def locked(self) -> bool:
        """Whether it stands at one angle."""
        return bool(self.limits[0] == self.limits[1])

    @property
    def has_choice(self) -> bool:
        """Whether its limits are a turn or more apart: it can stand in some direction in more than one turn."""
        return bool(self.bounded and self.limits[1] - self.limits[0] >= 2 * math.pi * (1 - 1e-9))


R = TypeVar("R", bound=Record)


def read_table(
    kind: str, name: str | Path, files: Mapping[str, Path], schema: type[R], *, may_be_like: bool = False
) -> tuple[Path, R]:
    """Path and record of the TOML file of a `name` among `files`, or of a path that ends in .toml.

    With `may_be_like` the file may name another one of the `files` as `like`, which has what it leaves out. `kind` is
    the word for it in messages. MachineError where there is no such file, or it is no TOML; where it departs from the
    schema, with every key that is wrong (`faults`: key, what and remedy).
    """
    path = Path(name) if str(name).endswith(".toml") else files.get(str(name))
    if path is None:
        raise MachineError(
            f"{kind} {str(name)!r} is unknown{did_you_mean(str(name), files)}: use one of {', '.join(files)}, or the "
            "path of a .toml file",
            name=str(name),
        )
    values = _values(kind, path, files)
    if may_be_like and "like" in values:
        values = _completed(values, kind, path, files)
    try:
        return path, checked(schema, values)
    except Faults as error:
        key = error.found[0][0]
        raise MachineError(f"{path}: {error}", file=str(path), key=key, faults=error.found) from error


def _values(kind: str, path: Path, files: Mapping[str, Path]) -> dict[str, Any]:
    try:
        text = input_text(path)
    except FileNotFoundError as error:
        remedy = f"give a {kind}'s .toml file, or one of {', '.join(files)}"
        raise MachineError(f"{path}: no such file: {remedy}", file=str(path)) from error
    except (OSError, UnicodeDecodeError) as error:
        raise MachineError(f"{path}: {error}: correct the file", file=str(path)) from error
    except ValueError as error:  # a name with a zero character
        raise MachineError(f"{str(path)!r}: {error}: give a name or a file", file=str(path)) from error
    try:
        return parse_toml(text)
    except Faults as error:
        raise MachineError(f"{path}: {error}: correct the file", file=str(path)) from error


def _completed(values: dict[str, Any], kind: str, path: Path, files: Mapping[str, Path]) -> dict[str, Any]:
    """The values of a file with those of the file that it is like."""
    own = dict(values)
    name = own.pop("like")
    known = [each for each in files if files[each] != path]
    if name not in known:
        raise MachineError(f"{path}: like: {shown(str(name))}: use one of {', '.join(known)}", file=str(path))
    base = _values(kind, files[name], files)
    if "like" in base:
        raise MachineError(f"{path}: like: {name} is itself like another: use {base['like']}", file=str(path))
    return merged(base, own)


def merged(base: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Tables joined key by key; what is no table in both is that of `own`."""
    joined = dict(base)
    for key, value in own.items():
        both = isinstance(value, dict) and isinstance(joined.get(key), dict)
        joined[key] = merged(joined[key], value) if both else value
    return joined


FARTHEST = 1e5
"""No place or travel of a machine is beyond this, mm: 100 m."""
FASTEST = 1e6
"""No axis (mm/min, deg/s) and no spindle (1/min) is faster."""
SLOWEST = 1e-3
"""No axis (mm/min, deg/s) and no spindle (1/min) is slower."""
MOST_DEGREES = 1e6
"""No rotary axis turns further from its zero: 2,800 turns."""
LINEAR = "XYZ"
CHAIN_REMEDY = (
    'give one or two rotary letters and "XYZ", all linear axes as one item whatever they move, from the part to the '
    'tool, such as ["C", "B", "XYZ"]'
)
MOST_BODIES = 12
"""Meshes of links: two a link of the longest chain."""
PARALLEL = 1e-9
"""Directions are parallel, or at right angles, within this of their cosine."""


def _rising(limits: list[float]) -> list[float]:
    if limits[0] >= limits[1]:
        raise ValueError(f"{limits[0]:g} is not below {limits[1]:g}: give the lowest and the highest value")
    return limits


def _unit(direction: list[float]) -> list[float]:
    length = math.hypot(*direction)
    if abs(length - 1) > 1e-6:
        unit = f", [{', '.join(repr(part / length) for part in direction)}]" if length > 0 else ""
        raise ValueError(f"has length {length:g}: give a unit vector{unit}")
    return direction


def _sign(sign: float) -> float:
    if sign not in (1, -1):
        raise ValueError(f"{sign:g}: give 1 or -1")
    return sign


def _few(chain: object) -> object:
    if isinstance(chain, list) and not 2 <= len(chain) <= 3:
        raise ValueError(f"it has {counted(len(chain), 'item')}: {CHAIN_REMEDY}")
    return chain


Length = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
Place = Annotated[list[Length], Field(min_length=3, max_length=3)]
Limits = Annotated[list[Length], Field(min_length=2, max_length=2), AfterValidator(_rising)]
Degrees = Annotated[float, Field(ge=-MOST_DEGREES, le=MOST_DEGREES)]
LimitsDeg = Annotated[list[Degrees], Field(min_length=2, max_length=2), AfterValidator(_rising)]
Direction = Annotated[
    list[Annotated[float, Field(ge=-1, le=1)]], Field(min_length=3, max_length=3), AfterValidator(_unit)
]
Speed = Annotated[float, Field(ge=SLOWEST, le=FASTEST)]
Size = Annotated[float, Field(gt=0, le=FARTHEST)]
FrustumRow = Annotated[list[Size], Field(min_length=2, max_length=3)]
Stack = Annotated[list[FrustumRow], Field(max_length=MOST_FRUSTUMS)]
Name = Annotated[str, Field(max_length=200), AfterValidator(check_printable)]


class LinearTable(Record):
    """The table of X, Y or Z: speed in mm/min, acceleration in mm/s^2, jerk in mm/s^3, and limits or travel in mm."""

    speed: Speed
    acceleration: Speed | None = None
    jerk: Speed | None = None
    limits: Limits | None = None
    travel: Annotated[float, Field(gt=0, le=2 * FARTHEST)] | None = None

    @model_validator(mode="after")
    def _has_room(self) -> "LinearTable":
        if self.jerk is not None and self.acceleration is None:
            raise KeyFault("acceleration", "missing beside jerk: add it (mm/s^2)")
        if self.limits is None and self.travel is None:
            raise KeyFault("travel", "missing: add it (mm), or limits")
        return self


class RotaryTable(Record):
    """The table of A, B or C: direction (unit) and pivot (mm), limits in degrees, speed in deg/s,
    acceleration in deg/s^2, jerk in deg/s^3; `locked_deg` in the place of limits, where it stands at one angle."""

    direction: Direction
    pivot: Place
    sign: Annotated[float, AfterValidator(_sign)]
    limits_deg: LimitsDeg | None = None
    endless: bool = False
    locked_deg: Degrees | None = None
    speed_deg_s: Speed
    acceleration_deg_s2: Speed | None = None
    jerk_deg_s3: Speed | None = None

    @model_validator(mode="after")
    def _is_bounded(self) -> "RotaryTable":
        if self.jerk_deg_s3 is not None and self.acceleration_deg_s2 is None:
            raise KeyFault("acceleration_deg_s2", "missing beside jerk_deg_s3: add it (deg/s^2)")
        if self.locked_deg is not None and (self.endless or self.limits_deg is not None):
            raise KeyFault("locked_deg", "a locked axis has no limits and is not endless: give the one or the other")
        if not self.endless and self.limits_deg is None and self.locked_deg is None:
            raise KeyFault("limits_deg", "missing: give limits, locked_deg, or endless = true")
        return self


class SecondsTable(Record):
    """The table of what takes time beside the axes, in seconds: a `tool_change` from chip to chip, a `spindle_start` to
    the working speed, a `retract` to the top of Z and the way back, beyond what a program states of it."""

    tool_change: Annotated[float, Field(ge=0, le=3600)]
    spindle_start: Annotated[float, Field(ge=0, le=3600)]
    retract: Annotated[float, Field(ge=0, le=3600)]


class SpindleTable(Record):
    """The table of the spindle: `nose`, its cylinders and cones behind the gauge line, mm."""

    nose: Annotated[Stack, Field(min_length=1)]


class BodiesTable(Record):
    """The table of what the part stands on: `diameter` of a disc about the program's Z axis, or `width` and `depth`
    (along X and Y) of a plate in whose middle it is; `beside`, what is below its plane beside it; `standing`, the
    cylinders and cones that stand on it round the Z axis; mm."""

    diameter: Size | None = None
    width: Size | None = None
    depth: Size | None = None
    beside: Literal["closed", "open"] = "closed"
    standing: Stack = Field(default_factory=list)

    @model_validator(mode="after")
    def _has_one_shape(self) -> "BodiesTable":
        if (self.width is None) != (self.depth is None):
            raise KeyFault("depth" if self.depth is None else "width", "missing: a plate has width and depth")
        if self.diameter is not None and self.width is not None:
            raise KeyFault("diameter", "a disc has no width and depth: give the one or the other")
        if self.beside == "open" and self.diameter is None and self.width is None:
            raise KeyFault("beside", "'open': give diameter, or width and depth: nothing is beside a table without end")
        return self


class LinkBodyTable(Record):
    """The table of a body of the machine that is a mesh: its `name`, the `link` that it moves with, the file `stl`,
    whose path is relative to that of the machine, and its `units`."""

    name: Name
    link: Literal["A", "B", "C", "XYZ", "bed"]
    stl: Name
    units: Literal["mm", "cm", "m", "inch"] = "mm"


class MachineFile(Record):
    """A machine file."""

    title: Name
    source: Annotated[str, Field(max_length=1000), AfterValidator(check_printable)] = ""
    controller: Name = ""
    assumed: Annotated[list[Name], Field(max_length=20)] = Field(default_factory=list)
    chain: Annotated[list[Literal["A", "B", "C", "XYZ"]], BeforeValidator(_few)]
    part_x: Direction | None = None
    part_z: Direction | None = None
    part_zero: Place = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    programmed_point: Literal["tip", "centre"] = "tip"
    tool_centre_control: Name = ""
    spindle_speed: Speed | None = None
    spindle_lowest: Annotated[float, Field(ge=0, le=FASTEST)] = 0.0
    spindle: SpindleTable | None = None
    seconds: SecondsTable | None = None
    table: BodiesTable | None = None
    bodies: Annotated[list[LinkBodyTable], Field(max_length=MOST_BODIES)] = Field(default_factory=list)
    X: LinearTable
    Y: LinearTable
    Z: LinearTable
    A: RotaryTable | None = None
    B: RotaryTable | None = None
    C: RotaryTable | None = None

    @model_validator(mode="after")
    def _is_a_chain(self) -> "MachineFile":
        twice = len(set(self.chain)) != len(self.chain)
        if twice or LINEAR not in self.chain:
            what = "an axis stands there twice" if twice else "it has no linear axes"
            raise KeyFault("chain", f"{what}: {CHAIN_REMEDY}")
        for letter in "ABC":
            if letter in self.chain and getattr(self, letter) is None:
                raise KeyFault(letter, "the axis is missing: add its table")
            if letter not in self.chain and getattr(self, letter) is not None:
                raise KeyFault(letter, "chain does not name it: remove the table, or add it there")
        directions = [getattr(self, letter).direction for letter in self.chain if letter != LINEAR]
        if len(directions) == 2 and abs(_dot(*directions)) > 1 - PARALLEL:
            raise KeyFault("chain", "the two rotary axes are parallel: give different directions")
        last = self.chain[-1]
        if last != LINEAR and abs(getattr(self, last).direction[2]) > 1 - PARALLEL:
            raise KeyFault("chain", f"{last} next to the tool turns it about itself: {CHAIN_REMEDY}")
        return self

    @model_validator(mode="after")
    def _has_a_part_frame(self) -> "MachineFile":
        """The part's frame is given, or what carries the part turns about its Z axis."""
        if (self.part_x is None) != (self.part_z is None):
            missing = "part_x" if self.part_x is None else "part_z"
            raise KeyFault(missing, "missing: part_x and part_z belong together")
        inner = self.chain[0]
        if self.part_x is not None and self.part_z is not None:
            if abs(_dot(self.part_x, self.part_z)) > PARALLEL:
                raise KeyFault("part_x", "is not at right angles to part_z: correct the one or the other")
        elif inner != LINEAR:
            axis = getattr(self, inner)
            if axis.locked_deg is None and abs(axis.direction[2]) < 1 - PARALLEL:
                what = f"missing: {inner} carries the part and does not turn about the machine's Z"
                remedy = "give part_x and part_z, how the part's X and Z (from the table through the part) lie"
                raise KeyFault("part_z", f"{what}: {remedy} in the machine, all axes at zero")
        return self

    @model_validator(mode="after")
    def _has_bodies_and_speeds(self) -> "MachineFile":
        links = [*self.chain, "bed"]
        names = [body.name for body in self.bodies]
        for at, body in enumerate(self.bodies, 1):
            if body.link not in links:
                raise KeyFault(f"bodies.{at}.link", f"{body.link}: use one of {', '.join(links)}")
            if body.name in names[: at - 1]:
                raise KeyFault(f"bodies.{at}.name", f"{body.name!r} is there twice: rename one")
            if not body.stl.lower().endswith(".stl"):
                raise KeyFault(f"bodies.{at}.stl", f"{body.stl!r}: give a file that ends in .stl")
        if self.spindle_speed is not None and self.spindle_lowest > self.spindle_speed:
            why = f"{self.spindle_lowest:g}: above spindle_speed = {self.spindle_speed:g}: give the lowest speed"
            raise KeyFault("spindle_lowest", why)
        return self


def _dot(first: list[float], second: list[float]) -> float:
    return sum(a * b for a, b in zip(first, second, strict=True))
