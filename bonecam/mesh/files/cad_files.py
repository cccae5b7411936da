"""STEP and IGES files, read in a process of its own.

OpenCASCADE ends its process on some damaged files (measured: about one in ten that were damaged at random).
So that a bad file is one line and not a crash, it works in a child, which hands back the result.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bonecam.mesh.files.cad_shapes import refuse_foreign, unreadable
from bonecam.mesh.files.cad_tessellation import read_and_tessellate
from bonecam.mesh.files.child import call_in_child
from bonecam.mesh.files.formats.content import MeshFile
from bonecam.mesh.files.opencascade import is_failure, kind_of, missing

SECONDS = 60.0
"""Time that OpenCASCADE has for a file, and 100 s more for each MB."""
MEMORY = 2**31
"""Memory that OpenCASCADE has for its data, bytes, and 500 more for each byte of the file."""


def read_cad_mesh(path: str | Path, chord_tolerance: float | None = None) -> MeshFile:
    """The part in a STEP or IGES file as triangles in mm, within `chord_tolerance` (mm; default 5e-4 of its
    diagonal) of its faces.

    FileError names the file and what is wrong: not installed, no such file, no STEP or IGES, cut short,
    damaged, no surfaces in it.
    """
    work = read_and_tessellate
    given: MeshFile = in_child(f"{work.__module__}:{work.__name__}", Path(path), chord_tolerance)
    return given


def in_child(work: str, file: Path, *values: Any) -> Any:
    """What a function returns for a STEP or IGES file, run in a process of its own.

    `work` names the function as "module:function"; it is called with the file's name, `values` and a progress.
    FileError where the function raised one, or the process broke down or went beyond SECONDS or MEMORY.
    """
    data = refuse_foreign(file)
    if find_spec("OCP") is None:
        raise missing(f"{file}: reading {kind_of(file)}")
    try:
        return call_in_child(
            work,
            str(file),
            *values,
            library="OpenCASCADE",
            remedy=f"it may be damaged: export the part as {kind_of(file)} again",
            seconds=SECONDS + len(data) / 1e4,
            memory=MEMORY + 500 * len(data),
        )
    except Exception as error:
        if not is_failure(error):
            raise
        raise unreadable(file, str(error)) from error
