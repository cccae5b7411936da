"""The loop of all sequences ends below the stock, and where it does not get there with the level and the place.

Levels that are mended move as little as keeps their limits, and go on to the stock where that took them
away from it.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from level_parts import CAPSULE, SCHEDULE, waisted

from bonecam.errors import LevelError
from bonecam.levels.certificates import certify_last_cut
from bonecam.levels.measure import Rules, excess_bound, inspect, trouble
from bonecam.levels.problem import ATTRACTIONS, DEPTH_TOLERANCE, StepParameters, creases, discretise, remaining, whole
from bonecam.levels.sequences import (
    LANDING,
    MOST_CREEP,
    RESTORED_MARGIN,
    SequenceMaker,
    Stop,
    _runs,
    levels_to_stock,
    restore_certificates,
    restore_feasibility,
)
from bonecam.levels.solvers.exchange import project_level
from bonecam.progress import silent

STOP = Stop("mend it", max_stalled=2, most=20)


@dataclass(frozen=True)
class Rest:
    """A level is a height here, below a stock 2 mm high."""

    left: float
    place: np.ndarray


def rest_above(level: float, k: int = 0, before: Rest | None = None) -> Rest:
    return Rest(2.0 - level, np.array([0.0, 0.0, level]))


def climb(share: float, stop: Stop = STOP, least: int = 0) -> list[float]:
    """Heights of levels that use this share of their depth."""
    return levels_to_stock(
        [0.0],
        rest_above(0.0),
        SCHEDULE,
        lambda height, k, rest: height + min(share * SCHEDULE.limit(k), rest.left),
        rest_above,
        stop,
        silent,
        lower_bound=6,
        least=least,
    )


def test_levels_are_made_until_less_than_one_depth_is_left():
    assert climb(1.0) == pytest.approx([0.0, 0.1, 0.2, 0.7, 1.2, 1.7])
    assert len(climb(0.5)) > 6


def test_more_levels_are_made_where_so_many_are_asked_for():
    assert len(climb(1.0, least=7)) == 7


def test_levels_that_stall_in_turn_are_an_error_with_level_and_place():
    with pytest.raises(
        LevelError, match=r"^level 3 gets no nearer to the stock than 1\.930 mm at \(.*\): mend it$"
    ) as error:
        climb(0.1)
    assert error.value.evidence["level"] == 3
    assert error.value.evidence["place"][2] == pytest.approx(0.07)


def test_more_levels_than_allowed_are_an_error():
    with pytest.raises(LevelError, match=r"^level 4 gets no nearer"):
        climb(0.5, Stop("mend it", most=4))


@pytest.mark.parametrize("evidence", [{}, {"level": 1}])
def test_the_error_of_a_level_that_cannot_be_made_has_its_number(evidence):
    def fail(height, k, rest):
        raise LevelError("no answer", **evidence)

    with pytest.raises(LevelError, match="no answer") as error:
        levels_to_stock([0.0], rest_above(0.0), SCHEDULE, fail, rest_above, STOP, silent, lower_bound=6)
    assert error.value.evidence["level"] == 1
    assert str(error.value).startswith("level 1: ") == (not evidence)


STIFFNESS = 5e-7
PARAMETERS = StepParameters(STIFFNESS, bending=3e-7, uniform=3.0)


@pytest.fixture(scope="module")
def maker():
    discretisation = discretise(waisted(), CAPSULE, ATTRACTIONS["stock"])
    around = whole(CAPSULE)
    rest = remaining(discretisation, discretisation.surface.control_points, around)
    return SequenceMaker(discretisation, around, SCHEDULE, SCHEDULE.lower_bound(rest.left), silent, "admm", STIFFNESS)


@pytest.fixture(scope="module")
def made(maker):
    discretisation = maker.discretisation
    return maker.sequence(PARAMETERS, remaining(discretisation, discretisation.surface.control_points, whole(CAPSULE)))


def unwatched(made: list[np.ndarray]) -> dict[int, np.ndarray]:
    return {k: np.empty((0, 2)) for k in range(len(made))}


def test_mended_levels_keep_their_limits_and_move_little(maker, made):
    discretisation, spoilt = maker.discretisation, [*made]
    spoilt[3] = made[2] + 1.02 * (made[3] - made[2])
    mended, moved = maker.restore_limits(spoilt, {3}, (), unwatched(made))
    assert 3 in moved
    assert all(np.array_equal(mended[k], spoilt[k]) for k in range(len(made)) if k not in moved)
    assert max(np.linalg.norm(discretisation.watch.R @ (mended[k] - spoilt[k]), axis=1).max() for k in moved) < 0.1
    assert all(
        project_level(discretisation, mended[k - 1], mended[k], replace(maker.cut(k), margin=RESTORED_MARGIN)).broken
        < 0.001
        for k in moved
    )


def test_levels_above_a_mended_one_follow_less_and_less(maker, made):
    """What a level goes back for its depth those above need not all, within their margins."""
    spoilt = [*made]
    spoilt[3] = made[2] + 1.005 * (made[3] - made[2])
    _, moved = maker.restore_limits(spoilt, {3}, (), unwatched(made))
    assert moved == list(range(3, 3 + len(moved)))
    assert len(moved) < len(made) - 4


def test_a_folded_level_starts_again_midway(maker, made):
    discretisation, spoilt = maker.discretisation, [*made]
    some = np.arange(len(made[3])) % 7 == 3
    spoilt[3] = made[3] + 4.0 * some[:, None] * np.array([0.0, 0.0, 1.0])
    mended, moved = maker.restore_limits(spoilt, {3}, {3}, unwatched(made))
    assert 3 in moved
    assert np.linalg.norm(discretisation.watch.R @ (mended[3] - (made[2] + made[4]) / 2), axis=1).max() < 0.05


@pytest.fixture
def spoilt(maker, made):
    """Level 3 is too deep, and measured."""
    levels = [*made]
    levels[3] = made[2] + 1.02 * (made[3] - made[2])
    return levels, inspect(maker.discretisation.surface, levels, Rules(CAPSULE, SCHEDULE, 0.001, 0.001, 0.02), silent)


def test_what_is_mended_is_measured_again(maker, spoilt):
    _, inspection = spoilt
    assert trouble(inspection.levels[3:5], doubts=False) > (0, 0.005)
    inspection = restore_feasibility(inspection, maker)
    assert trouble(inspection.levels[3:5], doubts=False) < (0, DEPTH_TOLERANCE)
    assert {3, 4}.isdisjoint(level.index for level in inspection.failed)


@pytest.mark.parametrize(("out", "mended"), [(0.006, True), (0.03, False)])
def test_most_levels_are_mended_only_where_all_break_little(maker, made, out, mended):
    """Of three levels two go `out` mm farther than they may."""
    moves = np.diff(made, axis=0)
    moves *= out / np.linalg.norm(moves, axis=2).max(axis=1)[:, None, None]
    levels = [made[0], *(level + k % 3 * move for k, (level, move) in enumerate(zip(made[1:], moves), start=1))]
    inspection = inspect(maker.discretisation.surface, levels, Rules(CAPSULE, SCHEDULE, 0.001, 0.001, 0.02), silent)
    failed = len(inspection.failed)
    assert failed > len(levels) / 2
    inspection = restore_feasibility(inspection, maker)
    assert len(inspection.failed) <= failed / 4 if mended else len(inspection.failed) == failed


def test_levels_above_a_mended_one_follow_or_stay(maker, spoilt):
    levels, inspection = spoilt
    which = {level.index for level in inspection.failed}
    alone, followed = (
        maker.restore_limits(levels, {min(which)}, (), unwatched(levels), follow=follow)[1] for follow in (False, True)
    )
    assert alone == [min(which)]
    assert followed[0] == min(which)
    assert len(followed) > 1


def test_what_is_no_better_mended_stays_as_it_was(maker, spoilt, monkeypatch):
    levels, inspection = spoilt
    before = trouble(inspection.levels[1:], doubts=False)

    def worse(self, made, *_, **__):
        return [*made[:3], made[2] + 1.1 * (made[3] - made[2]), *made[4:-1], 1.5 * made[-1] - 0.5 * made[-2]], [
            3,
            len(made) - 1,
        ]

    monkeypatch.setattr(SequenceMaker, "restore_limits", worse)
    inspection = restore_feasibility(inspection, maker)
    assert trouble(inspection.levels[1:], doubts=False) == before
    for level, net in zip(inspection.levels, levels):
        assert level.surface is not None
        assert np.array_equal(level.surface.control_points, net)
    assert len(inspection.levels) == len(levels) + 1


def test_a_slit_that_the_points_measured_missed_takes_one_more_level(maker, made):
    inspection = inspect(
        maker.discretisation.surface,
        maker.restore_limits(made, {5}, (), unwatched(made))[0],
        Rules(CAPSULE, SCHEDULE, 0.01, 0.001, 0.02),
        silent,
    )
    assert not inspection.failed
    last = inspection.levels[-1]
    sure = certify_last_cut(inspection.levels[-2].surface, CAPSULE, last.limit)
    deep = replace(last, certificate=replace(sure, depth=last.limit + 0.05))
    inspection = replace(inspection, levels=(*inspection.levels[:-1], deep))
    again = restore_certificates(inspection, maker)
    assert len(again.levels) == len(made) + 2
    assert excess_bound(again.levels[-1]) < 0.01
    assert not again.failed


def test_a_last_cut_that_is_measured_too_deep_takes_one_more_level(maker, made):
    levels = maker.restore_limits(made, {5}, (), unwatched(made))[0][:-1]
    inspection = inspect(maker.discretisation.surface, levels, Rules(CAPSULE, SCHEDULE, 0.01, 0.001, 0.02), silent)
    assert [level.index for level in inspection.failed] == [len(levels)]
    again = restore_certificates(inspection, maker)
    assert len(again.levels) == len(levels) + 2
    assert not again.failed


@pytest.mark.parametrize(("flat", "sharp"), [(1.0, False), (0.1, True)], ids=["round", "sharp"])
def test_a_broken_limit_names_the_edge_that_the_part_follows_there(maker, flat, sharp):
    """A flat part has an edge along each side, of which the radius is its curvature's."""
    part = waisted().with_control_points(waisted().control_points * [1.0, flat, 1.0])
    place = part.positions(np.array([0.0]), np.array([0.5]))[0]
    discretisation = discretise(part, CAPSULE, ATTRACTIONS["stock"])
    step = replace(
        project_level(discretisation, part.control_points, part.control_points, maker.cut(1)), broken=0.05, place=place
    )
    message = str(replace(maker, discretisation=discretisation)._broken(1, step))
    assert message.endswith("smooth the mesh" if sharp else "give more control points or a larger stock")
    if sharp:
        found = part.curvature(np.linspace(-0.05, 0.05, 41) % 1, np.full(41, 0.5))
        radius = float(message.partition("a radius of ")[2].partition(" mm")[0])
        assert 0.3 < radius * np.abs([found.k1, found.k2]).max() <= 1.1


