"""The beam gives the answers of the books: deflection, stress and frequency of bodies with known ones.

Slices of columns, meshes and rays have the areas and moments of the bodies.

How stiffly a tailstock holds the free end, beside formulas of beams and finite ones.
"""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.job import HoldingJob
from bonecam.material.rays import lay_grid, lay_rays
from bonecam.mechanics import Beam, Sections, Support, column_sections, join, mesh_sections, ray_sections, shoulder
from bonecam.mechanics.beam import POISSON, STEEL, shell_seat, tailstock_support
from bonecam.mesh import TriangleMesh
from bonecam.mesh.solids import prism, revolve
from bonecam.mesh.triangle_mesh import side_by_side
from bonecam.setup import Cylinder
from bonecam.setup.stocks.capsule import Capsule
from bonecam.workholding.post import Column
from bonecam.workholding.shell import turn_over

E, NU = 70000.0, 0.33
G = E / (2 * (1 + NU))
FORCES = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def shear(length: float, area: float) -> float:
    """What shear adds to the deflection of a round cantilever, mm/N (Cowper 1966)."""
    return length / (6 * (1 + NU) / (7 + 6 * NU) * G * area)


def at(x: float, y: float, z: float) -> np.ndarray:
    return np.array([[x, y, z]])


@pytest.mark.parametrize("height", [40.0, 23.3])
def test_a_cylinder_bends_shears_and_stretches(height):
    beam = Beam(column_sections(2.0, 3.0, 50.0), E, NU)
    second, area, length = np.pi * 4.0, np.pi * 4.0, height - 3.0
    found = beam.compliance(at(0, 0, height))[0]
    bent = length**3 / (3 * E * second) + shear(length, area)
    np.testing.assert_allclose(found, np.diag([bent, bent, length / (E * area)]), rtol=1e-7, atol=1e-15)


def test_a_load_off_the_axis_twists_and_turns():
    length, arm = 40.0, 6.0
    beam = Beam(column_sections(2.0, 0.0, 60.0), E, NU)
    second, area = np.pi * 4.0, np.pi * 4.0
    found = beam.compliance(at(arm, 0, length))[0]
    bent = length**3 / (3 * E * second) + shear(length, area)
    twist = arm**2 * length / (G * 2 * second)
    assert found[1, 1] == pytest.approx(bent + twist, rel=1e-7)
    assert found[2, 2] == pytest.approx(length / (E * area) + arm**2 * length / (E * second), rel=1e-7)
    assert found[0, 2] == pytest.approx(-arm * length**2 / (2 * E * second), rel=1e-7)
    np.testing.assert_allclose(found, found.T, atol=1e-15)


def test_a_step_adds_the_turn_of_its_lower_piece():
    low, high = 10.0, 30.0
    beam = Beam(join([column_sections(2.0, 0.0, low), column_sections(5.0, low, high)]), E, NU)
    soft, stiff = E * np.pi / 4 * 2.0**4, E * np.pi / 4 * 5.0**4
    rest = high - low
    bent = (high**3 - rest**3) / (3 * soft) + rest**3 / (3 * stiff)
    sheared = shear(low, np.pi * 4) + shear(rest, np.pi * 25)
    assert beam.compliance(at(0, 0, high))[0, 0, 0] == pytest.approx(bent + sheared, rel=1e-7)


def test_a_section_without_symmetry_bends_aside():
    plain = column_sections(2.0, 0.0, 40.0)
    second = np.array([[9.0, 4.0], [4.0, 6.0]])
    beam = Beam(
        Sections(plain.low, plain.high, plain.area, plain.centroid, np.tile(second, (80, 1, 1)), plain.flexible), E, NU
    )
    found = beam.compliance(at(0, 0, 40.0))[0, :2, :2]
    wanted = 40.0**3 / (3 * E) * np.linalg.inv(second) + shear(40.0, np.pi * 4) * np.eye(2)
    np.testing.assert_allclose(found, wanted, rtol=1e-7)


def test_a_cone_bends_by_the_integral_of_its_radius():
    length, wide, narrow = 80.0, 6.0, 3.0
    mesh = revolve(np.array([wide, narrow]), np.array([0.0, length]), (0.0, length), 200)
    found = Beam(mesh_sections(mesh), E, NU).compliance(at(0, 0, length))[0, 0, 0]
    z = np.linspace(0, length, 200001)
    radius = wide + (narrow - wide) * z / length
    polygon = 100 * np.sin(2 * np.pi / 200) / np.pi
    bent = np.trapezoid((length - z) ** 2 / (np.pi / 4 * radius**4), z) / E
    sheared = np.trapezoid(1 / (np.pi * radius**2), z) * shear(1.0, 1.0)
    # slices of 0.5 mm are even: the error falls with the square of their height
    assert found == pytest.approx((bent + sheared) / polygon**2, rel=2.3e-5)


