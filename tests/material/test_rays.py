"""Solids of any form on rays: their volume, hollows, overlaps, and that a mesh with a hole is found.

Material on rays against volumes, distances and scallops that are known.
"""

import numpy as np
import pytest
from small_parts import FINISHING_CUTTER

from bonecam.errors import JobError
from bonecam.kernels.bodies import frustum_clearance
from bonecam.kernels.rays import air_distances, cut_capsule, in_material
from bonecam.kernels.removal import Pieces
from bonecam.material.dexels import copy_of, with_more_room
from bonecam.material.rays import lay_grid, lay_rays, lay_solids, order
from bonecam.mesh import TriangleMesh
from bonecam.mesh.solids import cylinder, solid_difference
from bonecam.mesh.triangle_mesh import keep_faces
from bonecam.setup import Box, Capsule, ConvexStock, Cylinder
from bonecam.verify.sweeping import NormalProbes, SimulatedStock, Sweeping, volumes

RING = solid_difference(cylinder(5.0, 0.0, 4.0, 1e-3), cylinder(3.0, -1.0, 5.0, 1e-3))


def test_a_ring_keeps_its_hole():
    sets, grid = lay_solids([RING], 0.1, 500.0)
    assert volumes(sets) == pytest.approx([RING.volume] * 3, rel=2e-3)
    assert max(int(rays.counts.max()) for rays in sets) == 2
    assert grid.cell == 0.1


def test_solids_that_overlap_count_once_and_convex_ones_are_as_bodies():
    low, high = cylinder(2.0, 0.0, 6.0, 1e-4), cylinder(2.0, 3.0, 9.0, 1e-4)
    sets, grid = lay_solids([low, high], 0.1, 500.0)
    body = Cylinder(2.0, 0.0, 9.0)
    expected = lay_rays([body], lay_grid([body], 0.1), 500.0)
    assert volumes(sets) == pytest.approx(volumes(expected), rel=1e-3)
    assert max(int(rays.counts.max()) for rays in sets) == 1
    assert np.abs(grid.rotation @ grid.rotation.T - np.eye(3)).max() < 1e-12


def test_less_memory_takes_a_coarser_cell():
    assert lay_solids([RING], 0.1, 1.0)[1].cell > 0.1


def test_a_mesh_with_a_hole_is_refused():
    with pytest.raises(JobError, match="not closed"):
        lay_solids([keep_faces(RING, slice(40, None))], 0.1, 500.0)


BLOCK = Box(np.array([-5.0, -4.0, 10.0]), np.array([5.0, 4.0, 18.0]))


def in_set(grid, direction, points):
    return np.ascontiguousarray(grid.of_points(np.atleast_2d(points))[:, order(direction)])


def cut(sets, grid, start, end, radius):
    """Cut a capsule out of all sets; the volume each of them tells."""
    told = []
    for direction, rays in enumerate(sets):
        total, full = cut_capsule(
            rays, in_set(grid, direction, start)[0], in_set(grid, direction, end)[0], radius, False
        )
        while full:
            rays = sets[direction] = with_more_room(rays)
            more, full = cut_capsule(
                rays, in_set(grid, direction, start)[0], in_set(grid, direction, end)[0], radius, False
            )
            total += more
        told.append(total)
    return told


@pytest.mark.parametrize(
    ("body", "volume"),
    [
        (BLOCK, 640.0),
        (Cylinder(4.0, 0.0, 7.0), np.pi * 16 * 7),
        (Capsule(np.array([0.0, 0.0, 5.0]), np.array([0.0, 0.0, 12.0]), 3.0), np.pi * 9 * 7 + 36 * np.pi),
    ],
    ids=str,
)
def test_every_set_holds_the_volume_of_the_body(body, volume):
    grid = lay_grid([body], 0.1)
    assert volumes(lay_rays([body], grid, 500.0)) == pytest.approx([volume] * 3, rel=5e-4)


def test_a_convex_mesh_lies_on_every_ray_where_its_body_does():
    block = ConvexStock(BLOCK.mesh(0.01))
    grid = lay_grid([BLOCK], 0.1)
    for made, exact in zip(lay_rays([block], grid, 500.0), lay_rays([BLOCK], grid, 500.0), strict=True):
        same = made.counts == exact.counts
        assert (~same).sum() <= 4  # rays through an edge
        assert np.abs(made.spans - exact.spans)[same].max() < 1e-4


def test_bodies_that_overlap_are_one():
    both = [Cylinder(4.0, 0.0, 7.0), Cylinder(1.0, -5.0, 3.0)]
    sets = lay_rays(both, lay_grid(both, 0.1), 500.0)
    assert volumes(sets) == pytest.approx([np.pi * 16 * 7 + np.pi * 5] * 3, rel=1e-3)


