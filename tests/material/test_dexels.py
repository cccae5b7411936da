"""What stands on rays that cross one another, and what balls would remove of it."""

import numpy as np
import pytest

from bonecam.material.dexels import Dexels, uncut_rays
from bonecam.setup import Box

BLOCK = Box(np.array([-5.0, -4.0, 10.0]), np.array([5.0, 4.0, 30.0]))
UP = np.array([0.0, 0.0, 1.0])
RADIUS = 1.5
ALONG = np.array([[5.0, 0.0, 15.0], [5.0, 0.0, 18.0], [5.0, 0.0, 25.0]])
"""A ball's way along a face, half of it in the block."""


@pytest.fixture(scope="module")
def block():
    return uncut_rays(BLOCK).balls


def poses(centres: np.ndarray, axis: np.ndarray = UP) -> tuple[np.ndarray, np.ndarray]:
    return centres, np.tile(axis, (len(centres), 1))


NOTHING = [poses(np.zeros((0, 3)))]


def removed(dexels: Dexels, line: np.ndarray, behind: int = 0) -> float:
    """What a ball removes on a line, behind balls at its first places."""
    return float(dexels.removed_by([poses(line)], [poses(line[:behind])], RADIUS)[0])


def test_a_ball_would_remove_what_it_goes_through_once(block):
    half = np.pi * RADIUS**2 / 2 * 10 + 2 / 3 * np.pi * RADIUS**3
    assert removed(block, ALONG) == pytest.approx(half, rel=0.01)
    assert removed(block, np.vstack([ALONG, ALONG[::-1]])) == pytest.approx(half, rel=0.01)
    assert removed(block, ALONG + np.array([RADIUS + 0.01, 0, 0])) == 0


def test_asking_leaves_the_material_as_it_is(block):
    leaning = np.array([0.6, 0.0, 0.8])
    lines = [poses(ALONG + np.array([0.3 * k, 0, 0]), leaning) for k in range(-8, 5)]
    for reach in (0.0, 4.0):
        first = block.removed_by(lines, NOTHING * len(lines), RADIUS, reach)
        again = block.removed_by(lines[::-1], NOTHING * len(lines), RADIUS, reach)
        assert np.array_equal(first, again[::-1])
        assert np.array_equal(first, uncut_rays(BLOCK).balls.removed_by(lines, NOTHING * len(lines), RADIUS, reach))


def test_what_a_ball_at_a_contact_holds_is_not_removed_on_its_way_from_there(block):
    out = np.array([[5.0, 0.0, 20.0], [5.5, 0.0, 20.0], [7.0, 0.0, 20.0]])
    assert removed(block, out, behind=1) == pytest.approx(0, abs=1e-3)
    sunk = out - np.array([1.0, 0.0, 0.0])
    assert removed(block, sunk, behind=1) > 0.5
    both = removed(block, sunk), removed(block, sunk[:1])
    assert removed(block, sunk, behind=1) == pytest.approx(both[0] - both[1])


def test_a_rib_between_two_cuts_is_known_by_its_width(block):
    """A wall of 0.3 mm between two grooves, narrower than the lines of a height field are apart."""
    width, cut = 0.3, block
    for side in (-1, 1):
        at = np.array([0.0, side * (RADIUS + width / 2), 0.0])
        for depth in np.arange(0.0, 3.0, 0.05):
            line = np.array([[-8.0, 0.0, 30.0 - depth], [8.0, 0.0, 30.0 - depth]]) + at
            cut = cut.without(poses(line[:1]), poses(line[1:]), RADIUS)
    over = np.array([[-8.0, 0.0, 31.0], [8.0, 0.0, 31.0]])
    deep = 0.5
    section = RADIUS**2 * np.arccos(1 - deep / RADIUS) - (RADIUS - deep) * np.sqrt(deep * (2 * RADIUS - deep))
    assert removed(block, over) == pytest.approx(10 * section, rel=0.01)
    assert removed(cut, over) == pytest.approx(10 * width * deep, rel=0.05)


def test_rays_have_room_for_many_ribs(block):
    cut = block
    ys = np.arange(-3.6, 3.7, 0.6)
    for y in ys:
        line = np.array([[-8.0, y, 30.0], [8.0, y, 30.0]])
        cut = cut.without(poses(line[:1]), poses(line[1:]), 0.2)
    across = np.array([[0.0, -6.0, 30.0], [0.0, 6.0, 30.0]])
    gone = float(cut.removed_by([poses(across)], NOTHING, 0.2)[0])
    assert 0 < gone < float(block.removed_by([poses(across)], NOTHING, 0.2)[0])
    assert cut.without(poses(across[:1]), poses(across[1:]), 0.2).removed_by([poses(across)], NOTHING, 0.2)[0] == 0


def test_flutes_remove_what_the_ball_below_them_passes_by(block):
    """A ball under the block, whose flutes stand up into it: a slot as wide as they are, as high as they reach."""
    line = poses(np.array([[-8.0, 0.0, 8.0], [8.0, 0.0, 8.0]]))
    assert block.removed_by([line], NOTHING, RADIUS)[0] == 0
    assert block.removed_by([line], NOTHING, RADIUS, 1.9)[0] == 0
    slot = 2 * RADIUS * 10 * 3.0
    assert block.removed_by([line], NOTHING, RADIUS, 5.0)[0] == pytest.approx(slot, rel=0.01)


def test_flutes_are_known_by_where_they_stand_on_their_way(block):
    """A tool that leans into the block beside its ball, and turns upright on its way."""
    leaning = np.array([-0.6, 0.0, 0.8])
    centres = np.array([[8.0, 0.0, 20.0], [8.0, 0.0, 20.0]])
    upright = poses(centres)
    turning = centres, np.array([leaning, UP])
    assert block.removed_by([upright], NOTHING, RADIUS, 6.0)[0] == 0
    assert block.removed_by([poses(centres, leaning)], NOTHING, RADIUS, 6.0)[0] > 1
    swept = block.removed_by([turning], NOTHING, RADIUS, 6.0)[0]
    assert swept > block.removed_by([poses(centres, leaning)], NOTHING, RADIUS, 6.0)[0]


def test_what_flutes_have_removed_is_gone(block):
    line = np.array([[-8.0, 0.0, 8.0], [8.0, 0.0, 8.0]])
    cut = block.without(poses(line[:1]), poses(line[1:]), RADIUS, 5.0)
    assert cut.removed_by([poses(line)], NOTHING, RADIUS, 5.0)[0] == pytest.approx(0, abs=0.01)
    assert cut.removed_by([poses(line)], NOTHING, RADIUS, 6.0)[0] == pytest.approx(2 * RADIUS * 10, rel=0.01)
    contact = line.mean(axis=0)[None]
    there = poses(contact)
    assert block.removed_by([there], [there], RADIUS, 5.0)[0] == pytest.approx(0, abs=1e-3)
    assert block.removed_by([there], NOTHING, RADIUS, 5.0)[0] == pytest.approx(3 * np.pi * RADIUS**2, rel=0.02)
