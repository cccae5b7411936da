"""A lump with a groove, the contacts on it, and what stands round it."""

from collections.abc import Callable

import pytest

from bonecam.job import HoldingJob, PathJob
from bonecam.levels.measure import Level
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.contacts import candidate_contacts, contact_path
from bonecam.planning.scene import Scene
from bonecam.setup.capsule import Capsule
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath
from bonecam.workholding.clamping import Clamping
from bonecam.workholding.post import post_below


@pytest.fixture(scope="session")
def lump(
    grooved_pebble: Callable[..., TSpline],
    mesh_of: Callable[..., TriangleMesh],
    holding: HoldingJob,
    roughing_cutter: Cutter,
    upright_capsule: Capsule,
    level_of: Callable[..., Level],
) -> Callable[..., tuple[TSpline, ContactPath, Scene]]:
    """Makes a lump with a groove of depth `waist` (mm) under 0.4 mm of material, its contacts for a cutter, and their
    scene."""

    def make(
        job: PathJob, clamping: Clamping, cutter: Cutter = roughing_cutter, waist: float = 0.8
    ) -> tuple[TSpline, ContactPath, Scene]:
        surface = grooved_pebble(waist)
        level, material = mesh_of(surface), mesh_of(grooved_pebble(waist, 0.4))
        post = post_below(level, holding)
        found = candidate_contacts(level_of(surface), [MeshDistance(level)], cutter, post, job)
        scene = Scene(level, material, upright_capsule, post, clamping=clamping)
        return surface, contact_path(found), scene

    return make