def test_a_propped_cantilever_sinks_in_its_middle_as_in_the_books():
    length = 4000.0
    sections = column_sections(2.0, 0.0, length)
    stiff = Support(np.array([0.0, 0.0, length]), np.diag([1e9, 1e9, 0.0]))
    found = Beam(sections, E, NU, stiff).compliance(at(0, 0, length / 2))[0]
    assert found[0, 0] == pytest.approx(7 * length**3 / (768 * E * np.pi * 4), rel=1e-5)
    assert Beam(sections, E, NU, stiff).compliance(at(0, 0, length))[0, 1, 1] == pytest.approx(1e-9, rel=1e-6)


def test_a_soft_support_shares_the_load_with_the_beam():
    sections = column_sections(2.0, 0.0, 50.0)
    alone = Beam(sections, E, NU).compliance(at(0, 0, 50.0))[0, 0, 0]
    soft = Support(np.array([0.0, 0.0, 50.0]), np.diag([1 / alone, 0.0, 0.0]))
    both = Beam(sections, E, NU, soft).compliance(at(0, 0, 50.0))[0]
    assert both[0, 0] == pytest.approx(alone / 2, rel=1e-9)
    assert both[1, 1] == pytest.approx(alone, rel=1e-9)


def test_a_shell_gives_way_as_an_elastic_wall_and_a_cantilever():
    """A rigid bar in a wall of k N/mm on each mm of its height h moves by F / (k h) and turns by 12 F z / (k h^3), on a
    solid cantilever below the middle of that height; in a chuck up to there the wall alone gives way."""
    soft, height, top = 1600.0, 12.0, 30.0
    part = revolve(np.array([3.0, 3.0]), np.array([10.0, top]), (10.0, top), 200)
    shell = revolve(np.array([12.0, 12.0]), np.array([0.0, 22.0]), (0.0, 22.0), 200)
    sections = mesh_sections(part, 10.0, top)
    rigid = replace(sections, flexible=np.zeros(len(sections.low)))
    wall = 0.65 * soft / (1 - POISSON**2)
    arm = top - 16.0
    in_wall = 1 / (wall * height) + 12 * arm**2 / (wall * height**3)
    for foot in (16.0, 0.0):
        seat = shell_seat(shell, part, foot, 10.0 + height, soft)
        found = Beam(rigid, E, NU, seat=seat).compliance(at(0, 0, top))[0, 0, 0]
        cantilever = Beam(mesh_sections(shell, 0.0, 16.0), soft).compliance(at(0, 0, top))[0, 0, 0] if not foot else 0.0
        assert found == pytest.approx(in_wall + cantilever, rel=1e-9)
    bent = Beam(sections, E, NU, seat=seat).compliance(at(0, 0, top))[0, 0, 0]
    alone = Beam(sections, E, NU).compliance(at(0, 0, top))[0, 0, 0]
    assert bent == pytest.approx(found + alone, rel=1e-9)


def test_the_halves_of_a_shell_bend_each_by_itself():
    part = revolve(np.array([3.0, 3.0]), np.array([10.0, 30.0]), (10.0, 30.0), 60)
    outline = np.array([[0.5, -8.0], [8.0, -8.0], [8.0, 8.0], [0.5, 8.0]])
    halves = side_by_side([prism(outline, 0.0, 22.0), prism(-outline, 0.0, 22.0)])
    seat = shell_seat(halves, part, 0.0, 22.0, 1600.0)
    wall = shell_seat(halves, part, 16.0, 22.0, 1600.0)
    (shell,) = seat.integrals[0] - wall.integrals[0]
    along, across = 2 * 7.5 * 16.0**3 / 12, 2 * 16.0 * 7.5**3 / 12
    assert shell[0, 0] == pytest.approx(16.0 / (1600.0 * along), rel=1e-6), "about X as one block"
    assert shell[1, 1] == pytest.approx(16.0 / (1600.0 * across), rel=1e-6), "about Y as two"