def capsule_errors(cell):
    """Errors of the volume of a ball's way through the block, at places that differ by a share of a cell."""
    start = np.array([-2.0, -1.0, 13.0])
    end = np.array([1.5, 0.7, 14.4])
    volume = np.pi * 1.5**2 * np.linalg.norm(end - start) + 4 / 3 * np.pi * 1.5**3
    grid = lay_grid([BLOCK], cell)
    sets = lay_rays([BLOCK], grid, 500.0)
    errors = []
    for shift in np.linspace(0, 1, 4):
        off = shift * np.array([0.11, 0.07, 0.05])
        errors += cut([copy_of(rays) for rays in sets], grid, start + off, end + off, 1.5)
    return np.array(errors) - volume, volume


def test_a_ball_through_a_block_removes_its_capsule():
    errors, volume = capsule_errors(0.1)
    assert np.abs(errors).max() < 2e-3 * volume


def test_flutes_end_flat():
    grid = lay_grid([BLOCK], 0.1)
    start, end = np.array([-2.0, -1.0, 13.0]), np.array([1.5, 0.7, 14.4])
    volume = np.pi * 1.5**2 * np.linalg.norm(end - start) + 2 / 3 * np.pi * 1.5**3
    for direction, rays in enumerate(lay_rays([BLOCK], grid, 500.0)):
        places = [in_set(grid, direction, point)[0] for point in (start, end)]
        assert cut_capsule(rays, *places, 1.5, True)[0] == pytest.approx(volume, rel=3e-3)


def test_half_the_cell_at_most_halves_the_error():
    coarse, fine = (np.sqrt((capsule_errors(cell)[0] ** 2).mean()) for cell in (0.2, 0.1))
    assert fine < coarse / 2


def test_the_order_of_cuts_does_not_change_the_body():
    random = np.random.default_rng(3)
    starts = random.uniform([-5, -4, 10], [5, 4, 18], (40, 3))
    ends = starts + random.uniform(-1, 1, (40, 3))
    grid = lay_grid([BLOCK], 0.2)
    laid = lay_rays([BLOCK], grid, 500.0)
    bodies = []
    for way in (range(40), random.permutation(40)):
        sets = [copy_of(rays) for rays in laid]
        removed = sum(cut(sets, grid, starts[i], ends[i], 0.8)[0] for i in way)
        bodies.append(volumes(sets))
        assert bodies[-1][0] + removed == pytest.approx(volumes(laid)[0], rel=1e-5)
    assert bodies[0] == pytest.approx(bodies[1], rel=1e-6)


def test_the_distance_to_air_is_that_of_the_nearest_face():
    grid = lay_grid([BLOCK], 0.1)
    sets = lay_rays([BLOCK], grid, 500.0)
    points = np.array([[0.0, 0.0, 17.3], [4.6, 1.0, 14.0], [0.0, 0.0, 14.0], [0.0, 0.0, 19.0]])
    found = np.empty(4)
    air_distances(*sets, grid.of_points(points), found)
    assert found[:3] == pytest.approx([0.7, 0.4, 4.0], abs=0.02)
    assert found[3] <= np.sqrt(0.5) * grid.cell  # in air: to the nearest ray


@pytest.mark.parametrize("depth", [0.1, 0.5])
def test_the_depth_below_a_curved_face_is_exact_to_a_twentieth_of_a_cell(depth):
    capsule = Capsule(np.array([0.0, 0.0, 5.0]), np.array([0.0, 0.0, 12.0]), 3.0)
    grid = lay_grid([capsule], 0.1)
    sets = lay_rays([capsule], grid, 500.0)
    outward = np.random.default_rng(5).normal(size=(500, 3))
    outward[:, 2] = np.maximum(outward[:, 2], 0.0)
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    below = [0.0, 0.0, 12.0] + (3.0 - depth) * outward

    start, end = np.array([-4.0, 0.7, 9.2]), np.array([4.0, -0.4, 8.8])
    cut(sets, grid, start, end, 1.0)
    axis = (end - start) / np.linalg.norm(end - start)
    across = np.cross(axis, outward)
    across /= np.linalg.norm(across, axis=1)[:, None]
    middle = start + np.random.default_rng(6).uniform(0.42, 0.58, (500, 1)) * (end - start)

    points = np.vstack([below, middle + (1.0 + depth) * across])
    found = np.empty(len(points))
    air_distances(*sets, grid.of_points(points), found)
    assert np.abs(found - depth).max() < 0.005


