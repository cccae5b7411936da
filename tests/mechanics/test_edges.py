"""Forces from rays against integrals over engagements that are known in closed form.

The compliance of cutters against cantilevers that are known.

The force at the middle of a strip, beside an edge that is summed cell by cell.
"""

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.job.materials.preset import CuttingForce
from bonecam.kernels.removal import Pieces
from bonecam.machine.bodies import Frustum
from bonecam.material.rays import lay_grid, lay_rays
from bonecam.mechanics.edges import (
    CARBIDE,
    CORE,
    across,
    cutter_compliance,
    edges_in_grid,
    edges_on,
    forces_of,
    job_strip_force,
    lighter_cuts,
    strip_force,
)
from bonecam.setup import Box
from bonecam.tool import Cutter
from bonecam.verify.sweeping import Sweeping

RADIUS = 2.0
BLOCK = Box(np.array([-8.0, -6.0, 0.0]), np.array([8.0, 6.0, 8.0]))
COEFFICIENTS = np.array([631.0, 99.0, 273.0, 13.0, 10.0, 2.8])
CELL = 0.1
CUTTER = Cutter(1, "roughing", RADIUS, 8.0, 4.0, 30.0, (Frustum(50.0, 20.0, 20.0),), 4500.0, 900.0, 0.05)


def line(y, depth, step, cutter):
    """Pieces along X at a depth below the block's top, the tool upright."""
    x = np.arange(-11.0, 6.0, step)
    centres = np.column_stack([x, np.full(len(x), y), np.full(len(x), 8.0 - depth + cutter.radius)])
    count = len(x) - 1
    axes = np.tile([0.0, 0.0, 1.0], (count, 1))
    above = np.full((count, 2), np.inf), np.zeros((count, 2, 2))
    still = np.zeros(count), np.zeros(count, dtype=bool)
    poses = centres[:-1], centres[1:], axes, axes.copy()
    return Pieces(*poses, np.arange(count), *still, *above)


def cut(depth, *, y=0.0, chip=0.1, step=0.2, flutes=2, passes=1, cutter=CUTTER):
    """The forces of the last of some passes along one line, the volumes of its moves, and which are within the
    block."""
    pieces = line(y, depth, step, cutter)
    grid = lay_grid([BLOCK], CELL)
    sets = lay_rays([BLOCK], grid, 500.0)
    for _ in range(passes):
        edges = edges_on(pieces, np.full(len(pieces.starts), chip), COEFFICIENTS, CELL, cutter)
        asked = [edges_in_grid(edges, grid, k) for k in range(3)]
        sweeping = Sweeping(sets, grid, np.array(BLOCK.bounds), len(pieces.starts))
        sweeping.run(pieces, cutter, lambda _: None, asked)
        sets = sweeping.sets
    inside = (pieces.starts[:, 0] > -4) & (pieces.ends[:, 0] < 4)
    return forces_of(edges, asked, flutes), sweeping.volumes, inside


def exact(depth, first, last, chip=0.1, flutes=2, count=1000, arc=RADIUS):
    """The mean force of a ball, or a corner whose `arc` has another radius (mm), that is engaged up to a depth from phi
    `first` to `last`, along feed, to the left of it and up, by the midpoint rule."""
    ktc, krc, kac, kte, kre, kae = COEFFICIENTS
    end = np.arccos(1 - depth / arc)
    kappa = (np.arange(count)[:, None] + 0.5) * end / count
    phi = first + (np.arange(count) + 0.5) * (last - first) / count
    thick = chip * np.sin(kappa) * np.cos(phi)
    tangential, normal, meridian = ktc * thick + kte, krc * thick + kre, kac * thick + kae
    radial = normal * np.sin(kappa) + meridian * np.cos(kappa)
    up = meridian * np.sin(kappa) - normal * np.cos(kappa)
    ahead = tangential * np.sin(phi) + radial * np.cos(phi)
    left = radial * np.sin(phi) - tangential * np.cos(phi)
    share = flutes * arc * end / count * (last - first) / count / (2 * np.pi)
    return share * np.array([ahead.sum(), left.sum(), up.sum()])


@pytest.mark.parametrize("depth", [0.3, 1.0, 2.0])
def test_a_slot_has_the_force_of_the_integral(depth):
    forces, _, inside = cut(depth)
    force = exact(depth, -np.pi / 2, np.pi / 2)
    assert np.linalg.norm(forces.mean[inside].mean(0) - force) < 0.01 * np.linalg.norm(force)


