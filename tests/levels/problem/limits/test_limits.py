"""What all limits promise, whichever are listed, and that one more in a list holds."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.levels import program as limits
from bonecam.levels.problem import Cut
from bonecam.levels.program import SLABS, WALLS, LevelProgram, heights
from bonecam.levels.solvers import admm
from bonecam.setup.capsule import Capsule

GAP = np.linspace(0, 6, 200)
RNG = np.random.default_rng(5)


@pytest.mark.parametrize("slab", SLABS, ids=lambda slab: slab.__name__)
def test_a_slab_leaves_room_and_the_tightest_counts(half_millimetre: Cut, slab) -> None:  # type: ignore[no-untyped-def]
    low, high = slab(half_millimetre, GAP)
    lowest, largest = heights(half_millimetre, GAP)
    assert low.shape == high.shape == GAP.shape
    assert (low <= lowest).all()
    assert (lowest < largest).all()
    assert (largest <= high).all()
    assert (lowest >= 0).all()
    assert (largest <= half_millimetre.depth).all()


@pytest.mark.parametrize("wall", WALLS, ids=lambda wall: wall.__name__)
def test_a_wall_holds_what_it_may_and_its_plane_is_its_slope(capsule: Capsule, half_millimetre: Cut, wall) -> None:  # type: ignore[no-untyped-def]
    y = capsule.closest_points(capsule.middle + RNG.normal(size=(len(GAP), 3)) * [1, 1, 5]) + 0.1 * RNG.normal(
        size=(len(GAP), 3)
    )
    m, h = wall(half_millimetre, GAP, capsule, y)
    assert np.allclose(np.linalg.norm(m, axis=1), 1)
    outside = (m * y).sum(1) - h
    stays = y - outside[:, None] * m
    assert np.allclose(-capsule.signed_distance(stays), np.minimum(GAP, half_millimetre.clearance), atol=1e-9)
    for step in 1e-5 * np.eye(3):
        moved, at = wall(half_millimetre, GAP, capsule, y + step)
        assert np.allclose(((moved * (y + step)).sum(1) - at - outside) / 1e-5, m @ step / 1e-5, atol=1e-4)


def test_a_sample_may_slide_to_where_the_level_before_is_nearer_to_the_wall(
    first_program: Callable[[], LevelProgram], capsule: Capsule
) -> None:
    program = first_program()
    before, y = program.limits.before, program.x
    there = -capsule.signed_distance(y)
    cut = Cut(depth=0.5, landing=float(np.median(there)))
    near = there < cut.clearance
    found = limits.limits_at(before, capsule, cut, there + 1.0, y, program.s, program.t, 3)
    assert 0.4 < near.mean() < 0.6
    assert found.broken(y)[near].max() < 1e-6
    assert found.broken(y + 0.01 * found.m)[near].min() > 0.009


def test_a_new_slab_is_one_function_more(
    first_program: Callable[[], LevelProgram], half_millimetre: Cut, monkeypatch: pytest.MonkeyPatch
) -> None:
    def half(cut: Cut, gap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.full(len(gap), -np.inf), np.full(len(gap), cut.depth / 2)

    monkeypatch.setattr(limits, "SLABS", (*SLABS, half))
    one = first_program()
    y = one.x + one.R @ admm.solve(one)
    assert one.limits.at(y, 3).heights(y).max() < 0.55 * half_millimetre.depth


def test_a_new_wall_is_one_function_more(
    first_program: Callable[[], LevelProgram], monkeypatch: pytest.MonkeyPatch
) -> None:
    free = first_program()
    top = float(free.x[:, 2].max()) + 0.1

    def ceiling(cut: Cut, gap: np.ndarray, stock: object, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.tile([0.0, 0.0, 1.0], (len(y), 1)), np.full(len(y), top)

    assert (free.x + free.R @ admm.solve(free))[:, 2].max() > top + 0.1
    monkeypatch.setattr(limits, "WALLS", (*WALLS, ceiling))
    held = first_program()
    assert (held.x + held.R @ admm.solve(held))[:, 2].max() < top + 0.02
