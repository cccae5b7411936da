"""What a machine file says and leaves unsaid is told to someone who writes one."""

import re

import pytest

from bonecam.machine import check_machine, machine_names
from bonecam.machine.machine import MACHINES


@pytest.mark.parametrize("name", machine_names())
def test_every_shipped_machine_has_a_source_and_tells_what_is_assumed(name: str) -> None:
    found = check_machine(name)
    assert found.source
    assert found.assumed
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
