"""How a value differs from a type made of TypedDicts, lists, dicts and unions."""

from types import NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints, is_typeddict


def differences(value: Any, kind: Any, name: str = "") -> list[str]:
    """What is missing, not named or of another type, each with its path."""
    if is_typeddict(kind):
        if not isinstance(value, dict):
            return [f"{name}: {value!r}"]
        kinds = get_type_hints(kind)
        missing = [f"{name}.{key}: missing" for key in sorted(kind.__required_keys__ - set(value))]
        unnamed = [f"{name}.{key}: has no name" for key in sorted(set(value) - set(kinds))]
        named = (differences(value[key], kinds[key], f"{name}.{key}") for key in value if key in kinds)
        return sum(named, [*missing, *unnamed])
    if isinstance(kind, UnionType):
        found = [differences(value, each, name) for each in get_args(kind)]
        return min(found, key=len)
    if get_origin(kind) is list:
        pairs = enumerate(value) if isinstance(value, list) else ()
        (each,) = get_args(kind)
    elif get_origin(kind) is dict:
        pairs = value.items() if isinstance(value, dict) else ()
        each = get_args(kind)[1]
    else:
        allowed = {float: (float, int), NoneType: NoneType}.get(kind, kind)
        return [] if isinstance(value, allowed) else [f"{name}: {value!r}"]
    whole = isinstance(value, get_origin(kind))
    return sum((differences(item, each, f"{name}[{key}]") for key, item in pairs), [] if whole else [name])
