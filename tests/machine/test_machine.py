import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bonecam.errors import MachineError
from bonecam.machine.bodies import Frustum, Table
from bonecam.machine.machine import MACHINES, machine_names, read_machine
from bonecam.machine.machine_file import SecondsTable


def test_the_mikron_is_the_one_whose_post_could_be_read(axis):
    machine = read_machine("mikron-ucp600")
    assert [axis.letter for axis in machine.part_axes] == ["C", "B"]
    assert machine.letters == "XYZBC"
    b, c = machine.rotary
    assert (math.degrees(b.limits[0]), math.degrees(b.limits[1])) == pytest.approx((-115, 30))
    assert c.endless
    assert [axis.travel for axis in machine.linear] == [600, 450, 450]


@pytest.mark.parametrize("name", machine_names())
def test_every_shipped_machine_is_read_the_same_by_name_and_by_path(name):
    assert read_machine(name) == read_machine(MACHINES / f"{name}.toml")


@pytest.mark.parametrize("kind", ["table-table", "head-table", "head-head", "nutating"])
def test_a_user_machine_is_read_by_path(write_machine, chains, kind, tmp_path):
    assert read_machine(write_machine(tmp_path, chains[kind])).title == "test"


@pytest.mark.parametrize(
    ("old", "new", "count", "key"),
    [
        ('title = "test"', "", -1, "title"),
        ("['C', 'A', 'XYZ']", "['C', 'XYZ']", -1, "chain"),
        ("['C', 'A', 'XYZ']", "['C', 'C', 'XYZ']", -1, "chain"),
        ("['C', 'A', 'XYZ']", "['C', 'Q', 'XYZ']", -1, "chain"),
        ("[X]\ntravel = 4000.0", "[X]", -1, "X.travel"),
        ("[X]\ntravel = 4000.0", "[X]\nlimits = [3.0, 1.0]", -1, "X.limits"),
        ("[X]\ntravel = 4000.0\nspeed = 10000.0", "", -1, "[X]"),
        ("speed = 10000.0", "speed = 0.0", 1, "X.speed"),
        ("speed = 10000.0", "velocity = 1.0", 1, "X.velocity"),
        ("direction = [0, 0, 1]", "direction = [0, 0, 2]", -1, "C.direction"),
        ("direction = [0, 0, 1]", "direction = [1, 0, 0]", -1, "chain"),
        ("direction = [0, 0, 1]", "direction = [0, 1]", -1, "C.direction"),
        ("sign = -1", "sign = 0", 1, "C.sign"),
        ("limits_deg = [-179.0, 179.0]", "", 1, "A.limits_deg"),
        ("endless = true", "endless = 1", 1, "C.endless"),
        ("pivot = [1, 2, 0]", "pivot = [nan, 2, 0]", -1, "C.pivot"),
    ],
)
def test_a_wrong_value_in_a_machine_file_is_refused_with_file_and_key(
    chains, write_machine, old, new, count, key, tmp_path
):
    good = chains["table-table"]
    assert old in good
    check_refused(write_machine(tmp_path, good.replace(old, new, count)), key)


@pytest.mark.parametrize(
    ("more", "key"), [("\n[Q]\nspeed = 1", "Q"), ('\n[A2]\nx = "', "correct the file")], ids=["table", "quote"]
)
def test_what_does_not_belong_into_a_machine_file_is_refused_with_file_and_key(
    write_machine, chains, more, key, tmp_path
):
    check_refused(write_machine(tmp_path, chains["table-table"] + more), key)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            '["B", "A", "XYZ"]',
            '["B", "A", "X", "Y", "Z"]',
            'chain: it has 5 items: give one or two rotary letters and "XYZ"',
        ),
        ('["B", "A", "XYZ"]', '["XYZ"]', "chain: it has 1 item: give one or two"),
        (
            "direction = [1.0, 0.0, 0.0]",
            "direction = [0.0, 1.0, 1.0]",
            "A.direction: has length 1.41421: give a unit vector, [0.0, 0.7071",
        ),
        ("direction = [1.0, 0.0, 0.0]", "direction = [0.0, 0.0, 0.0]", "A.direction: has length 0: give a unit vector"),
    ],
)
def test_a_wrong_chain_or_direction_is_told_with_the_right_one(old: str, new: str, told: str, tmp_path: Path) -> None:
    text = (MACHINES / "pocket-nc.toml").read_text()
    assert old in text
    path = tmp_path / "own.toml"
    path.write_text(text.replace(old, new, 1))
    check_refused(path, told)


