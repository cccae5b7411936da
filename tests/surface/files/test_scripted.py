"""A filter script that a part's mesh goes through first."""

from pathlib import Path

import igl
import numpy as np
import pytest

from bonecam.errors import FileError, FilterError, JobError
from bonecam.job import Job
from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.files.surface_input import read_part, refuse_changes

SMOOTH = """<!DOCTYPE FilterScript>
<FilterScript>
 <filter name="Transform: Scale, Normalize">
  <Param name="axisX" type="RichFloat" value="2"/>
  <Param name="axisY" type="RichFloat" value="2"/>
  <Param name="axisZ" type="RichFloat" value="2"/>
 </filter>
</FilterScript>
"""
COPY = '<!DOCTYPE FilterScript>\n<FilterScript>\n <filter name="Duplicate Current layer"/>\n</FilterScript>\n'


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    vertices, faces = igl.icosahedron()
    for _ in range(3):
        vertices, faces = igl.upsample(vertices, faces)
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    write_mesh(TriangleMesh(10 * vertices * [1, 1, 1.4], faces.astype(np.int32)), tmp_path / "ball.ply")
    return tmp_path / "ball.ply"


def job_of(file: Path, text: str) -> Job:
    file.write_text(text)
    return Job(mesh={"script": str(file)})


def test_the_part_is_what_the_script_leaves_of_the_mesh(ball: Path, tmp_path: Path) -> None:
    plain, _ = read_part(ball, Job())
    part, given = read_part(ball, job_of(tmp_path / "s.mlx", SMOOTH))
    assert given is None
    assert part.file == str(ball)
    assert part.given.volume == pytest.approx(8 * plain.given.volume, rel=1e-5)
    assert any("s.mlx" in note for note in part.notes)


def test_a_mesh_in_memory_goes_through_the_script_too(ball: Path, tmp_path: Path) -> None:
    mesh = read_part(ball, Job())[0].given
    part, _ = read_part(mesh, job_of(tmp_path / "s.mlx", SMOOTH))
    assert part.given.volume == pytest.approx(8 * mesh.volume, rel=1e-5)


def test_a_script_that_leaves_two_meshes_is_refused(ball: Path, tmp_path: Path) -> None:
    with pytest.raises(FilterError, match=r"s.mlx: leaves 2 layers with faces: let it end"):
        read_part(ball, job_of(tmp_path / "s.mlx", COPY))


def test_a_script_that_is_not_there_or_does_not_fit_is_named(ball: Path, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"no.mlx"):
        read_part(ball, Job(mesh={"script": str(tmp_path / "no.mlx")}))
    with pytest.raises(FilterError, match=r"s.mlx, line 3"):
        read_part(ball, job_of(tmp_path / "s.mlx", COPY.replace("Duplicate", "Triplicate")))
    with pytest.raises(JobError, match=r"mesh.*script"):
        refuse_changes(job_of(tmp_path / "s.mlx", SMOOTH).mesh, "a.tsm")
