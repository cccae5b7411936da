"""Runs of contacts that are linked one after the other."""

import numpy as np
import pytest
from boxes import boxes
from numpy import ndarray

from bonecam.machine.bodies import Frustum
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.link_space import Feeds, LinkSpace, Pose
from bonecam.planning.links import link_runs
from bonecam.planning.scene import Scene
from bonecam.setup.capsule import smallest_capsule
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import Post

FLOOR, ROOF = 35.0, 55.0
ALONG = np.arange(-9.0, 9.1, 0.5)
"""y of the contacts of a run, mm."""


@pytest.fixture(scope="module")
def roofed() -> LinkSpace:
    """A plate with a roof over y > 3: no tool that stands below it gets away."""
    mesh = boxes(([-9, -10, FLOOR - 5], [9, 10, FLOOR]), ([-9, 3, ROOF], [9, 10, ROOF + 3]))
    scene = Scene(
        mesh, mesh, smallest_capsule(mesh.vertices, 0.5), Post(2.0, FLOOR - 5), known_level_distance=MeshDistance(mesh)
    )
    thin = Cutter(1, "ball", 1.0, 1.0, 0.8, 40.0, (Frustum(30.0, 4.0, 4.0),), 4500.0, 900.0, 0.02)
    return LinkSpace(
        CollisionChecker(scene, thin, 2.0), MachineLimits(np.radians(80.0)), Feeds(1500.0, 300.0, 10000.0), 2.0, 0.01
    )


def poses_at(x: float, along: ndarray) -> list[Pose]:
    return [(np.array([x, y, FLOOR + 1.0]), np.array([0.0, 0.0, 1.0])) for y in along]


@pytest.mark.whole
def test_a_run_that_ends_where_the_tool_is_caught_is_cut_short_and_the_next_is_reached(roofed: LinkSpace) -> None:
    poses = poses_at(-3.0, ALONG) + poses_at(3.0, ALONG[::-1])
    runs = [np.arange(len(ALONG)), np.arange(len(ALONG)) + len(ALONG)]
    found = link_runs(roofed, poses, runs, [None])
    assert [k for k, _ in found.links] == [0, 1]
    assert found.home is not None
    (first, second) = found.runs
    assert first[0] == runs[0][0]
    assert second[-1] == runs[1][-1]
    for run, whole in zip(found.runs, runs, strict=True):
        heights = [poses[i][0][1] for i in run]
        assert max(heights) < 3.0, "not below the roof"
        assert len(run) > 8
        assert set(run) < set(whole)


def test_runs_that_are_reached_stay_whole_and_one_that_lies_all_below_the_roof_is_left_out(roofed: LinkSpace) -> None:
    free, caught = ALONG[ALONG < 0], ALONG[ALONG > 6]
    poses = poses_at(-3.0, free) + poses_at(0.0, caught)
    runs = [np.arange(len(free)), np.arange(len(caught)) + len(free)]
    found = link_runs(roofed, poses, runs, [None])
    assert [k for k, _ in found.links] == [0]
    assert all(np.array_equal(run, whole) for run, whole in zip(found.runs, runs, strict=True))