@pytest.mark.parametrize(("y", "first"), [(6.0, -np.pi / 2), (-6.0, 0.0)])
@pytest.mark.parametrize("depth", [0.5, 1.0, 2.0])
def test_half_immersion_has_the_force_of_the_integral(depth, y, first):
    forces, _, inside = cut(depth, y=y)
    force = exact(depth, first, first + np.pi / 2)
    assert np.linalg.norm(forces.mean[inside].mean(0) - force) < 0.025 * np.linalg.norm(force)


@pytest.mark.parametrize("step", [0.05, 0.2, 1.0])
@pytest.mark.parametrize("y", [0.0, 6.0])
def test_the_area_engaged_sweeps_what_is_removed(step, y):
    forces, volumes, inside = cut(1.0, y=y, step=step)
    assert (forces.areas * step)[inside].sum() == pytest.approx(volumes[inside].sum(), rel=0.02)


def test_flutes_above_the_ball_cut_too():
    forces, volumes, inside = cut(3.5, step=0.2)
    assert (forces.areas * 0.2)[inside].sum() == pytest.approx(volumes[inside].sum(), rel=0.02)
    deep, ball = forces.mean[inside].mean(0), exact(2.0, -np.pi / 2, np.pi / 2)
    # 1.5 mm of flutes in a slot, in cells of 0.4 mm: chips 2 fz / pi on average
    chips = 2 / np.pi * 0.1
    ktc, _, kac, kte, _, kae = COEFFICIENTS
    assert deep[1] - ball[1] == pytest.approx(-1.5 * (ktc * 0.1 / 2 + 2 / np.pi * kte), rel=0.05)
    assert deep[2] - ball[2] == pytest.approx(1.5 * (kac * chips + kae), rel=0.05)


def test_the_force_is_linear_in_the_chip():
    low, middle, high = (cut(1.0, chip=chip)[0].mean for chip in (0.05, 0.1, 0.15))
    assert np.abs(high - 2 * middle + low).max() < 1e-5 * np.abs(middle).max()


def test_a_way_that_is_free_needs_no_force():
    forces, volumes, _ = cut(1.0, passes=2)
    assert volumes.max() == 0
    # the last piece looks ahead of its end, where the block still stands
    assert not forces.cut[:-1].any()
    assert not forces.mean[:-1].any()
    assert not forces.peak[:-1].any()


def test_more_flutes_carry_the_mean_and_even_the_peak():
    one, two, four = (cut(1.0, flutes=flutes)[0] for flutes in (1, 2, 4))
    middle = len(one.mean) // 2
    assert two.mean[middle] == pytest.approx(2 * one.mean[middle], rel=1e-9)
    ratios = [np.linalg.norm(each.peak[middle]) / np.linalg.norm(each.mean[middle]) for each in (one, two, four)]
    assert ratios[0] > ratios[1] > ratios[2] > 1
    # of one edge in a slot the largest force is that of the thickest chip, ahead
    thickest = np.linalg.norm(one.single[middle], axis=1)
    assert np.linalg.norm(one.peak[middle]) == pytest.approx(thickest.max(), rel=1e-6)


def test_the_load_lies_ahead_of_the_centre_and_below_it():
    forces, _, inside = cut(1.0)
    away = (forces.places - forces.edges.centres)[inside]
    assert (away[:, 0] > 0.5).all()
    assert (np.abs(away[:, 1]) < 0.05).all()
    assert (away[:, 2] < -RADIUS + 1.0).all()


@pytest.mark.parametrize(("name", "most"), [("roughing", 0.5e-3), ("finishing", 2.5e-3)])
def test_the_default_cutters_bend_by_mohrs_integral(name, most):
    cutter = Cutter.from_job(1, name, Job().tool(name))
    x = np.linspace(0, cutter.overhang - cutter.radius, 200_001)
    radius = np.empty_like(x)
    for piece in cutter.profile:
        here = (x >= piece.start - cutter.radius) & (x <= piece.end - cutter.radius)
        radius[here] = (CORE if piece.name == "cutter" else 1.0) * (
            piece.radius + piece.taper * (x[here] - piece.start + cutter.radius)
        )
    y = x**2 / (CARBIDE * np.pi / 4 * radius**4)
    mohr = float(((y[1:] + y[:-1]) / 2 * np.diff(x)).sum())
    assert cutter_compliance(cutter) == pytest.approx(mohr, rel=1e-3)
    assert cutter_compliance(cutter) < most