def test_the_stress_is_the_moment_over_the_modulus_at_the_weakest_slice():
    beam = Beam(
        join(
            [
                column_sections(6.0, 0.0, 20.0),
                shoulder(4.0, 20.0),
                column_sections(2.0, 20.0, 27.0),
                column_sections(5.0, 27.0, 60.0),
            ]
        ),
        E,
        NU,
    )
    force, height = 10.0, 50.0
    modulus = np.pi / 4 * 2.0**3
    found = beam.moment_stress(force * FORCES, np.array([[0, 0, height]] * 3))
    assert found[0] == pytest.approx(force * (height - 20) / modulus, rel=1e-9)
    assert found[1] == pytest.approx(found[0], rel=1e-12)
    assert found[2] == pytest.approx(0.0, abs=1e-9)
    off_axis = beam.moment_stress(force * FORCES[2:], at(4.0, 0, height))
    assert off_axis[0] == pytest.approx(force * 4.0 / modulus, rel=1e-9)
    below = beam.moment_stress(force * FORCES[:1], at(0, 0, 10.0))
    assert below[0] == pytest.approx(force * 10.0 / (np.pi / 4 * 6.0**3), rel=1e-9)


def test_a_support_takes_the_moment_off_the_foot():
    length = 4000.0
    stiff = Support(np.array([0.0, 0.0, length]), np.diag([1e9, 1e9, 0.0]))
    found = Beam(column_sections(2.0, 0.0, length), E, NU, stiff).moment_stress(FORCES[:1], at(0, 0, length / 2))
    assert found[0] == pytest.approx(3 * length / 16 / (np.pi / 4 * 8), rel=1e-4)


def test_a_slender_rod_swings_at_the_frequency_of_the_books():
    length, density = 100.0, 2700.0
    found = Beam(column_sections(0.25, 0.0, length), E, NU).first_frequency(density)
    second, area = np.pi / 4 * 0.25**4, np.pi * 0.25**2
    wanted = 1.8751041**2 / (2 * np.pi * length**2) * np.sqrt(E * second / (density * 1e-12 * area))
    assert found == pytest.approx(wanted, rel=5e-5)


def on_a_neck(radius: float, wide: float, *, low: float, neck: float, high: float) -> float:
    """Compliance (mm/N) across the axis at the top of a round piece on a neck on another round piece."""
    foot, top = low, low + neck
    pieces = [
        column_sections(wide, 0.0, foot),
        shoulder(2 * radius, foot, 2 * wide),
        column_sections(radius, foot, top),
        shoulder(2 * radius, top, 2 * wide),
        column_sections(wide, top, top + high),
    ]
    return float(Beam(join(pieces), E, NU).compliance(at(0, 0, top + high))[0, 0, 0])


def test_a_shoulder_softens_a_neck_as_a_piece_of_it_would():
    radius, wide, low, neck, high = 2.0, 4.0, 10.0, 7.0, 23.0
    plain = [
        column_sections(wide, 0.0, low),
        column_sections(radius, low, low + neck),
        column_sections(wide, low + neck, low + neck + high),
    ]
    alone = Beam(join(plain), E, NU).compliance(at(0, 0, 40.0))[0, 0, 0]
    more = 0.24 * 4.0 * 0.75
    turns = more * (30.0**2 + 23.0**2) / (E * np.pi * 4)
    found = on_a_neck(radius, wide, low=low, neck=neck, high=high)
    assert found - alone == pytest.approx(turns + shear(2 * more, np.pi * 4), rel=1e-9)


