"""What users and packages add by name: files (machines, dialects, materials, tools, lists of tools, jobs) and Python
objects of these kinds:

    commands    Command             a command of the command line
    demos       Command             a part that `bonecam demo --NAME` machines instead of the phalanx
    filters     tuple of Filter     filters of MeshSet and of MeshLab scripts
    readers     Reader              files with the ending NAME: meshes or surfaces
    strategies  function            path.strategy
    patterns    function            path.pattern
    orientations  function          path.orientation
    methods     Method              levels.method
    solvers     function            levels.solver
    stocks      StockKind           stock.kind
    sections    JobSection          a section of the job
    scripts     function            runs mesh.script, a file with the ending NAME
    figures     function            figures of a Result by name, for report (`added`), summary and page
    names       anything            a name of `bonecam` itself

`plan(levels, stock, job, limits, progress)` of a strategy gives the tool paths in machining order, `axes(path, surface,
scene, limits, job)` of an orientation a unit vector for each contact, `solve(program)` of a solver the free moves of a
level's program; a Method is that of `bonecam.levels`.

They stand in folders of these names below the user's folder (`user_folder`; a Python file holds the object as the name
that `ATTRIBUTES` tells), or come with an installed package whose entry points name them: the group `bonecam.machines`
(and so on) a package with TOML files, `bonecam.commands` (and so on) the object itself. What ships cannot be replaced:
its names are taken. Nothing is imported before it is used, but the declarations of commands, demos and sections.

An object that is asked for and cannot be loaded is an error that names it; one of many that are listed is told in one
line, once, and left out. With BONECAM_NO_PLUGINS set nothing of packages is taken: the core alone.
"""

import logging
import os
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from traceback import extract_tb
from typing import Any, Literal

from bonecam.errors import BonecamError, JobError

log = logging.getLogger("bonecam")

HOME = "BONECAM_HOME"
"""The variable of the environment that names the user's folder, if it is another."""
ALONE = "BONECAM_NO_PLUGINS"
"""The variable of the environment that leaves out what packages add."""


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


@dataclass(frozen=True)
class Reader:
    """Files with an ending of a plugin's: `read` takes a path and returns a TriangleMesh or a TSpline as `holds` says,
    mm (FileError where the file is damaged); `write`, if there is one, takes a TSpline and a path. An ending is named
    in small letters, without its dot."""

    holds: Literal["mesh", "surface"]
    read: Callable[[Path], Any]
    write: Callable[[Any, Path], None] | None = None


ATTRIBUTES = {
    "commands": "COMMAND",
    "demos": "DEMO",
    "filters": "FILTERS",
    "readers": "READER",
    "strategies": "plan",
    "patterns": "lines",
    "orientations": "axes",
    "methods": "METHOD",
    "solvers": "solve",
    "stocks": "KIND",
    "sections": "SECTION",
    "scripts": "run",
    "figures": "figures",
    "names": "NAME",
}
"""Kinds of Python objects, and the name that a user's file holds one by."""


def added_names(kind: str) -> tuple[str, ...]:
    """The names of Python objects of a kind that users and packages add; nothing of them is imported."""
    names = [path.stem for path in sorted((user_folder() / kind).glob("*.py"))]
    names += sorted(_points(kind))
    return tuple(dict.fromkeys(names))


def added(kind: str, name: str) -> Any:
    """The object of a name, from the user's file or what an entry point names. JobError where it cannot be loaded;
    KeyError where there is none."""
    file = user_folder() / kind / f"{name}.py"
    points = _points(kind)
    if not file.is_file() and name not in points:
        raise KeyError(name)
    try:
        if not file.is_file():
            return points[name].load()
        spec = spec_from_file_location(f"bonecam_user_{file.stem}", file)
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        return getattr(module, ATTRIBUTES[kind])
    except (Exception, SystemExit) as error:  # whatever a stranger's module raises while it is imported
        raise _failed(kind, name, "cannot be loaded", error) from error


def check_added(kind: str, name: str) -> None:
    """JobError where the object of a name cannot be loaded; a name of what ships is none of these."""
    if name in added_names(kind):
        added(kind, name)


def reader_endings() -> tuple[str, ...]:
    """The endings of the files that users and packages read, with the dot."""
    return tuple(f".{name}" for name in added_names("readers"))


def all_added(kind: str, wanted: Any = object, taken: Collection[str] = ()) -> dict[str, Any]:
    """All objects of a kind by name, without the names that are `taken`. Those that cannot be loaded, or are none of
    what is `wanted`, are left out, each told in one line once."""
    found = {}
    for name in [name for name in added_names(kind) if name not in taken]:
        try:
            item = added(kind, name)
            with run_added(kind, name):
                if not isinstance(item, wanted):
                    raise TypeError(f"{item!r} is no {wanted.__name__}")
            found[name] = item
        except JobError as error:
            _tell_once(f"{kind} {name}: {error}")
    return found


@cache
def _tell_once(text: str) -> None:
    log.warning("bonecam: %s", text)


@contextmanager
def run_added(kind: str, name: str) -> Iterator[None]:
    """A block that runs the object of a name; JobError where it fails otherwise than with an error of bonecam."""
    try:
        yield
    except BonecamError:
        raise
    except Exception as error:  # whatever a stranger's code raises
        raise _failed(kind, name, "fails", error) from error


def added_figures(result: Any) -> dict[str, dict[str, Any]]:
    """What plugins tell of a Result, by their names. One that fails is told in one line, once: the run stands."""
    told = {}
    for name, figures in all_added("figures", Callable).items():
        try:
            with run_added("figures", name):
                told[name] = dict(figures(result))
        except BonecamError as error:
            _tell_once(str(error))
    return told


def _failed(kind: str, name: str, what: str, error: BaseException) -> JobError:
    """The error of an added object, with its file or entry point, and the last line of it that ran."""
    file = user_folder() / kind / f"{name}.py"
    place = str(file)
    if not file.is_file():
        point = _points(kind)[name]
        place = f"entry point {point.value}{f' of {point.dist.name}' if point.dist else ''}"
    frames = [frame for frame in extract_tb(error.__traceback__) if frame.filename == str(file)]
    where = f"line {frames[-1].lineno}: " if frames else ""
    why = " ".join(f"{type(error).__name__}: {error}".split())
    return JobError(f"{place}: {where}{what}: {why}: mend or remove it", file=place)


def _packaged(kind: str) -> Iterator[Path]:
    """The folders of the packages that entry points of a kind name."""
    for _, point in sorted(_points(kind).items()):
        try:
            spec = find_spec(point.value)
        except (ImportError, ValueError):
            continue
        if spec is not None:
            yield from map(Path, spec.submodule_search_locations or ())


def plugin_folders() -> list[Path]:
    """The folders of the packages that add something, without bonecam itself, in order."""
    values = {point.value.partition(":")[0] for kind in ATTRIBUTES for point in _points(kind).values()}
    packages = sorted({value.partition(".")[0] for value in values} - {"bonecam"})
    specs = [find_spec(package) for package in packages]
    return [Path(folder) for spec in specs if spec for folder in spec.submodule_search_locations or ()]


@cache
def _points(kind: str) -> dict[str, EntryPoint]:
    """The entry points of a kind by name."""
    if os.environ.get(ALONE):
        return {}
    return {point.name: point for point in entry_points(group=f"bonecam.{kind}")}
