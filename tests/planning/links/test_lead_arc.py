"""Arcs on which the ball comes onto a cut and leaves it, on a floor with a wall at its end."""

from collections.abc import Callable

import numpy as np
import pytest
from boxes import boxes
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.machine.bodies import Frustum
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.link_space import Feeds, LinkSpace
from bonecam.planning.links import ARC_STEPS, arcs_from, arcs_to, begins_tangentially, find_leads, led_links, link_runs
from bonecam.planning.scene import Scene
from bonecam.setup.capsule import smallest_capsule
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind
from bonecam.workholding.post import Post

FLOOR, RADIUS = 35.0, 1.0
ALONG = np.arange(-4.0, 4.1, 0.5)


@pytest.fixture(scope="module")
def floor() -> Callable[[float], LinkSpace]:
    """What is planned in over a floor with a wall from a place on in y, mm."""

    def made(wall: float) -> LinkSpace:
        mesh = boxes(([-9, -10, FLOOR - 5], [9, 12, FLOOR]), ([-9, wall, FLOOR], [9, wall + 2, FLOOR + 6]))
        scene = Scene(
            mesh,
            mesh,
            smallest_capsule(mesh.vertices, 0.5),
            Post(2.0, FLOOR - 5),
            known_level_distance=MeshDistance(mesh),
        )
        thin = Cutter(1, "ball", RADIUS, 1.0, 0.8, 40.0, (Frustum(30.0, 4.0, 4.0),), 4500.0, 900.0, 0.02)
        checker = CollisionChecker(scene, thin, 2.0)
        feeds = Feeds(1500.0, 300.0, 10000.0)
        return LinkSpace(checker, MachineLimits(np.radians(80.0)), feeds, 2.0, 0.01, None, RADIUS)

    return made


def lines(*xs: float) -> tuple[tuple[ndarray, ndarray, ndarray], list[ndarray]]:
    """Contacts of straight cuts along +y at some x, and their runs."""
    places = [[x, y, FLOOR + RADIUS] for x in xs for y in ALONG]
    up = np.tile([0.0, 0, 1], (len(places), 1))
    runs = [np.arange(len(ALONG)) + k * len(ALONG) for k in range(len(xs))]
    return (np.array(places), up, up), runs


def test_an_arc_is_tangential_to_the_cut_and_rises_from_it(floor: Callable[[float], LinkSpace]) -> None:
    contacts, runs = lines(0.0)
    (into,), (out,) = arcs_to(floor(9.0), contacts, runs), arcs_from(floor(9.0), contacts, runs)
    assert into is not None
    assert out is not None
    for (centres, axes), end, way in ((into, ALONG[0], -1.0), (out, ALONG[-1], 1.0)):
        assert len(centres) == ARC_STEPS
        middle = np.array([0.0, end, FLOOR + 2 * RADIUS])
        assert np.allclose(np.linalg.norm(centres - middle, axis=1), RADIUS)
        assert (np.diff(centres[:, 2]) > 0).all()
        assert (way * (centres[:, 1] - end) > 0).all()
        assert (axes == [0, 0, 1]).all()
    assert begins_tangentially(into[0][0], contacts[0][runs[0]])
    assert not begins_tangentially(contacts[0][0] + [0, 0, 1.0], contacts[0][runs[0]])


def test_an_arc_that_would_go_through_a_wall_is_refused_and_a_smaller_one_taken(
    floor: Callable[[float], LinkSpace],
) -> None:
    """The ball is 0.3 mm, then 0.02 mm off the wall where the cut ends."""
    contacts, runs = lines(0.0)
    (small,) = arcs_from(floor(ALONG[-1] + RADIUS + 0.3), contacts, runs)
    assert small is not None
    assert small[0][:, 1].max() <= ALONG[-1] + 0.3
    near = floor(ALONG[-1] + RADIUS + 0.02)
    assert arcs_from(near, contacts, runs) == [None]


def test_runs_are_linked_by_their_arcs_and_straight_where_there_is_none(floor: Callable[[float], LinkSpace]) -> None:
    """The first approach comes on an arc at the feed of cuts, no move of it at the plunge feed; beside the wall the
    last contact is left straight up."""
    space = floor(ALONG[-1] + RADIUS + 0.02)
    contacts, runs = lines(-3.0, 3.0)
    leads = find_leads(space, contacts, runs, [None])
    assert sorted(leads.enter) == [0, len(ALONG)]
    assert not leads.leave
    poses = list(zip(contacts[0], contacts[2]))
    found = link_runs(space, poses, runs, [None], leads)
    assert [k for k, _ in found.links] == [0, 1]
    for (_, link), run in zip(found.links, runs, strict=True):
        assert begins_tangentially(link.centres[-1], contacts[0][run])
        assert (link.feeds[-ARC_STEPS:] == 900.0).all()
        assert (link.kinds[-ARC_STEPS:] == MoveKind.LINK).all()
        assert 300.0 not in link.feeds
    assert found.home is not None
    assert np.allclose(found.home.centres[0, :2], contacts[0][runs[1][-1], :2])


def test_a_direct_link_goes_from_arc_to_arc(floor: Callable[[float], LinkSpace]) -> None:
    """The axis leans, for no link stands at the pole of the rotary axes."""
    (centres, normals, _), runs = lines(0.0, 1.0)
    axes = unit(normals + np.array([0.2, 0, 0]))
    runs[1] = runs[1][::-1]
    (link,) = led_links(floor(9.0), (centres, normals, axes), [runs[0]], [runs[1]], 2.5)
    assert link is not None
    assert begins_tangentially(link.centres[-1], centres[runs[1]])
    assert (np.linalg.norm(np.diff(link.centres, axis=0), axis=1) > 0).all()
