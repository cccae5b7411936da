"""The TOML files of machines and dialects, those of bonecam by name, others by path, checked against a schema."""

from pathlib import Path
from typing import TypeVar

from bonecam.errors import MachineError, did_you_mean
from bonecam.files import input_text
from bonecam.text.faults import Faults
from bonecam.text.record import Record, checked
from bonecam.text.toml import parse_toml

R = TypeVar("R", bound=Record)


def names_in(folder: Path) -> tuple[str, ...]:
    """The names of the TOML files in a folder, without their ending."""
    return tuple(sorted(path.stem for path in folder.glob("*.toml")))


def read_table(kind: str, name: str | Path, folder: Path, schema: type[R]) -> tuple[Path, R]:
    """Path and record of the TOML file `name` of a `folder`, or of a path that ends in .toml.

    `kind` is the word for it in messages. MachineError where there is no such file, or it is no TOML; where it
    departs from the schema, with every key that is wrong (`faults`: key, what and remedy).
    """
    path = Path(name) if str(name).endswith(".toml") else folder / f"{name}.toml"
    text = _text(kind, name, path, folder)
    try:
        values = parse_toml(text)
    except Faults as error:
        raise MachineError(f"{path}: {error}: correct the file", file=str(path)) from error
    try:
        return path, checked(schema, values)
    except Faults as error:
        key = error.found[0][0]
        raise MachineError(f"{path}: {error}", file=str(path), key=key, faults=error.found) from error


def _text(kind: str, name: str | Path, path: Path, folder: Path) -> str:
    try:
        return input_text(path)
    except FileNotFoundError as error:
        known = ", ".join(names_in(folder))
        if path == Path(name):
            raise MachineError(
                f"{path}: no such file: give a {kind}'s .toml file, or one of {known}", file=str(path)
            ) from error
        close = did_you_mean(str(name), names_in(folder))
        raise MachineError(
            f"{kind} {str(name)!r} is unknown{close}: use one of {known}, or the path of a .toml file",
            name=str(name),
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise MachineError(f"{path}: {error}: correct the file", file=str(path)) from error
    except ValueError as error:  # a name with a zero character
        raise MachineError(f"{str(path)!r}: {error}: give a name or a file", file=str(path)) from error
