"""What a covered level promises: no cusp above the scallop, no gouge, no long chord, no contact at the
post."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial import KDTree

from bonecam.errors import ToolPathError
from bonecam.job import HoldingJob, PathJob
from bonecam.levels.measure import Level
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.contacts import POST_CLEARANCE, candidate_contacts, contact_path
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath
from bonecam.workholding.post import post_below

PATTERNS = ("round", "along", "iso-scallop", "spiral", "bands")


@pytest.fixture(scope="module")
def covered(
    level_of: Callable[..., Level], holding: HoldingJob, finishing_cutter: Cutter
) -> Callable[..., ContactPath]:
    """Covers a surface with contacts of the finishing cutter, lines running in `pattern`; each way once."""

    @cache
    def cover(surface: TSpline, pattern: str, post_clearance: float = POST_CLEARANCE) -> ContactPath:
        level = level_of(surface)
        post = post_below(level.mesh, holding)
        job = PathJob(pattern=pattern)
        return contact_path(
            candidate_contacts(
                level, [MeshDistance(level.mesh)], finishing_cutter, post, job, post_clearance=post_clearance
            )
        )

    return cover


def joined(path: ContactPath) -> np.ndarray:
    return np.flatnonzero(path.pass_index[1:] == path.pass_index[:-1])


def swept_centres(path: ContactPath, parts: int = 12) -> np.ndarray:
    i = joined(path)
    return np.vstack([(1 - f) * path.centres[i] + f * path.centres[i + 1] for f in np.linspace(0, 1, parts + 1)])


def heights_left(surface: TSpline, path: ContactPath, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Random surface points and how far along the normal material is left above each, by rays into the
    balls."""
    rng = np.random.default_rng(7)
    s, t = rng.random(count), 0.001 + 0.998 * rng.random(count)
    points, normals = np.asarray(surface.evaluate(s, t)), surface.normals(s, t)
    centres, radius = swept_centres(path), path.cutter.radius
    left = np.full(count, np.inf)
    for i, near in enumerate(KDTree(centres).query_ball_point(points + radius * normals, 0.9 * radius)):
        to = centres[near] - points[i]
        along = to @ normals[i]
        root = radius**2 - (to * to).sum(1) + along**2
        if (root > 0).any():
            left[i] = (along - np.sqrt(np.maximum(root, 0)))[root > 0].min()
    return points, left


@pytest.mark.parametrize("pattern", PATTERNS)
def test_no_cusp_exceeds_the_scallop(
    covered: Callable[..., ContactPath], pebble: Callable[..., TSpline], pattern: str
) -> None:
    surface = pebble()
    path = covered(surface, pattern)
    points, left = heights_left(surface, path, 1500)
    reached = KDTree(path.uncut).query(points)[0] > 0.6
    assert reached.mean() > 0.85
    assert left[reached].max() <= path.cutter.scallop + 1e-3
    assert left[reached].max() >= 0.6 * path.cutter.scallop, "passes lie closer than needed"
    assert left[reached].min() >= -PathJob().gouge_tolerance


@pytest.mark.parametrize("pattern", PATTERNS)
def test_straight_moves_follow_the_offset_curve(
    covered: Callable[..., ContactPath], pebble: Callable[..., TSpline], pattern: str
) -> None:
    surface, job = pebble(), PathJob()
    path = covered(surface, pattern)
    i = joined(path)
    length = np.linalg.norm(path.centres[i + 1] - path.centres[i], axis=1)
    assert length.max() <= job.max_step + 1e-9
    assert path.lifts.max() == 0
    for f in (0.25, 0.5, 0.75):
        centres = (1 - f) * path.centres[i] + f * path.centres[i + 1]
        distances = surface.project(centres).distances
        assert np.abs(distances - path.cutter.radius).max() <= 1.25 * job.chord_tolerance


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_ball_never_enters_the_level(
    covered: Callable[..., ContactPath],
    grooved_pebble: Callable[..., TSpline],
    mesh_of: Callable[..., TriangleMesh],
    pattern: str,
) -> None:
    surface = grooved_pebble(1.6)
    path = covered(surface, pattern)
    fine = MeshDistance(mesh_of(surface))
    assert path.lifts.max() > path.cutter.scallop, "the groove must be too sharp for the ball, else this proves nothing"
    assert (path.cutter.radius - fine.signed(swept_centres(path, 8))).max() <= PathJob().gouge_tolerance
    assert "gouge" in path.reasons


