"""Parts that come as a surface.

A filter script that a part's mesh goes through first.
"""

import time
from pathlib import Path

import igl
import numpy as np
import pytest
from tsplines import SECTION_POLES, bone_like, samples, sections, write_rows

from bonecam.errors import FileError, FilterError, JobError, SurfaceError, UnitsError
from bonecam.job import Job
from bonecam.mesh import TriangleMesh, write_mesh
from bonecam.surface import Deviation, Fit, TSpline, save_surface
from bonecam.surface.files.surface_input import (
    closed_mesh,
    holds_surface,
    move_with_part,
    read_part,
    read_surface,
    refuse_changes,
    reverse_parameters,
)
from bonecam.surface.files.tspline_text import check_target


def test_turning_a_surface_reverses_both_parameters_and_nothing_else():
    surface = bone_like(9, 7, 4)
    s, t = samples(2000)
    np.testing.assert_allclose(
        reverse_parameters(surface).evaluate(s, t), surface.evaluate(np.mod(-s, 1), 1 - t), rtol=0, atol=1e-13
    )
    assert reverse_parameters(surface).volume == pytest.approx(surface.volume, rel=1e-12)


def test_rows_in_metres_are_skinned_in_mm_and_their_deviation_is_told(tmp_path):
    file = write_rows(
        [row / 1000 for row in [SECTION_POLES[:1], *sections(6, 16), SECTION_POLES[1:]]], tmp_path / "rows.csv"
    )
    assert holds_surface(file)
    found = read_surface(file, 1000.0, 0.05, 450)
    assert found.reached
    assert 0 < found.deviation.max <= 0.05
    assert found.surface.volume == pytest.approx(4 / 3 * np.pi * 4 * 3 * 9, rel=0.05)


def test_a_saved_surface_comes_back_as_it_was(tmp_path):
    surface = bone_like(9, 7, 4)
    save_surface(surface, tmp_path / "a.tspline")
    found = read_surface(tmp_path / "a.tspline", 1.0, 0.1, 450)
    assert found.surface.control_points.tobytes() == surface.control_points.tobytes()
    assert found.deviation.max == 0


