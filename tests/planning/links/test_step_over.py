"""Where the tool steps over from one pass to the next on the surface."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import HoldingJob, PathJob
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.layers import HeightMesh
from bonecam.planning.link_space import Feeds, LinkSpace
from bonecam.planning.links import steps_over
from bonecam.planning.scene import Scene
from bonecam.setup.capsule import Capsule
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import post_below

Poses = tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"]]


@dataclass(frozen=True, eq=False)
class Grooved:
    """A pebble with a groove under 0.4 mm of material, and what links over it are planned in."""

    surface: TSpline
    space: LinkSpace

    def poses(self, s: float, t: float, lift: float = 0.0) -> Poses:
        """The ball at a place of the surface, lifted by so much (mm), its axis normal to it."""
        at = np.array([s]), np.array([t])
        normals = self.surface.normals(*at)
        return self.surface.positions(*at) + (self.space.ball_radius + lift) * normals, normals, normals


@pytest.fixture(scope="module")
def grooved(
    mesh_of: Callable[..., TriangleMesh],
    grooved_pebble: Callable[..., TSpline],
    upright_capsule: Capsule,
    holding: HoldingJob,
    roughing_cutter: Cutter,
) -> Grooved:
    surface, material = grooved_pebble(0.8), mesh_of(grooved_pebble(0.8, 0.4))
    level = mesh_of(surface)
    checker = CollisionChecker(Scene(level, material, upright_capsule, post_below(level, holding)), roughing_cutter)
    job = PathJob()
    planned = (MachineLimits(np.radians(115.0)), Feeds(500.0, 200.0, 5000.0), job.clearance, job.gouge_tolerance)
    return Grooved(surface, LinkSpace(checker, *planned, HeightMesh(material)))


def test_the_tool_steps_over_to_a_place_nearby(grooved: Grooved) -> None:
    ends, starts = grooved.poses(0.1, 0.3, 0.1), grooved.poses(0.1, 0.315, 0.1)
    assert 0.2 < np.linalg.norm(ends[0] - starts[0]) < 1.0
    assert steps_over(grooved.space, ends, starts, 5.0).all()
    assert not steps_over(grooved.space, ends, starts, 0.1).any()


def test_no_step_over_goes_into_the_level(grooved: Grooved) -> None:
    ends, starts = grooved.poses(0.1, 0.3), grooved.poses(0.2, 0.3)
    assert not grooved.space.ball_free(ends[0], starts[0]).any()
    assert not steps_over(replace(grooved.space, material=None), ends, starts, 50.0).any()


def test_no_step_over_goes_deeper_than_the_passes(grooved: Grooved) -> None:
    """From air to air round the pebble, over material."""
    ends, starts = grooved.poses(0.1, 0.3, 0.65), grooved.poses(0.15, 0.3, 0.65)
    assert grooved.space.ball_free(ends[0], starts[0]).all()
    assert not steps_over(grooved.space, ends, starts, 50.0).any()
    assert steps_over(replace(grooved.space, material=None), ends, starts, 50.0).all()


def test_no_step_over_turns_far(grooved: Grooved) -> None:
    (centres, normals, axes), starts = grooved.poses(0.1, 0.3, 0.1), grooved.poses(0.1, 0.315, 0.1)
    assert not steps_over(grooved.space, (centres, normals, -axes), starts, 5.0).any()


def test_nothing_is_stepped_over_where_there_is_one_run(grooved: Grooved) -> None:
    none = (np.zeros((0, 3)),) * 3
    assert not len(steps_over(grooved.space, none, none, 5.0))
