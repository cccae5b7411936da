import math

import pytest
from machines import CHAINS, axis, machine_text, write

from bonecam.errors import MachineError
from bonecam.nc.machine import FOLDER, machine_names, read_machine


def test_the_mikron_is_the_one_whose_post_could_be_read():
    machine = read_machine("mikron-ucp600")
    assert [axis.letter for axis in machine.part_axes] == ["C", "B"]
    assert machine.letters == "XYZBC"
    b, c = machine.rotary
    assert (math.degrees(b.limits[0]), math.degrees(b.limits[1])) == pytest.approx((-115, 30))
    assert c.endless
    assert [axis.travel for axis in machine.linear] == [600, 450, 450]


@pytest.mark.parametrize("name", machine_names())
def test_every_shipped_machine_is_read_the_same_by_name_and_by_path(name):
    assert read_machine(name) == read_machine(FOLDER / f"{name}.toml")


@pytest.mark.parametrize("text", CHAINS.values(), ids=CHAINS)
def test_a_user_machine_is_read_by_path(text, tmp_path):
    assert read_machine(write(tmp_path, text)).title == "test"


GOOD = CHAINS["table-table"]


@pytest.mark.parametrize(
    ("text", "key"),
    [
        (GOOD.replace('title = "test"', ""), "title"),
        (GOOD.replace("['C', 'A', 'XYZ']", "['C', 'XYZ']"), "chain"),
        (GOOD.replace("['C', 'A', 'XYZ']", "['C', 'C', 'XYZ']"), "chain"),
        (GOOD.replace("['C', 'A', 'XYZ']", "['C', 'Q', 'XYZ']"), "chain"),
        (GOOD.replace("[X]\ntravel = 4000.0", "[X]"), "X.travel"),
        (GOOD.replace("[X]\ntravel = 4000.0", "[X]\nlimits = [3.0, 1.0]"), "X.limits"),
        (GOOD.replace("[X]\ntravel = 4000.0\nspeed = 10000.0", ""), "[X]"),
        (GOOD.replace("speed = 10000.0", "speed = 0.0", 1), "X.speed"),
        (GOOD.replace("speed = 10000.0", "velocity = 1.0", 1), "X.velocity"),
        (GOOD.replace("direction = [0, 0, 1]", "direction = [0, 0, 2]"), "C.direction"),
        (GOOD.replace("direction = [0, 0, 1]", "direction = [1, 0, 0]"), "chain"),
        (GOOD.replace("direction = [0, 0, 1]", "direction = [0, 1]"), "C.direction"),
        (GOOD.replace("sign = -1", "sign = 0", 1), "C.sign"),
        (GOOD.replace("limits_deg = [-179.0, 179.0]", "", 1), "A.limits_deg"),
        (GOOD.replace("endless = true", "endless = 1", 1), "C.endless"),
        (GOOD.replace("pivot = [1, 2, 0]", "pivot = [nan, 2, 0]"), "C.pivot"),
        (GOOD + "\n[Q]\nspeed = 1", "Q"),
        (GOOD + '\n[A2]\nx = "', "mend the file"),
        (machine_text(["C", "A", "XYZ"], {"C": axis([0, 0, 1], [0, 0, 0])}), "[A]"),
        (machine_text(["C", "A", "XYZ"], {}, 'programmed_point = "top"'), "programmed_point"),
    ],
)
def test_a_wrong_machine_file_is_refused_with_file_and_key(text, key, tmp_path):
    path = write(tmp_path, text)
    with pytest.raises(MachineError) as caught:
        read_machine(path)
    assert str(path) in str(caught.value)
    assert key in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_machine_is_refused_with_the_known_ones():
    with pytest.raises(MachineError, match=r"'nosuch' is unknown: use one of linuxcnc-xyzbc, mikron-ucp600"):
        read_machine("nosuch")
    with pytest.raises(
        MachineError,
        match=r"^none/mill\.toml: no such file: give a machine's \.toml file, or one of linuxcnc",
    ):
        read_machine("none/mill.toml")
