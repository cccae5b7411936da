"""Machines whose table has limits, and tool axes round it.

Where paths are lifted for rewinds: planted windings, and limits that lie between two rows.
"""

from itertools import product

import numpy as np
import pytest
from machine_files import axis, machine_text, write_machine

from bonecam.errors import MachineError
from bonecam.machine import inverse_rotary, read_machine
from bonecam.machine.kinematics import tool_axes
from bonecam.nc.path_words import lift_places
from bonecam.nc.rotary import choose_angles
from bonecam.tool import MoveKind


def pointing(tilt_deg: object, azimuth_deg: object) -> np.ndarray:
    """Makes unit tool axes of tilts and azimuths, degrees."""
    given = np.broadcast_arrays(np.asarray(tilt_deg, float), np.asarray(azimuth_deg, float))
    tilt, azimuth = np.radians(given)
    return np.column_stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])


def cuts(count: int, *rapids: int) -> np.ndarray:
    """Makes the kinds of a path that cuts but for its first row and some more, which are rapids."""
    kinds = np.full(count, int(MoveKind.CUT))
    kinds[[0, *rapids]] = MoveKind.RAPID
    return kinds


@pytest.fixture
def winding(tmp_path):
    """Makes a machine whose table turns between two angles (deg), as an endless axis that winds or as another."""

    def build(low, high, endless=False, tilts=(-100, 0)):
        rotary = {
            "C": {**axis([0, 0, 1], [0, 0, 0], -1, low, high), "endless": endless},
            "B": axis([0, 1, 0], [0, 0, 0], -1, *tilts),
        }
        return read_machine(write_machine(tmp_path, machine_text(["C", "B", "XYZ"], rotary)))

    return build


MIKRON = read_machine("mikron-ucp600")
HOLD = np.radians(0.0005)


def test_through_the_singular_axis_the_tilt_changes_sign_and_the_table_rests():
    tilt = np.linspace(-20, 20, 41)
    choice = choose_angles(MIKRON, pointing(tilt, 30.0), cuts(41), HOLD)
    assert np.degrees(np.ptp(choice.angles[:, 1])) < 1e-6
    assert np.allclose(np.abs(np.degrees(choice.angles[:, 0])), np.abs(tilt), atol=1e-9)


def test_the_table_is_held_where_the_axis_is_upright():
    axes = np.vstack(
        [pointing(np.linspace(10, 1, 10), 50.0), np.tile([0, 0, 1.0], (20, 1)), pointing(np.linspace(1, 10, 10), 50.0)]
    )
    choice = choose_angles(MIKRON, axes, cuts(40), HOLD)
    assert np.degrees(np.ptp(choice.angles[:, 1])) < 1e-6
    everywhere = choose_angles(MIKRON, np.tile([0, 0, 1.0], (5, 1)), cuts(5), HOLD)
    assert np.array_equal(everywhere.angles, np.zeros((5, 2)))


@pytest.mark.parametrize("endless", [False, True])
@pytest.mark.parametrize(
    ("low", "high", "turns", "rewinds"),
    [(-360, 360, 1.9, 0), (-360, 360, 3, 1), (-1000, 1000, 5, 0), (0, 360, 0.9, 0), (-185, 185, 3, 2), (90, 810, 3, 1)],
)
def test_a_winding_path_is_rewound_as_seldom_as_its_limits_allow(winding, low, high, turns, rewinds, endless):
    machine = winding(low, high, endless)
    rows = 109
    begin = tool_axes(machine, np.radians([[-60.0, low + 1.0]]))[0]
    axes = pointing(60.0, np.degrees(np.arctan2(begin[1], begin[0])) + np.linspace(0, 360 * turns, rows))
    kinds = cuts(rows, *range(6, rows, 6))
    choice = choose_angles(machine, axes, kinds, HOLD)
    assert choice.rewinds.sum() == rewinds
    assert (kinds[choice.rewinds] == MoveKind.RAPID).all()
    assert np.degrees(choice.angles[:, 1].min()) >= low - 1e-6
    assert np.degrees(choice.angles[:, 1].max()) <= high + 1e-6
    assert np.abs(tool_axes(machine, choice.angles) - axes).max() < 1e-9


def test_the_turn_in_which_a_stretch_begins_looks_ahead_over_all_of_it(winding):
    # begun in the turn next to zero it would end 600 degrees beyond
    for way in (1, -1):
        axes = pointing(60.0, np.linspace(0, 600 * way, 71))
        choice = choose_angles(winding(-450, 450, True), axes, cuts(71), HOLD)
        assert not choice.rewinds.any()
        assert np.abs(np.degrees(choice.angles[:, 1])).max() <= 450


