"""Typed filter parameters, MeshLab's way: a length is a number of mm or a percentage of the bounding box's
diagonal.

Parameters of a stage are derived from its job record (`parameters_of`), so that default, unit, range, label
and tooltip stay stated once, in `bonecam.job`. Text in scripts is read and written here too, one form a kind.
"""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

from bonecam.errors import FilterError, did_you_mean
from bonecam.job.parameter import record
from bonecam.mesh.triangle_mesh import TriangleMesh

Section = TypeVar("Section")


class Kind(Enum):
    """What values a parameter takes; the value is the name of the kind in MeshLab's scripts."""

    FLOAT = "RichFloat"
    INT = "RichInt"
    BOOL = "RichBool"
    ENUM = "RichEnum"
    STRING = "RichString"
    LENGTH = "RichPercentage"
    OPEN_FILE = "RichOpenFile"
    SAVE_FILE = "RichSaveFile"


TYPE_NAMES = {
    Kind.FLOAT: "a number",
    Kind.INT: "a whole number",
    Kind.BOOL: "true or false",
    Kind.ENUM: "a choice",
    Kind.STRING: "a text",
    Kind.LENGTH: "a number of mm, a PureValue or a PercentageValue",
    Kind.OPEN_FILE: "a file name",
    Kind.SAVE_FILE: "a file name",
}


@dataclass(frozen=True)
class Percentage:
    """A length as a percentage of the bounding box's diagonal (or of the parameter's own range where it says
    so)."""

    value: float


@dataclass(frozen=True)
class FilterParameter:
    """One parameter of a filter. `computed` gives the default where it depends on the mesh; `default` is then
    shown as example.

    Raises ValueError where the record contradicts itself: a default of the wrong kind or out of range, an
    empty label or tooltip.
    """

    name: str
    kind: Kind
    default: Any
    label: str
    tooltip: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    percentage_of_range: bool = False
    computed: Callable[[TriangleMesh], Any] | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not (self.name.isidentifier() and self.name == self.name.lower() and self.label and self.tooltip):
            raise ValueError(f"parameter {self.name!r} needs a lower-case name, a label and a tooltip")
        if self.percentage_of_range and not math.isfinite(self.high - self.low):
            raise ValueError(f"parameter {self.name!r}: a percentage of its range needs a range")
        if (self.kind is Kind.ENUM) != bool(self.choices):
            raise ValueError(f"parameter {self.name!r}: choices belong to {Kind.ENUM}, and to nothing else")
        try:
            self.checked(self.default)
        except FilterError as error:
            raise ValueError(f"the default of {error}") from error

    def checked(self, value: Any) -> Any:
        """`value` as the kind's own type; lengths stay Percentage until `resolved`. FilterError names
        parameter, value and range."""
        value = _plain(value)
        if self.kind is Kind.ENUM:
            return self._choice(value)
        if isinstance(value, Percentage):
            if self.kind is not Kind.LENGTH:
                raise self._refusal(f"{value.value:g} %", f"give {TYPE_NAMES[self.kind]}")
            if self.percentage_of_range and not 0 <= value.value <= 100:
                raise self._refusal(f"{value.value:g} %", "keep it within 0 .. 100 %")
            return value
        return self._in_range(self._typed(value))

    def resolved(self, value: Any, mesh: TriangleMesh | None) -> Any:
        """`checked`, with a percentage turned into mm on `mesh`."""
        value = self.checked(value)
        if not isinstance(value, Percentage):
            return value
        if self.percentage_of_range:
            return self.low + value.value / 100 * (self.high - self.low)
        if mesh is None or not len(mesh.vertices):
            raise self._refusal(f"{value.value:g} %", "a percentage needs a current layer: load a mesh first")
        return self._in_range(value.value / 100 * mesh.diagonal)

    def default_on(self, mesh: TriangleMesh | None) -> Any:
        """The default on `mesh`, resolved."""
        value = self.computed(mesh) if self.computed is not None and mesh is not None else self.default
        return self.resolved(value, mesh)

    def read(self, text: str) -> Any:
        """The value of a script's text; numbers of a length are mm, `3%` a percentage. FilterError where it
        is malformed."""
        text = text.strip() if self.kind not in (Kind.STRING, Kind.OPEN_FILE, Kind.SAVE_FILE) else text
        try:
            if self.kind is Kind.BOOL:
                return {"true": True, "false": False, "1": True, "0": False}[text.lower()]
            if self.kind is Kind.INT or (
                self.kind is Kind.ENUM and text not in self.choices and text.lstrip("-").isdigit()
            ):
                return self.checked(int(text))
            if self.kind is Kind.LENGTH and text.endswith("%"):
                return self.checked(Percentage(float(text[:-1])))
            if self.kind in (Kind.FLOAT, Kind.LENGTH):
                return self.checked(float(text))
        except (ValueError, KeyError) as error:
            raise self._refusal(repr(text), f"give {TYPE_NAMES[self.kind]}") from error
        return self.checked(text)

    def written(self, value: Any) -> str:
        """The text of a value in a script: what `read` gives back."""
        value = self.checked(value)
        if isinstance(value, Percentage):
            return f"{value.value!r}%"
        return str(value).lower() if isinstance(value, bool) else str(value) if isinstance(value, str) else repr(value)

    def _choice(self, value: Any) -> str:
        """MeshLab gives enumerations by number or by name."""
        if type(value) is int and 0 <= value < len(self.choices):
            return self.choices[value]
        if value not in self.choices:
            what = f"{value!r}{did_you_mean(str(value), self.choices)}"
            raise self._refusal(what, f"choose one of {', '.join(self.choices)}")
        return str(value)

    def _typed(self, value: Any) -> Any:
        wanted = {Kind.BOOL: bool, Kind.INT: int, Kind.FLOAT: float, Kind.LENGTH: float}.get(self.kind, str)
        if wanted is float and type(value) is int:
            value = float(value)
        if wanted is str and isinstance(value, Path):
            value = str(value)
        if type(value) is not wanted or (isinstance(value, float) and not math.isfinite(value)):
            raise self._refusal(repr(value), f"give {TYPE_NAMES[self.kind]}")
        return value

    def _in_range(self, value: Any) -> Any:
        if type(value) in (int, float) and not self.low <= value <= self.high:
            raise self._refusal(f"{value:g}", f"keep it within {self.low:g} .. {self.high:g} {self.unit}".rstrip())
        return value

    def _refusal(self, value: str, remedy: str) -> FilterError:
        return FilterError(f"parameter {self.name} = {value}: {remedy}", parameter=self.name)