@pytest.mark.parametrize(("radius", "wide", "neck"), [(4.0, 6.0, 7.0), (3.0, 6.0, 6.0), (3.0, 9.0, 6.0)])
def test_finite_elements_find_a_neck_with_its_shoulders_as_soft(radius, wide, neck):
    """Bodies of revolution under a load across their axis: one wave round the axis, quadratic elements in r and z."""
    skfem = pytest.importorskip("skfem")
    low, high, step = 2 * wide, 40.0, 0.5
    top = low + neck
    total = top + high
    radii = np.r_[
        np.linspace(0, radius, int(radius / step) + 1), np.linspace(radius, wide, int((wide - radius) / step) + 1)
    ]
    heights = [
        np.linspace(*ends, int((ends[1] - ends[0]) / size) + 1)
        for ends, size in (((0, low), 2 * step), ((low, top), step), ((top, total), 2 * step))
    ]
    mesh = skfem.MeshQuad.init_tensor(np.unique(radii), np.unique(np.concatenate(heights)))
    r, z = mesh.p[:, mesh.t].mean(axis=1)
    mesh = mesh.remove_elements(np.flatnonzero((r > radius) & (z > low) & (z < top)))
    element = skfem.ElementVector(skfem.ElementQuad2(), 3)

    def strains(u, r):
        """Strains of the displacement (u cos, v sin, w cos) along r, round the axis, along z."""
        (u_, v_, w_), (du, dv, dw) = u, u.grad
        return [du[0], (u_ + v_) / r, dw[1], du[1] + dw[0], dv[0] - (u_ + v_) / r, dv[1] - w_ / r]

    @skfem.BilinearForm
    def stiffness(u, v, w):
        one, other = strains(u, w.x[0]), strains(v, w.x[0])
        volume = E * NU / ((1 + NU) * (1 - 2 * NU)) * sum(one[:3]) * sum(other[:3])
        shape = sum(k * a * b for k, a, b in zip((2, 2, 2, 1, 1, 1), one, other, strict=True))
        return np.pi * w.x[0] * (volume + G * shape)

    @skfem.LinearForm
    def push(v, w):
        return np.pi * w.x[0] * (v[0] - v[1])

    upper = mesh.facets_satisfying(lambda x: np.isclose(x[1], total))
    load = skfem.asm(push, skfem.FacetBasis(mesh, element, facets=upper, intorder=4))
    basis = skfem.Basis(mesh, element, intorder=4)
    held = basis.get_dofs(lambda x: np.isclose(x[1], 0))
    moved = skfem.solve(*skfem.condense(skfem.asm(stiffness, basis), load, D=held))
    wanted = float(load @ moved) / (np.pi * wide**2) ** 2
    assert on_a_neck(radius, wide, low=low, neck=neck, high=high) == pytest.approx(wanted, rel=0.03)


@pytest.mark.parametrize("values", [(0.0, 0.3), (-1.0, 0.3), (E, 0.5), (E, -1.0)])
def test_a_material_that_cannot_be_is_refused(values):
    with pytest.raises(ValueError, match="give E > 0"):
        Beam(column_sections(2.0, 0.0, 5.0), *values)


def test_a_gap_in_what_stands_is_refused():
    gap = column_sections(2.0, 5.0, 6.0)
    empty = Sections(gap.low, gap.high, 0 * gap.area, gap.centroid, 0 * gap.second, gap.flexible)
    with pytest.raises(ValueError, match=r"nothing stands at z = 5\.25 mm"):
        Beam(join([column_sections(2.0, 0.0, 5.0), empty, column_sections(2.0, 6.0, 9.0)]), E)


BOX = np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]])
SIDES = np.array([[1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]])


def leaning_box(width: float, depth: float, shift: float) -> TriangleMesh:
    """A box of 10 mm height with its lowest corner at the origin, whose top is moved along X."""
    base = np.array([[0.0, 0, 0], [width, 0, 0], [width, depth, 0], [0, depth, 0]])
    return TriangleMesh(np.vstack([base, base + np.array([shift, 0, 10.0])]), np.vstack([BOX, SIDES]).astype(np.int32))


def test_a_leaning_box_has_its_area_its_middle_and_its_moments():
    cut = mesh_sections(leaning_box(3.0, 2.0, 5.0))
    assert np.allclose(cut.high - cut.low, 0.5)
    np.testing.assert_allclose(cut.area, 6.0, rtol=1e-12)
    np.testing.assert_allclose(cut.centroid, np.column_stack([1.5 + cut.z / 2, np.ones(len(cut.z))]), rtol=1e-12)
    np.testing.assert_allclose(cut.second, np.broadcast_to(np.diag([4.5, 2.0]), (20, 2, 2)), atol=1e-11)


