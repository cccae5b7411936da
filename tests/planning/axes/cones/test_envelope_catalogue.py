"""What planes tell from a sweep is clear of it, facets that they leave are all that can touch, and FCL's answer from
the catalogue is that of a fine mesh."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from bonecam.arrays import unit
from bonecam.kernels.cones import facets_below
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones import COARSE_SIDES, Obstacle, Sweep, crossing
from bonecam.planning.collision import crosses, solid_object

CASES = 400

Case = tuple[np.ndarray, np.ndarray, np.ndarray, TriangleMesh]


@cache
def cases() -> list[Case]:
    """Sizes, places, turns, and the convex hull of a few points near each."""
    random = np.random.default_rng(7)
    made = []
    for turn in Rotation.random(CASES, random_state=1).as_matrix():
        second, first = np.sort(random.uniform(0.05, 1.1, 2))
        start, radius = random.uniform(0.0, 6.0), random.uniform(0.5, 3.0)
        size = np.array([start, start + random.uniform(3.0, 20.0), radius, first, second, 0.3])
        place = 5 * random.normal(size=3)
        middle = place + 9 * random.normal(size=3)
        points = middle + random.uniform(0.3, 3.0) * random.normal(size=(12, 3))
        hull = ConvexHull(points)
        made.append((size, place, turn, TriangleMesh(points[hull.simplices].reshape(-1, 3), triples(hull))))
    return made


def triples(hull: ConvexHull) -> np.ndarray:
    """Faces of a mesh whose triangles have corners of their own."""
    return np.arange(3 * len(hull.simplices), dtype=np.int32).reshape(-1, 3)


def fine_crosses(size: np.ndarray, place: np.ndarray, turn: np.ndarray, solid: TriangleMesh) -> bool:
    return crosses(solid_object(*Sweep(*size.tolist()).mesh(96)), turn, place, Obstacle.of(solid).surface)


def holds(size: np.ndarray, place: np.ndarray, turn: np.ndarray, solid: TriangleMesh) -> bool:
    """Whether a corner of the solid lies inside."""
    return bool(Sweep(*size.tolist()).holds((solid.vertices[:1] - place) @ turn, 96).any())


def test_what_planes_tell_apart_does_not_touch_and_most_is() -> None:
    told = clear = 0
    for size, place, turn, solid in cases():
        apart = Obstacle.of(solid).clear(size[None], place[None], turn[None])[0]
        free = not fine_crosses(size, place, turn, solid) and not holds(size, place, turn, solid)
        assert free or not apart
        told += apart
        clear += free
    assert 0.9 * clear < told <= clear < CASES


def test_planes_tell_no_point_from_what_holds_it() -> None:
    """Small triangles about points of the tool at axes of the cone, grown: half of them at its lower edge."""
    random = np.random.default_rng(5)
    for size, place, turn, _ in cases()[:100]:
        start, end, radius, first, second, growth = size
        count = 200
        share, angle, around = np.sqrt(random.random(count)), *random.uniform(0, 2 * np.pi, (2, count))
        flat = share * np.tan([[first], [second]]) * [np.cos(angle), np.sin(angle)]
        axes = unit(np.column_stack([*flat, np.ones(count)]))
        side = unit(np.cross(axes, random.normal(size=(count, 3))))
        height = np.where(around < np.pi, start, random.uniform(start, end, count))
        moved = 0.999 * growth * unit(radius * side - 0.5 * axes)
        points = height[:, None] * axes + radius * side + moved
        corners = place + (points[:, None] + 1e-9 * np.eye(3)) @ turn.T
        for three in corners:
            touching = Obstacle.of(TriangleMesh(three, np.array([[0, 1, 2]], dtype=np.int32)))
            assert not touching.clear(size[None], place[None], turn[None])[0]


def test_facets_that_are_left_cross_where_the_whole_mesh_does() -> None:
    left, met = [], 0
    for size, place, turn, solid in cases():
        vertices, faces = Sweep(*size.tolist()).mesh(COARSE_SIDES)
        obstacle = Obstacle.of(solid)
        near = facets_below(vertices, faces, place, turn, obstacle.directions, obstacle.supports)
        whole = crosses(solid_object(vertices, faces), turn, place, obstacle.surface)
        some = len(near[1]) > 0 and crosses(solid_object(*near), turn, place, obstacle.surface)
        assert some == whole
        met += whole
        left.append(len(near[1]) / len(faces))
    assert met > 0.05 * CASES
    assert np.mean(left) < 0.4


def test_left_facets_keep_their_places() -> None:
    vertices, faces = Sweep(2.0, 12.0, 1.0, 0.5, 0.3, 0.2).mesh(COARSE_SIDES)
    plane = np.array([[1.0, 0.0, 0.0]])
    kept, names = facets_below(vertices, faces, np.zeros(3), np.eye(3), plane, np.array([0.0]))
    corners = vertices[faces]
    assert kept[names] == pytest.approx(corners[(corners[:, :, 0] <= 0).any(axis=1)])
    assert 0 < len(names) < len(faces)


def test_the_catalogue_answers_as_fine_meshes_do() -> None:
    """Where a sweep crosses a solid by more than its growth that is told, unless it holds all of it; and hardly ever
    where it does not."""
    missed = false = 0
    for size, place, turn, solid in cases():
        told = crossing(size[None], place[None], turn[None], Obstacle.of(solid))[0]
        told |= holds(size, place, turn, solid)
        slim = np.r_[size[:5], 0.0]
        slim[0] += 0.1
        missed += fine_crosses(slim, place, turn, solid) and not told
        false += told and not fine_crosses(size, place, turn, solid) and not holds(size, place, turn, solid)
    assert missed == 0
    assert false <= 0.02 * CASES


def test_a_sweep_that_no_mesh_holds_is_taken_to_cross() -> None:
    size, origin, upright = (np.array([[0.0, 1.495, 0.5, 0.816, 0.087, 0.254]]), np.zeros((1, 3)), np.eye(3)[None])
    assert Sweep(*size[0].tolist()).mesh(COARSE_SIDES) is None
    *_, solid = cases()[0]
    far = Obstacle.of(TriangleMesh(solid.vertices + 100.0, solid.faces))
    assert crossing(size, origin, upright, far).all()
    size[0, 3] = 0.1
    assert not crossing(size, origin, upright, far).any()