def test_a_convex_body_needs_no_lift(covered: Callable[..., ContactPath], pebble: Callable[..., TSpline]) -> None:
    path = covered(pebble(), "round")
    assert path.lifts.max() == 0
    assert set(path.reasons) == {"post"}
    assert np.allclose(path.centres, path.contacts + path.cutter.radius * path.normals)


def test_balls_keep_clear_of_the_post(
    covered: Callable[..., ContactPath],
    pebble: Callable[..., TSpline],
    holding: HoldingJob,
    mesh_of: Callable[..., TriangleMesh],
) -> None:
    surface = pebble()
    path = covered(surface, "round", post_clearance=0.3)
    post = post_below(mesh_of(surface), holding)
    assert post.distance(path.centres).min() >= path.cutter.radius + 0.3
    assert path.reasons.count("post") > 10


def test_neighbouring_passes_run_opposite_ways(
    covered: Callable[..., ContactPath], pebble: Callable[..., TSpline]
) -> None:
    path = covered(pebble(), "round")
    i = joined(path)
    round_ = np.cross(path.centres[i], path.centres[i + 1])[:, 2]
    sense = np.array([np.sign(round_[path.pass_index[i] == k].sum()) for k in range(path.pass_index.max() + 1)])
    rings = np.array(
        [np.ptp(path.parameters[path.pass_index == k, 0]) > 0.999 for k in range(path.pass_index.max() + 1)]
    )
    both = rings[1:] & rings[:-1]
    assert both.mean() > 0.8
    assert (sense[1:] == -sense[:-1])[both].all()
    moves = path.centres[i + 1] - path.centres[i]
    assert ((path.feeds[i] * moves).sum(1) > 0).all()


def test_two_runs_are_identical(covered: Callable[..., ContactPath], grooved_pebble: Callable[..., TSpline]) -> None:
    first, second = (covered.__wrapped__(grooved_pebble(0.5), "round") for _ in range(2))  # type: ignore[attr-defined]
    assert first.centres.tobytes() == second.centres.tobytes()
    assert first.pass_index.tobytes() == second.pass_index.tobytes()


def test_a_post_beside_the_part_is_refused(
    mesh_of: Callable[..., TriangleMesh], pebble: Callable[..., TSpline]
) -> None:
    mesh = mesh_of(pebble())
    aside = replace(mesh, vertices=mesh.vertices + np.array([20.0, 0, 0]))
    with pytest.raises(ToolPathError, match="misses"):
        post_below(aside, HoldingJob(diameter=4.0))


def test_the_post_ends_inside_the_part(
    mesh_of: Callable[..., TriangleMesh], pebble: Callable[..., TSpline], holding: HoldingJob
) -> None:
    mesh = mesh_of(pebble())
    post = post_below(mesh, holding)
    rim = np.array([[post.radius * np.cos(a), post.radius * np.sin(a), post.top + 0.05] for a in np.linspace(0, 6, 9)])
    assert MeshDistance(mesh).inside(rim).all()


def test_nothing_to_cut_is_an_error(covered: Callable[..., ContactPath], pebble: Callable[..., TSpline]) -> None:
    with pytest.raises(ToolPathError, match=r"contacts \(\d+\.\d mm2\) are too near the post") as told:
        covered(pebble(), "round", post_clearance=50.0)
    assert told.value.evidence["area_mm2"] == pytest.approx(pebble().area, rel=0.01)
