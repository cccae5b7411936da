"""The fit: within the tolerance with few control points, unfolded, planar at the poles, honest where the
points do not suffice.

Deviation: measured both ways, against shapes whose distance is known.

Pruning: needless knots go, needed ones stay, and the surface without them is where it was.

The banded normal equations against dense ones.

Samples of the mesh keep their feet, and those that seem missed are looked for on the whole surface.

Bends that no level can follow are smoothed within what the fit may miss its mesh by.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation
from small_parts import pebble
from tsplines import bone_like, samples

from bonecam.errors import MeshError
from bonecam.mesh import MeshDistance, TriangleMesh, harmonic_rows
from bonecam.surface import Fit, RowTMesh, TSpline, deviation, fit, skin
from bonecam.surface.fitting import (
    OFF,
    FitTarget,
    Form,
    MeshSamples,
    Term,
    first_tmesh,
    pole_rings,
    through_loops,
    transfer,
)
from bonecam.surface.growth import LOWEST, Aim, Votes, least_radius, prune, refine, settle, without_creases


def pear(bump: float = 0.35) -> TriangleMesh:
    """A pear-like body, 12 mm long, with one local bump, as a mesh."""
    t, s = np.meshgrid(np.pi * np.arange(1, 24) / 24, 2 * np.pi * np.arange(40) / 40, indexing="ij")
    radius = np.sin(t) * (2.5 + 0.7 * np.cos(t)) + bump * np.exp(
        -((t - 1.3) ** 2 + np.minimum(s, 2 * np.pi - s) ** 2) / 0.12
    )
    points = np.stack([radius * np.cos(s), 0.8 * radius * np.sin(s), -6 * np.cos(t)], axis=2)
    return skin(points, 1e-3, poles=np.array([[0, 0, -6.0], [0, 0, 6.0]])).tessellate(0.01)


@pytest.fixture(scope="module")
def body():
    mesh = pear()
    return harmonic_rows(mesh, 16, 60), mesh


@pytest.fixture(scope="module")
def fitted(body):
    return fit(body[1], 0.05, 300, rows=body[0])


def test_the_tolerance_is_reached_and_said_so(fitted):
    assert fitted.reached
    assert fitted.deviation.max <= 0.05
    assert fitted.control_points <= 300
    assert fitted.shortfall == ""


def test_the_normals_point_outward_everywhere(fitted, body):
    s, t = (v.ravel() for v in np.meshgrid(np.arange(60) / 60, np.linspace(0.005, 0.995, 60)))
    _, faces = MeshDistance(body[1]).closest(fitted.surface.positions(s, t))
    outward = body[1].face_vectors[faces]
    assert (np.einsum("ij,ij->i", fitted.surface.normals(s, t), outward) > 0).all()


def test_the_row_next_to_a_pole_lies_in_one_plane_with_it(fitted):
    starts, points = fitted.surface.tmesh.row_starts, fitted.surface.control_points
    for pole, ring in ((points[0], points[starts[1] : starts[2]]), (points[-1], points[starts[-3] : starts[-2]])):
        assert np.linalg.svd(ring - pole)[1][2] < 1e-10


@pytest.mark.whole
def test_too_few_control_points_are_reported_not_hidden(body):
    found = fit(body[1], 0.01, 60, rows=body[0])
    assert not found.reached
    assert found.control_points <= 60
    assert found.deviation.max > 0.01
    assert "raise surface.max_control_points" in found.shortfall


def test_a_fit_that_no_knot_can_mend_says_so_and_where(body):
    found = fit(body[1], 0.01, 300, rows=body[0], refine=lambda tmesh, votes, room: tmesh)
    assert not found.reached
    assert found.control_points < 300
    assert "would bring it no nearer" in found.shortfall
    place = found.deviation.place[None]
    away = max(found.surface.project(place).distances[0], MeshDistance(body[1]).unsigned(place)[0])
    assert away == pytest.approx(found.deviation.max, rel=1e-3)


def test_a_wrong_call_is_refused(body):
    with pytest.raises(ValueError, match="40 or more"):
        fit(body[1], 0.1, 20, rows=body[0])
    with pytest.raises(ValueError, match="above 0"):
        fit(body[1], 0.0, 200, rows=body[0])


def test_a_mesh_that_lies_tilted_is_fitted_where_it_lies(body):
    turn = Rotation.from_rotvec([0.4, 1.1, -0.3]).as_matrix()
    tilted = TriangleMesh(body[1].vertices @ turn.T + [5.0, -7.0, 30.0], body[1].faces)
    found = fit(tilted, 0.1)
    assert found.reached
    assert deviation(found.surface, tilted).max <= 0.105
    assert found.surface.volume == pytest.approx(tilted.volume, rel=0.01)


def test_an_open_mesh_is_refused_by_name(body):
    with pytest.raises(MeshError):
        fit(TriangleMesh(body[1].vertices, body[1].faces[40:]), 0.1)


def test_two_fits_are_equal_to_the_last_bit(body):
    one, two = (fit(body[1], 0.1, 120, rows=body[0]).surface for _ in range(2))
    assert one.control_points.tobytes() == two.control_points.tobytes()


def test_progress_may_cancel(body):
    from bonecam.errors import Cancelled

    with pytest.raises(Cancelled):
        fit(body[1], 0.01, 200, rows=body[0], progress=lambda fraction, message: False)


def test_progress_only_rises(body):
    told: list[float] = []
    fit(body[1], 0.03, 200, rows=body[0], progress=lambda fraction, message: told.append(fraction))
    assert len(told) >= 3
    assert told == sorted(told)
    assert 0 <= told[0] <= told[-1] <= 1


@pytest.mark.parametrize("turn", [pytest.param(0.0, marks=pytest.mark.slow), 0.2])
def test_a_cone_is_followed_to_its_tip(turn):
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


def test_the_best_cut_is_made_even_where_it_costs_much():
    tmesh = first_tmesh(6, 30)
    one = np.ones(1)
    finer = refine(tmesh, Votes(0.3 * one, 0.42 * one, one, 0.1 * one, 100 * one, 0.001, 0.05), 100)
    assert finer.size == tmesh.size + 30
    assert refine(tmesh, Votes(0.3 * one, 0.42 * one, one, 0.1 * one, 100 * one, 0.001, 0.05), 20).size == tmesh.size


def test_low_cells_are_not_cut_along_t():
    tmesh, one = first_tmesh(6, 30), np.ones(1)
    for height, rows in ((0.9 * LOWEST, 0), (1.1 * LOWEST, 1)):
        votes = Votes(0.3 * one, 0.42 * one, one, 0.1 * one, 6 * 0.05 * height * one, 0.001, 0.05)
        assert len(refine(tmesh, votes, 100).s_knots) == len(tmesh.s_knots) + rows


def test_rings_round_poles_are_drawn_only_where_they_are_far_off_an_ellipse():
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


POLES = np.array([[0.0, 0.0, -2.0], [0.0, 0.0, 2.0]])


@pytest.fixture(scope="module")
def ball():
    t, s = np.meshgrid(np.pi * np.arange(1, 16) / 16, 2 * np.pi * np.arange(40) / 40, indexing="ij")
    points = 2 * np.stack([np.sin(t) * np.cos(s), np.sin(t) * np.sin(s), -np.cos(t)], axis=2)
    return skin(points, 1e-4, poles=POLES)


def test_a_larger_ball_is_measured_both_ways(ball):
    mesh = ball.tessellate(0.002)
    found = deviation(ball, TriangleMesh(mesh.vertices * 1.1, mesh.faces), 4000)
    assert found.surface_to_mesh_max == pytest.approx(0.2, abs=0.005)
    assert found.mesh_to_surface_max == pytest.approx(0.2, abs=0.005)


def test_a_spike_of_the_mesh_is_seen_from_the_mesh_and_named(ball):
    mesh = ball.tessellate(0.01)
    vertices = mesh.vertices.copy()
    tip = int(np.argmax(vertices[:, 0]))
    vertices[tip] *= 1.25
    found = deviation(ball, TriangleMesh(vertices, mesh.faces), 4000)
    assert found.max == found.mesh_to_surface_max == pytest.approx(0.5, abs=0.01)
    assert np.allclose(found.place, vertices[tip])


LOW_POLES = np.array([[0.0, 0.0, -3.0], [0.0, 0.0, 3.0]])


@pytest.fixture(scope="module")
def round_body():
    t, s = np.meshgrid(np.pi * np.arange(1, 20) / 20, 2 * np.pi * np.arange(40) / 40, indexing="ij")
    points = np.stack([2 * np.sin(t) * np.cos(s), 1.6 * np.sin(t) * np.sin(s), -3 * np.cos(t)], axis=2)
    mesh = skin(points, 1e-4, poles=LOW_POLES).tessellate(0.004)
    return harmonic_rows(mesh, 16, 60), mesh


@pytest.fixture(scope="module")
def settled(round_body):
    surface = through_loops(round_body[0], first_tmesh(9, 16))
    aim = Aim(0.02, 1000)
    return settle(surface, FitTarget.of(round_body[1], round_body[0], 3000).on(surface, 0.02), aim, 4)


def test_an_ellipsoid_spares_many_knots_and_stays_where_it_is(settled):
    surface, target = settled
    tmesh = prune(surface, target, 0.02, 1000)
    assert tmesh.size < 0.8 * surface.tmesh.size
    fewer = transfer(surface, tmesh)
    assert target.on(fewer, 0.02).worst < 0.04


def test_no_more_knots_go_than_may(settled):
    surface, target = settled
    assert prune(surface, target, 0.02, 5).size == surface.tmesh.size - 5
    assert prune(surface, target, 1e-9, 1000).size == surface.tmesh.size


def test_rows_next_to_poles_keep_a_knot_every_quarter_turn(settled):
    """Round a gap of half a turn the surface folds at its pole."""
    surface, target = settled
    tmesh = surface.tmesh
    assert isinstance(tmesh, RowTMesh)
    ring = np.array([0.0, 0.125, 0.25, 0.5, 0.625, 0.75])
    rings = [tmesh.s_knots[0], ring, *tmesh.s_knots[2:-2], ring, tmesh.s_knots[-1]]
    denser = transfer(surface, RowTMesh.from_rows(tmesh.t_knots, rings))
    fewer = prune(denser, target.on(denser, 0.02), 10.0, 1000)
    for knots in (fewer.s_knots[1], fewer.s_knots[-2]):
        assert len(knots) < len(ring)
        assert np.diff(knots, append=knots[0] + 1).max() <= 0.25


def random_term(seed: int, size: int, width: int) -> Term:
    rng = np.random.default_rng(seed)
    first = rng.integers(0, size - width, 400)
    dense = np.zeros((400, size))
    dense[np.arange(400)[:, None], first[:, None] + np.arange(width + 1)] = rng.normal(size=(400, width + 1))
    half = rng.normal(size=(400, 3, 3))
    return Term(sp.csr_array(dense), half @ half.transpose(0, 2, 1), rng.normal(size=(400, 3)))


def test_a_form_that_leaves_a_control_point_free_is_refused():
    term = random_term(1, 10, 3)
    with pytest.raises(np.linalg.LinAlgError):
        Form.of([term], 12).least()


def test_a_sample_that_followed_a_wrong_foot_is_met_where_the_surface_is():
    surface = bone_like()
    s, t = samples(400)
    points = surface.positions(s, t) + 0.01 * surface.normals(s, t)
    lost = np.array([7, 90, 210])
    start = s.copy()
    start[lost] = np.mod(s[lost] + 0.5, 1.0)
    everywhere = MeshSamples(points, np.ones(400), start, t, np.full(400, np.inf))
    alone = everywhere.on(surface, np.inf)
    assert (np.flatnonzero(alone.distances > 0.05) == lost).all()
    met = everywhere.on(surface, 0.05)
    assert met.distances.max() < 0.0101
    np.testing.assert_allclose(surface.positions(met.s, met.t), surface.positions(s, t), atol=1e-4)
    np.testing.assert_array_equal(np.delete(met.s, lost), np.delete(alone.s, lost))


def test_many_samples_that_are_missed_keep_the_feet_they_came_from():
    surface = bone_like()
    s, t = samples(100)
    points = surface.positions(s, t) + 0.2 * surface.normals(s, t)
    given = MeshSamples(points, np.ones(100), s, t, np.full(100, np.inf))
    one, other = given.on(surface, 0.05), given.on(surface, np.inf)
    np.testing.assert_array_equal(one.s, other.s)
    np.testing.assert_array_equal(one.distances, other.distances)


@pytest.fixture(scope="module")
def mesh():
    return pebble().tessellate(0.01)


@pytest.fixture(scope="module")
def creased(mesh):
    """A fit of the pebble three of whose rows crowd."""
    surface = pebble()
    points = surface.control_points.copy()
    starts = surface.tmesh.row_starts  # type: ignore[attr-defined]
    middle = len(starts) // 2
    below, row, above = (points[starts[j] : starts[j + 1]] for j in (middle - 1, middle, middle + 1))
    below += 0.97 * (row - below)
    above += 0.97 * (row - above)
    surface = surface.with_control_points(points)
    missed = deviation(surface, mesh)
    return Fit(surface, missed, 2.0 * missed.max, reached=True)


def test_the_least_radius_grows_and_the_surface_stays_within_the_limit(mesh, creased):
    sharpest = least_radius(creased.surface)
    assert sharpest < 0.3
    found = without_creases(creased, mesh, 0.3, creased.tolerance)
    assert found is not None
    assert least_radius(found.surface) > 1.5 * sharpest
    measured = deviation(found.surface, mesh)
    assert measured.max <= creased.tolerance
    assert found.deviation.max == pytest.approx(measured.max)
    assert found.reached


def test_a_surface_without_such_bends_and_one_that_would_leave_its_limit_stay(mesh, creased):
    round_one = replace(creased, surface=pebble())
    assert least_radius(round_one.surface) > 0.3
    assert without_creases(round_one, mesh, 0.3, 1.0) is None
    assert without_creases(creased, mesh, 0.3, 1e-4) is None
