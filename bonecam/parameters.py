"""Parameters of a stage: each is declared once, on its dataclass field, with default, unit, range, label and
tooltip."""

import dataclasses
import math
import sys
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from bonecam.errors import JobError


@dataclass(frozen=True)
class Parameter:
    """What a person needs to know of one parameter."""

    label: str
    tooltip: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()


def parameter(default: Any, label: str, tooltip: str, **kinds: Any) -> Any:
    """A dataclass field that carries its Parameter record."""
    return field(default=default, metadata={"parameter": Parameter(label, tooltip, **kinds)})


def record(item: "dataclasses.Field[Any]") -> Parameter:
    """The Parameter record of a field made by `parameter`."""
    return item.metadata["parameter"]  # type: ignore[no-any-return]


KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}
"""What a person gives where a parameter is of a type."""


def check(stage: Any) -> None:
    """Raise JobError where a field of `stage` has the wrong type or leaves its range."""
    for item in fields(stage):
        if "parameter" not in item.metadata:
            continue
        given, known = getattr(stage, item.name), record(item)
        value = _plain(given, float if isinstance(item.default, float) else type(item.default))
        if value is not given:
            object.__setattr__(stage, item.name, value)
        if type(value) is not type(item.default):
            raise JobError(
                f"{item.name} = {str(value)[:40]!r}: give {KINDS[type(item.default)]}", field=item.name
            )
        if known.choices and value not in known.choices:
            raise JobError(
                f"{item.name} = {value!r}: choose one of {', '.join(known.choices)}", field=item.name
            )
        if isinstance(value, int | float) and not (known.low <= value <= known.high):
            raise JobError(
                f"{item.name} = {value}: keep it within {known.low:g} .. {known.high:g} {known.unit}".rstrip(),
                field=item.name,
            )


def _plain(value: Any, kind: type) -> Any:
    """A numpy scalar as Python's, a whole number where a number is wanted as that, a Path as its text."""
    if type(value).__module__ == "numpy" and getattr(value, "ndim", 1) == 0:
        value = value.item()
    if kind is float and type(value) is int and abs(value) <= sys.maxsize:
        return float(value)
    return str(value) if kind is str and isinstance(value, Path) else value


class Stage:
    """Base of the stage records: checks its fields when made."""

    def __post_init__(self) -> None:
        check(self)
