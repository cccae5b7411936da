"""Short passes are cut from as few directions as reach them, one direction after the other."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy import ndarray

from bonecam.arrays import angles_between
from bonecam.job import PathJob
from bonecam.machine.limits import MachineLimits
from bonecam.planning.axes.lead import lead_axes
from bonecam.planning.axes.tool_axes import WantedAxes
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.rest_machining import held_axes
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath
from bonecam.workholding.clamping import Clamping

LIMITS = MachineLimits(np.radians(100.0), tilt_speed=100.0, turn_speed=100.0)
JOB = PathJob()
COUNT = 5
"""Contacts of a pass."""


class Checker(CollisionChecker):
    """The tool is free but where its ball is beyond a height, mm."""

    def __init__(self, cutter: Cutter, highest: float = np.inf) -> None:
        scene = SimpleNamespace(clamping=Clamping((), closed=False, clearance=1.0))
        for name, value in (("cutter", cutter), ("scene", scene), ("highest", highest)):
            object.__setattr__(self, name, value)

    def free_by_distance(self, centres: ndarray, axes: ndarray) -> ndarray:
        return centres[:, 2] < vars(self)["highest"]


@pytest.fixture
def path(roughing_cutter: Cutter) -> ContactPath:
    """Passes up a cylinder about z, by turns on its two sides, each two at 20 degrees from another."""
    azimuths = np.radians([0, 180, 20, 200])
    normals = np.repeat(np.column_stack([np.cos(azimuths), np.sin(azimuths), 0 * azimuths]), COUNT, axis=0)
    heights = np.tile(50.0 + 0.5 * np.arange(COUNT), 4)
    contacts = 5 * normals + heights[:, None] * [0, 0, 1]
    flags = np.zeros(len(contacts), dtype=bool)
    up = np.tile([0.0, 0.0, 1.0], (len(contacts), 1))
    centres = contacts + roughing_cutter.radius * normals
    passes = np.repeat(np.arange(4), COUNT)
    return ContactPath(
        0,
        roughing_cutter,
        passes,
        contacts[:, :2],
        contacts,
        normals,
        up,
        centres,
        0.0 * heights,
        flags,
        np.zeros((0, 3)),
        (),
        rest=1,
    )


@pytest.fixture
def wanted(path: ContactPath) -> WantedAxes:
    """Axes that lean forward by an angle that grows along each pass."""
    leads = np.radians(np.tile(15.0 + 5 * np.arange(COUNT), 4))
    axes = [lead_axes(n[None], f[None], lead)[0] for n, f, lead in zip(path.normals, path.feeds, leads, strict=True)]
    return WantedAxes(np.array(axes), np.ones(len(axes), dtype=bool))


def test_each_side_is_cut_from_one_direction_and_then_the_other(path: ContactPath, wanted: WantedAxes) -> None:
    held, axes = held_axes(path, wanted, Checker(path.cutter), LIMITS, JOB)
    tilts = np.degrees(angles_between(axes.axes, held.normals))
    assert tilts.min() >= JOB.least_lead_deg - 1e-6
    assert tilts.max() <= JOB.max_tilt_deg + 1e-6
    assert len(np.unique(axes.axes, axis=0)) == 2
    assert (np.diff(axes.axes, axis=0) != 0).any(axis=1).sum() == 1
    # the same passes, whole, in another order
    assert (held.pass_index == path.pass_index).all()
    assert sorted(map(tuple, held.contacts)) == sorted(map(tuple, path.contacts))
    assert (np.diff(held.contacts[:, 2])[np.diff(held.pass_index) == 0] > 0).all()
    assert not axes.certified.any()


def test_a_pass_that_no_direction_reaches_keeps_its_axes(path: ContactPath, wanted: WantedAxes) -> None:
    third = path.pass_index == 2
    raised = replace(path, centres=path.centres + 100.0 * third[:, None] * [0, 0, 1])
    held, axes = held_axes(raised, wanted, Checker(path.cutter, highest=100.0), LIMITS, JOB)
    kept = held.centres[:, 2] > 100.0
    np.testing.assert_array_equal(axes.axes[kept], wanted.axes[third])
    assert axes.certified[kept].all()
    assert not axes.certified[~kept].any()
    assert len(np.unique(axes.axes[~kept], axis=0)) == 2


def test_a_machine_that_has_few_axes_keeps_them(path: ContactPath, wanted: WantedAxes) -> None:
    narrow = MachineLimits(np.radians(90.0), np.radians(90.0))
    held, axes = held_axes(path, wanted, Checker(path.cutter), narrow, JOB)
    assert held is path
    assert axes is wanted
