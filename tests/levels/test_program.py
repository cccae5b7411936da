"""Programs set up again where their samples are: targets slide beside the samples, but not at the poles.

What all limits promise, whichever are listed, and that one more in a list holds.

What all energies promise, whichever are listed, and that one more in a list is part of the program.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from level_parts import CAPSULE, HALF_MILLIMETRE, STEP_PARAMETERS

from bonecam.arrays import dots, unit
from bonecam.levels import program
from bonecam.levels import program as limits
from bonecam.levels.problem import ROUGH, Cut
from bonecam.levels.program import (
    MOST_BENT,
    NET,
    SAMPLED,
    SLABS,
    WALLS,
    Pulled,
    Quadratic,
    heights,
    plate,
    program_of,
    targets,
)
from bonecam.levels.solvers import admm
from bonecam.surface.query import closest_points_near


def test_targets_keep_their_way_along_the_normals_and_stand_still_at_the_poles(first_program):
    before = first_program()
    moves = np.tile([0.02, -0.01, 0.03], (before.R.shape[1], 1))
    after = before.at(moves)
    y, knots = before.x + before.R @ moves, np.unique(before.limits.before.tmesh.t_knots)
    free = (after.limits.t > knots[1]) & (after.limits.t < knots[-2])
    assert free.any()
    assert (~free).any()
    assert np.array_equal(after.H[~free], before.H[~free])
    along = dots(before.H - y, after.limits.n)
    assert np.allclose((after.H - y)[free], (along[:, None] * after.limits.n)[free], atol=1e-12)
    assert np.abs(after.H - before.H)[free].max() > 1e-3


GAP = np.linspace(0, 6, 200)
RNG = np.random.default_rng(5)


@pytest.mark.parametrize("slab", SLABS, ids=lambda slab: slab.__name__)
def test_a_slab_leaves_room_and_the_tightest_counts(slab):  # type: ignore[no-untyped-def]
    low, high = slab(HALF_MILLIMETRE, GAP)
    lowest, largest = heights(HALF_MILLIMETRE, GAP)
    assert low.shape == high.shape == GAP.shape
    assert (low <= lowest).all()
    assert (lowest < largest).all()
    assert (largest <= high).all()
    assert (lowest >= 0).all()
    assert (largest <= HALF_MILLIMETRE.depth).all()


@pytest.mark.parametrize("wall", WALLS, ids=lambda wall: wall.__name__)
def test_a_wall_holds_what_it_may_and_its_plane_is_its_slope(wall):  # type: ignore[no-untyped-def]
    y = CAPSULE.closest_points(CAPSULE.middle + RNG.normal(size=(len(GAP), 3)) * [1, 1, 5]) + 0.1 * RNG.normal(
        size=(len(GAP), 3)
    )
    m, h = wall(HALF_MILLIMETRE, GAP, CAPSULE, y)
    assert np.allclose(np.linalg.norm(m, axis=1), 1)
    outside = (m * y).sum(1) - h
    stays = y - outside[:, None] * m
    assert np.allclose(-CAPSULE.signed_distance(stays), np.minimum(GAP, HALF_MILLIMETRE.clearance), atol=1e-9)
    for step in 1e-5 * np.eye(3):
        moved, at = wall(HALF_MILLIMETRE, GAP, CAPSULE, y + step)
        assert np.allclose(((moved * (y + step)).sum(1) - at - outside) / 1e-5, m @ step / 1e-5, atol=1e-4)


def test_a_sample_may_slide_to_where_the_level_before_is_nearer_to_the_wall(first_program):
    program = first_program()
    before, y = program.limits.before, program.x
    there = -CAPSULE.signed_distance(y)
    cut = Cut(depth=0.5, landing=float(np.median(there)))
    near = there < cut.clearance
    found = limits.limits_at(before, CAPSULE, cut, there + 1.0, y, program.s, program.t, 3)
    assert 0.4 < near.mean() < 0.6
    assert found.broken(y)[near].max() < 1e-6
    assert found.broken(y + 0.01 * found.m)[near].min() > 0.009


def test_a_new_slab_is_one_function_more(first_program, monkeypatch):
    def half(cut, gap):
        return np.full(len(gap), -np.inf), np.full(len(gap), cut.depth / 2)

    monkeypatch.setattr(limits, "SLABS", (*SLABS, half))
    one = first_program()
    y = one.x + one.R @ admm.solve(one)
    assert one.limits.at(y, 3).heights(y).max() < 0.55 * HALF_MILLIMETRE.depth


def test_a_new_wall_is_one_function_more(first_program, monkeypatch):
    free = first_program()
    top = float(free.x[:, 2].max()) + 0.1

    def ceiling(cut, gap, stock, y):
        return np.tile([0.0, 0.0, 1.0], (len(y), 1)), np.full(len(y), top)

    assert (free.x + free.R @ admm.solve(free))[:, 2].max() > top + 0.1
    monkeypatch.setattr(limits, "WALLS", (*WALLS, ceiling))
    held = first_program()
    assert (held.x + held.R @ admm.solve(held))[:, 2].max() < top + 0.02


MOVES_RNG = np.random.default_rng(4)


@pytest.mark.parametrize("energy", [*NET, *SAMPLED], ids=lambda energy: energy.__name__)
def test_its_matrices_are_those_of_a_convex_energy(given, discretisation, energy):  # type: ignore[no-untyped-def]
    found, before, free = energy(given), given.before, discretisation.free
    if isinstance(found, Quadratic):
        matrix = found.matrix
        assert found.linear.shape == (free.shape[1], 3)
    else:
        assert isinstance(found, Pulled)
        assert np.allclose(found.R @ before.control_points, found.x, atol=1e-12)
        assert np.allclose(before.evaluate(found.s, found.t), found.x, atol=1e-12)
        *_, foot, _ = closest_points_near(before, found.target, found.s, found.t, 8)
        assert np.linalg.norm(found.target - foot, axis=1).max() < HALF_MILLIMETRE.depth + 0.002
        assert CAPSULE.signed_distance(found.target).max() < -HALF_MILLIMETRE.landing + 1e-9
        assert found.weights.min() >= 0
        assert found.beyond.min() >= 1
        matrix = free.T @ found.R.T @ sp.diags_array(found.weights) @ found.R @ free
    dense = matrix.toarray()
    assert dense.shape == (free.shape[1],) * 2
    assert np.abs(dense - dense.T).max() <= 1e-12 * np.abs(dense).max()
    eigenvalues = np.linalg.eigvalsh(dense)
    assert eigenvalues[0] >= -1e-12 * eigenvalues[-1]


def test_the_gradient_is_the_slope_of_the_energy_written_out(first_program):
    one, step = first_program(), 1e-3
    D = MOVES_RNG.normal(size=one.net.linear.shape)

    def energy(length):
        moves = length * D
        net = np.einsum("ij,ij->", moves, one.net.matrix @ moves) + 2 * np.einsum("ij,ij->", one.net.linear, moves)
        return float(one.weights @ ((one.x + one.R @ moves - one.H) ** 2).sum(1) + net)

    assert np.einsum("ij,ij->", one.gradient, D) == pytest.approx((energy(step) - energy(-step)) / (4 * step), rel=1e-6)
    assert one.energy(D) == pytest.approx(energy(1.0))


def test_the_plate_is_stiffness_of_the_moves_and_bending_of_the_level(given, discretisation):
    found, M, P = plate(given), discretisation.M, given.before.control_points
    D = MOVES_RNG.normal(size=found.linear.shape)
    moves, bending = discretisation.free @ D, STEP_PARAMETERS.bending * (HALF_MILLIMETRE.depth / ROUGH) ** 2
    of_moves, after, now = (float(np.einsum("ij,ij->", net, M @ net)) for net in (moves, P + moves, P))
    value = np.einsum("ij,ij->", D, found.matrix @ D) + 2 * np.einsum("ij,ij->", found.linear, D)
    assert value == pytest.approx(STEP_PARAMETERS.stiffness * of_moves + bending * (after - now))


def test_what_is_near_the_wall_is_not_drawn_along_it(given, discretisation):
    middle = CAPSULE.start + (CAPSULE.end - CAPSULE.start) / 2
    net = middle + 1.09 * (given.before.control_points - middle)
    near, samples = (replace(given, before=discretisation.surface.with_control_points(net)), discretisation.samples)
    x = samples.R @ net
    gap, outward = -CAPSULE.signed_distance(x), CAPSULE.normals(x)
    assert gap.min() < 0.5 * HALF_MILLIMETRE.depth < 0.5 < gap.max()
    oblique = unit(outward + unit(np.cross(outward, MOVES_RNG.normal(size=3))))
    found = targets(near, x, samples.s, samples.t, samples.normals(net), oblique, np.ones(len(x)))
    way = np.linalg.norm(found - x, axis=1)
    assert (way <= np.sqrt(2) * gap + 1e-9).all()
    assert way[gap > HALF_MILLIMETRE.depth].min() > 0.4 * HALF_MILLIMETRE.depth


def test_bending_alone_takes_no_sample_farther_than_some_depths(given):
    one = given

    def with_bending(bending):
        """And how far bending alone takes samples."""
        found = program_of(
            one.discretisation, one.before.control_points, one.rest, one.cut, replace(one.parameters, bending=bending)
        )
        moves = np.linalg.solve(found.matrix.toarray(), -found.net.linear)
        return found, float(np.linalg.norm(found.R @ moves, axis=1).max())

    soft, its = with_bending(STEP_PARAMETERS.bending)
    assert np.array_equal(soft.net.linear, plate(one).linear)
    assert its < MOST_BENT * HALF_MILLIMETRE.depth
    stiff, its = with_bending(1e-2)
    assert its == pytest.approx(MOST_BENT * HALF_MILLIMETRE.depth)
    whole_pull = plate(replace(one, parameters=replace(one.parameters, bending=1e-2))).linear
    assert np.allclose(stiff.net.linear, whole_pull * (stiff.net.linear[0, 2] / whole_pull[0, 2]))


def test_a_new_energy_is_one_function_more(given, first_program, monkeypatch):
    def anchor(given):
        count = given.discretisation.free.shape[1]
        return Quadratic(sp.csc_array(1e3 * sp.eye_array(count)), np.zeros((count, 3)))

    assert np.abs(admm.solve(first_program())).max() > 0.3
    monkeypatch.setattr(program, "NET", (*NET, anchor))
    assert np.abs(admm.solve(first_program())).max() < 0.01
