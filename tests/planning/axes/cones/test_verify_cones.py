"""FCL's word on cones: it lets those pass that are proven, and sees what is wider, contained, or in the way."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.mesh.solids import revolve
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones import AxisCones, verified_cones, verify_cones
from bonecam.planning.scene import Scene
from bonecam.tool.path import ContactPath

SOME = 30
"""Every so many cones are asked."""

Made = tuple[ContactPath, Scene]


@pytest.fixture(scope="module")
def some(cones: AxisCones) -> AxisCones:
    return only(cones, np.arange(len(cones.shapes)) % SOME == 0)


def only(cones: AxisCones, kept: np.ndarray) -> AxisCones:
    """The cones of some nodes alone."""
    return replace(cones, shapes=cones.shapes.scaled(np.where(kept, 1.0, -1.0)))


def ball(radius: float, centre: np.ndarray) -> TriangleMesh:
    angle = np.linspace(0, np.pi, 10)[1:-1]
    mesh = revolve(radius * np.sin(angle), -radius * np.cos(angle), (-radius, radius), 16)
    return TriangleMesh(mesh.vertices + centre, mesh.faces)


def test_cones_that_are_proven_pass(made: Made, some: AxisCones) -> None:
    _, scene = made
    verdict = verify_cones(some, scene)
    assert len(verdict.asked) == some.shapes.found.sum() > 15
    assert len(verdict.refused) <= 0.02 * len(verdict.asked)


def test_wider_cones_are_refused_and_narrowed_to_what_passes(made: Made, some: AxisCones) -> None:
    _, scene = made
    wide = replace(some, shapes=some.shapes.scaled(1.3))
    verdict = verify_cones(wide, scene)
    assert len(verdict.refused) > 0.3 * len(verdict.asked)
    assert {"cutter against the level", "shank against the material"} & set(verdict.refused.values())
    mended = verified_cones(wide, scene)
    assert mended.check is not None
    assert mended.check.narrowed + mended.check.refused == len(verdict.refused)
    refused = list(verdict.refused)
    assert (mended.shapes.angles[refused] < wide.shapes.angles[refused]).all()
    assert mended.shapes.found[refused].sum() == mended.check.narrowed > 0
    assert not verify_cones(mended, scene).refused
    assert mended.of(mended.path).check == mended.check
    assert mended.about(mended.shapes.axes[mended.free.net.node_of]).check is None


def test_an_obstacle_wholly_inside_and_one_round_the_tool_are_seen(made: Made, some: AxisCones) -> None:
    """FCL itself tells surfaces that cross, not what is contained."""
    _, scene = made
    node = int(np.flatnonzero(some.shapes.found)[0])
    one = only(some, np.arange(len(some.shapes)) == node)
    place, axis = one.free.net.places[node], one.shapes.axes[node]
    inner = ball(0.3, place + 22.0 * axis)
    beside = TriangleMesh(
        np.vstack([scene.material.vertices, inner.vertices]),
        np.vstack([scene.material.faces, inner.faces + len(scene.material.vertices)]),
    )
    assert not verify_cones(one, scene).refused
    assert verify_cones(one, replace(scene, material=beside)).refused == {node: "holder against the material"}
    outer = ball(400.0, place)
    assert verify_cones(one, replace(scene, material=outer)).refused == {node: "shank against the material"}
