"""The published choice: least energy among what is allowed and free, and never a program that collides."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.job import NcJob, PathJob
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.facets import ElasticEnergy, delaunay, voronoi_areas
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.published import choose, published_axes
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.oriented_path import orient
from bonecam.planning.scene import Scene
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import ContactPath, MoveKind
from bonecam.workholding.clamping import Clamping

LIMITS = MachineLimits(np.radians(115.0))
JOB = PathJob(pattern="along", orientation="published")
GRID = np.stack(np.meshgrid(np.arange(12), np.arange(12)), axis=-1).reshape(-1, 2) * 0.5
FLAT = TriangleMesh(np.column_stack([GRID, np.zeros(len(GRID))]), delaunay(GRID))
ENERGY = ElasticEnergy.of(FLAT).matrix(1.0, 0.0)
AREAS = voronoi_areas(FLAT)
FAN = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [-0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])
CANDIDATES = np.tile(FAN, (len(GRID), 1, 1))

Made = tuple[TSpline, ContactPath, Scene]


def anything(contacts: np.ndarray, axes: np.ndarray) -> np.ndarray:
    return np.ones(len(contacts), dtype=bool)


def test_one_axis_for_all_is_chosen_where_all_may_have_it() -> None:
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


def test_what_collides_is_not_chosen_and_what_has_no_other_keeps_its_middle() -> None:
    allowed = np.ones(CANDIDATES.shape[:2], dtype=bool)
    asked = []

    def free(contacts: np.ndarray, axes: np.ndarray) -> np.ndarray:
        asked.append(len(contacts))
        return (axes[:, 0] > 0.5) & (contacts != 5)

    chosen = choose(CANDIDATES, allowed, ENERGY, AREAS, free)
    others = np.delete(chosen, 5)
    assert (others == 1).all()
    assert chosen[5] == 0
    assert sum(asked) <= CANDIDATES.shape[0] * CANDIDATES.shape[1]


@pytest.fixture(scope="module")
def case(lump: Callable[..., Made]) -> Made:
    return lump(JOB, Clamping(clearance=0.5))


def test_its_path_collides_nowhere_and_tells_what_is_refused(
    case: Made, deepest_entry: Callable[..., np.ndarray]
) -> None:
    surface, contacts, scene = case
    axes = published_axes(contacts, surface, CollisionChecker(scene, contacts.cutter), LIMITS, JOB)
    assert np.allclose(np.linalg.norm(axes, axis=1), 1.0)
    path = orient(contacts, scene, LIMITS, JOB, NcJob(), fixed=axes, explained=False)
    cut = path.kinds == MoveKind.CUT
    assert cut.sum() / len(contacts.contacts) > 0.5
    assert len(path.uncut) == len(path.reasons)
    assert set(path.reasons[len(contacts.reasons) :]) <= {"limits", "collision"}
    some = np.flatnonzero(cut)[::5]
    assert deepest_entry(scene, contacts.cutter, path.balls[some], path.axes[some]).max() < 0.011
    assert LIMITS.allow(path.axes[cut]).all()


def test_contacts_on_a_line_get_the_surface_s_normals(case: Made) -> None:
    surface, contacts, scene = case
    line = contacts.take(np.flatnonzero(contacts.pass_index == contacts.pass_index[len(contacts.pass_index) // 2])[:2])
    axes = published_axes(line, surface, CollisionChecker(scene, line.cutter), LIMITS, JOB)
    assert np.array_equal(axes, line.normals)
