"""Slices of columns, meshes and rays have the areas and moments of the bodies."""

import numpy as np
import pytest

from bonecam.material.rays import lay_grid, lay_rays
from bonecam.mechanics.beam import column_sections, join, mesh_sections, ray_sections, shoulder
from bonecam.mesh.solids import revolve
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stocks.capsule import Capsule
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.workholding.shell import turn_over

BOX = np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]])
SIDES = np.array([[1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]])


def leaning_box(width: float, depth: float, shift: float) -> TriangleMesh:
    """A box of 10 mm height with its lowest corner at the origin, whose top is moved along X."""
    base = np.array([[0.0, 0, 0], [width, 0, 0], [width, depth, 0], [0, depth, 0]])
    return TriangleMesh(np.vstack([base, base + np.array([shift, 0, 10.0])]), np.vstack([BOX, SIDES]).astype(np.int32))


def test_a_leaning_box_has_its_area_its_middle_and_its_moments() -> None:
    cut = mesh_sections(leaning_box(3.0, 2.0, 5.0))
    assert np.allclose(cut.high - cut.low, 0.5)
    np.testing.assert_allclose(cut.area, 6.0, rtol=1e-12)
    np.testing.assert_allclose(cut.centroid, np.column_stack([1.5 + cut.z / 2, np.ones(len(cut.z))]), rtol=1e-12)
    np.testing.assert_allclose(cut.second, np.broadcast_to(np.diag([4.5, 2.0]), (20, 2, 2)), atol=1e-11)


def test_a_mesh_and_a_column_of_one_shape_have_one_section() -> None:
    around = 720
    mesh = revolve(np.array([2.0, 2.0]), np.array([1.0, 8.0]), (1.0, 8.0), around)
    polygon = around / 2 * np.sin(2 * np.pi / around) / np.pi
    one, other = mesh_sections(mesh), column_sections(2.0, 1.0, 8.0)
    np.testing.assert_allclose(one.area, polygon * other.area, rtol=1e-12)
    np.testing.assert_allclose(one.second, other.second, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("low", [2.0, 0.3])
def test_rays_have_the_moments_of_a_body_off_the_axis(low: float) -> None:
    body = Capsule(np.array([3.0, -2.0, 3.0]), np.array([3.0, -2.0, 13.0]), 3.0)
    grid = lay_grid([body], 0.1)
    cut = ray_sections(lay_rays([body], grid, 200.0), grid, low, 14.0)
    wall = (cut.low >= 3.0) & (cut.high <= 13.0)
    np.testing.assert_allclose(cut.area[wall], np.pi * 9, rtol=3e-3)
    np.testing.assert_allclose(cut.centroid[wall], [[3.0, -2.0]] * wall.sum(), atol=5e-3)
    np.testing.assert_allclose(cut.second[wall], [np.pi / 4 * 81 * np.eye(2)] * wall.sum(), atol=0.3)


def test_the_cap_of_a_free_end_is_rigid_and_a_thin_neck_is_not() -> None:
    bodies = [Cylinder(0.8, 0.0, 6.0), Capsule(np.array([0.0, 0, 7]), np.array([0.0, 0, 14]), 2.0)]
    grid = lay_grid(bodies, 0.1)
    cut = ray_sections(lay_rays(bodies, grid, 200.0), grid, 0.0, 16.0)
    assert (cut.area[cut.high < 5.0] < 4.0).all()
    assert (cut.flexible[cut.low < 15.5] > 0).all()
    assert cut.rigid == 1
    assert cut.area[-1] < 4.0


def test_a_cut_keeps_the_share_of_the_slices_at_its_ends_and_the_shoulders_in_it() -> None:
    whole = join([column_sections(5.0, 0.0, 4.0), shoulder(4.0, 4.0), column_sections(2.0, 4.0, 9.0)])
    cut = whole.between(3.2, 8.1)
    assert (cut.low[0], cut.high[-1]) == (3.2, 8.1)
    assert cut.flexible.sum() == pytest.approx(4.9 + 0.24 * 4.0)
    assert whole.rigid == 0


def test_what_was_turned_over_has_the_sections_of_the_body_as_it_stands():
    body = Cylinder(4.0, 0.0, 10.0).move(np.array([1.0, 2.0, 0.0]))
    grid = lay_grid([body], 0.1)
    sets = lay_rays([body], grid, 500.0)
    found = ray_sections(sets, grid.move(turn_over(30.0)), 22.0, 28.0)
    assert found.area == pytest.approx(np.full(12, np.pi * 16), rel=5e-3)
    assert np.abs(found.centroid - [1.0, -2.0]).max() < 0.01