def test_a_machine_file_without_an_axis_or_with_an_unknown_point_is_refused(
    write_machine, machine_text, axis, tmp_path
):
    chain = ["C", "A", "XYZ"]
    check_refused(write_machine(tmp_path, machine_text(chain, {"C": axis([0, 0, 1], [0, 0, 0])})), "[A]")
    check_refused(write_machine(tmp_path, machine_text(chain, {}, 'programmed_point = "top"')), "programmed_point")


def test_a_machine_file_holds_spindle_nose_and_table(write_machine, chains, tmp_path):
    bodies = """
[spindle]
nose = [[30, 80], [60, 80, 160]]
[table]
diameter = 280
beside = "open"
standing = [[20, 120.5]]
"""
    machine = read_machine(write_machine(tmp_path, chains["table-table"] + bodies))
    assert machine.nose == (Frustum(30.0, 80.0, 80.0), Frustum(60.0, 80.0, 160.0))
    assert machine.table == Table(radius=140.0, open_beside=True, standing=(Frustum(20.0, 120.5, 120.5),))
    plate = read_machine(write_machine(tmp_path, chains["table-table"] + "[table]\nwidth = 500\ndepth = 300"))
    assert plate.table == Table(half_width=250.0, half_depth=150.0)
    assert plate.nose == ()


@pytest.mark.parametrize("name", machine_names())
def test_every_shipped_machine_has_a_nose_and_a_table(name):
    machine = read_machine(name)
    assert machine.nose
    assert math.isfinite(machine.table.radius)


@pytest.mark.parametrize(
    ("bodies", "key"),
    [
        ("[spindle]\nnose = []", "spindle.nose"),
        ("[spindle]\nnose = [[30]]", r"spindle.nose[0]"),
        ("[spindle]\nnose = [[30, 80, 160, 3]]", r"spindle.nose[0]"),
        ("[spindle]\nnose = [[30, -80]]", r"spindle.nose[0][1]: -80: give a number above 0"),
        ("[spindle]\nface = 3", "spindle.face"),
        ("[table]\nwidth = 300", "table.depth: missing: a plate has width and depth"),
        ("[table]\nwidth = 300\ndepth = 300\ndiameter = 3", "table.diameter: a disc has no width and depth"),
        ('[table]\nbeside = "open"', "table.beside: 'open': give diameter"),
        ('[table]\nbeside = "shut"', "table.beside: 'shut': choose one of"),
    ],
)
def test_bodies_that_are_none_are_refused_with_file_and_key(write_machine, chains, bodies, key, tmp_path):
    check_refused(write_machine(tmp_path, chains["table-table"] + "\n" + bodies), key)


def test_all_faults_of_a_machine_file_are_told_at_once(chains, write_machine, tmp_path):
    text = (
        chains["table-table"].replace("speed = 10000.0", 'speed = "fast"', 1).replace("endless = true", "endless = 1")
    )
    path = write_machine(tmp_path, text.replace("sign = -1", "sign = 2", 1) + "colour = 3\n")
    with pytest.raises(MachineError) as caught:
        read_machine(path)
    assert str(caught.value) == (
        f"{path}: X.speed: 'fast': give a number; A.colour: unknown key: use one of acceleration_deg_s2, direction, "
        "endless, jerk_deg_s3, limits_deg, locked_deg, pivot, sign, speed_deg_s; C.sign: 2: give 1 or -1; "
        "C.endless: 1: give true or false"
    )


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"chain = " + b"[\n" * 10_000, "nest deeper than 10"),
        (b"a." * 4000 + b"a = 1", "nest deeper than 10"),
        (b"title = " + b"9" * 30, "title: a whole number of more than 64 bits: give a number that fits"),
        (b"title = " + b"9" * 5000, "correct the file"),
        (b"title = '" + b"x" * 20_000 + b"'", "line 1 has 20010 characters: 10000 are allowed"),
        (b"\n" * 200_000, "the text has 200000 characters"),
        (b"title = '\xff'", "correct the file"),
        (b"title = 1979-05-27", "title: datetime.date(1979, 5, 27): give a text"),
    ],
    ids=["arrays", "dotted", "bits", "digits", "line", "size", "latin", "date"],
)
def test_a_machine_file_that_is_no_sane_text_is_refused(text, why, tmp_path):
    path = tmp_path / "test.toml"
    path.write_bytes(text)
    check_refused(path, why)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (("part_zero", "part_z = [0.0, 1.0, 0.0]\npart_zero"), "part_x: missing: part_x and part_z belong together"),
        (
            ("part_zero", "part_z = [0.0, 1.0, 0.0]\npart_x = [0.0, 1.0, 0.0]\npart_zero"),
            "part_x: is not at right angles to part_z",
        ),
        (('["C", "A"', '["A", "C"'), "part_z: missing: A carries the part and does not turn about the machine's Z"),
        (("limits_deg", "locked_deg = 3.0\nlimits_deg"), "A.locked_deg: a locked axis has no limits"),
        (("part_zero", "spindle_speed = 100.0\nspindle_lowest = 200.0\npart_zero"), "spindle_lowest: 200: above"),
    ],
)
def test_what_a_machine_assumes_of_its_part_is_asked_for(write_machine, chains, change, key, tmp_path):
    text = chains["table-table"].replace("'C', 'A'", '"C", "A"').replace(*change, 1)
    check_refused(write_machine(tmp_path, text), key)