def test_a_path_begins_in_the_turn_next_to_where_the_machine_comes_from(winding):
    machine = winding(-450, 450, True)
    before = np.array([0.0, np.radians(400.0)])
    axes = tool_axes(machine, np.radians(np.column_stack([np.full(5, -60.0), np.linspace(40, 60, 5)])))
    assert np.degrees(choose_angles(machine, axes, cuts(5), HOLD, before).angles[0, 1]) == pytest.approx(400.0)
    assert np.degrees(choose_angles(machine, axes, cuts(5), HOLD).angles[0, 1]) == pytest.approx(40.0)


def test_where_no_turn_fits_the_path_is_lifted_from_a_link_rather_than_from_a_cut(winding):
    machine = winding(-200, 200)
    axes, kinds = pointing(60.0, np.linspace(0, 500, 51)), cuts(51)
    everywhere = np.ones(51, dtype=bool)
    assert choose_angles(machine, axes, kinds, HOLD, liftable=everywhere).rewinds.sum() == 1
    kinds[36] = MoveKind.LINK
    lifted = choose_angles(machine, axes, kinds, HOLD, liftable=everywhere)
    assert np.flatnonzero(lifted.rewinds).tolist() == [36]
    lifted = choose_angles(machine, axes, kinds, HOLD, liftable=np.arange(51) == 37)
    assert np.flatnonzero(lifted.rewinds).tolist() == [37]
    kinds[[35, 38]] = MoveKind.RAPID
    assert np.flatnonzero(choose_angles(machine, axes, kinds, HOLD, liftable=everywhere).rewinds)[0] in (35, 38)


def least_by_trial(machine, axes, kinds, low, high):
    """Rewinds, those of them close to the part, and travel (rad) of the best of all sequences, by trial."""
    found, _ = inverse_rotary(machine, axes)
    rows = [
        [
            (side, b, c + turn)
            for side, (b, c) in enumerate(solutions)
            for turn in 2 * np.pi * np.arange(-3, 4)
            if low <= np.degrees(c + turn) <= high
        ]
        for solutions in found
    ]
    rapid = kinds == MoveKind.RAPID
    close = ~(rapid[:-1] & np.r_[rapid[2:], True])
    best = np.inf, np.inf, np.inf
    for states in product(*rows):
        steps = np.abs(np.diff(states, axis=0))
        jumps = (steps[:, 0] > 0) | (steps[:, 2] > np.pi)
        if not (jumps & ~rapid[1:]).any():
            best = min(best, (int(jumps.sum()), int((jumps & close).sum()), float(steps[:, 1:].sum())))
    return best


@pytest.mark.parametrize("seed", range(16))
def test_no_other_sequence_has_fewer_rewinds_or_as_many_and_less_travel(winding, seed):
    rng = np.random.default_rng(seed)
    low, high = [(-360, 360), (0, 360), (-185, 185), (-100, 300)][seed % 4]
    machine = winding(low, high, endless=seed % 3 == 1, tilts=(-100, 100))
    azimuths = rng.uniform(0, 360) + np.cumsum(rng.uniform(25, 55, 7) * rng.choice([-1, 1]))
    axes, kinds = (pointing(rng.uniform(55, 65, 7), azimuths), cuts(7, *rng.choice(np.arange(1, 7), 3, replace=False)))
    rewinds, _, travel = least_by_trial(machine, axes, kinds, low, high)
    if not np.isfinite(rewinds):
        with pytest.raises(MachineError, match="reach their limits within a cut"):
            choose_angles(machine, axes, kinds, HOLD)
        return
    choice = choose_angles(machine, axes, kinds, HOLD)
    assert choice.rewinds.sum() == rewinds
    assert np.abs(np.diff(choice.angles, axis=0)).sum() == pytest.approx(travel, abs=0.02)


def test_beyond_the_tilt_the_error_names_the_axis_that_cannot_reach_not_the_one_that_turns(winding):
    with pytest.raises(MachineError, match=r"point 1: B -110.000 deg leaves the limit -100.000 deg"):
        choose_angles(winding(0, 360), pointing([50.0, 110.0], 234.0), cuts(2), HOLD)


NOWHERE = np.zeros(0)