def test_the_clearance_of_a_cylinder_is_its_distance_from_the_block():
    grid = lay_grid([BLOCK], 0.1)
    sets = lay_rays([BLOCK], grid, 500.0)
    for foot, lean, truth in (([7.0, 0.0, 14.0], 0.0, 1.0), ([0.0, 0.0, 18.7], 0.4, 0.7 - np.sin(0.4))):
        axis = np.array([np.sin(lean), 0.0, np.cos(lean)])
        told = [
            frustum_clearance(
                rays,
                in_set(grid, direction, np.array(foot))[0],
                np.ascontiguousarray(grid.of_vectors(axis[None])[0][order(direction)]),
                0.0,
                6.0,
                1.0,
                0.0,
                3.0,
            )
            for direction, rays in enumerate(sets)
        ]
        assert min(told) == pytest.approx(truth, abs=0.06)


def test_a_cell_too_small_for_the_memory_names_one_that_fits():
    grid = lay_grid([BLOCK], 0.005)
    with pytest.raises(JobError, match="give a cell of at least") as refused:
        lay_rays([BLOCK], grid, 50.0)
    fits = refused.value.evidence["cell"]
    assert lay_rays([BLOCK], lay_grid([BLOCK], fits), 50.0)


def ball_pieces(starts, ends):
    """Pieces of a ball below an upright axis, its flutes clear of all material."""
    n = len(starts)
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    probed = np.zeros(n, dtype=bool)
    bounds = np.full((n, 2), np.inf)
    return Pieces(starts, ends, up, up, np.arange(n), np.zeros(n), probed, bounds, np.zeros((n, 2, 2)))


def test_a_shank_that_passes_by_on_a_long_piece_does_not_touch():
    grid = lay_grid([BLOCK], 0.1)
    sweeping = Sweeping(lay_rays([BLOCK], grid, 500.0), grid, BLOCK.bounds, 1)
    pieces = ball_pieces(np.array([[8.0, -4.0, 9.0]]), np.array([[8.0, 4.0, 9.0]]))
    sweeping.run(pieces, FINISHING_CUTTER, lambda pieces: None)
    away = 8.0 - FINISHING_CUTTER.shank_diameter / 2 - 5.0
    assert sweeping.clearance(0)[0] == pytest.approx(away, abs=0.02)
    assert sweeping.touched(0) == -1


def probes_at(points, normals):
    mesh = TriangleMesh(points, np.array([[0, 1, 2]], dtype=np.int32))
    return NormalProbes(mesh, points, normals, np.ones(len(points)))


def test_a_raster_leaves_scallops_of_the_formula_on_a_plane():
    radius, step = 1.0, 0.3
    x = np.linspace(-1, 1, 201)
    points = np.column_stack([x, np.zeros((201, 2))])
    normal_probes = probes_at(points, np.tile([0.0, 0.0, 1.0], (201, 1)))
    passes = np.arange(-5, 6) * step
    starts = np.column_stack([passes, np.full(11, -2.0), np.full(11, radius)])
    normal_probes.cut(ball_pieces(starts, starts + np.array([0.0, 4.0, 0.0])), radius)
    away = (x + step / 2) % step - step / 2
    assert normal_probes.heights == pytest.approx(radius - np.sqrt(radius**2 - away**2), abs=1e-9)


def test_balls_round_a_sphere_leave_the_scallop_of_a_convex_section():
    radius, sphere, turn = 1.0, 4.0, 0.1
    angles = np.linspace(-0.3, 0.3, 121)
    normals = np.column_stack([np.sin(angles), np.zeros(121), np.cos(angles)])
    normal_probes = probes_at(sphere * normals, normals)
    at = np.arange(-5, 6) * turn
    centres = (sphere + radius) * np.column_stack([np.sin(at), np.zeros(11), np.cos(at)])
    normal_probes.cut(ball_pieces(centres, centres), radius)
    out = sphere + radius
    scallop = out * np.cos(turn / 2) - np.sqrt(radius**2 - (out * np.sin(turn / 2)) ** 2) - sphere
    assert normal_probes.heights.max() == pytest.approx(scallop, abs=1e-6)
    assert normal_probes.heights.min() == pytest.approx(0.0, abs=1e-9)


def test_what_lies_below_a_height_goes_and_the_rest_turns_with_its_pose():
    grid = lay_grid([BLOCK], 0.2)
    given = SimulatedStock(lay_rays([BLOCK], grid, 500.0), grid, None)
    low, high = BLOCK.bounds
    middle = float((low + high)[2] / 2)
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    left = given.above(middle).move(pose)
    assert np.mean(volumes(left.sets)) == pytest.approx(np.mean(volumes(given.sets)) / 2, rel=0.02)
    inside = (low + high) / 2 + np.array([[0.1, 0.2, 0.5], [0.1, 0.2, -0.5]])
    found = np.zeros(2, dtype=bool)
    in_material(*left.sets, left.grid.of_points(inside @ pose[:3, :3].T), found)
    assert found.tolist() == [True, False]
