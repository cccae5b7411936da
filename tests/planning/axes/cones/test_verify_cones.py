"""FCL's word on cones: it lets those pass that are proven, and sees what is wider, contained, or in the way."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.mesh.solids.revolution import revolve
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones.admissible_cones import MOST_SLACK, NO_CONE, AxisCones
from bonecam.planning.axes.cones.verify_cones import verified_cones, verify_cones
from bonecam.planning.collision.scene import Scene
from bonecam.tool.path import ContactPath

SOME = 30
"""Every so many cones are asked."""

Made = tuple[ContactPath, Scene]


@pytest.fixture(scope="module")
def some(cones: AxisCones) -> AxisCones:
    kept = np.arange(len(cones.angles)) % SOME == 0
    return replace(cones, angles=np.where(kept, cones.angles, NO_CONE))


def ball(radius: float, centre: np.ndarray) -> TriangleMesh:
    angle = np.linspace(0, np.pi, 10)[1:-1]
    mesh = revolve(radius * np.sin(angle), -radius * np.cos(angle), (-radius, radius), 16)
    return TriangleMesh(mesh.vertices + centre, mesh.faces)


def test_cones_that_are_proven_pass(made: Made, some: AxisCones) -> None:
    _, scene = made
    verdict = verify_cones(some, scene)
    assert len(verdict.asked) == (some.angles > 0).sum() > 15
    assert len(verdict.refused) <= 0.02 * len(verdict.asked)


def test_wider_cones_are_refused_and_narrowed_to_what_passes(made: Made, some: AxisCones) -> None:
    _, scene = made
    wide = replace(some, angles=np.where(some.angles > 0, 1.3 * some.angles, NO_CONE))
    verdict = verify_cones(wide, scene)
    assert len(verdict.refused) > 0.3 * len(verdict.asked)
    assert {"cutter against the level", "shank against the material"} & set(verdict.refused.values())
    mended = verified_cones(wide, scene)
    assert mended.check is not None
    assert mended.check.narrowed + mended.check.refused == len(verdict.refused)
    refused = list(verdict.refused)
    assert (mended.angles[refused] < wide.angles[refused]).all()
    assert (mended.angles[refused] > 0).sum() == mended.check.narrowed > 0
    assert not verify_cones(mended, scene).refused
    assert mended.of(mended.path).check == mended.check
    assert mended.about(mended.axes[mended.free.net.node_of]).check is None


def test_an_obstacle_wholly_inside_and_one_round_the_tool_are_seen(made: Made, some: AxisCones) -> None:
    """FCL itself tells surfaces that cross, not what is contained."""
    _, scene = made
    node = int(np.flatnonzero(some.angles > 0)[0])
    one = replace(some, angles=np.where(np.arange(len(some.angles)) == node, some.angles, NO_CONE))
    place, axis = one.free.apexes.places[node], one.axes[node]
    inner = ball(0.3, place + 22.0 * axis)
    beside = TriangleMesh(
        np.vstack([scene.material.vertices, inner.vertices]),
        np.vstack([scene.material.faces, inner.faces + len(scene.material.vertices)]),
    )
    assert not verify_cones(one, scene).refused
    assert verify_cones(one, replace(scene, material=beside)).refused == {node: "holder against the material"}
    outer = ball(400.0, place)
    assert verify_cones(one, replace(scene, material=outer)).refused == {node: "spindle against the material"}


def test_the_slack_is_what_the_proof_has_to_spare(cones: AxisCones) -> None:
    """With apexes that may be further off by all of it but a tenth of a millimetre a tenth is left."""
    slacks, free = cones.slacks, cones.free
    assert (slacks[cones.angles <= 0] == 0).all()
    assert slacks.max() <= MOST_SLACK
    some = (slacks > 0.2) & (slacks < 0.9 * MOST_SLACK)
    apexes = free.apexes._replace(
        growth=np.where(some, free.apexes.growth + slacks - 0.1, free.apexes.growth)
    )
    left = replace(cones, free=replace(free, apexes=apexes)).slacks
    assert some.sum() > 50
    assert left[some] == pytest.approx(0.1, abs=0.04)
    assert (left[~some] == slacks[~some]).all()