def lifted(axes, kinds, places, turned):
    """Axes and kinds of the path with ways off the part at the places, and back to the place, or on from a link."""
    rows, moves = [axes[:1]], [kinds[:1]]
    for row in range(1, len(axes)):
        for place, turned_axis in zip(places, turned, strict=True):
            if row - 1 <= place < row:
                inside = kinds[row] == kinds[row - 1] == MoveKind.CUT
                there = [turned_axis[None]] * 3 if inside else [axes[row - 1 : row]] * 2
                rows += there + [axes[row : row + 1]] * (not inside)
                moves.append(
                    np.array([int(MoveKind.CUT), *[int(MoveKind.RAPID)] * 2] if inside else [int(MoveKind.RAPID)] * 3)
                )
        rows.append(axes[row : row + 1])
        moves.append(kinds[row : row + 1])
    return np.vstack(rows), np.concatenate(moves)


@pytest.mark.parametrize(
    ("low", "high", "turns", "lifts"),
    [
        (-360, 360, 1.9, 0),
        (-360, 360, 3, 1),
        (0, 360, 2.9, 2),
        (-185, 185, 3, 2),
        (-450, 450, 8, 3),
        (-90, 270, 0.9, 0),
    ],
)
def test_a_path_of_cuts_is_lifted_as_seldom_as_its_limits_allow(winding, low, high, turns, lifts):
    machine = winding(low, high)
    begin = tool_axes(machine, np.radians([[-60.0, low + 1.0]]))[0]
    azimuth = np.degrees(np.arctan2(begin[1], begin[0])) + np.linspace(0, 360 * turns, 141)
    axes, kinds = pointing(60.0, azimuth), cuts(141)
    places, turned = lift_places(machine, axes, kinds, NOWHERE)
    assert len(places) == lifts
    choice = choose_angles(machine, *lifted(axes, kinds, places, turned), 0.0)
    assert choice.rewinds.sum() == lifts
    assert np.degrees(choice.angles[:, 1].min()) >= low - 1e-6
    assert np.degrees(choice.angles[:, 1].max()) <= high + 1e-6


def test_with_limits_just_a_turn_apart_the_place_is_where_the_axis_is_at_its_limit(winding):
    machine = winding(0, 360)
    axes, kinds = pointing(60.0, np.linspace(100, 300, 41) + 0.7), cuts(41)
    (place,), turned = lift_places(machine, axes, kinds, NOWHERE)
    assert 0 < place % 1 < 1
    angle = np.degrees(inverse_rotary(machine, turned)[0][0, :, 1]) % 360
    assert np.abs((angle + 180) % 360 - 180).min() < 1e-6
    azimuth = np.degrees(np.arctan2(turned[0, 1], turned[0, 0])) % 360
    assert 100.7 + 5 * int(place) < azimuth < 105.7 + 5 * int(place)


def block_all(machine, axes, kinds, blocked):
    """Block the places that are chosen until none is left."""
    while len(blocked) < 120:
        more, _ = lift_places(machine, axes, kinds, blocked)
        assert not np.isin(more, blocked).any()
        blocked = np.r_[blocked, more]


def test_links_are_lifted_first_and_places_that_cannot_be_left_never(winding):
    machine = winding(-200, 200)
    axes, kinds = pointing(60.0, np.linspace(0, 500, 101)), cuts(101)
    kinds[72] = MoveKind.LINK
    places, _ = lift_places(machine, axes, kinds, NOWHERE)
    assert places.tolist() == [71.0]
    (other,), _ = lift_places(machine, axes, kinds, np.array([71.0]))
    assert other != 71.0
    with pytest.raises(MachineError, match=r"point \d+: the rotary axes of test reach their limits") as caught:
        block_all(machine, axes, kinds, np.r_[np.arange(101.0), other])
    assert 0 <= caught.value.evidence["row"] < 101


def test_beside_the_pole_the_axes_turn_round_between_two_rows(winding):
    # two rows on both sides of the pole, 0.3 degrees off it: the table turns from 350 over 0 to 170
    machine = winding(0, 360, tilts=(-100, 100))
    tilted = tool_axes(machine, np.radians([[-5.0, 40.0], [-3.0, 358.0], [-3.0, 170.0], [-5.0, 150.0]]))
    places, turned = lift_places(machine, tilted, cuts(4), NOWHERE)
    choice = choose_angles(machine, *lifted(tilted, cuts(4), places, turned), 0.0)
    assert np.degrees(choice.angles[:, 1].min()) >= -1e-6
    assert np.degrees(choice.angles[:, 1].max()) <= 360 + 1e-6