def test_runs_are_numbers_that_follow_each_other():
    assert _runs([]) == []
    assert _runs([4]) == [(4, 4)]
    assert _runs([1, 2, 3, 7, 9, 10]) == [(1, 3), (7, 7), (9, 10)]


def test_the_landing_creeps_outwards_and_not_from_far(maker):
    for lower_bound in (1, 2, 16, 40, 100):
        some = replace(maker, lower_bound=lower_bound)
        landings = np.array([some.cut(k).landing for k in range(1, lower_bound + 1)])
        assert (np.diff(landings[:-1]) < 0).all()
        assert landings.max() <= LANDING + MOST_CREEP
        assert landings.min() >= LANDING


def test_levels_that_end_too_early_go_on_to_the_stock(maker, made):
    assert len(maker.onward(made)) == len(made)
    longer = maker.onward(made[:-2])
    left = remaining(maker.discretisation, longer[-1], whole(CAPSULE)).left
    assert len(longer) >= len(made) - 1
    assert left <= SCHEDULE.limit(len(longer))
    assert all(np.array_equal(a, b) for a, b in zip(longer, made[:-2]))


def test_places_that_bend_more_than_before_or_are_hollow_are_watched(maker):
    """What moves as it is needs few places between those of the even pattern; a groove needs many, on the
    level before as well."""
    surface, pattern = maker.discretisation.surface, maker.discretisation.watch
    starts, row = surface.tmesh.row_starts, len(surface.tmesh.row_starts) // 2
    grooved = np.array(surface.control_points)
    grooved[starts[row] : starts[row + 1], :2] *= 0.5
    low, high = surface.tmesh.t_knots[[row, row + 4]]

    def between(level, before):
        t = creases(pattern, level, before)[:, 1]
        places = maker.discretisation.watched(level, before)
        assert len(places.s) == places.R.shape[0] == len(pattern.s) + len(t)
        return int(((low < t) & (t < high)).sum())

    flat = surface.control_points
    assert 1.3 * between(1.2 * flat, flat) < between(1.2 * grooved, grooved)
    assert 1.3 * between(1.2 * grooved, grooved) < between(grooved, flat)
