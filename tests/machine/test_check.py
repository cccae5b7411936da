"""What a machine file says and leaves unsaid is told to someone who writes one."""

import re
from pathlib import Path

import pytest

from bonecam.errors import MachineError
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
    text = re.sub(r"(?s)assumed = \[.*?\]\n", "", text).replace("part_zero = [0.0, 0.0, 0.0]\n", "")
    text = re.sub(r"acceleration.*\n|(?s:\[seconds\].*?\n\n)", "", text)
    path = tmp_path / "own.toml"
    path.write_text(text.replace("[spindle]\nnose = [[100.0, 80.0]]", ""))
    told = " ".join(check_machine(path).assumed)
    for word in ("part_zero", "spindle.nose", "limits of X Y Z", "acceleration of X Y Z B C", "seconds:"):
        assert word in told
    assert "spindle_speed" not in told


@pytest.mark.parametrize(
    ("right", "wrong", "asked"),
    [
        ("spindle_speed = 20000.0", "spindle_speed = 333.0", "spindle_speed: 333 1/min at most: is it in 1/s?"),
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


@pytest.mark.parametrize(
    ("name", "right", "wrong", "asked"),
    [
        ("pocket-nc", '["B", "A", "XYZ"]', '["A", "B", "XYZ"]', "carries A: is it from the part outward, not B, A?"),
        ("pocket-nc", '["B", "A", "XYZ"]', '["XYZ", "A", "B"]', "both axes carry the tool, yet part_z is not"),
        ("mill-4axis", "part_z = [1.0, 0.0, 0.0]", "part_z = [0.0, 1.0, 0.0]", "some sides .* part_z and direction"),
        ("mill-4axis", "endless = true", "limits_deg = [-5.0, 5.0]", "some sides .* limits_deg of A right"),
        ("mikron-ucp600", "[-115.0, 30.0]", "[-5.0, 5.0]", "leans by 5 deg at most, the sides of a part need 15"),
        (
            "dmu-45",
            "pivot = [0.0, 0.0, 0.0]\nsign = 1\n",
            "pivot = [0.0, 0.0, -60.0]\nsign = 1\n",
            "B: its pivot is 60 mm in front of the spindle nose",
        ),
        (
            "dmu-45",
            "pivot = [0.0, 0.0, 0.0]\nsign = 1\n",
            "pivot = [0.0, 90.0, 30.0]\nsign = 1\n",
            "B: its pivot is 60 mm in front of the spindle nose",
        ),
        ("mikron-ucp600", "[Z]\ntravel = 450.0", "[Z]\nlimits = [-500.0, -50.0]", "Z: its limits end at -50, below"),
        ("mikron-ucp600", "[X]\ntravel = 600.0", "[X]\nlimits = [50.0, 650.0]", "X: its limits begin at 50, above"),
    ],
)
def test_what_no_machine_is_like_is_asked_about(name: str, right: str, wrong: str, asked: str, tmp_path: Path) -> None:
    text = (MACHINES / f"{name}.toml").read_text()
    if wrong.startswith("part_z"):
        text = text.replace("part_x = [0.0, 0.0, 1.0]", "part_x = [1.0, 0.0, 0.0]")
    assert right in text
    path = tmp_path / "own.toml"
    path.write_text(text.replace(right, wrong, 1))
    (told,) = check_machine(path).doubtful
    assert re.search(asked, told)


@pytest.mark.parametrize(
    ("name", "right", "wrong", "told"),
    [
        (
            "mill-4axis",
            "direction = [1.0, 0.0, 0.0]",
            "direction = [0.0, 0.0, 1.0]",
            "a single direction in the part: .* correct direction: one along the spindle",
        ),
        (
            "mikron-ucp600",
            '["C", "B", "XYZ"]',
            '["XYZ", "B", "C"]',
            "chain: C next to the tool turns it about itself: .*from the part to the tool",
        ),
    ],
)
def test_an_axis_that_leans_nothing_is_refused(name: str, right: str, wrong: str, told: str, tmp_path: Path) -> None:
    text = (MACHINES / f"{name}.toml").read_text()
    assert right in text
    path = tmp_path / "own.toml"
    path.write_text(text.replace(right, wrong, 1))
    with pytest.raises(MachineError, match=told):
        check_machine(path)
