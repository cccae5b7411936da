"""Where paths are lifted for rewinds: planted windings, and limits that lie between two rows."""

import numpy as np
import pytest

from bonecam.errors import MachineError
from bonecam.machine.kinematics import inverse_rotary, tool_axes
from bonecam.machine.machine import read_machine
from bonecam.nc.path_words import lift_places
from bonecam.nc.rotary import choose_angles
from bonecam.tool.path import MoveKind

NOWHERE = np.zeros(0)


def lifted(axes, kinds, places, turned):
    """Axes and kinds of the path with ways off the part at the places, and back to the place, or on from a link."""
    rows, moves = [axes[:1]], [kinds[:1]]
    for row in range(1, len(axes)):
        for place, axis in zip(places, turned, strict=True):
            if row - 1 <= place < row:
                inside = kinds[row] == kinds[row - 1] == MoveKind.CUT
                there = [axis[None]] * 3 if inside else [axes[row - 1 : row]] * 2
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
def test_a_path_of_cuts_is_lifted_as_seldom_as_its_limits_allow(winding, pointing, cuts, low, high, turns, lifts):
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


def test_with_limits_just_a_turn_apart_the_place_is_where_the_axis_is_at_its_limit(winding, pointing, cuts):
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


def test_links_are_lifted_first_and_places_that_cannot_be_left_never(winding, pointing, cuts):
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


def test_beside_the_pole_the_axes_turn_round_between_two_rows(winding, pointing, cuts):
    # two rows on both sides of the pole, 0.3 degrees off it: the table turns from 350 over 0 to 170
    machine = winding(0, 360, tilts=(-100, 100))
    tilted = tool_axes(machine, np.radians([[-5.0, 40.0], [-3.0, 358.0], [-3.0, 170.0], [-5.0, 150.0]]))
    places, turned = lift_places(machine, tilted, cuts(4), NOWHERE)
    choice = choose_angles(machine, *lifted(tilted, cuts(4), places, turned), 0.0)
    assert np.degrees(choice.angles[:, 1].min()) >= -1e-6
    assert np.degrees(choice.angles[:, 1].max()) <= 360 + 1e-6


def test_a_table_that_turns_for_ever_needs_no_lift(pointing, cuts):
    axes, kinds = pointing(60.0, np.linspace(0, 5000, 1001)), cuts(1001)
    assert not len(lift_places(read_machine("mikron-ucp600"), axes, kinds, NOWHERE)[0])