def test_a_surface_that_no_mesh_follows_is_refused_with_its_file():
    surface = bone_like(9, 7, 4)
    weights = surface.weights.copy()
    weights[len(weights) // 3] = 1e12
    with pytest.raises(
        SurfaceError, match=r"a\.tspline: the surface cannot be tessellated .*correct weights"
    ) as caught:
        closed_mesh(TSpline(surface.tmesh, surface.control_points, weights), "a.tspline")
    assert caught.value.evidence["file"] == "a.tspline"


@pytest.mark.parametrize("far", [900.0, 2000.0])
def test_a_surface_that_would_take_minutes_to_mesh_is_refused_at_once(far):
    surface = bone_like(9, 7, 4)
    points = surface.control_points.copy()
    points[len(points) // 3, 2] = far
    began = time.process_time()
    with pytest.raises(SurfaceError, match=rf"a\.tspline: .* with {len(points)},000 vertices, .*correct weights"):
        closed_mesh(TSpline(surface.tmesh, points, surface.weights), "a.tspline")
    assert time.process_time() < began + 5.0


def test_a_surface_that_is_put_upside_down_runs_from_the_lower_pole_again():
    given = bone_like(9, 7, 4)
    upside_down = np.diag([1.0, -1.0, -1.0, 1.0])
    upside_down[:3, 3] = [1, 2, 30]
    fit = Fit(given, Deviation(0.0, 0.0, 0.0, 0.0, np.zeros(3)), 0.1, True)
    surface = move_with_part(fit, upside_down).surface
    assert surface.control_points[0, 2] < surface.control_points[-1, 2]
    assert surface.volume == pytest.approx(given.volume, rel=1e-12)


def test_what_encloses_no_part_is_refused(tmp_path):
    surface = bone_like()
    write_rows(sections(), tmp_path / "open.csv")
    write_rows([SECTION_POLES[:1], *sections(4, 12), SECTION_POLES[1:]], tmp_path / "many.csv")
    save_surface(surface, tmp_path / "bone.tspline")
    save_surface(bone_like(poles=False), tmp_path / "tube.tspline")
    save_surface(surface.with_control_points(surface.control_points * [1, -1, 1]), tmp_path / "inward.tspline")
    save_surface(surface.with_control_points(surface.control_points * [0, 0, 1]), tmp_path / "line.tspline")
    for name, allowed, reason in (
        ("line.tspline", 450, "encloses no volume: give rows that go round"),
        ("open.csv", 450, "encloses no part: give a pole .*`bonecam finish`"),
        ("tube.tspline", 450, "encloses no part: .*`bonecam finish`"),
        ("inward.tspline", 450, "point inward"),
        ("many.csv", 20, r"the rows need 26 control points at least: raise surface\.max_control_points"),
        ("bone.tspline", 20, "20 are allowed: raise surface.max_control_points"),
    ):
        with pytest.raises(SurfaceError, match=rf"{name}: .*{reason}"):
            read_surface(tmp_path / name, 1.0, 0.3, allowed)
    with pytest.raises(UnitsError, match=r"inward\.tspline: states its unit"):
        read_surface(tmp_path / "inward.tspline", 1000.0, 0.1, 450)


def test_the_ending_decides_what_is_written(tmp_path):
    pytest.importorskip("OCP", reason="OpenCASCADE's wheel is not installed: pip install 'bonecam[cad]'")
    surface = bone_like(7, 5, 1)
    for name, head in (
        ("a.tspline", b"#bonecam"),
        ("a.step", b"ISO-10303-21"),
        ("a.stp", b"ISO"),
        ("a.igs", b" "),
        ("a.IGES", b" "),
    ):
        save_surface(surface, tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(head)


def test_a_name_that_fits_no_form_is_refused_before_the_work(tmp_path):
    with pytest.raises(FileError, match=r"unknown ending '\.prt'"):
        check_target(tmp_path / "a.prt")
    assert not list(tmp_path.iterdir())


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
def ball(tmp_path):
    vertices, faces = igl.icosahedron()
    for _ in range(3):
        vertices, faces = igl.upsample(vertices, faces)
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    write_mesh(TriangleMesh(10 * vertices * [1, 1, 1.4], faces.astype(np.int32)), tmp_path / "ball.ply")
    return tmp_path / "ball.ply"


def job_of(file: Path, text: str) -> Job:
    file.write_text(text)
    return Job(mesh={"script": str(file)})


@pytest.mark.plugged
def test_the_part_is_what_the_script_leaves_of_the_mesh(ball, tmp_path):
    plain, _ = read_part(ball, Job())
    part, given = read_part(ball, job_of(tmp_path / "s.mlx", SMOOTH))
    assert given is None
    assert part.file == str(ball)
    assert part.given.volume == pytest.approx(8 * plain.given.volume, rel=1e-5)
    assert any("s.mlx" in note for note in part.notes)


@pytest.mark.plugged
def test_a_mesh_in_memory_goes_through_the_script_too(ball, tmp_path):
    mesh = read_part(ball, Job())[0].given
    part, _ = read_part(mesh, job_of(tmp_path / "s.mlx", SMOOTH))
    assert part.given.volume == pytest.approx(8 * mesh.volume, rel=1e-5)


@pytest.mark.plugged
def test_a_script_that_leaves_two_meshes_is_refused(ball, tmp_path):
    with pytest.raises(FilterError, match=r"s.mlx: leaves 2 layers with faces: let it end"):
        read_part(ball, job_of(tmp_path / "s.mlx", COPY))


@pytest.mark.plugged
def test_a_script_that_is_not_there_or_does_not_fit_is_named(ball, tmp_path):
    with pytest.raises(FileError, match=r"no.mlx"):
        read_part(ball, Job(mesh={"script": str(tmp_path / "no.mlx")}))
    with pytest.raises(FilterError, match=r"s.mlx, line 3"):
        read_part(ball, job_of(tmp_path / "s.mlx", COPY.replace("Duplicate", "Triplicate")))
    with pytest.raises(JobError, match=r"mesh.*script"):
        refuse_changes(job_of(tmp_path / "s.mlx", SMOOTH).mesh, "a.tsm")
