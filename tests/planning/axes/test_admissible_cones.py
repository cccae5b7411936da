"""What certified cones promise: no axis inside collides, however it is chosen."""

from dataclasses import replace

import numpy as np
import pytest
from deepest_entry import deepest_entry
from scipy.spatial import cKDTree

from bonecam.arrays import unit
from bonecam.errors import OrientationError
from bonecam.job import PathJob
from bonecam.kernels.cones import Apexes, direction_maps
from bonecam.machine import MachineLimits
from bonecam.machine.limits import ReachedAxes, polar_angles
from bonecam.mesh import TriangleMesh
from bonecam.planning import AxisCones, admissible_cones, verify_cones
from bonecam.planning.axes.free_axes import leaf_centres, sphere_leaves
from bonecam.workholding import Clamping
from bonecam.workholding.post import Column

pytestmark = pytest.mark.whole


LIMITS = MachineLimits(np.radians(115.0))
JOB = PathJob(pattern="along")
RANDOM = np.random.default_rng(5)


def axes_in(cones: AxisCones, contacts: np.ndarray, scale: float = 1.0, rim: bool = False) -> np.ndarray:
    """Random axes in the cones of contacts, widened by a factor; on the `rim`: as far out as they go."""
    shapes = cones.shapes.take(cones.free.net.node_of[contacts])
    share = np.ones(len(shapes)) if rim else np.sqrt(RANDOM.random(len(shapes)))
    return shapes.scaled(scale * share).rims(RANDOM.uniform(0, 2 * np.pi, len(shapes)))


def test_no_axis_inside_a_cone_collides(made, cones):
    path, scene = made
    contacts = RANDOM.choice(np.flatnonzero(cones.found), 500)
    for rim in (False, True):
        axes = axes_in(cones, contacts, rim=rim)
        axes, chosen = axes[kept := polar_angles(axes) <= cones.largest_polar[contacts]], contacts[kept]
        assert deepest_entry(scene, path.cutter, path.centres[chosen], axes).max() < 0.011


def test_widened_cones_are_caught(made, cones):
    """The audit sees collisions of cones that are wider than those certified."""
    path, scene = made
    contacts = RANDOM.choice(np.flatnonzero(cones.found), 400)
    shapes = cones.shapes.take(cones.free.net.node_of[contacts])
    turns = RANDOM.uniform(0, 2 * np.pi, len(shapes))
    shares = []
    for scale in (1.1, 1.3, 1.8):
        axes = shapes.scaled(scale).rims(turns)
        entered = deepest_entry(scene, path.cutter, path.centres[contacts], axes) > 0.011
        shares.append(entered.mean())
    assert shares[0] < shares[1] < shares[2]
    assert shares[1] > 0.05


def blocked_by(cones: AxisCones) -> dict[int, str]:
    """The contacts without any cone, and what is against it."""
    nodes = np.flatnonzero(~cones.shapes.found)
    why = dict(zip(nodes.tolist(), cones.free.blocking(nodes)))
    return {int(i): why[int(cones.free.net.node_of[i])] for i in np.flatnonzero(~cones.found)}


def test_inside_the_part_every_axis_collides_and_no_contact_has_a_cone(made):
    """Apexes 0.3 mm below the surface."""
    path, scene = made
    some = path.take(np.arange(0, len(path.centres), 40))
    inside = replace(some, centres=some.centres - (path.cutter.radius + 0.3) * some.normals)
    tilted = unit(inside.normals + 0.7 * unit(RANDOM.normal(size=inside.normals.shape)))
    assert deepest_entry(scene, path.cutter, inside.centres, tilted).min() > 0.1
    none = admissible_cones(inside, scene, LIMITS, JOB)
    assert not none.found.any()
    assert len(blocked_by(none)) == len(inside.centres)


def test_corners_of_cones_cut_by_a_limit_meet_it(cones):
    """The two directions at a cone's rim that are on the limit: to a thousandth of a degree."""
    limit, hair = np.radians(80.0), np.radians(0.001)
    count = len(cones.path.centres)
    cut = replace(cones, largest_polar=np.full(count, limit), max_tilt=np.pi)
    shapes = cut.shapes.take(cut.free.net.node_of)
    turns = np.linspace(0, 2 * np.pi, 60)
    rims = np.stack([shapes.rims(np.full(count, turn)) for turn in turns])
    beyond = polar_angles(rims.reshape(-1, 3)).reshape(rims.shape[:2]) > limit
    met = 0
    for k, contact in np.argwhere(cut.found & (beyond[1:] != beyond[:-1]))[:200]:
        ends = turns[k : k + 2][np.argsort(beyond[k : k + 2, contact])]
        one = cut.shapes.take(cut.free.net.node_of[[contact]])
        for _ in range(40):
            middle = ends.mean()
            ends[int(polar_angles(one.rims(np.array([middle])))[0] > limit)] = middle
        corner = one.scaled(1 - 1e-9).rims(ends[:1])[0]
        flat = unit(corner[None, :2])[0]
        for within in (-1.0, 1.0):
            angle = limit + within * hair
            tried = np.tile([*np.sin(angle) * flat, np.cos(angle)], (count, 1))
            inside = cut.shapes.take(cut.free.net.node_of).scaled(1.001).off(tried)[contact]
            assert inside < 1.002 * one.mean_angles[0]
            if within > 0:
                assert not cut.contain(tried)[contact]
        met += 1
    assert met > 20


