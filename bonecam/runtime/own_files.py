"""Digests of files, and which files of a folder an earlier run wrote: the list `.bonecam-files` in it, as `sha256sum`
writes them.

A later run may remove what stands there only with the content that it was written with. A file that a person
put there, or has changed since, is theirs.
"""

import hashlib
import os
import re
from collections.abc import Collection, Iterable
from functools import cache
from pathlib import Path

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
    return "".join(_line(name, content) for name, content in sorted({**kept, **written}.items()))


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
    named = [(_unescaped(name) if escaped else name, content) for escaped, content, name in lines]
    resolved = [(name, content, Path(os.path.realpath((root / name).parent))) for name, content in named]
    return {name: content for name, content, place in resolved if root == place or root in place.parents}


def _line(name: str, content: str) -> str:
    """The line of a file, as `sha256sum` writes and reads it."""
    escaped = "".join(ESCAPES.get(letter, letter) for letter in name)
    return f"{'' if escaped == name else chr(92)}{content}  {escaped}\n"


def _unescaped(name: str) -> str:
    letters = {escape: letter for letter, escape in ESCAPES.items()}
    return re.sub(r"\\[\\nr]", lambda match: letters[match[0]], name)


def _is_unchanged(file: Path, content: str) -> bool:
    try:
        return not file.is_symlink() and file.is_file() and digest(file) == content
    except OSError:
        return False