def test_a_trunnion_whose_table_stands_on_edge_is_refused_without_its_part_frame(tmp_path):
    text = (MACHINES / "pocket-nc.toml").read_text()
    path = tmp_path / "trunnion.toml"
    path.write_text(text.replace("part_x = [1.0, 0.0, 0.0]\n", "").replace("part_z = [0.0, 1.0, 0.0]\n", ""))
    check_refused(path, "part_z: missing: B carries the part")


def check_refused(path, key):
    """Reading the file fails in one line that names the file and the key."""
    with pytest.raises(MachineError) as caught:
        read_machine(path)
    assert str(path) in str(caught.value)
    assert key in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_machine_is_refused_with_the_known_ones():
    with pytest.raises(MachineError, match=r"'nosuch' is unknown: use one of dmu-45, haas-umc750, "):
        read_machine("nosuch")
    with pytest.raises(
        MachineError, match=r"^none/mill\.toml: no such file: give a machine's \.toml file, or one of dmu-45, haas"
    ):
        read_machine("none/mill.toml")


def test_a_jerk_is_read_per_minute_and_needs_an_acceleration(
    tmp_path: Path, write_machine: Callable[..., Path]
) -> None:
    text = (MACHINES / "hermle-c600u.toml").read_text()
    jerked = text.replace("acceleration = 6000.0", "acceleration = 6000.0\njerk = 50000.0")
    jerked = jerked.replace("acceleration_deg_s2 = 600.0", "acceleration_deg_s2 = 600.0\njerk_deg_s3 = 5000.0")
    machine = read_machine(write_machine(tmp_path, jerked))
    assert [axis.jerk for axis in machine.linear] == [50000.0 * 60**3] * 3
    assert [axis.jerk for axis in machine.rotary] == [pytest.approx(np.radians(5000.0) * 60**3), np.inf]
    for gone, told in (
        ("acceleration = 6000.0\n", "X.acceleration: missing beside jerk: add it"),
        ("acceleration_deg_s2 = 600.0\n", "A.acceleration_deg_s2: missing beside jerk_deg_s3: add it"),
    ):
        with pytest.raises(MachineError, match=re.escape(told)):
            read_machine(write_machine(tmp_path, jerked.replace(gone, "", 1)))


@pytest.mark.parametrize("name", machine_names())
def test_every_machine_that_ships_has_what_times_need_and_says_what_is_assumed(name: str) -> None:
    machine = read_machine(name)
    assert machine.knows_accelerations
    assert machine.seconds is not None
    assert bool(machine.time_assumed) is not name.startswith("linuxcnc")


def test_seconds_are_whole_or_refused(tmp_path: Path, write_machine: Callable[..., Path]) -> None:
    text = (MACHINES / "mikron-ucp600.toml").read_text()
    assert read_machine(write_machine(tmp_path, text)).seconds == SecondsTable(
        tool_change=6.0, spindle_start=2.0, retract=2.0
    )
    for right, wrong, told in (
        ("tool_change = 6.0\n", "", "seconds.tool_change: missing: add it"),
        ("retract = 2.0", "retract = -1.0", "seconds.retract: -1.0: give 0 or more"),
    ):
        with pytest.raises(MachineError, match=re.escape(told)):
            read_machine(write_machine(tmp_path, text.replace(right, wrong)))
