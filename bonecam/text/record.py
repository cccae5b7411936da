"""Records: tables with a schema that is told once and checks types, ranges and keys (pydantic).

Types are taken strictly (no text for a number, no 1 for true; a whole number is a number), unknown keys are
refused, numbers are finite, and all faults of a table are told at once in our words.
"""

from collections.abc import Mapping
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from bonecam.errors import did_you_mean
from bonecam.text.numbers import Faults, shown


class Record(BaseModel):
    """A table of a file; its fields are the keys. A validator raises ValueError with what is wrong and the remedy."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


class KeyFault(ValueError):
    """What a validator of a whole record finds wrong at one of its keys."""

    def __init__(self, key: str, why: str) -> None:
        super().__init__(why)
        self.key = key


R = TypeVar("R", bound=Record)

_WHY = {
    "missing": "missing: add it",
    "float_type": "{shown}: give a number",
    "finite_number": "{shown}: give a finite number",
    "int_type": "{shown}: give a whole number",
    "bool_type": "{shown}: give true or false",
    "string_type": "{shown}: give a text",
    "list_type": "{shown}: give a list",
    "dict_type": "{shown}: give a table",
    "model_type": "{shown}: give a table",
    "literal_error": "{shown}: choose one of {expected}",
    "too_short": "has {actual_length} items: give {min_length} or more",
    "too_long": "has more than {max_length} items: give at most {max_length}",
    "string_too_short": "{shown}: give {min_length} characters or more",
    "string_too_long": "has more than {max_length} characters: give at most {max_length}",
    "string_pattern_mismatch": "{shown}: give a text of the form {pattern}",
    "greater_than": "{shown}: give a number above {gt:g}",
    "greater_than_equal": "{shown}: give {ge:g} or more",
    "less_than_equal": "{shown}: give at most {le:g}",
    "value_error": "{error}",
}
"""What is wrong and the remedy, by pydantic's name of the fault and with what pydantic knows of it."""


def checked(kind: type[R], values: Mapping[str, Any]) -> R:
    """The record of a table; Faults names every key that is wrong."""
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        raise Faults([(_key(item), _why(item, kind)) for item in error.errors(include_url=False)]) from error


def _key(fault: ErrorDetails) -> str:
    """The place of a fault in a file as one writes it: X.speed, statements[2].effect; a table of one letter: [X]."""
    error = fault.get("ctx", {}).get("error")
    place = (*fault["loc"], error.key) if isinstance(error, KeyFault) else fault["loc"]
    key = ""
    for part in place:
        key += f"[{part}]" if isinstance(part, int) else f".{part[:40]}"
    key = key.removeprefix(".")
    return f"[{key}]" if len(key) == 1 else key


def _why(fault: ErrorDetails, kind: type[Record]) -> str:
    """What is wrong, and the remedy; of a key that is unknown where it stands, what is known there."""
    if fault["type"] == "extra_forbidden":
        inside = kind
        for part in fault["loc"][:-1]:
            if isinstance(part, str) and part in inside.model_fields:
                inside = _record_in(inside.model_fields[part].annotation) or inside
        known = sorted(inside.model_fields)
        return f"unknown key{did_you_mean(str(fault['loc'][-1]), known)}: use one of {', '.join(known)}"
    text = _WHY.get(fault["type"], "{shown}: correct it")
    return text.format(shown=shown(fault["input"]), **fault.get("ctx", {}))


def _record_in(annotation: object) -> type[Record] | None:
    """The record in an annotation such as `list[Statement]` or `Axis | None`."""
    if isinstance(annotation, type) and not get_args(annotation) and issubclass(annotation, Record):
        return annotation
    return next(filter(None, map(_record_in, get_args(annotation))), None)
