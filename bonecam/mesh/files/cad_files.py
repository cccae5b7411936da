"""STEP and IGES files, read in a process of its own.

OpenCASCADE ends its process on some damaged files (measured: about one in ten that were damaged at random).
So that a bad file is one line and not a crash, it works in a child, which hands back arrays.
"""

import io
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy import ndarray

from bonecam.mesh.files.cad_shapes import refuse_foreign
from bonecam.mesh.files.cad_tessellation import read_and_tessellate
from bonecam.mesh.files.child import call_in_child
from bonecam.mesh.files.opencascade import kind_of, missing
from bonecam.mesh.triangle_mesh import TriangleMesh


def read_cad_mesh(path: str | Path, chord_tolerance: float | None = None) -> TriangleMesh:
    """The part in a STEP or IGES file as triangles in mm, within `chord_tolerance` (mm; default 5e-4 of its
    diagonal) of its faces.

    FileError names the file and what is wrong: not installed, no such file, no STEP or IGES, cut short,
    damaged, no surfaces in it.
    """
    found = in_child(f"{__name__}:mesh_arrays", Path(path), str(chord_tolerance or 0.0))
    return TriangleMesh(found["vertices"], found["faces"])


def mesh_arrays(file: Path, chord_tolerance: str) -> dict[str, ndarray]:
    """Vertices and faces of the part in a STEP or IGES file; `read_cad_mesh` runs this in the child."""
    mesh = read_and_tessellate(file, float(chord_tolerance) or None)
    return {"vertices": mesh.vertices, "faces": mesh.faces}


def in_child(work: str, file: Path, *words: str) -> dict[str, ndarray]:
    """The arrays that a function returns for a STEP or IGES file, run in a process of its own.

    `work` names the function as "module:function"; it is called with the file and `words`. FileError where
    the function raised one, or the process broke down.
    """
    refuse_foreign(file)
    if find_spec("OCP") is None:
        raise missing(f"{file}: reading {kind_of(file)}")
    answer = call_in_child(
        f"{__name__}:packed_arrays",
        str(file),
        work,
        *words,
        library="OpenCASCADE",
        remedy=f"export the part as {kind_of(file)} again",
    )
    with np.load(io.BytesIO(answer)) as found:
        return dict(found)


def packed_arrays(file: str, work: str, *words: str) -> bytes:
    """The arrays of `work` as .npz; `in_child` runs this in the child."""
    module, _, function = work.partition(":")
    content = io.BytesIO()
    np.savez(content, **getattr(import_module(module), function)(Path(file), *words))
    return content.getvalue()
