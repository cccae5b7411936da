"""Eqs. 18 to 20 as candidate sets: semi-angles and offsets against their closed forms.

The published choice: least energy among what is allowed and free, and never a program that collides.
"""

import numpy as np
import pytest
from bonecam_plugins.study.axes import (
    HIGH,
    LENGTH,
    LOW,
    candidate_axes,
    candidate_frames,
    choose,
    elastic_energy,
    published_axes,
    semi_angles,
    weighted_offsets,
)
from deepest_entry import deepest_entry
from small_lump import at_parameters, lattice_on, lump, round_capsule

from bonecam.arrays import dots
from bonecam.job import NcJob, PathJob
from bonecam.machine import MachineLimits
from bonecam.mesh import Curvature, TriangleMesh, delaunay, vertex_normals
from bonecam.mesh.facets import voronoi_areas
from bonecam.planning import orient
from bonecam.planning.axes.field import contact_facets
from bonecam.tool import MoveKind
from bonecam.workholding import Clamping


@pytest.fixture(scope="module")
def capsule():
    return round_capsule()


def curvature(k1: float, k2: float, count: int = 10) -> Curvature:
    x, y = np.tile([1.0, 0.0, 0.0], (count, 1)), np.tile([0.0, 1.0, 0.0], (count, 1))
    return Curvature(np.full(count, k1), np.full(count, k2), x, y)


def test_where_a_surface_bulges_evenly_the_cone_is_as_wide_as_allowed():
    """All ratios to the mean curvature are 1, their logarithms 0."""
    np.testing.assert_allclose(semi_angles(curvature(0.2, 0.2), 1.0), HIGH)
    np.testing.assert_allclose(semi_angles(curvature(0.0, 0.0), 1.0), HIGH)


def test_in_a_hollow_ball_axes_end_on_the_ball():
    """From the ball's centre, R - r off the hollow's, the axis l long at the semi-angle ends on the sphere R - r."""
    radius, hollow = 1.0, 4.0
    angle = semi_angles(curvature(-1 / hollow, -1 / hollow), radius)[0, 0]
    free = np.arccos(LENGTH * radius / (2 * (hollow - radius)))
    assert angle == pytest.approx(min(free, HIGH))
    end = np.array([np.sin(free), np.cos(free)]) * LENGTH - [0.0, hollow - radius]
    assert np.linalg.norm(end) == pytest.approx(hollow - radius)


def test_a_hollow_too_narrow_for_an_axis_leaves_none_and_the_weight_halves_the_room():
    assert (semi_angles(curvature(-0.6, -0.6), 1.0) <= LOW).all()
    mixed = Curvature(
        *(np.r_[a, b] for a, b in zip(vars(curvature(0.1, 0.1)).values(), vars(curvature(2.0, 2.0)).values()))
    )
    angles = semi_angles(mixed, 1.0)[:, 0]
    ratios = np.abs(np.log((np.array([0.1, 2.0]) + 1e-4) / (1.05 + 1e-4)))
    weight = ratios / ratios.max()
    np.testing.assert_allclose(angles[[0, 10]], LOW + (HIGH - LOW) * (1 - weight / 2))


def test_eq_20_offsets_a_circle_to_its_centre_by_the_ball_s_radius_at_most(capsule):
    """The pass bends alike everywhere: the weight is 1. Its ends, and those of another pass, have no bend."""
    turn = np.linspace(0, 0.9, 40)
    path = at_parameters(capsule, np.column_stack([turn, np.full(40, 0.5)]), np.repeat([0, 1], 20))
    found = weighted_offsets(path)
    inner = np.setdiff1d(np.arange(40), [0, 19, 20, 39])
    assert not found[[0, 19, 20, 39]].any()
    inward = -path.contacts[inner] * [1.0, 1.0, 0.0]
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    assert dots(found[inner], inward).min() > 0.85 * path.cutter.radius
    assert np.linalg.norm(found, axis=1).max() <= path.cutter.radius * (1 + 1e-12)


def test_candidates_are_on_the_oblique_elliptic_cone_of_each_contact(capsule):
    """Eq. 16: in the frame of middle and conjugate semi-diameters q1^2 + q2^2 = (share q3)^2."""
    facets = contact_facets(lattice_on(capsule), capsule)
    assert facets is not None
    axes, frames = candidate_axes(facets), candidate_frames(facets)
    q = np.linalg.solve(np.swapaxes(frames, 1, 2)[:, None], axes[..., None])[..., 0]
    shares = np.hypot(q[..., 1], q[..., 2]) / q[..., 0]
    np.testing.assert_allclose(shares, np.tile([0.0] + [0.5] * 8 + [1.0] * 12, (len(axes), 1)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=2), 1.0)
    tangent = np.abs(np.einsum("vkd,vd->vk", frames[:, 1:], vertex_normals(facets.mesh)))
    assert tangent.max() < 1e-9


