"""Files that a mesh file names and MeshLab opens with it: materials (OBJ: `mtllib`) and textures (their `map_Kd`;
PLY: `comment TextureFile`).

MeshLab looks for them beside the file that names them and in the folder of the process, takes a backslash for a
slash, and the words that follow for one name or for several (measured, pymeshlab 2025.7). How other kinds of
files name files is not known here.
"""

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from bonecam.errors import FileError
from bonecam.files import input_bytes

PLY = re.compile(rb"[ \t]*comment.*?Texture(?:Normal)?File(.*)")
OBJ = re.compile(rb"[ \t]*(?:mtllib|usemap|maplib)\s+(.*)")
MATERIALS = re.compile(rb"[ \t]*(?:map_\w+|bump|disp|decal|refl|norm)\s+(.*)", re.IGNORECASE)
"""Lines that name files, up to the name."""
NAMING = {".ply": PLY, ".obj": OBJ}
"""The lines of each kind of mesh file that name files."""


@dataclass(frozen=True)
class NamedFile:
    """A file that is there, by the line of the file `by` that names it."""

    place: Path
    by: Path
    line: int

    def refuse(self, what: str) -> NoReturn:
        """Raise FileError: `what` is wrong with the file, and the remedy."""
        message = f"{self.by}: line {self.line}: {str(self.place)!r} {what}"
        raise FileError(message, file=str(self.by), line=self.line)


def refuse_special_names(file: Path, data: bytes) -> None:
    """FileError where a PLY or OBJ of the bytes `data`, or its materials, names a pipe, a device or a folder."""
    for named in named_files(file, data):
        if not named.place.is_file():
            named.refuse("is no regular file: remove the line")


def refuse_names_outside(file: Path, data: bytes, folders: Sequence[Path], remedy: str) -> None:
    """FileError with the `remedy` where a PLY or OBJ of the bytes `data`, or its materials, names a file that is below
    none of the folders."""
    roots = [Path(os.path.realpath(folder)) for folder in folders]
    for named in named_files(file, data):
        if not any(root in Path(os.path.realpath(named.place)).parents for root in roots):
            named.refuse(remedy)


def named_files(file: Path, data: bytes) -> Iterator[NamedFile]:
    """The files that a PLY or OBJ of the bytes `data` names, and its materials, where they are there. None of them
    is opened but materials that are regular files."""
    naming = NAMING.get(file.suffix.lower())
    if naming is None:
        return
    for named in _found(file, data, naming):
        yield named
        if naming is OBJ and named.place.is_file():
            yield from _found(named.place, _materials(named), MATERIALS)


def _found(file: Path, data: bytes, naming: re.Pattern[bytes]) -> Iterator[NamedFile]:
    """What is there of the files that the lines of a file name."""
    for number, line in enumerate(data.splitlines(), 1):
        match = naming.match(line)
        if match:
            for folder in dict.fromkeys((file.parent, Path())):
                for name in _names(match[1]):
                    if os.path.exists(folder / name):
                        yield NamedFile(folder / name, file, number)


def _names(rest: bytes) -> list[str]:
    """The names that the end of a line may mean."""
    text = os.fsdecode(rest).replace("\\", "/").strip(" \t\"'")
    words = text.split()
    return list(dict.fromkeys([text, words[0], words[-1]])) if words else []


def _materials(named: NamedFile) -> bytes:
    try:
        return input_bytes(named.place)
    except OSError as error:
        named.refuse(f"cannot be read ({error.strerror}): remove the line")
