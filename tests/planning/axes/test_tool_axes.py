"""Axes that a rotary axis would hold the cut up with are eased, where that is free.

FCL judges the axes that no cone of its own holds, one by one, and leaves out those that collide.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from small_lump import lump
from small_parts import ROUGHING_CUTTER

from bonecam.arrays import angles_between
from bonecam.job import PathJob
from bonecam.machine.bodies import Frustum
from bonecam.machine.limits import MachineLimits
from bonecam.planning.axes.tool_axes import ToolAxes, WantedAxes, choose_axes, eased_axes, judged_axes
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.motion_time import rotary_minutes
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import ConeCheck, ContactPath, FreeCones
from bonecam.workholding.clamping import Clamping

LIMITS = MachineLimits(np.radians(100.0), tilt_speed=np.radians(6000.0), turn_speed=np.radians(9000.0))
"""Degrees a minute."""
FEED = 900.0
COUNT = 81


class Open(CollisionChecker):
    """A checker for which the tool is free but where its ball is in a forbidden range of x, mm."""

    def __init__(self, low: float = np.inf, high: float = np.inf) -> None:
        object.__setattr__(self, "forbidden", (low, high))

    def free(self, centres: ndarray, axes: ndarray) -> ndarray:
        low, high = vars(self)["forbidden"]
        return ~((centres[:, 0] >= low) & (centres[:, 0] <= high))

    def moves_free(
        self, tips: ndarray, axes: ndarray, joined: ndarray, known_free: ndarray | None = None, *, cutting: bool = True
    ) -> ndarray:
        return joined


def pass_of(azimuths: ndarray) -> tuple[ContactPath, ToolAxes]:
    """A pass along +x on a plane, 0.25 mm from contact to contact, with axes of these azimuths (rad), 40 degrees from
    the normal."""
    cutter = replace(ROUGHING_CUTTER, feed=FEED)
    count = len(azimuths)
    places = np.column_stack([0.25 * np.arange(count), np.zeros(count), np.full(count, 50.0)])
    normals = np.tile([0.0, 0.0, 1.0], (count, 1))
    tilt = np.radians(40.0)
    around = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.zeros(count)])
    axes = np.sin(tilt) * around + np.cos(tilt) * normals
    flags = np.zeros(count, dtype=bool)
    path = ContactPath(
        0,
        cutter,
        np.zeros(count, dtype=np.int64),
        places[:, :2],
        places,
        normals,
        np.tile([1.0, 0.0, 0.0], (count, 1)),
        places + cutter.radius * normals,
        np.zeros(count),
        flags,
        np.zeros((0, 3)),
        (),
    )
    return path, ToolAxes(axes, ("",) * count, ~flags)


def feeds(path: ContactPath, axes: ndarray) -> ndarray:
    """The feed that the rotary axes allow the tip on each move, mm/min."""
    ways = np.linalg.norm(np.diff(path.centres - path.cutter.radius * axes, axis=0), axis=1)
    azimuths = np.unwrap(np.arctan2(axes[:, 1], axes[:, 0]))
    polar = np.arccos(axes[:, 2])
    minutes = np.maximum(np.abs(np.diff(azimuths)) / LIMITS.turn_speed, np.abs(np.diff(polar)) / LIMITS.tilt_speed)
    return ways / np.maximum(minutes, 1e-12)


def eased(path: ContactPath, chosen: ToolAxes, checker: Open, limits: MachineLimits = LIMITS) -> ToolAxes:
    wanted = WantedAxes(chosen.axes, np.zeros(len(chosen.axes), dtype=bool))
    return eased_axes(path, chosen, wanted, checker, limits, PathJob())


TURNED = np.radians(60.0) * np.clip((np.arange(COUNT) - 39) / 2, 0, 1)
"""Two moves of 0.25 mm in the middle of a pass of 20 mm turn the azimuth by 60 degrees."""


def test_a_sudden_turn_is_spread_over_its_neighbours():
    path, chosen = pass_of(TURNED)
    assert feeds(path, chosen.axes).min() < 0.3 * FEED
    made = eased(path, chosen, Open())
    assert feeds(path, made.axes).min() > 0.5 * FEED
    assert (made.axes[[0, -1]] == chosen.axes[[0, -1]]).all()
    changed = np.flatnonzero((made.axes != chosen.axes).any(axis=1))
    assert not made.free_in_motion[changed].any()
    assert made.free_in_motion[: changed[0] - 1].all()
    assert angles_between(made.axes, path.normals).min() > np.radians(PathJob().least_lead_deg)


def test_axes_stay_where_the_eased_ones_collide_or_nothing_is_slow():
    path, chosen = pass_of(TURNED)
    assert (eased(path, chosen, Open(9.0, 11.0)).axes == chosen.axes).all()
    unknown = MachineLimits(np.radians(100.0))
    assert (eased(path, chosen, Open(), unknown).axes == chosen.axes).all()
    slow = replace(path, cutter=replace(path.cutter, feed=0.1 * FEED))
    assert (eased(slow, chosen, Open()).axes == chosen.axes).all()


def test_axes_that_turn_unevenly_become_those_that_a_machine_follows():
    """Contacts 0.1 to 0.4 mm apart whose azimuth grows by 0.4 degrees at each: even over contacts, not over the way."""
    path, _ = pass_of(np.zeros(COUNT))
    path = replace(path, cutter=replace(path.cutter, feed=5000.0))
    centres = path.centres.copy()
    centres[:, 0] = np.cumsum(np.random.default_rng(2).uniform(0.1, 0.4, COUNT))
    path = replace(path, centres=centres, contacts=centres - path.centres[0] + path.contacts[0])
    _, chosen = pass_of(np.radians(0.4) * np.arange(COUNT))
    driven = replace(LIMITS, tilt_acceleration=np.radians(500) * 3600, turn_acceleration=np.radians(800) * 3600)
    made = eased(path, chosen, Open(), driven)

    def minutes(axes: ndarray) -> float:
        at_feed = np.linalg.norm(np.diff(path.centres - path.cutter.radius * axes, axis=0), axis=1) / 5000
        return float(rotary_minutes(driven, axes, at_feed, np.ones(COUNT - 1, dtype=bool)).sum() / at_feed.sum())

    assert minutes(made.axes) - 1 < 0.5 * (minutes(chosen.axes) - 1)
    assert angles_between(made.axes, chosen.axes).max() < np.radians(0.5)
    assert (made.axes[[0, -1]] == chosen.axes[[0, -1]]).all()


@pytest.mark.parametrize("certified", [False, True])
@pytest.mark.parametrize(("angle_deg", "changes"), [(5.0, False), (40.0, True)])
def test_axes_that_lie_in_their_cones_stay_there(angle_deg, changes, certified):
    """Also on a path that is made anew of some of a level's contacts: its moves are not certified by the cones."""
    path, chosen = pass_of(TURNED)
    cones = EllipticCones.circular(chosen.axes, np.full(COUNT, np.radians(angle_deg)))
    free = FreeCones(path.centres, cones, np.arange(COUNT))
    wanted = WantedAxes(chosen.axes, np.full(COUNT, certified), free)
    made = eased_axes(path, chosen, wanted, Open(), LIMITS, PathJob())
    assert (made.axes != chosen.axes).any() == changes
    assert angles_between(made.axes, chosen.axes).max() < np.radians(angle_deg)


