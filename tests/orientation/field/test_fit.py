"""What a fitted field promises: bounds, smoothness, and ways round obstacles."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bonecam.arrays import dots
from bonecam.job import HoldingJob, NcJob, PathJob
from bonecam.levels.measure.level import Level
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.orientation.axes.lead import lead_axes
from bonecam.orientation.collision.checker import CollisionChecker
from bonecam.orientation.collision.scene import Scene
from bonecam.orientation.field.fit import fit_axis_field
from bonecam.orientation.limits import AxisLimits, polar_angles
from bonecam.orientation.oriented_path import orient
from bonecam.setup.capsule import Capsule
from bonecam.setup.fixture.clamping import Clamping
from bonecam.setup.holding import post_below
from bonecam.surface.tspline import TSpline
from bonecam.toolpath.contacts import candidate_contacts, contact_path
from bonecam.toolpath.cutters.cutter import Cutter
from bonecam.toolpath.path import ContactPath, Kind

LIMITS = AxisLimits(np.radians(115.0), tilt_speed=np.radians(90) * 60, turn_speed=np.radians(120) * 60)
JOB = PathJob(pattern="along", orientation="smooth")

NEAR = Clamping(clearance=0.5)
"""Holders may come near the post: the part is what they meet."""

Made = tuple[TSpline, ContactPath, Scene]


@pytest.fixture(scope="module")
def made(
    grooved_pebble: Callable[..., TSpline],
    mesh_of: Callable[..., TriangleMesh],
    holding: HoldingJob,
    roughing_cutter: Cutter,
    upright_capsule: Capsule,
    level_of: Callable[..., Level],
) -> Callable[..., Made]:
    """Contacts along a lump with a groove, for a cutter."""

    def make(cutter: Cutter | None = None, job: PathJob = JOB) -> Made:
        surface = grooved_pebble(0.8)
        level, material = mesh_of(surface), mesh_of(grooved_pebble(0.8, 0.4))
        post = post_below(level, holding)
        tool = cutter or roughing_cutter
        contacts = contact_path(candidate_contacts(level_of(surface), [MeshDistance(level)], tool, post, job))
        return surface, contacts, Scene(level, material, upright_capsule, post, clamping=NEAR)

    return make


def fitted(made: Made, job: PathJob = JOB, limits: AxisLimits = LIMITS) -> np.ndarray:
    surface, contacts, scene = made
    checker = CollisionChecker(scene, contacts.cutter)
    field = fit_axis_field(contacts, surface.domain[1], checker, limits, job)
    return field.axes(contacts.parameters)


def on_lines(contacts: ContactPath) -> np.ndarray:
    """Which contacts lie on passes along the part: not on the ring round the post."""
    s = contacts.parameters[:, 0]
    spread = [np.ptp(s[contacts.pass_index == number]) for number in contacts.pass_index]
    return np.array(spread) < 1e-9


def rates(contacts: ContactPath, axes: np.ndarray) -> np.ndarray:
    """Turn of the slower rotary axis over each move of a pass along the part, as a share of what it can at the
    feed."""
    same = (contacts.pass_index[1:] == contacts.pass_index[:-1]) & on_lines(contacts)[1:]
    azimuth = np.arctan2(axes[:, 1], axes[:, 0])
    turn = np.abs(np.angle(np.exp(1j * np.diff(azimuth)))) / LIMITS.turn_speed
    tilt = np.abs(np.diff(polar_angles(axes))) / LIMITS.tilt_speed
    time = np.linalg.norm(np.diff(contacts.centres, axis=0), axis=1) / contacts.cutter.feed
    return (np.maximum(turn, tilt) / np.maximum(time, 1e-9))[same]


def test_the_field_keeps_its_bounds(made: Callable[..., Made]) -> None:
    case = made()
    axes, normals = fitted(case), case[1].normals
    tilt = np.degrees(np.arccos(dots(axes, normals)))
    assert tilt.max() < JOB.max_tilt_deg
    assert np.mean(tilt[on_lines(case[1])] < JOB.least_lead_deg - 1) < 0.03
    assert polar_angles(axes).max() < LIMITS.largest


def test_the_machine_follows_the_field_at_the_feed(made: Callable[..., Made]) -> None:
    case = made()
    contacts = case[1]
    smooth = rates(contacts, fitted(case))
    lead = rates(contacts, lead_axes(contacts.normals, contacts.feeds, np.radians(10.0)))
    assert np.mean(smooth > 1) < 0.01
    assert np.mean(lead > 1) > 0.2
    assert np.mean(np.maximum(smooth, 1)) < 1.02


def test_the_field_gives_way_to_a_holder_near_the_part(
    made: Callable[..., Made], roughing_cutter: Cutter, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A holder just above the flutes collides in most leaning axes; targets turn the field away."""
    from bonecam.orientation.field import fit

    case = made(replace(roughing_cutter, overhang=12.0))
    _, contacts, scene = case
    checker = CollisionChecker(scene, contacts.cutter)
    axes = fitted(case)
    monkeypatch.setattr(fit, "COLLISION_ROUNDS", 0)
    without = fitted(case)
    hits = [np.mean(~checker.free_by_distance(contacts.centres, tried)) for tried in (axes, without)]
    assert hits[1] > 0.02
    assert hits[0] < 0.5 * hits[1]


def test_the_oriented_path_takes_the_axes_of_the_field(made: Callable[..., Made]) -> None:
    case = made()
    _, contacts, scene = case
    wanted = fitted(case)
    path = orient(contacts, scene, LIMITS, JOB, NcJob(), wanted)
    cut = path.kinds == Kind.CUT
    distance = np.linalg.norm(path.contacts[cut][:, None] - contacts.contacts[None], axis=2)
    off = np.linalg.norm(path.axes[cut] - wanted[distance.argmin(axis=1)], axis=1)
    assert np.mean(off < 1e-9) > 0.9


def test_a_neighbours_field_is_a_start_that_leads_to_the_same_smoothness(made: Callable[..., Made]) -> None:
    surface, contacts, scene = made()
    checker = CollisionChecker(scene, contacts.cutter)
    first = fit_axis_field(contacts, surface.domain[1], checker, LIMITS, JOB)
    again = fit_axis_field(contacts, surface.domain[1], checker, LIMITS, JOB, first)
    one, other = (rates(contacts, field.axes(contacts.parameters)) for field in (first, again))
    assert np.sqrt(np.mean(other**2)) < 1.05 * np.sqrt(np.mean(one**2))