def test_nearly_all_contacts_of_a_lump_have_a_cone(cones):
    assert cones.found.mean() > 0.97
    assert np.degrees(np.median(cones.shapes.mean_angles)) > 20


def test_a_map_proves_no_leaf_of_which_an_axis_collides(made, cones):
    """Whether it was proven by itself or in a larger triangle."""
    path, scene = made
    free, leaves = cones.free, sphere_leaves()[1]
    node, leaf = RANDOM.choice(np.argwhere(free.proven), 500).T
    at_corner = leaves.vertices[leaves.leaves[leaf, RANDOM.integers(3, size=len(leaf))]]
    contact = np.array([RANDOM.choice(np.flatnonzero(free.net.node_of == k)) for k in node])
    above = polar_angles(at_corner) <= cones.largest_polar[contact]
    entered = deepest_entry(scene, path.cutter, path.centres[contact[above]], at_corner[above])
    assert above.mean() > 0.5
    assert entered.max() < 0.011


def test_each_cone_holds_proven_leaves_alone(cones):
    """Directions all over each cone, at the rim too, against the map; cones a fifth wider are not so."""
    free, found = cones.free, np.flatnonzero(cones.shapes.found)
    for scale, most in ((1.0, 0.0), (1.2, 1.0)):
        outside = 0
        for share in np.linspace(0.1, 1.0, 6):
            for turn in np.linspace(0, 2 * np.pi, 24):
                shapes = cones.shapes.scaled(scale * share * (1 - 1e-9))
                axes = shapes.take(found).rims(np.full(len(found), turn))
                outside += int((~free.proven[found, leaves_of(axes)]).sum())
        assert outside == 0 if most == 0 else outside > 1000


def leaves_of(axes: np.ndarray) -> np.ndarray:
    """The leaf in which each direction lies: of the nearest ones that whose edges have it inside."""
    leaves = sphere_leaves()[1]
    near = cKDTree(leaf_centres()).query(axes, k=8)[1]
    corners = leaves.vertices[leaves.leaves[near]]
    sides = np.cross(corners, np.roll(corners, -1, axis=2))
    inside = np.einsum("nmij,nj->nmi", sides, axes).min(axis=2)
    return np.asarray(near[np.arange(len(near)), inside.argmax(axis=1)])


def test_a_leaf_of_several_apexes_is_proven_where_it_is_for_each(cones):
    free = cones.free
    some = np.arange(0, len(free.starts) - 1, 30)[:20]
    apexes = Apexes(*(part[free.starts[some]] for part in free.apexes))
    asked, each = free.allowed[some], np.arange(len(some) + 1)
    alone = direction_maps(free.obstacles, apexes, each, asked, sphere_leaves()[0])
    together = direction_maps(free.obstacles, apexes, 2 * np.arange(11), asked[::2], sphere_leaves()[0])
    assert together.sum() > 0
    assert not (together & ~alone[::2]).any()


def test_cones_are_larger_than_circles_and_hold_the_wanted_axes(cones):
    """Elliptic ones hold more of the free directions; both hold axes that are free themselves."""
    round_ = cones.as_circles().about(cones.shapes.axes[cones.free.net.node_of])
    again = cones.about(cones.shapes.axes[cones.free.net.node_of])
    assert np.allclose(round_.shapes.angles[:, 0], round_.shapes.angles[:, 1], atol=np.radians(10))
    assert again.shares.mean() > 1.1 * round_.shares.mean()
    near = cones.about(cones.path.normals)
    both = near.found & cones.found
    assert near.depths(cones.path.normals)[both].mean() > cones.depths(cones.path.normals)[both].mean()


def test_axes_in_a_cone_are_contained_and_others_are_not(cones):
    contacts = np.arange(len(cones.path.centres))
    inside, outside = (axes_in(cones, contacts, scale, rim=True) for scale in (0.999, 1.001))
    tilted = np.einsum("ij,ij->i", inside, cones.path.normals) < np.cos(cones.max_tilt)
    expected = cones.found & ~tilted & (polar_angles(inside) <= cones.largest_polar)
    np.testing.assert_array_equal(cones.contain(inside), expected)
    assert not cones.contain(outside).any()


def test_a_cone_as_a_surface_holds_the_axes_of_its_contact(cones):
    contact = int(np.flatnonzero(cones.found)[7])
    inside, outside = (axes_in(cones, np.full(50, contact), scale, rim=True) for scale in (0.99, 1.01))
    surface = cones.cone(contact)
    assert surface.contains(inside).all()
    assert not surface.contains(outside).any()