def _plain(value: Any) -> Any:
    """numpy scalars as Python's, pymeshlab's PureValue as a number, its PercentageValue as Percentage."""
    kind = type(value).__name__
    if type(value).__module__.startswith("pymeshlab") and kind in ("PureValue", "PercentageValue"):
        return Percentage(float(value.value())) if kind == "PercentageValue" else float(value.value())
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 1) == 0 else value


def parameters_of(
    section: Any, prefix: str = "", only: Collection[str] = (), without: Collection[str] = ()
) -> tuple[FilterParameter, ...]:
    """The parameters of a section of a job, whose values are the defaults; their names begin with `prefix`.

    Lengths in mm take percentages of the bounding box's diagonal as well.
    """
    parameters = []
    for item in fields(section):
        if (only and item.name not in only) or item.name in without:
            continue
        value = getattr(section, item.name)
        known = record(item)
        kinds = {bool: Kind.BOOL, int: Kind.INT, float: Kind.FLOAT, str: Kind.ENUM if known.choices else Kind.STRING}
        kind = Kind.LENGTH if type(value) is float and known.unit == "mm" else kinds[type(value)]
        parameters.append(
            FilterParameter(
                prefix + item.name,
                kind,
                default=value,
                label=known.label,
                tooltip=known.tooltip,
                unit=known.unit,
                low=known.low,
                high=known.high,
                choices=known.choices,
            )
        )
    return tuple(parameters)


def section_of(section: Section, values: Mapping[str, Any], prefix: str = "") -> Section:
    """A section of a job with the values of a filter's parameters, whose names are `prefix` and the field's
    name.

    The reverse of `parameters_of`.
    """
    known = {item.name for item in fields(section)}  # type: ignore[arg-type]
    changes = {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}
    kept = {name: value for name, value in changes.items() if name in known}
    return replace(section, **kept)  # type: ignore[type-var]
