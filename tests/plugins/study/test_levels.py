"""The published program, solved exactly, and the default method beside it."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sp
from bonecam_plugins.study.levels import Cones, Planes, PublishedProgram, next_moves, published_sequence, solve_cones
from level_parts import CAPSULE, SCHEDULE, waisted

from bonecam.errors import LevelError
from bonecam.levels import StockLevel, morph
from bonecam.levels.measure import NO_CUT, Rules
from bonecam.levels.problem import DEPTH_TOLERANCE
from bonecam.mesh import TriangleMesh
from bonecam.progress import silent
from bonecam.report import levels_report
from bonecam.report.summary import certified_text
from bonecam.setup import Cylinder, Schedule

pytestmark = pytest.mark.whole

STIFFNESS = 1e-7


def none(count: int) -> Planes:
    return Planes(sp.csr_array((0, count)), np.zeros((0, 3)), np.zeros(0))


def test_a_ball_holds_the_move_at_its_radius():
    E, pull = sp.csc_array(sp.eye_array(2)), np.array([[-3.0, -4.0, 0.0], [0.1, 0.0, 0.0]])
    balls = Cones(sp.eye_array(2, format="csr"), np.zeros((2, 3)), np.ones(2))
    assert np.allclose(solve_cones(E, pull, (balls,), none(2)), [[0.6, 0.8, 0], [-0.1, 0, 0]], atol=1e-4)


def test_a_capsule_holds_the_move_at_the_nearest_axis_point():
    E, pull = sp.csc_array(sp.eye_array(1)), np.array([[-5.0, 0.0, -2.0]])
    wall = Cones(sp.eye_array(1, format="csr"), np.zeros((1, 3)), np.ones(1), np.array([0.0, 0.0, 10.0]))
    assert np.allclose(solve_cones(E, pull, (wall,), none(1)), [[1, 0, 2]], atol=1e-4)


def test_contradicting_limits_are_an_error():
    ball = Cones(sp.eye_array(1, format="csr"), np.zeros((1, 3)), np.ones(1))
    away = Planes(sp.eye_array(1, format="csr"), np.array([[1.0, 0, 0]]), np.array([-2.0]))
    with pytest.raises(LevelError, match="ends as"):
        solve_cones(sp.csc_array(sp.eye_array(1)), np.zeros((1, 3)), (ball,), away)


def test_a_stock_that_is_no_capsule_is_held_by_planes():
    stock = Cylinder(3.3, 0.7, 19.3).round_edges(1.0)
    surface, program = waisted(), PublishedProgram(waisted(), stock, "stock")
    P = np.array(surface.control_points)
    moves = next_moves(program, P, 0.5, STIFFNESS)
    rng = np.random.default_rng(3)
    R = surface.basis(rng.random(3000), rng.random(3000))[0]
    assert stock.signed_distance(R @ (P + moves)).max() <= 0.001
    assert stock.signed_distance(R @ (P + moves)).max() > -0.05
    assert np.linalg.norm(R @ moves, axis=1).max() <= 0.506


@pytest.mark.parametrize("attraction", ["stock", "sphere"])
def test_the_exact_level_keeps_the_published_limits(attraction):
    surface, program = waisted(), PublishedProgram(waisted(), CAPSULE, attraction)
    P = np.array(surface.control_points)
    moves = next_moves(program, P, 0.5, STIFFNESS)
    rng = np.random.default_rng(3)
    R = surface.basis(rng.random(3000), rng.random(3000))[0]
    assert np.linalg.norm(R @ moves, axis=1).max() <= 0.503
    assert CAPSULE.signed_distance(R @ (P + moves)).max() <= 0.001
    hull = next_moves(PublishedProgram(waisted(), CAPSULE, attraction, hull=True), P, 0.5, STIFFNESS)
    assert np.linalg.norm(hull, axis=1).max() <= 0.5 + 1e-5
    assert (
        program.energy(P, moves, STIFFNESS)
        <= program.energy(P, hull, STIFFNESS)
        < program.energy(P, 0 * moves, STIFFNESS)
    )


@pytest.mark.parametrize("attraction", ["stock", "sphere"])
def test_the_default_method_comes_within_one_percent_of_the_exact_energy(attraction, monkeypatch):
    """Of the published energy, for the depth held on the control points and solved exactly, from each of the
    first levels to the next."""
    # What is measured on the finished levels does not matter here: no level is moved for it.
    monkeypatch.setattr(Rules, "violations", lambda *_, **__: [])
    made = morph(waisted(), CAPSULE, SCHEDULE, attraction=attraction, chord_tolerance=0.05)
    nets = [level.surface.control_points for level in made.levels if level.surface is not None]
    program = PublishedProgram(waisted(), CAPSULE, attraction, hull=True)
    for k, (before, after) in enumerate(pairwise(nets[:5]), start=1):
        exact = program.energy(before, next_moves(program, before, SCHEDULE.limit(k), STIFFNESS), STIFFNESS)
        assert program.energy(before, after - before, STIFFNESS) <= 1.01 * exact


def test_as_printed_the_program_forgets_nesting_and_what_lies_between_its_samples():
    P = np.array(waisted().control_points)
    ours, printed = (PublishedProgram(waisted(), CAPSULE, "sphere", printed=printed) for printed in (False, True))
    moves = next_moves(printed, P, 0.5, STIFFNESS)
    assert printed.energy(P, moves, STIFFNESS) < ours.energy(P, next_moves(ours, P, 0.5, STIFFNESS), STIFFNESS)
    rng = np.random.default_rng(3)
    R = waisted().basis(rng.random(3000), rng.random(3000))[0]
    assert 0.5 < np.linalg.norm(R @ moves, axis=1).max() < 0.6


def test_the_method_has_the_default_ones_interface():
    made = morph(waisted(rows=8, around=6), CAPSULE, Schedule((), 0.8), method="qcqp", chord_tolerance=0.05)
    assert made.lower_bound <= made.cuts <= made.lower_bound + 2
    assert all(level.depth_max <= level.limit + 0.002 for level in made.levels[1:])


def test_the_printed_program_is_a_choice_whose_broken_limits_are_told():
    surface = waisted(rows=8, around=6)
    made = morph(surface, CAPSULE, Schedule((), 0.8), method="published", chord_tolerance=0.05)
    over = max(level.deepest - level.limit for level in made.levels[1:])
    behind = max(-level.nesting_min for level in made.levels[1:])
    assert made.breaks >= max(over, behind) > 0.02, "what qcqp does not allow"


class Unmeetable(PublishedProgram):
    """The published program with a limit at one sample that no move meets."""

    sample, excess = 7, 0.01

    def broken(self, P: np.ndarray, moves: np.ndarray, depth: float) -> tuple[np.ndarray, np.ndarray]:
        broken, outside = super().broken(P, moves, depth)
        broken[self.sample] = self.excess
        return broken, outside


class NearlyMet(Unmeetable):
    """A limit that is left broken by less than the check of levels allows: a level of a bone that is drawn to its
    bounding sphere was left at 0.0014 mm after all rounds."""

    excess = 0.0014


def test_a_level_that_leaves_its_limits_is_told_with_its_place(monkeypatch):
    monkeypatch.setattr("bonecam_plugins.study.levels.PublishedProgram", Unmeetable)
    with pytest.raises(
        LevelError,
        match=r"^level 1: .* limits by 0\.0100 mm at \(.*\) after \d+ rounds: raise surface\.max_control_points$",
    ) as caught:
        morph(waisted(), CAPSULE, SCHEDULE, method="qcqp", attraction="sphere", chord_tolerance=0.05)
    assert caught.value.evidence["level"] == 1
    assert waisted().project(caught.value.evidence["place"][None]).distances[0] <= SCHEDULE.reach(1) + 0.01


def test_a_level_within_what_is_measured_as_sound_is_taken():
    program = NearlyMet(waisted(), CAPSULE, "sphere")
    P = np.array(waisted().control_points)
    broken, _ = program.broken(P, next_moves(program, P, 0.5, STIFFNESS), 0.5)
    assert broken.max() <= DEPTH_TOLERANCE


def test_levels_that_get_no_nearer_end_soon_and_tell_another_attraction(monkeypatch):
    def outwards(program, P, depth, stiffness):
        return depth * P / np.linalg.norm(P, axis=1, keepdims=True)

    monkeypatch.setattr("bonecam_plugins.study.levels.next_moves", outwards)
    monkeypatch.setattr("bonecam_plugins.study.levels.distance_left", lambda level, targets: (3.0, targets[0]))
    program = PublishedProgram(waisted(), CAPSULE, "sphere")
    with pytest.raises(
        LevelError,
        match=r"^level 11 gets no nearer to the stock than 3\.000 mm at .*, or take levels\.attraction stock$",
    ):
        published_sequence(program, waisted(), SCHEDULE, STIFFNESS, silent)


def test_why_its_levels_have_no_certificate_is_told():
    mesh = TriangleMesh(np.eye(3), np.array([[0, 1, 2]], dtype=np.int32))
    rows = levels_report([StockLevel(k, mesh, 0.5, NO_CUT) for k in range(3)])
    why = "levels by qcqp may fall 0.02 mm behind one another, more than the 0.001 mm of a certificate"
    assert certified_text(rows, "qcqp") == f"nothing on 2 cuts: {why}"


def test_an_unknown_method_is_refused():
    with pytest.raises(ValueError, match="choose one of qp, qcqp, published"):
        morph(waisted(), CAPSULE, SCHEDULE, method="magic")


def test_an_attraction_the_paper_has_not_is_refused():
    with pytest.raises(ValueError, match="choose one of"):
        PublishedProgram(waisted(), CAPSULE, "nearest")