def test_a_mesh_and_a_column_of_one_shape_have_one_section():
    around = 720
    mesh = revolve(np.array([2.0, 2.0]), np.array([1.0, 8.0]), (1.0, 8.0), around)
    polygon = around / 2 * np.sin(2 * np.pi / around) / np.pi
    one, other = mesh_sections(mesh), column_sections(2.0, 1.0, 8.0)
    np.testing.assert_allclose(one.area, polygon * other.area, rtol=1e-12)
    np.testing.assert_allclose(one.second, other.second, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("low", [2.0, 0.3])
def test_rays_have_the_moments_of_a_body_off_the_axis(low):
    body = Capsule(np.array([3.0, -2.0, 3.0]), np.array([3.0, -2.0, 13.0]), 3.0)
    grid = lay_grid([body], 0.1)
    cut = ray_sections(lay_rays([body], grid, 200.0), grid, low, 14.0)
    wall = (cut.low >= 3.0) & (cut.high <= 13.0)
    np.testing.assert_allclose(cut.area[wall], np.pi * 9, rtol=3e-3)
    np.testing.assert_allclose(cut.centroid[wall], [[3.0, -2.0]] * wall.sum(), atol=5e-3)
    np.testing.assert_allclose(cut.second[wall], [np.pi / 4 * 81 * np.eye(2)] * wall.sum(), atol=0.3)


def test_the_cap_of_a_free_end_is_rigid_and_a_thin_neck_is_not():
    bodies = [Cylinder(0.8, 0.0, 6.0), Capsule(np.array([0.0, 0, 7]), np.array([0.0, 0, 14]), 2.0)]
    grid = lay_grid(bodies, 0.1)
    cut = ray_sections(lay_rays(bodies, grid, 200.0), grid, 0.0, 16.0)
    assert (cut.area[cut.high < 5.0] < 4.0).all()
    assert (cut.flexible[cut.low < 15.5] > 0).all()
    assert cut.rigid == 1
    assert cut.area[-1] < 4.0


def test_a_cut_keeps_the_share_of_the_slices_at_its_ends_and_the_shoulders_in_it():
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


RIGID = HoldingJob(diameter=6.0, tailstock="pin", tailstock_column=200.0, tailstock_arm=200.0, tailstock_reach=120.0)
YOUNG = 70000.0


def stiffness(holding: HoldingJob, pin: Column) -> np.ndarray:
    support = tailstock_support(holding, pin, YOUNG)
    assert support is not None
    return support.stiffness


def test_a_pin_of_2_by_10_mm_of_steel_gives_495_newtons_a_millimetre():
    found = stiffness(RIGID, Column(1.0, 60.0, 50.0))
    assert np.diag(found) == pytest.approx([495.0, 495.0, 0.0], rel=0.003)


def test_an_upper_neck_is_of_the_parts_material():
    pin, neck = (stiffness(replace(RIGID, tailstock=kind), Column(1.0, 60.0, 50.0)) for kind in ("pin", "neck"))
    assert neck[0, 0] / pin[0, 0] == pytest.approx(YOUNG / STEEL, rel=0.003)


def test_a_slender_column_gives_way_as_a_cantilever_and_more_across_the_arm():
    holding = replace(RIGID, tailstock_column=10.0, tailstock_reach=80.0)
    found = stiffness(holding, Column(20.0, 100.0, 99.0))
    second = np.pi / 64 * 10.0**4
    height = 100.0 + holding.tailstock_arm / 2
    along = height**3 / (3 * STEEL * second)
    assert found[0, 0] == pytest.approx(1 / along, rel=1e-3)
    twisted = 80.0**2 * height / (81000.0 * 2 * second)
    assert found[1, 1] == pytest.approx(1 / (along + twisted), rel=1e-3)
    turned = stiffness(replace(holding, tailstock_azimuth_deg=90.0), Column(20.0, 100.0, 99.0))
    assert turned[1, 1] == pytest.approx(found[0, 0])


def test_a_bar_on_a_rigid_tailstock_is_the_propped_cantilever_of_the_books():
    length, radius = 4000.0, 2.0
    pin = Column(40.0, length + 1.0, length)
    support = tailstock_support(replace(RIGID, tailstock_column=200.0), pin, YOUNG)
    assert support is not None
    stiff = replace(support, stiffness=support.stiffness * 1e6)
    beam = Beam(column_sections(radius, 0.0, length), YOUNG, support=stiff)
    found = beam.compliance(np.array([[0.0, 0.0, length / 2]]))[0]
    assert found[0, 0] == pytest.approx(7 * length**3 / (768 * YOUNG * np.pi / 4 * radius**4), rel=1e-4)


def test_a_tailstock_stiffens_loads_less_and_rings_higher():
    sections = column_sections(3.0, 0.0, 60.0)
    pin = Column(1.5, 72.0, 60.0)
    holding = HoldingJob(diameter=6.0, tailstock="pin", tailstock_reach=100.0)
    bare = Beam(sections, YOUNG)
    held = Beam(sections, YOUNG, support=tailstock_support(holding, pin, YOUNG))
    middle, force = np.array([[0.0, 0.0, 40.0]]), np.array([[10.0, 0.0, 0.0]])
    assert held.compliance(middle)[0, 0, 0] < 0.3 * bare.compliance(middle)[0, 0, 0]
    assert held.moment_stress(force, middle)[0] < 0.6 * bare.moment_stress(force, middle)[0]
    assert held.first_frequency(2700.0) > 2 * bare.first_frequency(2700.0)


def test_without_a_pin_nothing_holds_the_free_end():
    assert tailstock_support(HoldingJob(), None, YOUNG) is None
