"""Files that MeshLab reads into its own layers, with colours, textures and all that it knows of a format.

Its readers end their process on some damaged files, so they work in a child with limits of time and memory,
which hands back layers that MeshLab wrote itself. STL, PLY, OBJ and OFF are read by `mesh.files.formats` first:
what is wrong with them is told with its line.

What else of MeshLab may end its process, or take all its time, is tried in a child before it is done here: it cannot
hand over a project or a raster as it can a mesh, and a snapshot needs its window.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bonecam.mesh.files.child import call_in_child
from bonecam.mesh.files.mesh_files import MESHES, bytes_of, read_content
from bonecam.mesh.files.named_files import refuse_names_outside, refuse_special_names
from bonecam.mesh.meshlab import call_on_cube, write_layers
from bonecam.runtime.temporary import temporary_folder

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
    refuse_special_names(file, data)
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
