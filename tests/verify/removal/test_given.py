"""A program judged against the mesh as given, not only against the surface that was made of it."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.errors import MeshError, VerifyError
from bonecam.job import Job, MeshJob
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.healing import Repair, surface_moves
from bonecam.mesh.part import Part, measure_taken_off, prepare_part
from bonecam.mesh.smooth_surface import Smoothing, coarseness_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.capsule import Capsule
from bonecam.verify.findings import GivenSurface, given_surface, measure_given
from bonecam.verify.gouge import Gouge
from bonecam.verify.sweeping import NormalProbes

RADIUS = 2.5


@pytest.fixture(scope="module")
def capsule() -> TriangleMesh:
    return Capsule(np.array([0.0, 0, 2.5]), np.array([0.0, 0, 7.5]), RADIUS).mesh(0.001)


def as_given(mesh: TriangleMesh, allowed: float) -> GivenSurface:
    return GivenSurface(MeshDistance(mesh), allowed)


def probes_of(mesh: TriangleMesh, heights: float) -> NormalProbes:
    """Normal probes on the capsule's vertices that were cut at one height."""
    inner = mesh.vertices.copy()
    inner[:, :2] = 0.0
    inner[:, 2] = np.clip(mesh.vertices[:, 2], 2.5, 7.5)
    normals = (mesh.vertices - inner) / RADIUS
    normal_probes = NormalProbes(mesh, np.array(mesh.vertices), normals, np.ones(len(inner)))
    normal_probes.heights[:] = heights
    return normal_probes


def dented(mesh: TriangleMesh, depth: float) -> TriangleMesh:
    """The mesh with its side at x = RADIUS pressed in."""
    vertices = np.array(mesh.vertices)
    vertices[:, 0] = np.minimum(vertices[:, 0], RADIUS - depth)
    return TriangleMesh(vertices, mesh.faces)


@pytest.mark.parametrize("height", [-0.2, -0.01, 0.0, 0.15])
def test_what_is_left_lies_as_far_inside_or_outside_as_it_was_cut(capsule: TriangleMesh, height: float) -> None:
    none = np.zeros(len(capsule.vertices), dtype=bool)
    found = measure_given(probes_of(capsule, height), none, as_given(capsule, 1.0))
    assert found.inside == pytest.approx(-height, abs=0.002)
    assert found.outside == pytest.approx(height, abs=0.002)
    assert found.report["gouge_max_mm"] == pytest.approx(max(-height, 0.0), abs=0.002)


def test_the_post_keeps_material_that_is_not_told_as_left(capsule: TriangleMesh) -> None:
    normal_probes = probes_of(capsule, 0.0)
    low = normal_probes.points[:, 2] < 0.2
    normal_probes.heights[low] = 0.3
    assert measure_given(normal_probes, low, as_given(capsule, 1.0)).outside < 0.002
    assert measure_given(normal_probes, np.zeros_like(low), as_given(capsule, 1.0)).outside == pytest.approx(
        0.3, abs=0.002
    )


def test_a_surface_too_deep_in_the_mesh_as_given_is_refused_with_place_and_remedy(capsule: TriangleMesh) -> None:
    normal_probes = probes_of(capsule, 0.0)
    normal_probes.heights[7] = -0.2
    none = np.zeros(len(capsule.vertices), dtype=bool)
    with pytest.raises(VerifyError, match=r"0\.[12]\d+ mm inside the mesh as given .* raise surface.largest_deviation"):
        measure_given(normal_probes, none, as_given(capsule, 0.1)).check()


def test_a_ball_too_deep_in_the_mesh_as_given_is_refused_with_its_line(capsule: TriangleMesh) -> None:
    given = as_given(capsule, 0.1)
    given.check_gouge(Gouge(0.09, 0.09, 12, (1.0, 2.0, 3.0), 5))
    with pytest.raises(VerifyError, match=r"line 12: the ball goes 0.1100 mm into the mesh as given") as told:
        given.check_gouge(Gouge(0.11, 0.11, 12, (1.0, 2.0, 3.0), 5))
    assert told.value.evidence["line"] == 12


def test_faces_that_do_not_close_are_measured_too(capsule: TriangleMesh) -> None:
    opened = TriangleMesh(capsule.vertices, capsule.faces[capsule.vertices[capsule.faces].mean(axis=1)[:, 0] > 0])
    points = np.array([[4.0, 0.0, 5.0], [RADIUS - 0.3, 0.0, 5.0]])
    assert as_given(opened, 1.0).signed(points, 9.0) == pytest.approx([1.5, 0.3], abs=0.002)


def test_a_program_may_go_as_deep_as_the_largest_deviation_the_fit_and_the_gouge_tolerance(
    capsule: TriangleMesh,
) -> None:
    job = Job()
    part = prepare_part(capsule, MeshJob())
    allowed = given_surface(part, job, {"surface": {"deviation_max_mm": 0.06}}).allowed
    assert allowed == job.surface.largest_deviation + 0.06 + job.path.gouge_tolerance


def test_a_mesh_off_which_repairs_take_too_much_is_refused_with_file_and_place(capsule: TriangleMesh) -> None:
    taken = measure_taken_off(capsule, dented(capsule, 0.7))
    assert taken.depth == pytest.approx(0.7, abs=1e-3)
    assert taken.place[0] == pytest.approx(RADIUS, abs=1e-3)
    made = replace(prepare_part(capsule, MeshJob()), file="bone.stl", taken_off=taken)
    assert made.require_kept(taken.depth + 0.01) is made
    with pytest.raises(MeshError, match=r"bone.stl: the repairs take 0\.\d+ mm off .* raise surface.largest_deviation"):
        made.require_kept(0.1)


def test_a_mesh_that_was_not_changed_loses_nothing(capsule: TriangleMesh) -> None:
    assert prepare_part(capsule, MeshJob()).taken_off is None


def part_of(given: TriangleMesh, repaired: TriangleMesh, smooth: TriangleMesh) -> Part:
    """A part whose mesh was repaired, then smoothed."""
    moves = surface_moves(repaired, smooth)
    place = moves.place
    found = Smoothing(smooth, repaired, coarseness_of(repaired), moves.outward, moves.inward, moves.largest, 0.1, place)
    done = (Repair("repaired"), found.change)
    return Part(smooth, "bone.stl", 10, "mm", done, np.eye(4), given, smoothing=found)


def test_a_program_may_go_deeper_by_what_a_smoothing_took_off(capsule: TriangleMesh) -> None:
    job = Job()
    part = part_of(capsule, capsule, dented(capsule, 0.7))
    report = {"surface": {"deviation_max_mm": 0.06}}
    allowed = given_surface(part, job, report).allowed
    plain = job.surface.largest_deviation + 0.06 + job.path.gouge_tolerance
    assert allowed - plain == pytest.approx(0.7, abs=1e-3)


def test_what_a_smoothing_takes_off_is_told_apart_from_what_repairs_take() -> None:
    coarse = Capsule(np.array([0.0, 0, 2.5]), np.array([0.0, 0, 7.5]), RADIUS).mesh(0.3)
    made = prepare_part(coarse, MeshJob(facets="smooth"))
    assert made.smoothing is not None
    assert made.smoothing.inward > 0.01
    assert made.taken_off is not None
    assert made.taken_off.depth < 1e-6
    assert made.require_kept(0.001) is made
