"""Guards round MeshLab: what of it may end the process, take all its time, or open files anywhere.

Files that a mesh file names and MeshLab opens with it: materials (OBJ: `mtllib`) and textures (their `map_Kd`;
PLY: `comment TextureFile`).

MeshLab looks for them beside the file that names them and in the folder of the process, takes a backslash for a
slash, and the words that follow for one name or for several (measured, pymeshlab 2025.7). How other kinds of
files name files is not known here.

Files that MeshLab reads into its own layers, with colours, textures and all that it knows of a format.

Its readers end their process on some damaged files, so they work in a child with limits of time and memory,
which hands back layers that MeshLab wrote itself. STL, PLY, OBJ and OFF are read by `bonecam.mesh` first: what is
wrong with them is told with its line.

What else of MeshLab may end its process, or take all its time, is tried in a child before it is done here: it cannot
hand over a project or a raster as it can a mesh, and a snapshot needs its window.
"""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

from bonecam.errors import FileError
from bonecam.files import input_bytes, library_name
from bonecam.mesh.files.cad import call_in_child
from bonecam.mesh.files.mesh_files import MESHES, bytes_of, read_content
from bonecam.mesh.meshlab import meshlab
from bonecam.progress import Progress, silent
from bonecam.runtime.staging import temporary_folder


@cache
def meshlab_filters() -> frozenset[str]:
    """The Python names of the filters that this pymeshlab has."""
    return frozenset(meshlab().filter_list())


@cache
def meshlab_refusals() -> tuple[type[Exception], ...]:
    """What pymeshlab raises where it takes no value or a filter fails: its own kinds of exception, of which only one is
    a PyMeshLabException, and those of pybind11."""
    own = (kind for kind in vars(meshlab().pmeshlab).values() if isinstance(kind, type))
    return (*(kind for kind in own if issubclass(kind, Exception)), RuntimeError, TypeError, ValueError)


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
                # The names that the end of a line may mean
                rest = match[1]
                text = os.fsdecode(rest).replace("\\", "/").strip(" \t\"'")
                words = text.split()
                for name in list(dict.fromkeys([text, words[0], words[-1]])) if words else []:
                    if os.path.exists(folder / name):
                        yield NamedFile(folder / name, file, number)


def _materials(named: NamedFile) -> bytes:
    try:
        return input_bytes(named.place)
    except OSError as error:
        named.refuse(f"cannot be read ({error.strerror}): remove the line")


def write_layers(file: str, folder: str, options: Mapping[str, Any], progress: Progress = silent) -> dict[str, str]:
    """Write the layers that MeshLab reads from a file, by `options` of its reader, into a folder; their labels by
    the names of the files.

    FileError where MeshLab refuses the file. A damaged one may end the process.
    """
    meshset = meshlab().MeshSet()
    try:
        with library_name(file) as name:
            meshset.load_new_mesh(name, **options)
    except meshlab().PyMeshLabException as error:
        reason = " ".join(str(error).split()).rstrip(":")
        raise FileError(f"{file}: {reason}: give a readable mesh file", file=file) from error
    labels = {}
    for k, layer in enumerate(meshset):
        meshset.set_current_mesh(layer.id())
        lines = layer.edge_number() > 0 and layer.face_number() == 0
        name = f"{k}.obj" if lines else f"{k}.ply"
        meshset.save_current_mesh(str(Path(folder) / name), **({} if lines else {"save_vertex_normal": True}))
        labels[name] = layer.label()
    return labels


def call_on_cube(file: str, method: str, values: Mapping[str, Any], progress: Progress = silent) -> None:
    """Call a method of a pymeshlab.MeshSet, with a cube in it, that reads or writes `file`. FileError where MeshLab
    refuses it; it may end the process."""
    meshset = meshlab().MeshSet()
    meshset.create_cube()
    try:
        getattr(meshset, method)(**values)
    except meshlab().PyMeshLabException as error:
        reason = " ".join(str(error).split()).rstrip(":")
        raise FileError(f"{file}: {reason}: give a readable file", file=file) from error


SECONDS = 60.0
"""Time that MeshLab has for a file, and one second more for each MB."""
MEMORY = 2**31
"""Memory that MeshLab has for its data, bytes, and 50 more for each byte of the file."""
OUTSIDE = "is not in the folder of the mesh: put it there, or allow it with MeshSet(allow_outside=True)"
"""What is wrong with a material or texture that a mesh names elsewhere: MeshLab would open it."""
ENDING = {
    "save_snapshot": ("", "imagefilename"),
    "nxs_build": ("input_file", "output_file"),
    "nxs_compress": ("input_file", "output_file"),
}
"""MeshLab's filters that end the process without a display, or on damaged files, and the parameters of each that are
the file it reads and the one it writes."""


@contextmanager
def layers_of(file: Path, options: Mapping[str, Any], *, allow_outside: bool) -> Iterator[list[tuple[Path, str]]]:
    """Files that MeshLab wrote of the layers of `file`, and their labels; they are removed with the block.

    `options` are those of MeshLab's reader of this kind of file. FileError names the file and what is wrong, which
    without `allow_outside` is a material or texture in another folder too.
    """
    remedy = "it may be damaged: write it anew from its source"
    data = bytes_of(file)
    if file.suffix.lower() in MESHES:
        read_content(file, data)
    # FileError where a PLY or OBJ of the bytes `data`, or its materials, names a pipe, a device or a folder
    for named in named_files(file, data):
        if not named.place.is_file():
            named.refuse("is no regular file: remove the line")
    if not allow_outside:
        refuse_names_outside(file, data, [file.parent], OUTSIDE)
    with temporary_folder() as folder:
        answer = call_in_child(
            f"{write_layers.__module__}:{write_layers.__name__}",
            str(file),
            str(folder),
            dict(options),
            library="MeshLab",
            remedy=remedy,
            seconds=SECONDS + len(data) / 1e6,
            memory=MEMORY + 50 * len(data),
        )
        yield [(folder / name, label) for name, label in answer.items()]


def try_reading(method: str, names: str | Sequence[str], values: Mapping[str, Any]) -> None:
    """Call a method of MeshLab's that reads files, on a scratch cube. FileError names the first of them where it
    breaks down, takes longer than a mesh of their size may, or is refused."""
    files = [names] if isinstance(names, str) else names
    _try(method, files[0], files, values, "they may be damaged: write them anew from their source")


def try_filter(name: str, given: Mapping[str, Any], values: Mapping[str, Any]) -> None:
    """Apply a filter of ENDING to a scratch cube and the files that it reads. `values` are those that are given, and
    defaults. FileError names the file that it would write where it breaks down."""
    reads, writes = ENDING[name]
    read = [str(values[reads])] if reads else []
    written = Path(str(values[writes]))
    remedy = "leave it out: it needs a display with OpenGL" if not read else "give it another file"
    with temporary_folder() as folder:
        work = {**given, writes: str(folder / written.name)}
        _try(name, str(written), read, work, remedy)


def _try(method: str, named: str, read: Sequence[str], values: Mapping[str, Any], remedy: str) -> None:
    size = sum(len(bytes_of(Path(file))) for file in read)
    call_in_child(
        f"{call_on_cube.__module__}:{call_on_cube.__name__}",
        named,
        method,
        dict(values),
        library=f"MeshLab's {method}",
        remedy=remedy,
        seconds=SECONDS + size / 1e6,
        memory=MEMORY + 50 * size,
    )
