"""What certified cones promise: no axis inside collides, however it is chosen."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bonecam.arrays import unit
from bonecam.errors import OrientationError
from bonecam.job import PathJob
from bonecam.kernels.closest.cone_marching import Apexes, Groups, free_directions
from bonecam.machine.limits import MachineLimits, polar_angles
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones.admissible_cones import AxisCones, admissible_cones
from bonecam.planning.axes.cones.verify_cones import verify_cones
from bonecam.planning.collision.scene import Scene
from bonecam.tool.path import ContactPath
from bonecam.workholding.clamping import Clamping
from bonecam.workholding.column import Column

LIMITS = MachineLimits(np.radians(115.0))
JOB = PathJob(pattern="along")
RANDOM = np.random.default_rng(5)

Made = tuple[ContactPath, Scene]


def axes_in(cones: AxisCones, contacts: np.ndarray, scale: float = 1.0, rim: bool = False) -> np.ndarray:
    """Random axes in the cones of contacts, widened by a factor; on the `rim`: as far out as they go."""
    node = cones.free.net.node_of[contacts]
    axis = cones.axes[node]
    share = np.ones(len(node)) if rim else np.sqrt(RANDOM.random(len(node)))
    off = scale * share * cones.angles[node]
    side = unit(np.cross(axis, RANDOM.normal(size=axis.shape)))
    return np.cos(off)[:, None] * axis + np.sin(off)[:, None] * side


def test_no_axis_inside_a_cone_collides(
    made: Made, cones: AxisCones, deepest_entry: Callable[..., np.ndarray]
) -> None:
    path, scene = made
    contacts = RANDOM.choice(np.flatnonzero(cones.found), 500)
    for rim in (False, True):
        axes = axes_in(cones, contacts, rim=rim)
        axes, chosen = axes[kept := polar_angles(axes) <= cones.largest_polar[contacts]], contacts[kept]
        assert deepest_entry(scene, path.cutter, path.centres[chosen], axes).max() < 0.011


def test_widened_cones_are_caught(
    made: Made, cones: AxisCones, deepest_entry: Callable[..., np.ndarray]
) -> None:
    """The audit sees collisions of cones that are wider than those certified."""
    path, scene = made
    contacts = RANDOM.choice(np.flatnonzero(cones.found), 400)
    shares = []
    for scale in (1.1, 1.3, 1.8):
        axes = axes_in(cones, contacts, scale, rim=True)
        entered = deepest_entry(scene, path.cutter, path.centres[contacts], axes) > 0.011
        shares.append(entered.mean())
    assert shares[0] < shares[1] < shares[2]
    assert shares[1] > 0.05


def test_inside_the_part_every_axis_collides_and_no_contact_has_a_cone(
    made: Made, deepest_entry: Callable[..., np.ndarray]
) -> None:
    """Apexes 0.3 mm below the surface."""
    path, scene = made
    some = path.take(np.arange(0, len(path.centres), 40))
    inside = replace(some, centres=some.centres - (path.cutter.radius + 0.3) * some.normals)
    tilted = unit(inside.normals + 0.7 * unit(RANDOM.normal(size=inside.normals.shape)))
    assert deepest_entry(scene, path.cutter, inside.centres, tilted).min() > 0.1
    none = admissible_cones(inside, scene, LIMITS, JOB)
    assert not none.found.any()
    assert len(none.blocked()) == len(inside.centres)


def test_corners_of_cones_cut_by_a_limit_meet_it(cones: AxisCones) -> None:
    """The two directions at a cone's rim that are on the limit: to a thousandth of a degree."""
    limit, hair = np.radians(80.0), np.radians(0.001)
    count = len(cones.path.centres)
    cut = replace(cones, largest_polar=np.full(count, limit), max_tilt=np.pi)
    axes, angles = (part[cut.free.net.node_of] for part in (cut.axes, cut.angles))
    polar = polar_angles(axes)
    meet = cut.found & (np.abs(limit - polar) < 0.9 * angles) & (polar > angles)
    assert meet.sum() > 20
    for within in (-1.0, 1.0):
        rim, height = angles - hair, np.cos(limit + within * hair)
        down = unit(np.cross(np.cross(axes, [0.0, 0.0, 1.0]), axes))
        down *= -np.sign(down[:, 2:])
        share = (np.cos(rim) * np.cos(polar) - height) / (np.sin(rim) * np.sin(polar))
        for side in (-1.0, 1.0):
            across = side * np.cross(axes, down) * np.sqrt(np.maximum(1 - share**2, 0))[:, None]
            corner = np.cos(rim)[:, None] * axes + np.sin(rim)[:, None] * (share[:, None] * down + across)
            assert (cut.contain(unit(corner))[meet] == (within < 0)).all()


def test_nearly_all_contacts_of_a_lump_have_a_cone(cones: AxisCones) -> None:
    assert cones.found.mean() > 0.97
    assert np.degrees(np.median(cones.angles)) > 20