def test_a_force_along_the_axis_bends_nothing():
    axes = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
    made = across(2e-3, axes)
    assert np.abs(np.einsum("nij,nj->ni", made, axes)).max() < 1e-15
    assert made[0] @ np.array([1.0, 0.0, 0.0]) == pytest.approx([2e-3, 0.0, 0.0])


FORCE = CuttingForce((631.0, 99.0, 273.0, 13.0, 10.0, 2.8), (0.6, 1.9), "test", scaled=False)


@pytest.mark.parametrize(("radius", "depth", "scallop", "chip"), [(2.0, 0.5, 0.05, 0.1), (1.0, 0.3, 0.1, 0.04)])
def test_the_force_is_the_sum_over_the_engaged_edge(radius, depth, scallop, chip):
    """A pass beside one that is w away: the edge meets material where the ball is below the surface and outside the
    ball of the pass before."""
    half = np.sqrt(2 * radius * scallop)
    kappa = np.linspace(-np.pi / 2, np.pi / 2, 200001)
    x, z = radius * np.sin(kappa), radius * (1 - np.cos(kappa))
    engaged = (z < depth) & (x > -half)
    edge = radius * np.diff(kappa)[0]
    thick = chip * np.abs(np.sin(kappa[engaged]))
    axes = [(c * thick + e).sum() * edge for c, e in ((631.0, 13.0), (99.0, 10.0), (273.0, 2.8))]
    assert strip_force(FORCE, radius, depth, scallop, chip) == pytest.approx(axes, rel=1e-4)


def test_a_slot_without_scallops_takes_half_of_the_ball():
    """Half of the ball at a depth of its radius: chips of h R, an edge of pi R / 2."""
    cut = np.array([631.0, 99.0, 273.0]) * 0.1 * 2.0 + np.array([13.0, 10.0, 2.8]) * np.pi
    for depth in (2.0, 5.0):
        assert strip_force(FORCE, 2.0, depth, 0.0, 0.1) == pytest.approx(cut)


def test_wider_scallops_of_deep_roughing_cuts_count():
    deep = {"levels": {"depths": "0.1 1"}}
    narrow, wide = Job(**deep), Job(levels={"depths": "0.1 1", "scallop_share": 0.2})
    stated = Job(**deep, roughing={"scallop": 0.2})
    for name, ratio in (("roughing", 1.15), ("finishing", 1.0)):
        forces = [job_strip_force(FORCE, job, name) for job in (narrow, wide, stated)]
        assert forces[1] == pytest.approx(forces[2])
        assert forces[1] == pytest.approx(ratio * forces[0], rel=0.05)


def test_shallower_cuts_take_less_and_less_of_the_force_at_the_feed_that_they_have():
    job = Job(levels={"finishing_depth": 0.3}, finishing={"scallop": 0.1})
    found = lighter_cuts(FORCE, job)
    assert found[0][0].startswith("finishing cuts of 0.15 mm with scallops of 0.05 (levels.finishing_depth")
    shares = [share for _, share in found]
    assert 1 > shares[0] > shares[1] > shares[2] > 0.2
    other = Job(levels={"finishing_depth": 0.15}, finishing={"scallop": 0.05})
    tool = other.tool("finishing")
    by_hand = np.linalg.norm(strip_force(FORCE, tool.radius, 0.15, 0.05, tool.feed / (2 * tool.spindle)))
    assert shares[0] * job_strip_force(FORCE, job, "finishing") == pytest.approx(by_hand)


@pytest.mark.parametrize(
    "levels", [{"depths": "0.3 0.5 1", "finishing_depth": 0.3}, {"depths": "0.3"}, {"schedule": "fewest"}]
)
def test_shallower_cuts_are_those_onto_the_part_of_any_schedule(levels):
    job = Job(levels=levels, finishing={"scallop": 0.1})
    depth = job.levels.depth_onto(0)
    numbers = Job(levels={"finishing_depth": depth}, finishing={"scallop": 0.1})
    found, wanted = lighter_cuts(FORCE, job), lighter_cuts(FORCE, numbers)
    assert [share for _, share in found] == pytest.approx([share for _, share in wanted])
    assert all("the first of levels.depths" in what for what, _ in found)
    assert found[0][0].startswith(f"finishing cuts of {depth / 2:g} mm")
