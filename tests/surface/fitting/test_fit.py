"""The fit: within the tolerance with few control points, unfolded, planar at the poles, honest where the
points do not suffice."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bonecam.errors import MeshError
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.rows import Rows, harmonic_rows
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.fitting import OFF, deviation, first_tmesh, pole_rings
from bonecam.surface.growth import LOWEST, Fit, Votes, fit, refine, with_t_knots
from bonecam.surface.skinning import skin
from bonecam.surface.tspline import TSpline


def pear(bump: float = 0.35) -> TriangleMesh:
    """A pear-like body, 12 mm long, with one local bump, as a mesh."""
    t, s = np.meshgrid(np.pi * np.arange(1, 24) / 24, 2 * np.pi * np.arange(40) / 40, indexing="ij")
    radius = np.sin(t) * (2.5 + 0.7 * np.cos(t)) + bump * np.exp(
        -((t - 1.3) ** 2 + np.minimum(s, 2 * np.pi - s) ** 2) / 0.12
    )
    points = np.stack([radius * np.cos(s), 0.8 * radius * np.sin(s), -6 * np.cos(t)], axis=2)
    return skin(points, 1e-3, poles=np.array([[0, 0, -6.0], [0, 0, 6.0]])).tessellate(0.01)


@pytest.fixture(scope="module")
def body() -> tuple[Rows, TriangleMesh]:
    mesh = pear()
    return harmonic_rows(mesh, 16, 60), mesh


@pytest.fixture(scope="module")
def fitted(body: tuple[Rows, TriangleMesh]) -> Fit:
    return fit(body[1], 0.05, 300, rows=body[0])


def test_the_tolerance_is_reached_and_said_so(fitted: Fit) -> None:
    assert fitted.reached
    assert fitted.deviation.max <= 0.05
    assert fitted.control_points <= 300
    assert fitted.shortfall == ""


def test_the_normals_point_outward_everywhere(fitted: Fit, body: tuple[Rows, TriangleMesh]) -> None:
    s, t = (v.ravel() for v in np.meshgrid(np.arange(60) / 60, np.linspace(0.005, 0.995, 60)))
    _, faces = MeshDistance(body[1]).closest(fitted.surface.positions(s, t))
    outward = body[1].face_vectors[faces]
    assert (np.einsum("ij,ij->i", fitted.surface.normals(s, t), outward) > 0).all()


def test_the_row_next_to_a_pole_lies_in_one_plane_with_it(fitted: Fit) -> None:
    starts, points = fitted.surface.tmesh.row_starts, fitted.surface.control_points
    for pole, ring in ((points[0], points[starts[1] : starts[2]]), (points[-1], points[starts[-3] : starts[-2]])):
        assert np.linalg.svd(ring - pole)[1][2] < 1e-10


@pytest.mark.whole
def test_too_few_control_points_are_reported_not_hidden(body: tuple[Rows, TriangleMesh]) -> None:
    found = fit(body[1], 0.01, 60, rows=body[0])
    assert not found.reached
    assert found.control_points <= 60
    assert found.deviation.max > 0.01
    assert "raise surface.max_control_points" in found.shortfall


def test_a_fit_that_no_knot_can_mend_says_so_and_where(body: tuple[Rows, TriangleMesh]) -> None:
    found = fit(body[1], 0.01, 300, rows=body[0], refine=lambda tmesh, votes, room: tmesh)
    assert not found.reached
    assert found.control_points < 300
    assert "would bring it no nearer" in found.shortfall
    place = found.deviation.place[None]
    away = max(found.surface.project(place).distances[0], MeshDistance(body[1]).unsigned(place)[0])
    assert away == pytest.approx(found.deviation.max, rel=1e-3)


def test_a_wrong_call_is_refused(body: tuple[Rows, TriangleMesh]) -> None:
    with pytest.raises(ValueError, match="40 or more"):
        fit(body[1], 0.1, 20, rows=body[0])
    with pytest.raises(ValueError, match="above 0"):
        fit(body[1], 0.0, 200, rows=body[0])


def test_a_mesh_that_lies_tilted_is_fitted_where_it_lies(body: tuple[Rows, TriangleMesh]) -> None:
    turn = Rotation.from_rotvec([0.4, 1.1, -0.3]).as_matrix()
    tilted = TriangleMesh(body[1].vertices @ turn.T + [5.0, -7.0, 30.0], body[1].faces)
    found = fit(tilted, 0.1)
    assert found.reached
    assert deviation(found.surface, tilted).max <= 0.105
    assert found.surface.volume == pytest.approx(tilted.volume, rel=0.01)


def test_an_open_mesh_is_refused_by_name(body: tuple[Rows, TriangleMesh]) -> None:
    with pytest.raises(MeshError):
        fit(TriangleMesh(body[1].vertices, body[1].faces[40:]), 0.1)


def test_two_fits_are_equal_to_the_last_bit(body: tuple[Rows, TriangleMesh]) -> None:
    one, two = (fit(body[1], 0.1, 120, rows=body[0]).surface for _ in range(2))
    assert one.control_points.tobytes() == two.control_points.tobytes()


def test_progress_may_cancel(body: tuple[Rows, TriangleMesh]) -> None:
    from bonecam.errors import Cancelled

    with pytest.raises(Cancelled):
        fit(body[1], 0.01, 200, rows=body[0], progress=lambda fraction, message: False)


def test_progress_only_rises(body: tuple[Rows, TriangleMesh]) -> None:
    told: list[float] = []
    fit(body[1], 0.03, 200, rows=body[0], progress=lambda fraction, message: told.append(fraction))
    assert len(told) >= 3
    assert told == sorted(told)
    assert 0 <= told[0] <= told[-1] <= 1


@pytest.mark.parametrize("turn", [pytest.param(0.0, marks=pytest.mark.slow), 0.2])
def test_a_cone_is_followed_to_its_tip(turn: float) -> None:
    angle, radius = (
        turn + 2 * np.pi * np.arange(40) / 40,
        np.concatenate([np.arange(1, 8) / 7, np.arange(19, 0, -1) / 20]),
    )
    height = np.concatenate([np.zeros(7), 1 - np.arange(19, 0, -1) / 20])
    rings = np.stack([r * np.column_stack([np.cos(angle), np.sin(angle)]) for r in radius])
    points = np.vstack(
        [[0, 0, 0], *(np.column_stack([3 * ring, np.full(40, 12 * z)]) for ring, z in zip(rings, height)), [0, 0, 12.0]]
    )
    i, k = np.arange(40), 1 + 40 * np.arange(len(radius) - 1)[:, None]
    right, last = (i + 1) % 40, len(points) - 1
    sides = [
        np.stack([k + i, k + right, k + 40 + right], axis=2),
        np.stack([k + i, k + 40 + right, k + 40 + i], axis=2),
    ]
    ends = [
        np.stack([0 * i, 1 + right, 1 + i], axis=1),
        np.stack([0 * i + last, last - 40 + i, last - 40 + right], axis=1),
    ]
    cone = TriangleMesh(points, np.concatenate([*(side.reshape(-1, 3) for side in sides), *ends]).astype(np.int32))
    found = fit(cone, 0.15, 200)
    assert found.reached, (found.deviation, found.shortfall)


def test_the_best_cut_is_made_even_where_it_costs_much() -> None:
    tmesh = first_tmesh(6, 30)
    one = np.ones(1)
    finer = refine(tmesh, Votes(0.3 * one, 0.42 * one, one, 0.1 * one, 100 * one, 0.001, 0.05), 100)
    assert finer.size == tmesh.size + 30
    assert refine(tmesh, Votes(0.3 * one, 0.42 * one, one, 0.1 * one, 100 * one, 0.001, 0.05), 20).size == tmesh.size


def test_low_cells_are_not_cut_along_t() -> None:
    tmesh, one = first_tmesh(6, 30), np.ones(1)
    for height, rows in ((0.9 * LOWEST, 0), (1.1 * LOWEST, 1)):
        votes = Votes(0.3 * one, 0.42 * one, one, 0.1 * one, 6 * 0.05 * height * one, 0.001, 0.05)
        assert len(refine(tmesh, votes, 100).s_knots) == len(tmesh.s_knots) + rows


def test_rings_round_poles_are_drawn_only_where_they_are_far_off_an_ellipse(bone_like: Callable[..., TSpline]) -> None:
    surface = bone_like(8, 5, spread=0.0)
    even = surface.tmesh.from_rows(
        surface.tmesh.t_knots, [row if len(row) == 1 else np.arange(5) / 5 for row in surface.tmesh.s_knots]
    )
    points = surface.control_points.copy()
    angle = 2 * np.pi * np.arange(5) / 5
    points[1:6] = points[0] + np.column_stack([3 * np.cos(angle), 2 * np.sin(angle), 0 * angle])
    for shift, pulled in ((0.0, 0), (0.5, 0), (1.5, 5)):
        moved = points.copy()
        moved[0, 0] += shift
        moved_surface = TSpline(even, moved, np.ones(even.size))
        assert np.count_nonzero(pole_rings(moved_surface, 2.0, OFF)[0].metric[:, 0, 0]) == pulled
    pulls = pole_rings(moved_surface, 2.0, 0.0)[0]
    assert (pulls.metric[:, 0, 0] == 2.0).all()
    assert not pulls.targets.any()


def test_a_new_t_knot_adds_one_row_that_is_like_its_neighbour() -> None:
    tmesh = first_tmesh(6, 8)
    finer = with_t_knots(tmesh.t_knots, list(tmesh.s_knots), np.array([0.4]))
    assert len(finer.s_knots) == len(tmesh.s_knots) + 1
    assert [len(row) for row in finer.s_knots] == [1, 4, *[8] * 6, 4, 1]