def test_directions_of_a_group_are_free_where_each_is(cones: AxisCones) -> None:
    """What the cone of a group proves free is so direction by direction too, all but a few grazing ones."""
    free = cones.free
    some = np.arange(0, len(free.free), 20)
    apexes = Apexes(*(part[some] for part in free.apexes))
    count = len(free.directions)
    alone = Groups(free.directions, np.zeros(count), np.arange(count + 1), np.arange(count))
    singly = free_directions(free.obstacles, apexes, free.directions, alone, free.allowed[some])
    assert not (singly & ~free.free[some]).any()
    assert (free.free[some] & ~singly).sum() < 1e-3 * singly.sum()


def test_the_chosen_cones_hold_the_wanted_axes_deep_or_are_wide(cones: AxisCones) -> None:
    """About the axes of the cones themselves no narrower cones are found; and those about the normals lie less deep
    in the widest cones."""
    node = cones.free.net.node_of
    again = cones.about(cones.axes[node])
    assert (again.angles[again.angles > 0] > (cones.angles - np.radians(2))[again.angles > 0]).mean() > 0.98
    near = cones.about(cones.path.normals)
    both = near.found & cones.found
    assert near.depths(cones.path.normals)[both].mean() > cones.depths(cones.path.normals)[both].mean()


def test_axes_in_a_cone_are_contained_and_others_are_not(cones: AxisCones) -> None:
    contacts = np.arange(len(cones.path.centres))
    inside, outside = (axes_in(cones, contacts, scale, rim=True) for scale in (0.999, 1.001))
    tilted = np.einsum("ij,ij->i", inside, cones.path.normals) < np.cos(cones.max_tilt)
    expected = cones.found & ~tilted & (polar_angles(inside) <= cones.largest_polar)
    np.testing.assert_array_equal(cones.contain(inside), expected)
    assert not cones.contain(outside).any()


def test_a_cone_as_a_surface_holds_the_axes_of_its_contact(cones: AxisCones) -> None:
    contact = int(np.flatnonzero(cones.found)[7])
    inside, outside = (axes_in(cones, np.full(50, contact), scale, rim=True) for scale in (0.99, 1.01))
    surface = cones.cone(contact)
    assert surface.contains(inside).all()
    assert not surface.contains(outside).any()


def test_contacts_without_a_cone_are_listed_with_what_blocks_them(made: Made) -> None:
    path, scene = made
    none = admissible_cones(path, scene, MachineLimits(np.radians(2.5)), JOB)
    assert set(none.blocked().values()) == {"limits"}
    assert len(none.blocked()) == len(path.centres)
    with pytest.raises(ValueError, match="no cone"):
        none.cone(0)
    high = replace(scene, clamping=Clamping((Column(14.0, 25.0),), clearance=4.0))
    low = admissible_cones(path, high, LIMITS, JOB)
    blocked = low.blocked()
    assert set(blocked) == set(np.flatnonzero(~low.found).tolist())
    assert all(why.endswith("against the clamping") for why in blocked.values())
    assert 0 < len(blocked) < 0.4 * len(path.centres)
    assert path.centres[list(blocked), 2].max() < np.median(path.centres[:, 2])


def test_an_obstacle_that_is_not_closed_is_refused(made: Made, cones: AxisCones) -> None:
    path, scene = made
    opened = TriangleMesh(scene.material.vertices, scene.material.faces[1:])
    with pytest.raises(OrientationError, match="not closed: 3 edges"):
        admissible_cones(path, replace(scene, material=opened), LIMITS, JOB)
    with pytest.raises(OrientationError, match="not closed: 3 edges"):
        verify_cones(cones, replace(scene, material=opened))


def test_no_contacts_are_refused(made: Made) -> None:
    path, scene = made
    with pytest.raises(OrientationError, match="no contacts"):
        admissible_cones(path.take(np.arange(0)), scene, LIMITS, JOB)


def test_what_is_kept_of_cones_tells_each_contact_its_own(cones: AxisCones) -> None:
    path = cones.path
    kept = cones.of(path)
    assert np.array_equal(kept.cone_of >= 0, cones.found)
    for contact in RANDOM.choice(np.flatnonzero(cones.found), 20):
        cone = cones.cone(int(contact))
        assert np.allclose(cone.axis, kept.axes[kept.cone_of[contact]])
        angle = np.arctan2(np.linalg.norm(cone.first), np.linalg.norm(cone.axis))
        assert angle == pytest.approx(kept.angles[kept.cone_of[contact]])
    some = np.arange(0, len(path.contacts), 3)
    fewer = path.take(some)
    assert np.array_equal(cones.of(fewer).cone_of, kept.cone_of[some])
    moved = replace(path, centres=path.centres + 1e-3)
    assert (cones.of(moved).cone_of == -1).all()


def test_what_blocks_several_nodes_is_what_blocks_each(cones: AxisCones) -> None:
    nodes = np.arange(0, len(cones.angles), len(cones.angles) // 7)
    together = cones.free.blocking(nodes)
    assert together == [why for node in nodes for why in cones.free.blocking(np.array([node]))]
    assert cones.free.blocking(nodes[:0]) == []
