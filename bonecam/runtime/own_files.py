"""Runs that put files into one folder take their turns, by a lock file in it while they do so: on any system and file
system, between computers that share the folder too.

Digests of files, and which files of a folder an earlier run wrote: the list `.bonecam-files` in it, as `sha256sum`
writes them.

A later run may remove what stands there only with the content that it was written with. A file that a person
put there, or has changed since, is theirs.
"""

import hashlib
import os
import re
from collections.abc import Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from threading import local

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
