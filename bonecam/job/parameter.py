"""A parameter of a job: default, unit, range, label and tooltip, declared on the field of its section."""

import dataclasses
import math
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeGuard

from bonecam.errors import JobError, did_you_mean
from bonecam.text.numbers import shown


@dataclass(frozen=True)
class Parameter:
    """Label, tooltip, unit, range and choices of one parameter; `form` reads its text, if that has one, and raises
    ValueError with what is wrong and the remedy. A text that ends in `file`, or one of them, is the path of a file."""

    label: str
    tooltip: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    form: Callable[[str], object] | None = None
    file: str | tuple[str, ...] | None = None

    def is_path(self, value: object) -> bool:
        """Whether a value is the path of a file."""
        return self.file is not None and isinstance(value, str) and value != "" and value.endswith(self.file)

    @property
    def allowed(self) -> str:
        """Range and unit, or the choices, in words; empty where any value does."""
        if self.choices:
            return ", ".join(self.choices)
        low, high = (f"{value:g}" if math.isfinite(value) else "" for value in (self.low, self.high))
        return f"{low} .. {high} {self.unit}".strip() if low or high else self.unit


def parameter(
    default: Any, label: str, tooltip: str, low: float = -math.inf, high: float = math.inf, **kinds: Any
) -> Any:
    """A dataclass field that carries its Parameter record."""
    return field(default=default, metadata={"parameter": Parameter(label, tooltip, low=low, high=high, **kinds)})


def millimetres(default: float, label: str, tooltip: str, low: float, high: float) -> Any:
    """A dataclass field of a length in mm."""
    return parameter(default, label, tooltip, low, high, unit="mm")


def record(item: "dataclasses.Field[Any]") -> Parameter:
    """The Parameter record of a field made by `parameter`."""
    return item.metadata["parameter"]  # type: ignore[no-any-return]


KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}
"""The words for the value that a parameter of a type takes."""


def check(section: Any) -> None:
    """JobError where fields of `section` have the wrong type or leave their range; it tells all of them (`faults`).

    Numpy scalars, whole numbers for decimal ones, and paths become the type of the field.
    """
    faults = []
    for item in fields(section):
        value = given = getattr(section, item.name)
        kind = type(item.default)
        if type(value).__module__ == "numpy" and getattr(value, "ndim", 1) == 0:
            value = value.item()
        if kind is float and type(value) is int and abs(value) <= sys.maxsize:
            value = float(value)
        elif kind is str and isinstance(value, Path):
            value = str(value)
        if value is not given:
            object.__setattr__(section, item.name, value)
        why = _fault(value, kind, record(item))
        if why:
            faults.append((item.name, f"{item.name} = {why}"))
    if faults:
        raise JobError("; ".join(text for _, text in faults), field=faults[0][0], faults=faults)


def _fault(value: object, kind: type, known: Parameter) -> str | None:
    """The value, what is wrong with it, and the remedy; None where it is of the `kind` and in its range."""
    if type(value) is not kind:
        return f"{shown(value)}: give {KINDS[kind]}"
    if known.choices and value not in known.choices:
        return f"{shown(value)}{did_you_mean(str(value), known.choices)}: choose one of {', '.join(known.choices)}"
    if isinstance(value, int | float) and not (known.low <= value <= known.high):
        return f"{value}: keep it within {known.low:g} .. {known.high:g} {known.unit}".rstrip()
    if isinstance(value, str) and "\0" in value:
        return f"{shown(value)}: leave the zero character out"
    if isinstance(value, str) and known.form is not None:
        try:
            known.form(value)
        except ValueError as error:
            return f"{shown(value)}: {error}"
    return None


def is_list(value: object) -> TypeGuard[Iterable[Any]]:
    """Whether a value that may stand for a text lists others: an array without a dimension does not."""
    return isinstance(value, Iterable) and not isinstance(value, str) and getattr(value, "ndim", 1) > 0


class JobSection:
    """Base of the sections of a job: it checks the fields of a new record, whose repr has what differs from the
    defaults."""

    def __init_subclass__(cls) -> None:
        cls.__repr__ = JobSection.__repr__  # type: ignore[method-assign]  # a dataclass keeps what its class has

    def __repr__(self) -> str:
        values = {item.name: getattr(self, item.name) for item in fields(self)}  # type: ignore[arg-type]
        defaults = {item.name: item.default for item in fields(self)}  # type: ignore[arg-type]
        changed = (f"{name}={value!r}" for name, value in values.items() if value != defaults[name])
        return f"{type(self).__name__}({', '.join(changed)})"

    def __post_init__(self) -> None:
        check(self)

    def fault(self, name: str, why: str) -> JobError:
        """The error of a field: the field with its value, then `why` with the bound and the remedy."""
        value = getattr(self, name)
        return JobError(f"{name} = {f'{value:g}' if isinstance(value, float) else shown(value)}: {why}", field=name)
