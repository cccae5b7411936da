"""STEP and IGES parts as triangles, read in a process of its own.

OpenCASCADE ends its process on some damaged files (measured: about one in fifteen that were damaged at random). So that a bad file is one
line and not a crash, it works in a child, which hands back the triangles.
"""

import os
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from bonecam.errors import FileError
from bonecam.mesh.opencascade import kind_of, missing, refuse_foreign
from bonecam.mesh.triangle_mesh import TriangleMesh

REFUSED = 2
CHILD = "from bonecam.mesh.cad_files import serve; serve()"


def read_cad_mesh(path: str | Path, chord_tolerance: float | None = None) -> TriangleMesh:
    """The part in a STEP or IGES file as triangles in mm, within `chord_tolerance` (mm; default 5e-4 of its diagonal) of its faces.

    FileError names the file and what is wrong: not installed, no such file, no STEP or IGES, cut short, damaged, no surfaces in it.
    """
    file = Path(path)
    refuse_foreign(file)
    if find_spec("OCP") is None:
        raise missing(f"{file}: reading {kind_of(file)}")
    with tempfile.TemporaryDirectory(prefix="bonecam.") as folder:
        target = Path(folder) / "mesh.npz"
        words = [sys.executable, "-c", CHILD, str(file), str(chord_tolerance or 0.0), str(target)]
        paths = os.pathsep.join(path for path in sys.path if path)
        done = subprocess.run(words, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True)
        if done.returncode == REFUSED:
            raise FileError(done.stderr.strip().splitlines()[-1], file=str(file))
        if done.returncode or not target.is_file():
            what = f"OpenCASCADE broke down on it (exit {done.returncode})"
            raise FileError(f"{file}: {what}: it is damaged: export the part as {kind_of(file)} again", file=str(file))
        with np.load(target) as found:
            return TriangleMesh(found["vertices"], found["faces"])


def serve() -> None:
    """The child: read argv[1] within argv[2] mm into argv[3]; a FileError goes to stderr with exit code REFUSED."""
    from bonecam.mesh.opencascade import mesh_in

    _, file, tolerance, target = sys.argv
    try:
        mesh = mesh_in(Path(file), float(tolerance) or None)
    except FileError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(REFUSED)
    np.savez(target, vertices=mesh.vertices, faces=mesh.faces)
