"""Wheels of one blade: the hub's profile, the channel between two blades, and what is no wheel."""

from pathlib import Path

import numpy as np
import pytest
from small_wheel import HEIGHT, PROFILE, blade, hub

import bonecam
from bonecam.errors import SurfaceError
from bonecam.mesh.solids import cylinder, solid_difference
from bonecam.surface.blades import Wheel, channel_of, hub_profile, meridional, places_on, point_at, wheel_of
from bonecam.surface.files.surface_input import read_blade, read_hub

REACH = 2.0


@pytest.fixture(scope="module")
def wheel() -> Wheel:
    return wheel_of(blade(), hub_profile(hub(), "hub.ply"), 3)


def test_the_profile_of_a_hub_is_that_it_was_turned_by() -> None:
    found = hub_profile(hub(), "hub.ply")
    for one, other in ((found, PROFILE), (PROFILE, found)):
        off = np.linalg.norm(point_at(other, places_on(other, one)) - one, axis=1)
        assert off.max() < 0.02
    assert (found[[0, -1], 0] == 0).all()


def test_a_hub_with_a_bore_or_a_keyway_is_refused() -> None:
    bored = solid_difference(hub(), cylinder(2.0, -5.0, 15.0, 0.1))
    with pytest.raises(SurfaceError, match="without bore"):
        hub_profile(bored, "hub.ply")
    pose = np.eye(4)
    pose[:3, 3] = [-14.0, 0.0, 0.0]
    keyed = solid_difference(hub(), cylinder(2.0, -5.0, 1.0, 0.1).move(pose))
    with pytest.raises(SurfaceError, match=r"no body of revolution|plain section"):
        hub_profile(keyed, "hub.ply")


def test_the_channel_runs_from_hub_to_tips_over_one_pitch(wheel: Wheel) -> None:
    channel = channel_of(wheel, REACH)
    (left, right), (low, high) = channel.floor.domain
    t = np.linspace(low, high, 50)
    floor, roof = (meridional(each.positions(np.full(50, left), t)) for each in (channel.floor, channel.roof))
    np.testing.assert_allclose(np.linalg.norm(roof - floor, axis=1), HEIGHT, atol=0.1)
    ends = [channel.floor.positions(np.full(50, s), t) for s in (left, right)]
    azimuths = [np.arctan2(each[:, 1], each[:, 0]) for each in ends]
    np.testing.assert_allclose(azimuths[1] - azimuths[0], wheel.pitch, atol=1e-3)
    along = PROFILE[3] - PROFILE[2]
    normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    np.testing.assert_allclose((floor - PROFILE[2]) @ normal, 0.0, atol=0.02)


def test_grown_blades_hold_the_true_one_by_the_allowance(wheel: Wheel) -> None:
    grown = bonecam.mesh.MeshDistance(wheel.grown_blades(0.2, 0.05)[0])
    s, t = (x.ravel() for x in np.meshgrid(np.linspace(0, 1, 40), np.linspace(0.2, 0.8, 9)))
    away = -grown.signed(wheel.blade.positions(s, t))
    assert away.min() > 0.19
    assert away.max() < 0.32


def test_the_gap_is_that_between_neighbours(wheel: Wheel) -> None:
    gap, place = wheel.gap()
    radius = float(np.hypot(*place[:2]))
    assert gap == pytest.approx(2 * radius * np.sin(wheel.pitch / 2), rel=0.01)


def test_blades_that_overlap_are_told_with_their_place() -> None:
    with pytest.raises(SurfaceError, match=r"12 blades overlap their neighbours, at \(") as error:
        wheel_of(blade(3.0), PROFILE, 12)
    assert error.value.evidence["error"] > 0


def test_a_hub_is_read_from_its_flow_path(tmp_path: Path) -> None:
    file = tmp_path / "hub.txt"
    file.write_text("x r\n" + "".join(f"{z:g} {r:g}\n" for r, z in PROFILE[2:4]))
    found = read_hub(file, blade(), "mm")
    on_cone = found[(found[:, 0] > 6.01) & (found[:, 1] > 0.01)]
    off = (on_cone - PROFILE[2]) @ np.array([10.0, 8.0]) / np.hypot(10.0, 8.0)
    np.testing.assert_allclose(off, 0.0, atol=0.01)
    assert found[0, 0] == 0.0


def test_an_open_side_of_a_blade_is_no_wheel(tmp_path: Path) -> None:
    file = tmp_path / "side.txt"
    rows = ["\n".join(f"{10 + h:g} {y:g} {z:g}" for z in range(6) for y in [0.1 * z]) for h in range(3)]
    file.write_text("\n\n".join(rows) + "\n")
    side, _ = read_blade(file, "mm", 0.01)
    with pytest.raises(SurfaceError, match="not closed round"):
        wheel_of(side, PROFILE, 3)
