"""The TOML files of machines and dialects: those of bonecam by name, others by path."""

import tomllib
from pathlib import Path
from typing import Any

from bonecam.errors import MachineError
from bonecam.files import input_text


def names_in(folder: Path) -> tuple[str, ...]:
    """The names of the TOML files in a folder, without their ending."""
    return tuple(sorted(path.stem for path in folder.glob("*.toml")))


def read_table(kind: str, name: str | Path, folder: Path) -> tuple[Path, dict[str, Any]]:
    """Path and values of the TOML file `name` of a `folder`, or of a path that ends in .toml.

    `kind` is the word for it in messages. MachineError where there is no such file, or it is no TOML.
    """
    path = Path(name) if str(name).endswith(".toml") else folder / f"{name}.toml"
    try:
        return path, tomllib.loads(input_text(path))
    except FileNotFoundError as error:
        known = ", ".join(names_in(folder))
        if path == Path(name):
            raise MachineError(
                f"{path}: no such file: give a {kind}'s .toml file, or one of {known}", file=str(path)
            ) from error
        raise MachineError(
            f"{kind} {str(name)!r} is unknown: use one of {known}, or the path of a .toml file",
            name=str(name),
        ) from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise MachineError(f"{path}: {error}: correct the file", file=str(path)) from error