def test_contacts_without_a_cone_are_listed_with_what_blocks_them(made):
    path, scene = made
    none = admissible_cones(path, scene, MachineLimits(np.radians(1.0)), JOB)
    assert set(blocked_by(none).values()) == {"limits"}
    assert len(blocked_by(none)) == len(path.centres)
    with pytest.raises(ValueError, match="no cone"):
        none.cone(0)
    high = replace(scene, clamping=Clamping((Column(14.0, 25.0),), clearance=4.0))
    low = admissible_cones(path, high, LIMITS, JOB)
    blocked = blocked_by(low)
    assert set(blocked) == set(np.flatnonzero(~low.found).tolist())
    assert all(why.endswith("against the clamping") for why in blocked.values())
    assert 0 < len(blocked) < 0.4 * len(path.centres)
    assert path.centres[list(blocked), 2].max() < np.median(path.centres[:, 2])


def test_cones_keep_off_a_column_beside_the_part(made, cones):
    """The column of a bracket takes directions towards itself; cones made without it enter it."""
    path, scene = made
    column = Column(6.0, 90.0, 0.0, 30.0, 10.0)
    beside = replace(scene, clamping=replace(scene.clamping, beside=(column,)))
    found = admissible_cones(path, beside, LIMITS, JOB)
    contacts = RANDOM.choice(np.flatnonzero(found.found & cones.found), 400)
    entered = []
    for which in (found, cones):
        axes = axes_in(which, contacts, rim=True)
        kept = polar_angles(axes) <= which.largest_polar[contacts]
        entered.append(deepest_entry(beside, path.cutter, path.centres[contacts[kept]], axes[kept]).max())
    assert entered[0] < 0.011
    assert entered[1] > 0.5


def test_contacts_that_a_curve_of_axes_does_not_reach_are_told_as_beyond_the_limits(made):
    """A machine that leans the tool in the plane of X and Z alone, and contacts whose normals are far from it."""
    path, scene = made
    plane = ReachedAxes(
        contains=lambda axes: np.abs(axes[:, 1]) < 1e-9,
        nearest=lambda axes: unit(axes * [1.0, 0.0, 1.0] + [0.0, 0.0, 1e-12]),
        samples=np.array([[0.0, 0.0, 1.0]]),
    )
    cones = admissible_cones(path, scene, replace(LIMITS, reached=plane), replace(JOB, max_tilt_deg=30.0))
    blocked = blocked_by(cones)
    off = np.abs(np.arcsin(np.clip(path.normals[:, 1], -1, 1)))
    far = np.flatnonzero(off > np.radians(50.0))
    assert len(far)
    assert {blocked[int(i)] for i in far} == {"limits"}
    near = cones.found & (off < np.radians(10.0))
    assert near.any()
    assert (np.abs(cones.free.directions[cones.free.free.any(axis=0)][:, 1]) < np.sin(np.radians(4.01))).all()


def test_an_obstacle_that_is_not_closed_is_refused(made, cones):
    path, scene = made
    opened = TriangleMesh(scene.material.vertices, scene.material.faces[1:])
    with pytest.raises(OrientationError, match="not closed: 3 edges"):
        admissible_cones(path, replace(scene, material=opened), LIMITS, JOB)
    with pytest.raises(OrientationError, match="not closed: 3 edges"):
        verify_cones(cones, replace(scene, material=opened))


def test_no_contacts_are_refused(made):
    path, scene = made
    with pytest.raises(OrientationError, match="no contacts"):
        admissible_cones(path.take(np.arange(0)), scene, LIMITS, JOB)


def test_what_is_kept_of_cones_tells_each_contact_its_own(cones):
    path = cones.path
    kept = cones.of(path)
    assert np.array_equal(kept.cone_of >= 0, cones.found)
    for contact in RANDOM.choice(np.flatnonzero(cones.found), 20):
        cone = cones.cone(int(contact))
        shapes, which = kept.shapes, kept.cone_of[contact]
        assert np.allclose(cone.axis, shapes.axes[which])
        assert np.arctan([np.linalg.norm(cone.first), np.linalg.norm(cone.second)]) == pytest.approx(
            shapes.angles[which]
        )
    some = np.arange(0, len(path.contacts), 3)
    fewer = path.take(some)
    assert np.array_equal(cones.of(fewer).cone_of, kept.cone_of[some])
    moved = replace(path, centres=path.centres + 1e-3)
    assert (cones.of(moved).cone_of == -1).all()


def test_what_blocks_several_nodes_is_what_blocks_each(cones):
    nodes = np.arange(0, len(cones.shapes), len(cones.shapes) // 7)
    together = cones.free.blocking(nodes)
    assert together == [why for node in nodes for why in cones.free.blocking(np.array([node]))]
    assert cones.free.blocking(nodes[:0]) == []
