"""What all energies promise, whichever are listed, and that one more in a list is part of the program."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from bonecam.arrays import unit
from bonecam.levels import program
from bonecam.levels.problem import ROUGH, Cut, Discretisation, StepParameters
from bonecam.levels.program import (
    MOST_BENT,
    NET,
    SAMPLED,
    Given,
    LevelProgram,
    Pulled,
    Quadratic,
    plate,
    program_of,
    targets,
)
from bonecam.levels.solvers import admm
from bonecam.setup.capsule import Capsule
from bonecam.surface.query import closest_points_near

RNG = np.random.default_rng(4)


@pytest.mark.parametrize("energy", [*NET, *SAMPLED], ids=lambda energy: energy.__name__)
def test_its_matrices_are_those_of_a_convex_energy(
    given: Given, discretisation: Discretisation, half_millimetre: Cut, capsule: Capsule, energy
) -> None:  # type: ignore[no-untyped-def]
    found, before, free = energy(given), given.before, discretisation.free
    if isinstance(found, Quadratic):
        matrix = found.matrix
        assert found.linear.shape == (free.shape[1], 3)
    else:
        assert isinstance(found, Pulled)
        assert np.allclose(found.R @ before.control_points, found.x, atol=1e-12)
        assert np.allclose(before.evaluate(found.s, found.t), found.x, atol=1e-12)
        *_, foot, _ = closest_points_near(before, found.target, found.s, found.t, 8)
        assert np.linalg.norm(found.target - foot, axis=1).max() < half_millimetre.depth + 0.002
        assert capsule.signed_distance(found.target).max() < -half_millimetre.landing + 1e-9
        assert found.weights.min() >= 0
        assert found.beyond.min() >= 1
        matrix = free.T @ found.R.T @ sp.diags_array(found.weights) @ found.R @ free
    dense = matrix.toarray()
    assert dense.shape == (free.shape[1],) * 2
    assert np.abs(dense - dense.T).max() <= 1e-12 * np.abs(dense).max()
    eigenvalues = np.linalg.eigvalsh(dense)
    assert eigenvalues[0] >= -1e-12 * eigenvalues[-1]


def test_the_gradient_is_the_slope_of_the_energy_written_out(first_program: Callable[[], LevelProgram]) -> None:
    one, step = first_program(), 1e-3
    D = RNG.normal(size=one.net.linear.shape)

    def energy(length: float) -> float:
        moves = length * D
        net = np.einsum("ij,ij->", moves, one.net.matrix @ moves) + 2 * np.einsum("ij,ij->", one.net.linear, moves)
        return float(one.weights @ ((one.x + one.R @ moves - one.H) ** 2).sum(1) + net)

    assert np.einsum("ij,ij->", one.gradient, D) == pytest.approx((energy(step) - energy(-step)) / (4 * step), rel=1e-6)
    assert one.energy(D) == pytest.approx(energy(1.0))


def test_the_plate_is_stiffness_of_the_moves_and_bending_of_the_level(
    given: Given, discretisation: Discretisation, step_parameters: StepParameters, half_millimetre: Cut
) -> None:
    found, M, P = plate(given), discretisation.M, given.before.control_points
    D = RNG.normal(size=found.linear.shape)
    moves, bending = discretisation.free @ D, step_parameters.bending * (half_millimetre.depth / ROUGH) ** 2
    of_moves, after, now = (float(np.einsum("ij,ij->", net, M @ net)) for net in (moves, P + moves, P))
    value = np.einsum("ij,ij->", D, found.matrix @ D) + 2 * np.einsum("ij,ij->", found.linear, D)
    assert value == pytest.approx(step_parameters.stiffness * of_moves + bending * (after - now))


def test_what_is_near_the_wall_is_not_drawn_along_it(
    capsule: Capsule, given: Given, discretisation: Discretisation, half_millimetre: Cut
) -> None:
    middle = capsule.start + (capsule.end - capsule.start) / 2
    net = middle + 1.09 * (given.before.control_points - middle)
    near, samples = (replace(given, before=discretisation.surface.with_control_points(net)), discretisation.samples)
    x = samples.R @ net
    gap, outward = -capsule.signed_distance(x), capsule.normals(x)
    assert gap.min() < 0.5 * half_millimetre.depth < 0.5 < gap.max()
    oblique = unit(outward + unit(np.cross(outward, RNG.normal(size=3))))
    found = targets(near, x, samples.s, samples.t, samples.normals(net), oblique, np.ones(len(x)))
    way = np.linalg.norm(found - x, axis=1)
    assert (way <= np.sqrt(2) * gap + 1e-9).all()
    assert way[gap > half_millimetre.depth].min() > 0.4 * half_millimetre.depth


def test_bending_alone_takes_no_sample_farther_than_some_depths(
    given: Given, step_parameters: StepParameters, half_millimetre: Cut
) -> None:
    one = given

    def with_bending(bending: float) -> tuple[LevelProgram, float]:
        """And how far bending alone takes samples."""
        found = program_of(
            one.discretisation, one.before.control_points, one.rest, one.cut, replace(one.parameters, bending=bending)
        )
        moves = np.linalg.solve(found.matrix.toarray(), -found.net.linear)
        return found, float(np.linalg.norm(found.R @ moves, axis=1).max())

    soft, its = with_bending(step_parameters.bending)
    assert np.array_equal(soft.net.linear, plate(one).linear)
    assert its < MOST_BENT * half_millimetre.depth
    stiff, its = with_bending(1e-2)
    assert its == pytest.approx(MOST_BENT * half_millimetre.depth)
    whole_pull = plate(replace(one, parameters=replace(one.parameters, bending=1e-2))).linear
    assert np.allclose(stiff.net.linear, whole_pull * (stiff.net.linear[0, 2] / whole_pull[0, 2]))


def test_a_new_energy_is_one_function_more(
    given: Given, first_program: Callable[[], LevelProgram], monkeypatch: pytest.MonkeyPatch
) -> None:
    def anchor(given: Given) -> Quadratic:
        count = given.discretisation.free.shape[1]
        return Quadratic(sp.csc_array(1e3 * sp.eye_array(count)), np.zeros((count, 3)))

    assert np.abs(admm.solve(first_program())).max() > 0.3
    monkeypatch.setattr(program, "NET", (*NET, anchor))
    assert np.abs(admm.solve(first_program())).max() < 0.01
