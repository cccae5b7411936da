"""The program does not depend on the processor: OpenBLAS has other kernels for each, numpy other loops."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bonecam.job import Job, write_job
from bonecam.mesh import TriangleMesh, write_mesh
from bonecam.setup import Capsule

pytestmark = pytest.mark.whole

JOB = Job().with_values(
    mechanics={"refuse": False},
    surface={"tolerance": 0.1},
    levels={"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.05},
    roughing={"preset": "ball-4", "scallop": 0.3},
    finishing={"preset": "ball-2", "scallop": 0.15},
    holding={"diameter": 3.0},
    path={"chord_tolerance": 0.02},
)
OTHERS = {"OPENBLAS_CORETYPE": "Prescott", "OMP_NUM_THREADS": "2"}


@pytest.fixture(scope="module")
def bent(tmp_path_factory):
    """A bent and flattened capsule, askew to all axes."""
    straight = Capsule(np.array([0.0, 0.0, -2.0]), np.array([0.0, 0.0, 2.0]), 2.5).mesh(0.1)
    x, y, z = straight.vertices.T
    vertices = np.column_stack([x + 0.03 * z**2, 0.8 * y + 0.1 * z, z + 0.2 * x])
    file = tmp_path_factory.mktemp("bent") / "bent.ply"
    write_mesh(TriangleMesh(vertices, straight.faces), file)
    return file


def program(mesh: Path, folder: Path, kernels: dict[str, str]) -> bytes:
    """The program that a process with these kernels makes."""
    folder.mkdir()
    (folder / "job.toml").write_text(write_job(JOB), encoding="utf-8")
    command = [sys.executable, "-m", "bonecam", "convert", str(mesh), "-o", str(folder / "bent.h")]
    command += ["--job", str(folder / "job.toml"), "--no-simulation", "-q"]
    subprocess.run(command, env={**os.environ, **kernels}, check=True, timeout=600)
    return (folder / "bent.h").read_bytes()


def test_the_program_is_the_same_to_the_byte_on_other_processors_and_threads(bent, tmp_path):
    here = program(bent, tmp_path / "here", {})
    assert len(here.splitlines()) > 1000
    assert program(bent, tmp_path / "there", OTHERS) == here
