"""Runs that put files into one folder take their turns, by a lock file in it while they do so: on any system and file
system, between computers that share the folder too.

Digests of files, and which files of a folder an earlier run wrote: the list `.bonecam-files` in it, as `sha256sum`
writes them.

A later run may remove what stands there only with the content that it was written with. A file that a person
put there, or has changed since, is theirs.

What users and other packages add by name: machines, dialects, materials, tools and lists of tools as files, stocks
and patterns as Python.

They stand in folders of these names below the user's folder (`user_folder`), or come with an installed package whose
entry points name them: the group `bonecam.machines` (and so on) a package with TOML files, the groups
`bonecam.stocks` and `bonecam.patterns` the object itself. What ships cannot be replaced: its names are taken.
"""

import hashlib
import os
import re
from collections.abc import Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from threading import local
from traceback import extract_tb
from typing import Any

from bonecam.errors import BonecamError, JobError

MAX_WAIT = 10.0
"""Longest wait for another run that is putting its files in place, s. That takes milliseconds; a run that was
stopped in between must not hold up this one."""
POLL = 0.01
"""How often the lock is tried, s."""
LOCK = ".bonecam-lock"
"""Name of the lock file."""


@contextmanager
def locked(folders: Iterable[Path]) -> Iterator[None]:
    """Keep other runs, and other threads, from placing files in the folders; without it where no lock can be made, or
    another run holds one for longer than MAX_WAIT. Blocks may stand inside each other."""
    held: set[Path] = _of_thread.__dict__.setdefault("held", set())
    with ExitStack() as locks:
        for folder in sorted({Path(os.path.realpath(folder)) for folder in folders} - held):
            locks.enter_context(_lock(folder / LOCK))
            held.add(folder)
            locks.callback(held.discard, folder)
        yield


_of_thread = local()
"""The folders that each thread has locked (`held`)."""


@contextmanager
def _lock(file: Path) -> Iterator[None]:
    """Hold a lock file that is there while the block lasts."""
    from filelock import SoftFileLock, Timeout

    lock = SoftFileLock(file)
    try:
        lock.acquire(timeout=MAX_WAIT, poll_interval=POLL)
    except Timeout:  # its run was killed or stopped: the next one need not wait
        with suppress(OSError):
            file.unlink()
    except OSError:
        pass
    try:
        yield
    finally:
        lock.release()


PACKAGE = Path(__file__).parents[1]
"""The folder of the package."""
OWN_FILES = ".bonecam-files"
"""Name of the list."""
ESCAPES = {"\\": "\\\\", "\n": "\\n", "\r": "\\r"}
"""How `sha256sum` writes the characters of a name that its lines cannot have; such a line begins with a backslash."""


def stale_files(folder: Path, own: str, new: Collection[str]) -> list[Path]:
    """The files of an earlier run that no file of `new` replaces, and whose names match `own`."""
    return [
        folder / name
        for name, content in _listed(folder).items()
        if name not in new and re.fullmatch(own, name) and _is_unchanged(folder / name, content)
    ]


def list_of_own(folder: Path, work: Path, new: Iterable[str], stale: Collection[Path]) -> str:
    """The text of the list once the files `new` have moved from `work` into the folder, and `stale` are gone."""
    written = {name: digest(work / name) for name in new}
    left = {name: content for name, content in _listed(folder).items() if folder / name not in stale}
    kept = {name: content for name, content in left.items() if (folder / name).is_file()}
    lines = []
    for name, content in sorted({**kept, **written}.items()):
        escaped = "".join(ESCAPES.get(letter, letter) for letter in name)
        lines.append(f"{'' if escaped == name else chr(92)}{content}  {escaped}\n")
    return "".join(lines)


def is_own(folder: Path, name: str) -> bool:
    """Whether an earlier run wrote this file of the folder, and it is as it was then."""
    content = _listed(folder).get(name)
    return content is not None and _is_unchanged(folder / name, content)


@cache
def folder_digest(folder: Path) -> str:
    """The SHA-256 of all files in and below a folder of a package, in the order of their names; what Python compiled of
    them does not count."""
    whole = hashlib.sha256()
    for place, folders, files in os.walk(folder):
        folders[:] = sorted({*folders} - {"__pycache__"})
        for file in sorted(Path(place, name) for name in files):
            whole.update(f"{file.relative_to(folder)}\0{digest(file)}".encode())
    return whole.hexdigest()


def digest(file: Path) -> str:
    """The SHA-256 of a file's bytes."""
    with open(file, "rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _listed(folder: Path) -> dict[str, str]:
    """The content of each file by its name, as the list tells it; nothing where there is no list of ours. Names that
    lead out of the folder, by `..` or by a link, are left out: anybody may have written the list."""
    try:
        text = (folder / OWN_FILES).read_bytes().decode()
    except (OSError, ValueError):
        return {}
    lines = re.findall(r"^(\\?)([0-9a-f]{64})  ([^/\n\0][^\n\0]*)$", text, re.MULTILINE)
    root = Path(os.path.realpath(folder))
    letters = {escape: letter for letter, escape in ESCAPES.items()}
    named = [
        (re.sub(r"\\[\\nr]", lambda match: letters[match[0]], name) if escaped else name, content)
        for escaped, content, name in lines
    ]
    resolved = [(name, content, Path(os.path.realpath((root / name).parent))) for name, content in named]
    return {name: content for name, content, place in resolved if root == place or root in place.parents}


def _is_unchanged(file: Path, content: str) -> bool:
    try:
        return not file.is_symlink() and file.is_file() and digest(file) == content
    except OSError:
        return False


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
        if not file.is_file():
            return points[name].load()
        spec = spec_from_file_location(f"bonecam_user_{file.stem}", file)
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        return getattr(module, attribute)
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


def _packaged(kind: str) -> Iterator[Path]:
    """The folders of the packages that entry points of a kind name."""
    for _, point in sorted(_points(kind).items()):
        try:
            spec = find_spec(point.value)
        except (ImportError, ValueError):
            continue
        if spec is not None:
            yield from map(Path, spec.submodule_search_locations or ())


@cache
def _points(kind: str) -> dict[str, EntryPoint]:
    """The entry points of a kind by name."""
    return {point.name: point for point in entry_points(group=f"bonecam.{kind}")}
