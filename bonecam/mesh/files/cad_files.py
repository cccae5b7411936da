"""STEP and IGES files, read in a process of its own.

OpenCASCADE ends its process on some damaged files (measured: about one in ten that were damaged at random).
So that a bad file is one line and not a crash, it works in a child, which hands back arrays.
"""

import io
import os
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy import ndarray

from bonecam.errors import FileError
from bonecam.mesh.files.cad_shapes import refuse_foreign
from bonecam.mesh.files.cad_tessellation import read_and_tessellate
from bonecam.mesh.files.opencascade import kind_of, missing
from bonecam.mesh.triangle_mesh import TriangleMesh

REFUSED = 2
"""Exit code of the child where it raised FileError, whose message is the last line of its stderr."""
STDOUT, STDERR = 1, 2
"""Numbers of the child's streams (POSIX)."""
CHILD = """
import sys
from bonecam.runtime.parent import end_with_parent
end_with_parent(int(sys.argv[1]))
from bonecam.mesh.files.cad_files import serve
serve()
"""
"""Python code that the child runs."""


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
    paths = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(os.getpid()), work, str(file), *words],
        env={**os.environ, "PYTHONPATH": paths},
        stdin=subprocess.DEVNULL,
        capture_output=True,
    )
    if done.returncode == REFUSED:
        told = done.stderr.decode(errors="replace").strip().splitlines()
        raise FileError(told[-1], file=str(file))
    if done.returncode or not done.stdout:
        what = f"OpenCASCADE broke down on it (exit {done.returncode})"
        raise FileError(
            f"{file}: {what}: it is damaged: export the part as {kind_of(file)} again", file=str(file)
        )
    with np.load(io.BytesIO(done.stdout)) as found:
        return dict(found)


def serve() -> None:
    """The child's main function. Its arguments are the number of its parent's process, a "module:function", the
    file to read and further words.

    The arrays that the function returns go to stdout as .npz, the message of a FileError to stderr, as does what
    OpenCASCADE prints.
    """
    _, _, work, file, *words = sys.argv
    answer = os.dup(STDOUT)
    os.dup2(STDERR, STDOUT)
    module, _, function = work.partition(":")
    try:
        arrays = getattr(import_module(module), function)(Path(file), *words)
    except FileError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(REFUSED)
    content = io.BytesIO()
    np.savez(content, **arrays)
    with open(answer, "wb") as pipe:
        pipe.write(content.getbuffer())
