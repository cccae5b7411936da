"""What a machine file says and leaves unsaid is told to someone who writes one."""

import re
from pathlib import Path

import pytest

from bonecam.machine import check_machine, machine_names
from bonecam.machine.machine import MACHINES


@pytest.mark.parametrize("name", machine_names())
def test_every_shipped_machine_has_a_source_and_tells_what_is_assumed(name: str) -> None:
    found = check_machine(name)
    assert found.source
    assert found.assumed
    assert not found.doubtful
    assert "the tool leans from the part's Z by" in str(found)


def test_what_the_tool_reaches_is_a_band_a_circle_or_a_region(tmp_path) -> None:
    text = (MACHINES / "mikron-ucp600.toml").read_text()
    locked = text.replace("limits_deg = [-115.0, 30.0]", "locked_deg = -90.0")
    narrow = text.replace("endless = true", "limits_deg = [-100.0, 100.0]").replace("30.0]", "0.0]")
    for changed, told in (
        (text, "0 to 115 deg, all round"),
        (locked, "90 deg, all round"),
        (narrow, "not all round: a region"),
        (text.replace("endless = true", "locked_deg = 10.0"), "not all round: a curve"),
    ):
        path = tmp_path / "own.toml"
        path.write_text(changed)
        assert told in check_machine(path).told[-1]


def test_what_a_file_leaves_out_is_assumed(tmp_path) -> None:
    text = (MACHINES / "mikron-ucp600.toml").read_text()
    text = re.sub(r"assumed = .*\n", "", text).replace("part_zero = [0.0, 0.0, 0.0]\n", "")
    path = tmp_path / "own.toml"
    path.write_text(text.replace("[spindle]\nnose = [[100.0, 80.0]]", ""))
    told = " ".join(check_machine(path).assumed)
    for word in ("part_zero", "spindle.nose", "limits of X Y Z", "acceleration of X Y Z B C"):
        assert word in told
    assert "spindle_speed" not in told


@pytest.mark.parametrize(
    ("right", "wrong", "asked"),
    [
        (
            "spindle_speed = 20000.0",
            "spindle_speed = 333.0",
            "spindle_speed: 333 1/min at most: is it in 1/s?",
        ),
        ("travel = 600.0", "travel = 0.6", "X: a travel of 0.6 mm: is it in m or inch?"),
        ("travel = 600.0", "travel = 24.0", "X: a travel of 24 mm: is it in m or inch?"),
        ("speed = 22000.0", "speed = 366.0", "X: a speed of 366 mm/min: is it in mm/s or m/min?"),
        ("[-115.0, 30.0]", "[-2.0, 0.5]", "B: it turns from -2 to 0.5 deg: are limits_deg in radians?"),
        ("speed_deg_s = ", "speed_deg_s = 1.5 # ", "B: a speed of 1.5 deg/s: is it in rad/s?"),
    ],
)
def test_a_figure_in_another_unit_is_asked_about(right: str, wrong: str, asked: str, tmp_path: Path) -> None:
    text = (MACHINES / "mikron-ucp600.toml").read_text()
    assert right in text
    path = tmp_path / "own.toml"
    path.write_text(text.replace(right, wrong, 1))
    assert list(check_machine(path).doubtful) == [asked]


@pytest.mark.parametrize(
    ("right", "wrong", "asked"),
    [
        ("part_z = [0.0, 1.0, 0.0]", "part_z = [0.0, -1.0, 0.0]", "part_z: the tool comes more from below"),
        ("sign = 1\nlimits_deg", "sign = -1\nlimits_deg", "and sign of A B?"),
        (
            "pivot = [0.0, 0.0, 0.0]\nsign = 1\nlimits",
            "pivot = [0.0, 0.0, 5e3]\nsign = 1\nlimits",
            "A: its pivot is 5000 mm off part_zero, farther than X Y Z travel",
        ),
    ],
)
def test_a_table_turned_over_and_a_pivot_out_of_reach_are_asked_about(
    right: str, wrong: str, asked: str, tmp_path: Path
) -> None:
    text = (MACHINES / "pocket-nc.toml").read_text()
    assert right in text
    path = tmp_path / "own.toml"
    path.write_text(text.replace(right, wrong, 1))
    (told,) = check_machine(path).doubtful
    assert asked in told
