"""What is swept in a cone is held by its mesh, and the mesh is not much larger."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.arrays import rotations_of, unit
from bonecam.mesh import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones.envelope import Sweep, held
from bonecam.report.pictures.views import is_closed

RANDOM = np.random.default_rng(3)
SWEEPS = {
    "flutes from the ball's centre": Sweep(0.0, 3.0, 1.0, 0.6, 0.4),
    "flutes above it": Sweep(0.9, 3.0, 1.0, 0.3, 0.2),
    "shank": Sweep(3.0, 24.0, 1.0, 0.69, 0.5),
    "holder": Sweep(24.0, 74.0, 10.0, 0.02, 0.05),
    "spindle that leans far": Sweep(20.0, 120.0, 40.0, 1.2, 0.3),
    "one place": Sweep(2.0, 9.0, 1.5, 0.5, 0.0),
}


def points_of(sweep: Sweep, count: int = 6000) -> np.ndarray:
    """Points on the outside of the cylinder for axes all over the cone, a third of them at its rim, moved as far as the
    apex may be."""
    angle = sweep.angle * np.sqrt(RANDOM.random(count))
    angle[::3] = sweep.angle
    turn = RANDOM.uniform(0, 2 * np.pi, count)
    axes = np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
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
    for made in (sweep, sweep.rounded(0.1, np.radians(1.0))):
        mesh = TriangleMesh(*made.mesh(24))
        assert is_closed(mesh)
        assert mesh.volume > 0
        assert MeshDistance(mesh).signed(points_of(sweep)).max() < 1e-4


@pytest.mark.parametrize("name", SWEEPS)
def test_the_finer_mesh_is_hardly_larger_than_what_is_swept(name: str) -> None:
    """By volume, of random points in its box."""
    sweep, count = SWEEPS[name], 5000
    mesh = TriangleMesh(*sweep.mesh(96))
    low, high = mesh.bounds
    points = RANDOM.uniform(low, high, (count, 3))
    inside = held(np.zeros(3), -points, np.tile([0.0, 0.0, 1.0], (count, 1)), [sweep] * count)
    assert 0.95 < mesh.volume / (inside.mean() * np.prod(high - low)) < 1.06


@pytest.mark.parametrize("name", SWEEPS)
def test_points_that_are_swept_are_held(name: str) -> None:
    sweep, apex, axis = SWEEPS[name], np.array([3.0, -2.0, 9.0]), unit(np.array([[0.3, -0.5, 0.6]]))[0]
    points = points_of(sweep, 300) @ rotations_of(axis[None])[0].T + apex
    slightly = replace(sweep, growth=sweep.growth + 1e-9)
    places, axes = np.stack([apex, apex + 1000.0]), np.stack([axis, axis])
    for point in points:
        assert held(point, places, axes, [slightly, sweep]).tolist() == [True, False]
