"""One level's program: what ADMM solves is what OSQP and a cone solver find, and its limits are
distances.

The quadratic program's answer obeys its rows, and contradictory rows are an error.

The solvers beside the default are reached from a job and lead to a verified program.
"""

from dataclasses import replace
from functools import cache

import clarabel
import numpy as np
import pytest
import scipy.sparse as sp
from bonecam_meshes import path as shipped
from level_parts import CAPSULE, HALF_MILLIMETRE, STEP_PARAMETERS, waisted

import bonecam
from bonecam.errors import LevelError
from bonecam.job import Job
from bonecam.levels.open_morph import body_surfaces
from bonecam.levels.problem import remaining, whole
from bonecam.levels.program import LevelProgram, LinearLimits, program_of
from bonecam.levels.solvers import admm
from bonecam.levels.solvers.exchange import next_level
from bonecam.levels.solvers.osqp import solve_qp
from bonecam.levels.solvers.solver import SOLVERS
from bonecam.mesh import read_mesh
from bonecam.plugins import added_names
from bonecam.setup import Capsule
from bonecam.surface.query import closest_points_near


@pytest.fixture(scope="module")
def program(discretisation):
    """Sets up the program of the level after this many."""

    @cache
    def set_up(levels):
        P = np.array(discretisation.surface.control_points)
        rest = remaining(discretisation, P, whole(CAPSULE))
        for _ in range(levels):
            P = P + next_level(discretisation, P, rest, HALF_MILLIMETRE, STEP_PARAMETERS).moves
            rest = remaining(discretisation, P, rest)
        return program_of(discretisation, P, rest, HALF_MILLIMETRE, STEP_PARAMETERS)

    return set_up


@pytest.mark.parametrize("levels", [0, 1, 2])
def test_the_energy_is_within_one_percent_of_the_reference(program, levels):
    """The same linear limits for both: ADMM does not set them up again here."""
    one = program(levels)
    ours = admm.solve(one, set_up_every=10**6)
    assert one.energy(ours) == pytest.approx(one.energy(exact(one)), rel=0.01)
    assert one.limits.broken(one.x + one.R @ ours).max() < 0.02 * HALF_MILLIMETRE.depth


@pytest.mark.parametrize("levels", [0, 1, 2])
def test_so_is_it_where_limits_and_targets_are_set_up_again(program, levels):
    """Where the samples came to. (Level 4 is the last below the stock, and has next to nothing to move.)"""
    one = program(levels)
    there = one.at(ours := admm.solve(one))
    assert there.energy(ours) == pytest.approx(there.energy(exact(there)), rel=0.01)


def exact(one: LevelProgram) -> np.ndarray:
    """Clarabel's moves for the program's limits as they are set up."""
    rows = one.limits.rows(one.R, one.x)
    A = sp.csr_array(sp.vstack([rows.A, -rows.A]))
    b = np.concatenate([rows.high, -rows.low])
    kept = np.isfinite(b)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    P = sp.csc_matrix(sp.triu(sp.block_diag([one.matrix] * 3), format="csc"))
    cones = [clarabel.NonnegativeConeT(int(kept.sum()))]
    answer = clarabel.DefaultSolver(P, one.gradient.T.ravel(), sp.csc_matrix(A[kept]), b[kept], cones, settings).solve()
    return np.array(answer.x).reshape(3, -1).T


def test_osqp_finds_the_same_optimum(program):
    one = program(1)
    rows = one.limits.rows(one.R, one.x)
    found = solve_qp(sp.csc_array(sp.block_diag([one.matrix] * 3)), one.gradient.T.ravel(), rows, 1e-5).reshape(3, -1).T
    assert one.energy(found) == pytest.approx(one.energy(admm.solve(one, set_up_every=10**6)), rel=0.01)


def test_what_is_left_broken_is_projected_away(discretisation):
    P = np.array(discretisation.surface.control_points)
    rest = remaining(discretisation, P, whole(CAPSULE))
    for k in range(4):
        step = next_level(
            discretisation,
            P,
            rest,
            replace(HALF_MILLIMETRE, landing=HALF_MILLIMETRE.landing + 0.01 * (4 - k)),
            STEP_PARAMETERS,
        )
        assert step.broken < 0.001
        assert not step.infeasible.any()
        P = P + step.moves
        rest = remaining(discretisation, P, rest)


def test_feet_are_nearest_places():
    surface = waisted()
    rng = np.random.default_rng(2)
    s, t = rng.random(300), rng.uniform(0.02, 0.98, 300)
    points = surface.evaluate(s, t) + 0.3 * surface.normals(s, t)
    found_s, found_t, foot, normals = closest_points_near(surface, points, s + 0.01, np.clip(t + 0.01, 0, 1), 8)
    assert np.allclose(surface.evaluate(found_s, found_t), foot, atol=1e-12)
    assert np.abs(np.linalg.norm(points - foot, axis=1) - 0.3).max() < 1e-3
    assert np.einsum("ij,ij->i", points - foot, normals).min() > 0
    others = rng.permutation(300)  # each is sought first in the element of the one before
    again = closest_points_near(surface, points[others], s[others] + 0.01, np.clip(t[others] + 0.01, 0, 1), 8)
    assert all(np.array_equal(a, b[others]) for a, b in zip(again, (found_s, found_t, foot, normals)))


