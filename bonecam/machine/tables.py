"""The TOML files of machines and dialects, by name or by path, checked against a schema."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from bonecam.errors import MachineError, did_you_mean
from bonecam.files import input_text
from bonecam.text.faults import Faults, shown
from bonecam.text.record import Record, checked
from bonecam.text.toml import parse_toml

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
        return parse_toml(_text(kind, path, files))
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


def _text(kind: str, path: Path, files: Mapping[str, Path]) -> str:
    try:
        return input_text(path)
    except FileNotFoundError as error:
        known = ", ".join(files)
        raise MachineError(
            f"{path}: no such file: give a {kind}'s .toml file, or one of {known}", file=str(path)
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise MachineError(f"{path}: {error}: correct the file", file=str(path)) from error
    except ValueError as error:  # a name with a zero character
        raise MachineError(f"{str(path)!r}: {error}: give a name or a file", file=str(path)) from error
