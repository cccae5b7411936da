import numpy as np
import pytest

from bonecam.errors import MachineError
from bonecam.nc.kinematics import tool_axes
from bonecam.nc.machine import read_machine
from bonecam.nc.posting.rotary import choose_angles
from bonecam.toolpath.path import Kind

MIKRON = read_machine("mikron-ucp600")
HOLD = np.radians(0.0005)


def pointing(tilt_deg, azimuth_deg) -> np.ndarray:
    tilt, azimuth = np.radians(
        np.broadcast_arrays(np.asarray(tilt_deg, float), np.asarray(azimuth_deg, float))
    )
    return np.column_stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])


def cuts(count: int, *rapids: int) -> np.ndarray:
    kinds = np.full(count, int(Kind.CUT))
    kinds[[0, *rapids]] = Kind.RAPID
    return kinds


def test_the_chosen_angles_point_the_axis_and_stay_within_limits():
    rng = np.random.default_rng(3)
    axes = pointing(
        60 + 40 * np.sin(np.linspace(0, 9, 800)), np.linspace(0, 2000, 800) + rng.normal(0, 0.1, 800)
    )
    choice = choose_angles(MIKRON, axes, cuts(800), HOLD)
    assert np.abs(tool_axes(MIKRON, choice.angles) - axes).max() < 1e-9
    assert choice.angles[:, 0].min() >= np.radians(-115)
    assert choice.angles[:, 0].max() <= np.radians(30)
    assert not choice.rewinds.any()


def test_an_endless_axis_winds_without_a_jump():
    azimuth = np.linspace(0, 3600, 1441)
    choice = choose_angles(MIKRON, pointing(80.0, azimuth), cuts(1441), HOLD)
    turned = np.degrees(choice.angles[:, 1] - choice.angles[0, 1])
    assert np.allclose(turned, azimuth, atol=1e-6)


def test_through_the_singular_axis_the_tilt_changes_sign_and_the_table_rests():
    tilt = np.linspace(-20, 20, 41)
    choice = choose_angles(MIKRON, pointing(tilt, 30.0), cuts(41), HOLD)
    assert np.degrees(np.ptp(choice.angles[:, 1])) < 1e-6
    assert np.allclose(np.abs(np.degrees(choice.angles[:, 0])), np.abs(tilt), atol=1e-9)


def test_the_table_is_held_where_the_axis_is_upright():
    axes = np.vstack(
        [
            pointing(np.linspace(10, 1, 10), 50.0),
            np.tile([0, 0, 1.0], (20, 1)),
            pointing(np.linspace(1, 10, 10), 50.0),
        ]
    )
    choice = choose_angles(MIKRON, axes, cuts(40), HOLD)
    assert np.degrees(np.ptp(choice.angles[:, 1])) < 1e-6
    everywhere = choose_angles(MIKRON, np.tile([0, 0, 1.0], (5, 1)), cuts(5), HOLD)
    assert np.array_equal(everywhere.angles, np.zeros((5, 2)))


def test_noise_within_the_hold_cone_does_not_turn_the_table():
    rng = np.random.default_rng(5)
    axes = np.column_stack([rng.normal(0, 1e-6, (200, 2)), np.ones(200)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    choice = choose_angles(MIKRON, axes, cuts(200), HOLD)
    assert np.ptp(choice.angles[:, 1]) == 0
    assert (
        np.degrees(np.arccos(np.clip((tool_axes(MIKRON, choice.angles) * axes).sum(1), -1, 1))).max() < 0.0006
    )


def test_beyond_the_tilt_limit_the_error_names_axis_value_and_limit():
    with pytest.raises(
        MachineError, match=r"point 3: B -?1[12]\d\.\d+ deg leaves the limit -115.000 deg"
    ) as caught:
        choose_angles(MIKRON, pointing([50.0, 90.0, 114.0, 120.0], 10.0), cuts(4), HOLD)
    assert caught.value.evidence["row"] == 3
    assert caught.value.evidence["limit_deg"] == pytest.approx(-115)


@pytest.fixture
def limited(axis, write_machine, machine_text, tmp_path):
    """A table that turns 200 degrees either way and a tilt to one side only."""
    rotary = {"C": axis([0, 0, 1], [0, 0, 0], -1, -200, 200), "B": axis([0, 1, 0], [0, 0, 0], -1, -100, 0)}
    return read_machine(write_machine(tmp_path, machine_text(["C", "B", "XYZ"], rotary)))


def test_a_limited_table_is_rewound_at_a_rapid_only(limited):
    axes, kinds = pointing(60.0, np.linspace(0, 700, 71)), cuts(71, 20, 38, 55)
    choice = choose_angles(limited, axes, kinds, HOLD)
    assert choice.rewinds.any()
    assert (kinds[choice.rewinds] == Kind.RAPID).all()
    assert np.abs(np.degrees(choice.angles[:, 1])).max() <= 200
    assert np.abs(tool_axes(limited, choice.angles) - axes).max() < 1e-9
    steps = np.abs(np.diff(choice.angles, axis=0)).max(1)
    assert np.degrees(steps[~choice.rewinds[1:]].max()) < 11


def test_a_limited_table_is_never_rewound_in_the_cut(limited):
    with pytest.raises(MachineError, match="reach their limits within a cut"):
        choose_angles(limited, pointing(60.0, np.linspace(0, 700, 71)), cuts(71), HOLD)


def test_a_winding_limit_is_met_by_unwinding_at_a_rapid(axis, write_machine, machine_text, tmp_path):
    rotary = {
        "C": {**axis([0, 0, 1], [0, 0, 0], -1, -1000, 1000), "endless": True},
        "B": axis([0, 1, 0], [0, 0, 0], -1, -100, 0),
    }
    machine = read_machine(write_machine(tmp_path, machine_text(["C", "B", "XYZ"], rotary)))
    axes = pointing(60.0, np.linspace(0, 1800, 361))
    choice = choose_angles(machine, axes, cuts(361, 150), HOLD)
    assert np.flatnonzero(choice.rewinds).tolist() == [150]
    assert np.abs(np.degrees(choice.angles)).max() <= 1000
    assert np.abs(tool_axes(machine, choice.angles) - axes).max() < 1e-9
    with pytest.raises(MachineError, match="C winds to"):
        choose_angles(machine, axes, cuts(361), HOLD)


@pytest.mark.parametrize("kind", ["table-table", "head-table", "head-head", "nutating"])
def test_every_chain_follows_a_gentle_path_without_a_flip(write_machine, chains, kind, tmp_path):
    machine = read_machine(write_machine(tmp_path, chains[kind]))
    axes = pointing(40 + 10 * np.sin(np.linspace(0, 6, 200)), np.linspace(-60, 60, 200))
    choice = choose_angles(machine, axes, cuts(200), HOLD)
    assert np.abs(tool_axes(machine, choice.angles) - axes).max() < 1e-9
    assert np.degrees(np.abs(np.diff(choice.angles, axis=0)).max()) < 5
