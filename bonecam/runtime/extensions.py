"""What users and other packages add by name: machines, dialects, materials, tools and lists of tools as files, stocks
and patterns as Python.

They stand in folders of these names below the user's folder (`user_folder`), or come with an installed package whose
entry points name them: the group `bonecam.machines` (and so on) a package with TOML files, the groups
`bonecam.stocks` and `bonecam.patterns` the object itself. What ships cannot be replaced: its names are taken.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from traceback import extract_tb
from typing import Any

from bonecam.errors import BonecamError, JobError

HOME = "BONECAM_HOME"
"""The variable of the environment that names the user's folder, if it is another."""


def user_folder() -> Path:
    """The user's folder: that of BONECAM_HOME, or `bonecam` in the folder for configurations."""
    named = os.environ.get(HOME)
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "bonecam"


def named_files(kind: str, shipped: Path | None = None, endings: tuple[str, ...] = (".toml",)) -> dict[str, Path]:
    """The files of a kind by name: those in the folder that ships, if any does, the user's, those of packages. Of files
    of one name the first counts, in a folder the one whose ending comes first."""
    files: dict[str, Path] = {}
    for folder in (*filter(None, [shipped]), user_folder() / kind, *_packaged(kind)):
        for ending in endings:
            for path in sorted(folder.glob(f"*{ending}")):
                files.setdefault(path.stem, path)
    return files


def added_names(kind: str) -> tuple[str, ...]:
    """The names of Python objects of a kind that users and packages add; nothing of them is imported."""
    names = [path.stem for path in sorted((user_folder() / kind).glob("*.py"))]
    names += sorted(_points(kind))
    return tuple(dict.fromkeys(names))


def added(kind: str, name: str, attribute: str) -> Any:
    """The object of a name: `attribute` of the user's file, or what an entry point names. JobError where it cannot be
    loaded; KeyError where there is none."""
    file = user_folder() / kind / f"{name}.py"
    points = _points(kind)
    if not file.is_file() and name not in points:
        raise KeyError(name)
    try:
        return _attribute_of(file, attribute) if file.is_file() else points[name].load()
    except (Exception, SystemExit) as error:  # whatever a stranger's module raises while it is imported
        raise _failed(kind, name, "cannot be loaded", error) from error


@contextmanager
def run_added(kind: str, name: str) -> Iterator[None]:
    """A block that runs the object of a name; JobError where it fails otherwise than with an error of bonecam."""
    try:
        yield
    except BonecamError:
        raise
    except Exception as error:  # whatever a stranger's code raises
        raise _failed(kind, name, "fails", error) from error


def _failed(kind: str, name: str, what: str, error: BaseException) -> JobError:
    """The error of an added object, with its file or entry point, and the last line of it that ran."""
    file = user_folder() / kind / f"{name}.py"
    place = str(file) if file.is_file() else f"entry point {_points(kind)[name].value}"
    frames = [frame for frame in extract_tb(error.__traceback__) if frame.filename == str(file)]
    where = f"line {frames[-1].lineno}: " if frames else ""
    why = " ".join(f"{type(error).__name__}: {error}".split())
    return JobError(f"{place}: {where}{what}: {why}: mend or remove it", file=place)


def _attribute_of(file: Path, attribute: str) -> Any:
    """`attribute` of a Python file."""
    spec = spec_from_file_location(f"bonecam_user_{file.stem}", file)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, attribute)


def _packaged(kind: str) -> Iterator[Path]:
    """The folders of the packages that entry points of a kind name."""
    for _, point in sorted(_points(kind).items()):
        yield from _folder_of(point)


@cache
def _points(kind: str) -> dict[str, EntryPoint]:
    """The entry points of a kind by name."""
    return {point.name: point for point in entry_points(group=f"bonecam.{kind}")}


def _folder_of(point: EntryPoint) -> Iterator[Path]:
    try:
        spec = find_spec(point.value)
    except (ImportError, ValueError):
        return
    if spec is not None:
        yield from map(Path, spec.submodule_search_locations or ())
