"""Levels that are mended move as little as keeps their limits, and go on to the stock where that took them away from it."""

import numpy as np
import pytest
from test_morph import SCHEDULE, STOCK, waisted

from bonecam.levels.attraction import ATTRACTIONS
from bonecam.levels.cut import Manner
from bonecam.levels.remaining import remaining, whole
from bonecam.levels.samples import creases
from bonecam.levels.sequence import Sequences
from bonecam.levels.setting import setting_of
from bonecam.levels.step import kept_level
from bonecam.progress import silent

STIFFNESS = 5e-7
MANNER = Manner(STIFFNESS, bending=3e-7, smoothing=1e-4, haste=1.0, late=1.0, beyond=2.0, even=3.0)


@pytest.fixture(scope="module")
def making() -> Sequences:
    setting = setting_of(waisted(), STOCK, ATTRACTIONS["stock"])
    rest = remaining(setting, setting.surface.control_points, whole(STOCK))
    return Sequences(setting, SCHEDULE, SCHEDULE.lower_bound(rest.left), silent, "qp", STIFFNESS)


@pytest.fixture(scope="module")
def made(making: Sequences) -> list[np.ndarray]:
    setting = making.setting
    return making.sequence(MANNER, remaining(setting, setting.surface.control_points, whole(STOCK)))


def test_mended_levels_keep_their_limits_and_move_little(making: Sequences, made: list[np.ndarray]) -> None:
    setting, spoilt = making.setting, [*made]
    spoilt[3] = made[2] + 1.02 * (made[3] - made[2])
    mended, moved = making.mended(spoilt, {3})
    assert 3 in moved
    assert all(np.array_equal(mended[k], spoilt[k]) for k in range(len(made)) if k not in moved)
    assert max(np.linalg.norm(setting.watch.R @ (mended[k] - spoilt[k]), axis=1).max() for k in moved) < 0.1
    assert all(kept_level(setting, mended[k - 1], mended[k], making.cut(k)).broken < 0.001 for k in moved)


def test_levels_that_end_too_early_go_on_to_the_stock(making: Sequences, made: list[np.ndarray]) -> None:
    assert len(making.onward(made)) == len(made)
    longer = making.onward(made[:-2])
    left = remaining(making.setting, longer[-1], whole(STOCK)).left
    assert len(longer) >= len(made) - 1
    assert left <= SCHEDULE.limit(len(longer))
    assert all(np.array_equal(a, b) for a, b in zip(longer, made[:-2]))


def test_places_that_bend_more_than_before_or_are_hollow_are_watched(making: Sequences) -> None:
    """What moves as it is needs few places between those of the even pattern; a groove needs many, on the level before as well."""
    surface, pattern = making.setting.surface, making.setting.watch
    starts, row = surface.tmesh.row_starts, len(surface.tmesh.row_starts) // 2
    grooved = np.array(surface.control_points)
    grooved[starts[row] : starts[row + 1], :2] *= 0.5
    low, high = surface.tmesh.t_knots[[row, row + 4]]

    def between(level: np.ndarray, before: np.ndarray) -> int:
        t = creases(pattern, level, before)[:, 1]
        places, moves = making.setting.watched(level, before)
        assert len(places.s) == moves.shape[0] == len(pattern.s) + len(t)
        return int(((low < t) & (t < high)).sum())

    flat = surface.control_points
    assert 1.3 * between(1.2 * flat, flat) < between(1.2 * grooved, grooved)
    assert 1.3 * between(1.2 * grooved, grooved) < between(grooved, flat)