def test_feet_are_found_from_farther_off_than_the_radius_of_curvature():
    thin = body_surfaces([Capsule(np.zeros(3), np.array([0.0, 0.0, 20.0]), 1.0)])[0]
    rng = np.random.default_rng(4)
    s, t = rng.random(300), rng.uniform(0.3, 0.7, 300)
    points = thin.evaluate(s, t) + 2.0 * thin.normals(s, t)
    _, _, foot, _ = closest_points_near(thin, points, s + 0.02, t, 3)
    assert np.abs(np.linalg.norm(points - foot, axis=1) - 2.0).max() < 1e-3


def test_feet_reach_the_poles():
    """On a part so large that the rings from which Newton goes no farther are 0.5 mm wide."""
    large = waisted()
    large = large.with_control_points(100 * large.control_points)
    rng = np.random.default_rng(5)
    s, within = rng.random(100), 1e-4 * rng.random(100)
    for out, t in ((-1.0, within), (1.0, 1 - within)):
        points = large.positions(s, t) + np.array([0.0, 0.0, 0.01 * out])
        _, found_t, foot, normals = closest_points_near(large, points, s, t, 8)
        assert np.abs(np.linalg.norm(points - foot, axis=1) - 0.01).max() < 0.004
        assert np.abs(found_t - t).max() < 1e-5
        assert (out * normals[:, 2] > 0.99).all()


def test_the_way_to_a_foot_ends_at_a_place_that_is_near_enough():
    surface = waisted()
    rng = np.random.default_rng(3)
    s, t = rng.random(300), rng.uniform(0.02, 0.98, 300)
    points = surface.evaluate(s, t) + 0.3 * surface.normals(s, t)
    start = points, s + 0.01, np.clip(t + 0.01, 0, 1)
    away = [
        np.linalg.norm(points - closest_points_near(surface, *start, 8, enough)[2], axis=1)
        for enough in (None, np.full(300, 0.31), np.full(300, 0.2))
    ]
    assert (away[1] <= 0.31).all()
    assert (away[1] > away[0] + 1e-4).sum() > 30
    assert np.array_equal(away[2], away[0])


def rows(A: np.ndarray, low: list[float], high: list[float]) -> LinearLimits:
    return LinearLimits(sp.csr_array(A), np.array(low, dtype=float), np.array(high, dtype=float))


def test_the_answer_is_the_nearest_point_of_the_box():
    found = solve_qp(sp.csc_array(sp.eye_array(2)), np.array([-3.0, -0.25]), rows(np.eye(2), [0, 0], [1, 1]), 1e-6)
    assert np.allclose(found, [1, 0.25], atol=1e-4)
    assert ((found > -1e-4) & (found < 1 + 1e-4)).all()


BOX_AND_PLANE = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])


def test_all_rows_hold_together():
    limits = rows(BOX_AND_PLANE, [0, 0, -np.inf], [1, 1, 1])
    found = solve_qp(sp.csc_array(sp.eye_array(2)), np.array([-3.0, -3.0]), limits, 1e-6)
    assert np.allclose(found, [0.5, 0.5], atol=1e-4)


def test_contradicting_rows_are_an_error():
    limits = rows(BOX_AND_PLANE, [0, 0, 5], [1, 1, np.inf])
    with pytest.raises(LevelError, match="contradict"):
        solve_qp(sp.csc_array(sp.eye_array(2)), np.zeros(2), limits, 1e-6)


COARSE = Job().with_values(
    mechanics={"refuse": False},
    mesh={"rows": 8},
    surface={"tolerance": 0.5, "largest_deviation": 1.0, "max_control_points": 60},
    holding={"diameter": 4.0, "length": 110.0},
    path={"orientation": "lead"},
    levels={"finishing_levels": 1, "finishing_depth": 0.5, "roughing_depth": 1.5, "chord_tolerance": 0.05},
    roughing={"preset": "ball-4", "scallop": 0.4},
    finishing={"radius": 2.0, "flute_length": 8.0, "shank_diameter": 4.0, "scallop": 0.4},
)


@pytest.mark.whole
@pytest.mark.parametrize("solver", sorted({*SOLVERS, *added_names("solvers")} - {"admm"}))
def test_a_reference_solver_leads_to_a_verified_program(solver, monkeypatch):
    """On the phalanx at half its size, without certificates: those of levels as coarse as these take longer than all
    the rest."""
    monkeypatch.setattr("bonecam.levels.measure.certifiable", lambda surface: False)
    job = COARSE.with_values(levels={"solver": solver})
    whole = read_mesh(shipped("phalanx"))
    result = bonecam.convert((0.5 * whole.vertices, whole.faces), job, simulation=False)
    assert result.program.text
    report = result.report
    assert report["nc"]["gouge_max_mm"] <= 0.01
    assert len(report["levels"]) - 1 <= report["levels_lower_bound"] + 1
    assert all(row["depth_max_mm"] <= row["limit_mm"] + 0.002 for row in report["levels"][1:])
