"""FCL judges the axes that no cone of its own holds, one by one, and leaves out those that collide."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bonecam.job import PathJob
from bonecam.machine.bodies import Frustum
from bonecam.planning.axes.tool_axes import ToolAxes, WantedAxes, judged_axes
from bonecam.planning.collision import CollisionChecker
from bonecam.tool.cutter import Cutter
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import ConeCheck, ContactPath, FreeCones
from bonecam.workholding.clamping import Clamping

Made = tuple[ContactPath, CollisionChecker]


@pytest.fixture(scope="module")
def made(lump: Callable[..., Any], roughing_cutter: Cutter) -> Made:
    """Some contacts of a lump with a groove, and the checker of a stubby tool, which its holder meets along normals."""
    holder, nose = (Frustum(20.0, 16.0, 16.0),), (Frustum(30.0, 40.0, 40.0),)
    stubby = replace(roughing_cutter, overhang=14.0, holder=holder, nose=nose)
    _, contacts, scene = lump(PathJob(pattern="along"), Clamping(clearance=1.0), stubby)
    some = contacts.take(np.arange(0, len(contacts.centres), 9))
    return some, CollisionChecker(scene, stubby)


def along(axes: np.ndarray) -> tuple[ToolAxes, WantedAxes]:
    """These axes, chosen without any proof."""
    none = np.zeros(len(axes), dtype=bool)
    return ToolAxes(axes, ("",) * len(axes), none), WantedAxes(axes, none)


def test_axes_that_collide_are_left_out_and_free_ones_stay(made: Made) -> None:
    path, checker = made
    chosen, wanted = along(path.normals)
    judged, poses = judged_axes(path, chosen, wanted, checker)
    free = checker.free_by_distance(path.centres, path.normals)
    refused = np.array([reason == "collision" for reason in judged.reasons])
    assert poses.asked == len(refused)
    assert poses.refused == refused.sum() > 0.02 * len(refused)
    assert free.sum() > 0.2 * len(free)
    assert not (refused & free).any()


def test_those_in_certified_cones_are_not_asked(made: Made) -> None:
    path, checker = made
    chosen, wanted = along(path.normals)
    count = len(path.normals)
    # every third contact has no cone, every second cone is about another axis
    shapes = EllipticCones.circular(
        np.where(np.arange(count)[:, None] % 2, path.normals, -path.normals), np.full(count, 0.2)
    )
    cone_of = np.where(np.arange(count) % 3, np.arange(count), -1)
    cones = FreeCones(path.centres, shapes, cone_of, check=ConeCheck(count, 0, 0))
    held = (np.arange(count) % 3 > 0) & (np.arange(count) % 2 > 0)
    judged, poses = judged_axes(path, chosen, replace(wanted, cones=cones), checker)
    assert poses.asked == (~held).sum()
    assert not np.array([bool(reason) for reason in judged.reasons])[held].any()
    unasked = replace(wanted, cones=replace(cones, check=None))
    assert judged_axes(path, chosen, unasked, checker)[1].asked == count