def test_a_contact_without_a_cone_is_not_bound_by_another_ones():
    path, chosen = pass_of(TURNED)
    cones = EllipticCones.circular(chosen.axes[:1], np.full(1, np.radians(5.0)))
    free = FreeCones(path.centres[:1], cones, np.r_[0, np.full(COUNT - 1, -1)])
    made = eased_axes(
        path, chosen, WantedAxes(chosen.axes, np.zeros(COUNT, dtype=bool), free), Open(), LIMITS, PathJob()
    )
    assert feeds(path, made.axes).min() > 0.5 * FEED


@pytest.fixture(scope="module")
def made():
    """Some contacts of a lump with a groove, and the checker of a stubby tool, which its holder meets along normals."""
    holder, nose = (Frustum(20.0, 16.0, 16.0),), (Frustum(30.0, 40.0, 40.0),)
    stubby = replace(ROUGHING_CUTTER, overhang=14.0, holder=holder, nose=nose)
    _, contacts, scene = lump(PathJob(pattern="along"), Clamping(clearance=1.0), stubby)
    some = contacts.take(np.arange(0, len(contacts.centres), 9))
    return some, CollisionChecker(scene, stubby)


def along(axes: np.ndarray) -> tuple[ToolAxes, WantedAxes]:
    """These axes, chosen without any proof."""
    none = np.zeros(len(axes), dtype=bool)
    return ToolAxes(axes, ("",) * len(axes), none), WantedAxes(axes, none)


def test_axes_that_collide_are_left_out_and_free_ones_stay(made):
    path, checker = made
    chosen, wanted = along(path.normals)
    judged, poses = judged_axes(path, chosen, wanted, checker)
    free = checker.free_by_distance(path.centres, path.normals)
    refused = np.array([reason == "collision" for reason in judged.reasons])
    assert poses.asked == len(refused)
    assert poses.refused == refused.sum() > 0.02 * len(refused)
    assert free.sum() > 0.2 * len(free)
    assert not (refused & free).any()


def test_an_axis_that_fcl_finds_free_is_not_replaced(made, monkeypatch):
    """Distances prove no tool free that touches the walls of a hollow hardly wider than its ball."""
    path, checker = made
    upright = angles_between(path.normals, np.tile([0.0, 0.0, 1.0], (len(path.normals), 1))) < 0.5
    free = path.take(np.flatnonzero(checker.free(path.centres, path.normals) & ~upright))
    assert len(free.normals) > 0.1 * len(path.normals)
    wanted = along(free.normals)[1]
    monkeypatch.setattr(CollisionChecker, "free_by_distance", lambda self, centres, axes: np.zeros(len(axes), bool))
    chosen = choose_axes(free, checker, MachineLimits(np.pi), PathJob(), wanted)
    assert (chosen.axes == free.normals).all()


def test_those_in_certified_cones_are_not_asked(made):
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
