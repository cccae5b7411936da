"""Ways off the surface where the tool stands in a narrow slit."""

from collections.abc import Sequence

import numpy as np
import pytest
from boxes import BOX

from bonecam.machine.bodies import Frustum
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning import link_space
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.link_space import Feeds, LinkSpace, Polyline, departures, find_retracts
from bonecam.planning.scene import Scene
from bonecam.setup.capsule import smallest_capsule
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import Post

RADIUS, GAP, TOP = 2.0, 5.0, 41.0
CENTRE = np.array([0.0, 0.0, TOP - 5.0])


def slit(lean: float) -> TriangleMesh:
    """Two walls GAP apart round CENTRE along x, both leaning by `lean` (radians) towards +x."""
    corners = []
    for low, high in ((-9.0, -GAP / 2), (GAP / 2, 9.0)):
        box = np.array([[x, y, z] for x in (low, high) for y in (-9.0, 9.0) for z in (TOP - 11, TOP)])
        corners.append(box + np.outer(box[:, 2] - CENTRE[2], [np.tan(lean), 0, 0]))
    return TriangleMesh(np.vstack(corners), np.vstack([BOX, BOX + 8]).astype(np.int32))


def space_in(walls: TriangleMesh) -> LinkSpace:
    stock = smallest_capsule(walls.vertices, 0.5)
    scene = Scene(walls, walls, stock, Post(2.0, TOP - 15), known_level_distance=MeshDistance(walls))
    thin = Cutter(1, "ball", RADIUS, RADIUS, 2.0, 40.0, (Frustum(30.0, 16.0, 16.0),), 4500.0, 900.0, 0.02)
    limits = MachineLimits(np.radians(115.0))
    return LinkSpace(CollisionChecker(scene, thin, 2.0), limits, Feeds(1500.0, 300.0, 10000.0), 2.0, 0.01)


def test_between_leaning_walls_the_way_out_leans_as_they_do(monkeypatch: pytest.MonkeyPatch) -> None:
    up = np.array([0.0, 0.0, 1.0])
    (straight,) = find_retracts(space_in(slit(0.0)), [(CENTRE, up)])
    assert straight is not None
    assert np.allclose(straight.moves.centres[:, :2], 0)

    leaning = space_in(slit(np.radians(15.0)))
    (found,) = find_retracts(leaning, [(CENTRE, up)])
    assert found is not None
    way = found.moves.centres[-1] - CENTRE
    assert 11 < np.degrees(np.arctan2(way[0], way[2])) < 17
    assert np.allclose(found.moves.axes, up)
    monkeypatch.setattr(link_space, "LEANS", np.zeros(0))
    assert find_retracts(leaning, [(CENTRE, up)]) == [None]


@pytest.mark.parametrize(("depth", "taken"), [(0.02, True), (0.1, False)])
def test_ways_that_all_cut_are_proven_once_and_the_first_that_cuts_little_is_taken(
    depth: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    leaning, pose = space_in(slit(np.radians(15.0))), (CENTRE, np.array([0.0, 0.0, 1.0]))
    (in_air,) = find_retracts(leaning, [pose])
    proofs = []
    proven = LinkSpace.polylines_free

    def counted(space: LinkSpace, lines: Sequence[Polyline], *, cutting: bool) -> np.ndarray:
        proofs.append(cutting)
        return proven(space, lines, cutting=cutting)

    monkeypatch.setattr(LinkSpace, "polylines_free", counted)
    monkeypatch.setattr(LinkSpace, "left_in_air", lambda _, contacts, centres, deepest: [depth < deepest])
    (found,) = find_retracts(leaning, [pose])
    assert in_air is not None
    if taken:
        assert found is not None
        assert np.array_equal(found.moves.centres, in_air.moves.centres)
    else:
        assert found is None, "a link may not cut"
    assert proofs.count(True) == len(departures(pose[1]))


@pytest.mark.parametrize("asked", ["cuts_little", "rapids_cut_nothing"])
def test_no_way_is_taken_on_which_rays_tell_of_a_cut(asked: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LinkSpace, asked, lambda _, lines, *contacts: np.zeros(len(lines), dtype=bool))
    assert find_retracts(space_in(slit(0.0)), [(CENTRE, np.array([0.0, 0.0, 1.0]))]) == [None]


def test_no_way_out_lets_a_drooping_tool_sink() -> None:
    axis = np.array([np.sin(2.0), 0.0, np.cos(2.0)])
    ways = departures(axis)
    assert np.allclose([np.linalg.norm(way.direction) for way in ways], 1.0)
    assert min(way.direction[2] for way in ways) >= axis[2] - 1e-12
    assert len({tuple(way.direction.round(9)) for way in ways}) > 5