LIMITS = MachineLimits(np.radians(115.0))
JOB = PathJob(pattern="along", orientation="published")
GRID = np.stack(np.meshgrid(np.arange(12), np.arange(12)), axis=-1).reshape(-1, 2) * 0.5
FLAT = TriangleMesh(np.column_stack([GRID, np.zeros(len(GRID))]), delaunay(GRID))
ENERGY = elastic_energy(FLAT)
AREAS = voronoi_areas(FLAT)
FAN = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [-0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])
CANDIDATES = np.tile(FAN, (len(GRID), 1, 1))


def anything(contacts: np.ndarray, axes: np.ndarray) -> np.ndarray:
    return np.ones(len(contacts), dtype=bool)


def test_one_axis_for_all_is_chosen_where_all_may_have_it():
    """It is the second candidate; the first ones lean by up to 45 degrees from it, each another way. Where one may not
    have it, the others keep it."""
    random = np.random.default_rng(2)
    leaning = np.column_stack([random.uniform(-0.7, 0.7, (len(GRID), 2)), np.ones(len(GRID))])
    leaning /= np.linalg.norm(leaning, axis=1, keepdims=True)
    candidates = np.stack([leaning, np.tile([0.0, 0.0, 1.0], (len(GRID), 1))], axis=1)
    allowed = np.ones(candidates.shape[:2], dtype=bool)
    assert (choose(candidates, allowed, ENERGY, AREAS, anything) == 1).all()
    allowed[40, 1] = False
    assert np.flatnonzero(choose(candidates, allowed, ENERGY, AREAS, anything) == 0).tolist() == [40]


def test_what_collides_is_not_chosen_and_what_has_no_other_keeps_its_middle():
    allowed = np.ones(CANDIDATES.shape[:2], dtype=bool)
    asked = []

    def free(contacts, axes):
        asked.append(len(contacts))
        return (axes[:, 0] > 0.5) & (contacts != 5)

    chosen = choose(CANDIDATES, allowed, ENERGY, AREAS, free)
    others = np.delete(chosen, 5)
    assert (others == 1).all()
    assert chosen[5] == 0
    assert sum(asked) <= CANDIDATES.shape[0] * CANDIDATES.shape[1]


@pytest.fixture(scope="module")
def case():
    return lump(JOB, Clamping(clearance=0.5))


def test_its_path_collides_nowhere_and_tells_what_is_refused(case):
    surface, contacts, scene = case
    axes = published_axes(contacts, surface, scene, LIMITS, JOB)
    assert np.allclose(np.linalg.norm(axes, axis=1), 1.0)
    path = orient(contacts, scene, LIMITS, JOB, NcJob(), fixed=axes, explained=False)
    cut = path.kinds == MoveKind.CUT
    assert cut.sum() / len(contacts.contacts) > 0.5
    assert len(path.uncut) == len(path.reasons)
    assert set(path.reasons[len(contacts.reasons) :]) <= {"limits", "collision"}
    some = np.flatnonzero(cut)[::5]
    assert deepest_entry(scene, contacts.cutter, path.balls[some], path.axes[some]).max() < 0.011
    assert LIMITS.allow(path.axes[cut]).all()


def test_contacts_on_a_line_get_the_surface_s_normals(case):
    surface, contacts, scene = case
    line = contacts.take(np.flatnonzero(contacts.pass_index == contacts.pass_index[len(contacts.pass_index) // 2])[:2])
    axes = published_axes(line, surface, scene, LIMITS, JOB)
    assert np.array_equal(axes, line.normals)


def test_the_membrane_of_a_linear_value_is_half_its_slope_squared_times_the_area():
    """Wherever the mesh lies; a constant has none."""
    value = 3 * GRID[:, 0] - 4 * GRID[:, 1]
    turn = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]])
    for mesh in (FLAT, TriangleMesh(FLAT.vertices @ turn.T, FLAT.faces)):
        energy = elastic_energy(mesh)
        assert value @ energy @ value / 2 == pytest.approx(25 / 2 * np.ptp(GRID[:, 0]) * np.ptp(GRID[:, 1]))
        assert np.abs(energy @ np.ones(len(GRID))).max() < 1e-9
