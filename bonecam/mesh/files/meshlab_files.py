"""Files that MeshLab reads into its own layers, with colours, textures and all that it knows of a format.

Its readers end their process on some damaged files, so they work in a child with limits of time and memory,
which hands back layers that MeshLab wrote itself. STL, PLY, OBJ and OFF are read by `mesh.files.formats` first:
what is wrong with them is told with its line.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bonecam.mesh.files.child import call_in_child
from bonecam.mesh.files.mesh_files import MESHES, bytes_of, read_content
from bonecam.mesh.files.named_files import refuse_special_names
from bonecam.mesh.meshlab import write_layers
from bonecam.runtime.temporary import temporary_folder

SECONDS = 60.0
"""Time that MeshLab has for a file, and one second more for each MB."""
MEMORY = 2**31
"""Address space that MeshLab has, bytes, and 50 more for each byte of the file."""


@contextmanager
def layers_of(file: Path, options: Mapping[str, Any]) -> Iterator[list[tuple[Path, str]]]:
    """Files that MeshLab wrote of the layers of `file`, and their labels; they are removed with the block.

    `options` are those of MeshLab's reader of this kind of file. FileError names the file and what is wrong.
    """
    remedy = "write it anew from its source"
    data = bytes_of(file)
    if file.suffix.lower() in MESHES:
        read_content(file, data)
    refuse_special_names(file, data)
    with temporary_folder() as folder:
        answer = call_in_child(
            f"{write_layers.__module__}:{write_layers.__name__}",
            str(file),
            str(folder),
            json.dumps(dict(options)),
            library="MeshLab",
            remedy=remedy,
            seconds=SECONDS + len(data) / 1e6,
            memory=MEMORY + 50 * len(data),
        )
        yield [(folder / name, label) for name, label in json.loads(answer).items()]
