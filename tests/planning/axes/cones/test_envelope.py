"""What is swept in an elliptic cone is held by its mesh, and the mesh is not much larger."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.arrays import unit
from bonecam.mesh import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones import Sweep
from bonecam.report.pictures import is_closed

RANDOM = np.random.default_rng(3)
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
    share = np.sqrt(RANDOM.random(count))
    share[::3] = 1.0
    turn = RANDOM.uniform(0, 2 * np.pi, count)
    flat = share * np.tan([[sweep.first], [sweep.second]]) * [np.cos(turn), np.sin(turn)]
    axes = unit(np.column_stack([*flat, np.ones(count)]))
    side = unit(np.cross(axes, RANDOM.normal(size=(count, 3))))
    height = RANDOM.uniform(sweep.start, sweep.end, count)
    radius = np.full(count, sweep.radius)
    height[::4], height[1::4] = sweep.start, sweep.end
    radius[::8] *= RANDOM.random(len(radius[::8]))
    moved = sweep.growth * unit(RANDOM.normal(size=(count, 3)))
    return height[:, None] * axes + radius[:, None] * side + moved


@pytest.mark.parametrize("name", SWEEPS)
def test_the_mesh_holds_what_is_swept_and_is_closed(name: str) -> None:
    sweep = SWEEPS[name]
    mesh = mesh_of(sweep, SIDES)
    points = points_of(sweep)
    assert is_closed(mesh)
    assert mesh.volume > 0
    assert MeshDistance(mesh).signed(points).max() < 1e-4
    assert sweep.holds(points, SIDES).all()


@pytest.mark.parametrize("name", SWEEPS)
def test_its_steps_hold_what_is_swept_together(name: str) -> None:
    sweep = SWEEPS[name]
    points = points_of(sweep)
    meshes = [mesh_of(step, SIDES) for step in sweep.steps()]
    assert all(is_closed(mesh) and mesh.volume > 0 for mesh in meshes)
    assert np.min([MeshDistance(mesh).signed(points) for mesh in meshes], axis=0).max() < 1e-4


def test_steps_leave_out_the_corner_that_growth_rounds() -> None:
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
def test_wide_and_short_sections_are_held_too(size: tuple[float, ...], sides: int) -> None:
    """Flutes that hardly reach over the ball's centre, and a low step of a holder: the corners of their polygon are
    farther from the apex than any of their points."""
    sweep = Sweep(*size)
    mesh = mesh_of(sweep, sides)
    assert is_closed(mesh)
    assert MeshDistance(mesh).signed(points_of(sweep, 6_000)).max() < 1e-4


@pytest.mark.parametrize("name", SWEEPS)
def test_the_fine_mesh_is_hardly_larger_than_its_bounds(name: str) -> None:
    """By volume, of random points in its box."""
    sweep, count = SWEEPS[name], 20_000
    mesh = mesh_of(sweep, 96)
    low, high = mesh.bounds
    inside = sweep.holds(RANDOM.uniform(low, high, (count, 3)), 96)
    assert 0.95 < mesh.volume / (inside.mean() * np.prod(high - low)) < 1.1


def test_points_that_no_axis_reaches_are_not_held() -> None:
    """Below the flutes, above the spindle, and beside the cone."""
    sweep = replace(SWEEPS["shank"], growth=0.0)
    outside = [[0, 0, 2.9], [0, 0, 24.1], [2.0, 1.0 / np.cos(0.2) + 10 * np.tan(0.2) + 0.5, 10.0], [0, 0, -5.0]]
    inside = [[0, 0, 3.1], [0, 0, 23.9], [10 * np.tan(0.69), 0.0, 10.0], [0, 10 * np.tan(0.2), 10.0]]
    assert not sweep.holds(np.array(outside), SIDES).any()
    assert sweep.holds(np.array(inside), SIDES).all()


def test_where_the_apex_may_lie_above_the_begin_a_mesh_holds_the_sweep_or_there_is_none() -> None:
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


def test_wide_flat_cones_are_held() -> None:
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
