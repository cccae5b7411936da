"""The cone as a NURBS surface, its implicit form, its principal angles and its meshes.

The mesh of cones holds what it should: closed cones at the contacts' balls, inside the cones they show.

The contacts of a node as apexes: all of them, each with its own moves, normal and room.

What is swept in an elliptic cone is held by its mesh, and the mesh is not much larger.

What planes tell from a sweep is clear of it, facets that they leave are all that can touch, and FCL's answer from
the catalogue is that of a fine mesh.

FCL's word on cones: it lets those pass that are proven, and sees what is wider, contained, or in the way.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from small_parts import path_of

from bonecam.arrays import angles_between, perpendicular, unit
from bonecam.errors import OrientationError
from bonecam.kernels.cones import facets_below
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.mesh.solids import revolve
from bonecam.planning import AxisCones, ObliqueEllipticCone, cones_mesh, verify_cones
from bonecam.planning.axes.cones import (
    CIRCLE_KNOTS,
    COARSE_SIDES,
    Obstacle,
    Sweep,
    at_contacts,
    crossing,
    verified_cones,
)
from bonecam.planning.collision import crosses, solid_object
from bonecam.report.pictures import is_closed
from bonecam.tool import FreeCones
from bonecam.tool.elliptic_cones import EllipticCones


def cone_of(*vectors: list[float]) -> ObliqueEllipticCone:
    return ObliqueEllipticCone(*np.array(vectors, dtype=float))


CONE = cone_of([1.0, 2.0, 3.0], [0.8, -0.5, 5.0], [2.0, 0.3, 0.1], [-0.4, 1.1, 0.6])
RANDOM = np.random.default_rng(7)


def angles(directions: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return np.arccos(np.clip(directions @ axis / np.linalg.norm(directions, axis=1) / np.linalg.norm(axis), -1, 1))


def test_the_nurbs_surface_lies_on_its_quadric():
    u, v = RANDOM.random((2, 2000))
    points = CONE.evaluate(u, v)
    assert np.abs(CONE.implicit(points)).max() < 1e-12
    np.testing.assert_allclose(CONE.heights(points), u, atol=1e-12)


def test_unit_weights_as_printed_miss_the_cone():
    """Eq. 16 without its rational part: a B-spline of the same net."""
    v = RANDOM.random(200)
    around = BSpline(CIRCLE_KNOTS, CONE.control_points[2], 2)(v)
    assert np.abs(CONE.implicit(around)).max() > 0.05


def test_the_gradient_is_that_of_the_implicit_form():
    points = RANDOM.normal(size=(50, 3)) * 4
    for axis in np.eye(3):
        change = CONE.implicit(points + 1e-6 * axis) - CONE.implicit(points - 1e-6 * axis)
        np.testing.assert_allclose(CONE.gradient(points) @ axis, change / 2e-6, rtol=1e-6, atol=1e-6)


def test_directions_inside_are_those_within_the_elliptic_section():
    x, y = RANDOM.uniform(-1.5, 1.5, (2, 5000))
    directions = CONE.axis + x[:, None] * CONE.first + y[:, None] * CONE.second
    np.testing.assert_array_equal(CONE.contains(directions), x**2 + y**2 <= 1)
    assert not CONE.contains(-directions).any()


def test_principal_angles_of_a_right_cone_are_its_own():
    cone = cone_of([0, 0, 0], [0, 0, 4.0], [3.0, 0, 0], [0, 1.0, 0])
    axes, semi_angles = cone.principal
    np.testing.assert_allclose(axes[0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(np.abs(axes[1]), [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(semi_angles, np.arctan([0.75, 0.25]), rtol=1e-12)


def test_an_oblique_cone_is_the_right_cone_of_its_principal_angles():
    axes, (wide, narrow) = CONE.principal
    right = ObliqueEllipticCone(CONE.apex, axes[0], np.tan(wide) * axes[1], np.tan(narrow) * axes[2])
    directions = RANDOM.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_array_equal(CONE.contains(directions), right.contains(directions))
    assert wide >= narrow
    assert angles(CONE.axis[None], axes[0])[0] > 0.01  # it is oblique


@pytest.mark.parametrize("sides", [3, 48])
def test_meshes_hold_the_cone_or_lie_in_it(sides):
    outer, inner = (CONE.tessellate(sides, circumscribed=way) for way in (True, False))
    u, v = RANDOM.random((2, 20_000))
    samples = CONE.evaluate(u, v)
    for mesh in (outer, inner):
        assert mesh.volume > 0
        edges = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        assert {tuple(edge) for edge in edges.tolist()} == {tuple(edge[::-1]) for edge in edges.tolist()}
    normals = outer.face_vectors / np.linalg.norm(outer.face_vectors, axis=1, keepdims=True)
    beyond = np.einsum("fk,nfk->nf", normals, samples[:, None] - outer.vertices[outer.faces[:, 0]])
    assert beyond.max() < 1e-12
    assert CONE.implicit(inner.vertices[2:]).max() < 1e-12
    assert inner.volume < np.pi / 3 * abs(np.linalg.det([CONE.axis, CONE.first, CONE.second])) < outer.volume


def test_what_is_no_cone_is_refused():
    with pytest.raises(ValueError, match="no cone"):
        cone_of([0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0])
    with pytest.raises(ValueError, match="no cone"):
        cone_of([0, 0, 0], [0, 0, 1], [0, 0, 0], [0, 1, 0])
    with pytest.raises(ValueError, match=r"apex = .* three finite numbers"):
        cone_of([0, 0, np.nan], [0, 0, 1], [1, 0, 0], [0, 1, 0])
    with pytest.raises(ValueError, match="3 or more"):
        CONE.tessellate(2, circumscribed=True)


LENGTH = 2.0


@pytest.fixture
def path():
    """Ten points, of which those with odd numbers have a cone."""
    tips = np.column_stack([np.arange(10.0), np.zeros(10), np.zeros(10)])
    axes = unit(np.column_stack([np.linspace(-1, 1, 10), np.ones(10), np.ones(10)]))
    made = path_of(tips, axes)
    which = np.where(np.arange(10) % 2, np.arange(10) // 2, -1)
    angles = np.column_stack([np.linspace(0.1, 0.6, 5), np.linspace(0.1, 0.3, 5)])
    shapes = EllipticCones(axes[1::2], perpendicular(axes[1::2]), angles)
    return replace(made, cones=FreeCones(made.balls[1::2], shapes, which))


def test_each_cone_stands_at_its_ball_and_is_as_wide_as_it_is_proven(path):
    mesh = cones_mesh(path, 10, LENGTH)
    assert is_closed(mesh)
    assert mesh.volume == pytest.approx(
        np.pi / 3 * LENGTH**3 * np.tan(path.cones.shapes.angles).prod(axis=1).sum(), rel=0.02
    )
    corners = mesh.vertices.reshape(5, -1, 3)
    for k, row in enumerate(range(1, 10, 2)):
        away = corners[k] - path.balls[row]
        apex = np.linalg.norm(away, axis=1) < 1e-12
        assert apex.sum() == 1
        off = angles_between(unit(away[~apex]), np.broadcast_to(path.axes[row], away[~apex].shape))
        assert off[off > 0].min() < off.max() == pytest.approx(path.cones.shapes.angles[k, 0])
        held = path.cones.shapes.take(np.full(len(off), k)).off(unit(away[~apex]))
        assert held.max() == pytest.approx(path.cones.shapes.mean_angles[k])


def test_fewer_cones_are_chosen_evenly(path):
    three = cones_mesh(path, 3, LENGTH)
    firsts = three.vertices.reshape(3, -1, 3)[:, 0]
    assert np.allclose(firsts, path.balls[[1, 5, 9]])


def test_a_path_without_cones_says_what_to_do(path):
    nowhere = replace(path.cones, cone_of=np.full(10, -1))
    for bare in (replace(path, cones=None), replace(path, cones=nowhere)):
        with pytest.raises(OrientationError, match=r"path\.orientation = 'cones'"):
            cones_mesh(bare)


def test_each_contact_of_the_nodes_is_an_apex_with_less_growth_and_no_less_room(made, cones):
    path, scene = made
    free = cones.free
    alone = np.diff(free.starts) == 1
    nodes = np.flatnonzero(alone & (np.bincount(free.net.node_of) > 1))[:40]
    near = at_contacts(free, nodes, path, scene)
    node = near.apex_nodes
    contacts = np.flatnonzero(np.isin(free.net.node_of, nodes))
    assert len(node) == len(contacts) > 2 * len(nodes)
    assert set(node.tolist()) == set(nodes.tolist())
    assert {tuple(place) for place in near.apexes.places} == {tuple(place) for place in path.centres[contacts]}
    assert near.apexes.growth.mean() < 0.8 * free.net.reach[node].mean()
    assert (near.apexes.room >= free.apexes.room[free.starts[node]]).all()
    away = np.linalg.norm(near.apexes.places - free.net.places[node], axis=1)
    assert (away <= free.net.reach[node] + 1e-9).all()


def test_nodes_with_several_apexes_keep_them(made, cones):
    path, scene = made
    several = np.flatnonzero(np.diff(cones.free.starts) > 1)
    near = at_contacts(cones.free, several, path, scene)
    kept = np.isin(cones.free.apex_nodes, several)
    np.testing.assert_array_equal(near.apexes.places, cones.free.apexes.places[kept])
    np.testing.assert_array_equal(near.apex_nodes, cones.free.apex_nodes[kept])


ENVELOPE_RANDOM = np.random.default_rng(3)
SIDES = 20
SWEEPS = {
    "flutes from the ball's centre": Sweep(0.0, 3.0, 1.0, 0.6, 0.4, 0.4),
    "flutes above it": Sweep(0.9, 3.0, 1.0, 0.3, 0.3, 0.2),
    "shank": Sweep(3.0, 24.0, 1.0, 0.69, 0.2, 0.5),
    "flat shank": Sweep(2.5, 39.0, 1.2, 0.9, 0.1, 0.2),
    "holder": Sweep(24.0, 74.0, 10.0, 0.02, 0.02, 0.05),
    "spindle that leans far": Sweep(20.0, 120.0, 40.0, 1.2, 0.8, 0.3),
    "one place": Sweep(2.0, 9.0, 1.5, 0.5, 0.3, 0.0),
}


def mesh_of(sweep: Sweep, sides: int) -> TriangleMesh:
    """Its mesh, which there is."""
    made = sweep.mesh(sides)
    assert made is not None
    return TriangleMesh(*made)


def points_of(sweep: Sweep, count: int = 24_000) -> np.ndarray:
    """Points of the cylinder, most on its outside, for axes all over the cone, a third of them at its rim, moved as far
    as the apex may be."""
    share = np.sqrt(ENVELOPE_RANDOM.random(count))
    share[::3] = 1.0
    turn = ENVELOPE_RANDOM.uniform(0, 2 * np.pi, count)
    flat = share * np.tan([[sweep.first], [sweep.second]]) * [np.cos(turn), np.sin(turn)]
    axes = unit(np.column_stack([*flat, np.ones(count)]))
    side = unit(np.cross(axes, ENVELOPE_RANDOM.normal(size=(count, 3))))
    height = ENVELOPE_RANDOM.uniform(sweep.start, sweep.end, count)
    radius = np.full(count, sweep.radius)
    height[::4], height[1::4] = sweep.start, sweep.end
    radius[::8] *= ENVELOPE_RANDOM.random(len(radius[::8]))
    moved = sweep.growth * unit(ENVELOPE_RANDOM.normal(size=(count, 3)))
    return height[:, None] * axes + radius[:, None] * side + moved


@pytest.mark.parametrize("name", SWEEPS)
def test_the_mesh_holds_what_is_swept_and_is_closed(name):
    sweep = SWEEPS[name]
    mesh = mesh_of(sweep, SIDES)
    points = points_of(sweep)
    assert is_closed(mesh)
    assert mesh.volume > 0
    assert MeshDistance(mesh).signed(points).max() < 1e-4
    assert sweep.holds(points, SIDES).all()


@pytest.mark.parametrize("name", SWEEPS)
def test_its_steps_hold_what_is_swept_together(name):
    sweep = SWEEPS[name]
    points = points_of(sweep)
    meshes = [mesh_of(step, SIDES) for step in sweep.steps()]
    assert all(is_closed(mesh) and mesh.volume > 0 for mesh in meshes)
    assert np.min([MeshDistance(mesh).signed(points) for mesh in meshes], axis=0).max() < 1e-4


def test_steps_leave_out_the_corner_that_growth_rounds():
    """In a narrow cone, outside and below the edge by 0.9 of the growth each: 1.27 of it away."""
    sweep = Sweep(3.0, 24.0, 1.0, 0.01, 0.01, 0.5)
    corner = np.array([[1.0 + 0.9 * 0.5, 0.0, 3.0 - 0.9 * 0.5]])
    assert sweep.holds(corner, 96).all()
    assert not any(step.holds(corner, 96).any() for step in sweep.steps())


@pytest.mark.parametrize("sides", [12, 24])
@pytest.mark.parametrize(
    "size",
    [
        (0.0, 0.2, 3.0, 0.3, 0.2, 0.05),
        (0.0, 0.6, 3.0, 0.3, 0.2, 0.05),
        (0.0, 0.5, 2.0, 0.9, 0.1, 0.05),
        (0.0, 0.05, 2.0, 0.6, 0.4, 0.0),
        (30.0, 31.0, 20.0, 1.2, 0.2, 0.1),
        (10.0, 10.5, 50.0, 0.5, 0.5, 0.02),
        (0.0, 30.53, 46.76, 0.1016, 0.053, 0.0),
    ],
)
def test_wide_and_short_sections_are_held_too(size, sides):
    """Flutes that hardly reach over the ball's centre, and a low step of a holder: the corners of their polygon are
    farther from the apex than any of their points."""
    sweep = Sweep(*size)
    mesh = mesh_of(sweep, sides)
    assert is_closed(mesh)
    assert MeshDistance(mesh).signed(points_of(sweep, 6_000)).max() < 1e-4


@pytest.mark.parametrize("name", SWEEPS)
def test_the_fine_mesh_is_hardly_larger_than_its_bounds(name):
    """By volume, of random points in its box."""
    sweep, count = SWEEPS[name], 20_000
    mesh = mesh_of(sweep, 96)
    low, high = mesh.bounds
    inside = sweep.holds(ENVELOPE_RANDOM.uniform(low, high, (count, 3)), 96)
    assert 0.95 < mesh.volume / (inside.mean() * np.prod(high - low)) < 1.1


def test_points_that_no_axis_reaches_are_not_held():
    """Below the flutes, above the spindle, and beside the cone."""
    sweep = replace(SWEEPS["shank"], growth=0.0)
    outside = [[0, 0, 2.9], [0, 0, 24.1], [2.0, 1.0 / np.cos(0.2) + 10 * np.tan(0.2) + 0.5, 10.0], [0, 0, -5.0]]
    inside = [[0, 0, 3.1], [0, 0, 23.9], [10 * np.tan(0.69), 0.0, 10.0], [0, 10 * np.tan(0.2), 10.0]]
    assert not sweep.holds(np.array(outside), SIDES).any()
    assert sweep.holds(np.array(inside), SIDES).all()


def test_where_the_apex_may_lie_above_the_begin_a_mesh_holds_the_sweep_or_there_is_none():
    """The sides of a wide cone meet below: before they come to where the section ends there, no mesh is told."""
    random, none = np.random.default_rng(1), 0
    for _ in range(60):
        radius, first = random.choice([0.25, 0.5, 1.0, 2.0, 3.0]), random.uniform(0.6, 1.39)
        end, second = radius * random.uniform(0.3, 6.0), first * random.uniform(0.1, 1.0)
        sweep = Sweep(0.0, end, radius, first, second, 10 ** random.uniform(-1.5, -0.1))
        made = sweep.mesh(12)
        none += made is None
        if made is not None:
            assert MeshDistance(TriangleMesh(*made)).signed(points_of(sweep, 2_000)).max() < 1e-4
    assert 10 < none < 40


def test_wide_flat_cones_are_held():
    """Directions on their rims are far from each other: between those of a few, no less is seen of a point."""
    random, made = np.random.default_rng(21), 0
    for _ in range(60):
        first, second = random.uniform(0.6, 1.3), 10 ** random.uniform(-2.7, -0.7)
        start, radius = random.uniform(0.3, 6.0), random.choice([0.25, 0.5, 1.0, 2.0, 3.0])
        end = start + radius * random.uniform(0.3, 20.0)
        sweep = Sweep(start, end, radius, first, second, 10 ** random.uniform(-1.5, -0.1))
        points = points_of(sweep, 3_000)
        assert sweep.holds(points, SIDES).all()
        mesh = sweep.mesh(SIDES)
        made += mesh is not None
        assert mesh is None or MeshDistance(TriangleMesh(*mesh)).signed(points).max() < 1e-4
    assert made > 55


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


def test_what_planes_tell_apart_does_not_touch_and_most_is():
    told = clear = 0
    for size, place, turn, solid in cases():
        apart = Obstacle.of(solid).clear(size[None], place[None], turn[None])[0]
        free = not fine_crosses(size, place, turn, solid) and not holds(size, place, turn, solid)
        assert free or not apart
        told += apart
        clear += free
    assert 0.9 * clear < told <= clear < CASES


def test_planes_tell_no_point_from_what_holds_it():
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


def test_facets_that_are_left_cross_where_the_whole_mesh_does():
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


def test_left_facets_keep_their_places():
    vertices, faces = Sweep(2.0, 12.0, 1.0, 0.5, 0.3, 0.2).mesh(COARSE_SIDES)
    plane = np.array([[1.0, 0.0, 0.0]])
    kept, names = facets_below(vertices, faces, np.zeros(3), np.eye(3), plane, np.array([0.0]))
    corners = vertices[faces]
    assert kept[names] == pytest.approx(corners[(corners[:, :, 0] <= 0).any(axis=1)])
    assert 0 < len(names) < len(faces)


def test_the_catalogue_answers_as_fine_meshes_do():
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


def test_a_sweep_that_no_mesh_holds_is_taken_to_cross():
    size, origin, upright = (np.array([[0.0, 1.495, 0.5, 0.816, 0.087, 0.254]]), np.zeros((1, 3)), np.eye(3)[None])
    assert Sweep(*size[0].tolist()).mesh(COARSE_SIDES) is None
    *_, solid = cases()[0]
    far = Obstacle.of(TriangleMesh(solid.vertices + 100.0, solid.faces))
    assert crossing(size, origin, upright, far).all()
    size[0, 3] = 0.1
    assert not crossing(size, origin, upright, far).any()


SOME = 30
"""Every so many cones are asked."""


@pytest.fixture(scope="module")
def some(cones):
    return only(cones, np.arange(len(cones.shapes)) % SOME == 0)


def only(cones: AxisCones, kept: np.ndarray) -> AxisCones:
    """The cones of some nodes alone."""
    return replace(cones, shapes=cones.shapes.scaled(np.where(kept, 1.0, -1.0)))


def ball(radius: float, centre: np.ndarray) -> TriangleMesh:
    angle = np.linspace(0, np.pi, 10)[1:-1]
    mesh = revolve(radius * np.sin(angle), -radius * np.cos(angle), (-radius, radius), 16)
    return TriangleMesh(mesh.vertices + centre, mesh.faces)


def test_cones_that_are_proven_pass(made, some):
    _, scene = made
    verdict = verify_cones(some, scene)
    assert len(verdict.asked) == some.shapes.found.sum() > 15
    assert len(verdict.refused) <= 0.02 * len(verdict.asked)


def test_wider_cones_are_refused_and_narrowed_to_what_passes(made, some):
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


def test_an_obstacle_wholly_inside_and_one_round_the_tool_are_seen(made, some):
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
