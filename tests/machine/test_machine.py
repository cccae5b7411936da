"""What a machine file says and leaves unsaid is told to someone who writes one."""

import math
import re

import numpy as np
import pytest
from machine_files import CHAINS, write_machine

from bonecam.errors import MachineError
from bonecam.machine import check_machine
from bonecam.machine.bodies import Frustum, Table
from bonecam.machine.machine import MACHINES, machine_names, read_machine
from bonecam.machine.machine_file import SecondsTable


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
    assert read_machine(name) == read_machine(MACHINES / f"{name}.toml")


@pytest.mark.parametrize("kind", ["table-table", "head-table", "head-head", "nutating"])
def test_a_user_machine_is_read_by_path(kind, tmp_path):
    assert read_machine(write_machine(tmp_path, CHAINS[kind])).title == "test"


@pytest.mark.parametrize(
    ("base", "old", "new", "told"),
    [
        ("table-table", 'title = "test"', "", "title"),
        ("table-table", "['C', 'A', 'XYZ']", "['C', 'XYZ']", "chain"),
        ("table-table", "['C', 'A', 'XYZ']", "['C', 'C', 'XYZ']", "chain"),
        ("table-table", "['C', 'A', 'XYZ']", "['C', 'Q', 'XYZ']", "chain"),
        ("table-table", "[X]\ntravel = 4000.0", "[X]", "X.travel"),
        ("table-table", "[X]\ntravel = 4000.0", "[X]\nlimits = [3.0, 1.0]", "X.limits"),
        ("table-table", "[X]\ntravel = 4000.0\nspeed = 10000.0", "", "[X]"),
        ("table-table", "speed = 10000.0", "speed = 0.0", "X.speed"),
        ("table-table", "speed = 10000.0", "velocity = 1.0", "X.velocity"),
        ("table-table", "direction = [0, 0, 1]", "direction = [0, 0, 2]", "C.direction"),
        ("table-table", "direction = [0, 0, 1]", "direction = [1, 0, 0]", "chain"),
        ("table-table", "direction = [0, 0, 1]", "direction = [0, 1]", "C.direction"),
        ("table-table", "sign = -1", "sign = 0", "C.sign"),
        ("table-table", "limits_deg = [-179.0, 179.0]", "", "A.limits_deg"),
        ("table-table", "endless = true", "endless = 1", "C.endless"),
        ("table-table", "pivot = [1, 2, 0]", "pivot = [nan, 2, 0]", "C.pivot"),
        ("table-table", "[A]\n", "[B]\n", "[A]"),
        ("table-table", "part_zero", 'programmed_point = "top"\npart_zero', "programmed_point"),
        (
            "table-table",
            "part_zero",
            "part_z = [0.0, 1.0, 0.0]\npart_zero",
            "part_x: missing: part_x and part_z belong together",
        ),
        (
            "table-table",
            "part_zero",
            "part_z = [0.0, 1.0, 0.0]\npart_x = [0.0, 1.0, 0.0]\npart_zero",
            "part_x: is not at right angles to part_z",
        ),
        (
            "table-table",
            "['C', 'A'",
            "['A', 'C'",
            "part_z: missing: A carries the part and does not turn about the machine's Z",
        ),
        ("table-table", "limits_deg", "locked_deg = 3.0\nlimits_deg", "A.locked_deg: a locked axis has no limits"),
        (
            "table-table",
            "part_zero",
            "spindle_speed = 100.0\nspindle_lowest = 200.0\npart_zero",
            "spindle_lowest: 200: above",
        ),
        ("table-table", "[X]\n", "[Q]\nspeed = 1\n[X]\n", "Q"),
        ("table-table", "[X]\n", '[A2]\nx = "\n[X]\n', "correct the file"),
        ("table-table", "[X]\n", "[spindle]\nnose = []\n[X]\n", "spindle.nose"),
        ("table-table", "[X]\n", "[spindle]\nnose = [[30]]\n[X]\n", "spindle.nose[0]"),
        ("table-table", "[X]\n", "[spindle]\nnose = [[30, 80, 160, 3]]\n[X]\n", "spindle.nose[0]"),
        (
            "table-table",
            "[X]\n",
            "[spindle]\nnose = [[30, -80]]\n[X]\n",
            "spindle.nose[0][1]: -80: give a number above 0",
        ),
        ("table-table", "[X]\n", "[spindle]\nface = 3\n[X]\n", "spindle.face"),
        ("table-table", "[X]\n", "[table]\nwidth = 300\n[X]\n", "table.depth: missing: a plate has width and depth"),
        (
            "table-table",
            "[X]\n",
            "[table]\nwidth = 300\ndepth = 300\ndiameter = 3\n[X]\n",
            "table.diameter: a disc has no width and depth",
        ),
        ("table-table", "[X]\n", '[table]\nbeside = "open"\n[X]\n', "table.beside: 'open': give diameter"),
        ("table-table", "[X]\n", '[table]\nbeside = "shut"\n[X]\n', "table.beside: 'shut': choose one of"),
        (
            "pocket-nc",
            '["B", "A", "XYZ"]',
            '["B", "A", "X", "Y", "Z"]',
            'chain: it has 5 items: give one or two rotary letters and "XYZ"',
        ),
        ("pocket-nc", '["B", "A", "XYZ"]', '["XYZ"]', "chain: it has 1 item: give one or two"),
        (
            "pocket-nc",
            "direction = [1.0, 0.0, 0.0]",
            "direction = [0.0, 1.0, 1.0]",
            "A.direction: has length 1.41421: give a unit vector, [0.0, 0.7071",
        ),
        (
            "pocket-nc",
            "direction = [1.0, 0.0, 0.0]",
            "direction = [0.0, 0.0, 0.0]",
            "A.direction: has length 0: give a unit vector",
        ),
        (
            "pocket-nc",
            "part_x = [1.0, 0.0, 0.0]\npart_z = [0.0, 1.0, 0.0]\n",
            "",
            "part_z: missing: B carries the part",
        ),
        ("mikron-ucp600", "tool_change = 6.0\n", "", "seconds.tool_change: missing: add it"),
        ("mikron-ucp600", "retract = 2.0", "retract = -1.0", "seconds.retract: -1.0: give 0 or more"),
    ],
)
def test_a_wrong_machine_file_is_refused_in_one_line_with_file_and_key(base, old, new, told, tmp_path):
    """The file of a machine that ships, or of a chain, with one change."""
    text = CHAINS[base] if base in CHAINS else (MACHINES / f"{base}.toml").read_text()
    assert old in text
    check_refused(write_machine(tmp_path, text.replace(old, new, 1)), told)


def test_a_machine_file_holds_spindle_nose_and_table(tmp_path):
    bodies = """
[spindle]
nose = [[30, 80], [60, 80, 160]]
[table]
diameter = 280
beside = "open"
standing = [[20, 120.5]]
"""
    machine = read_machine(write_machine(tmp_path, CHAINS["table-table"] + bodies))
    assert machine.nose == (Frustum(30.0, 80.0, 80.0), Frustum(60.0, 80.0, 160.0))
    assert machine.table == Table(radius=140.0, open_beside=True, standing=(Frustum(20.0, 120.5, 120.5),))
    plate = read_machine(write_machine(tmp_path, CHAINS["table-table"] + "[table]\nwidth = 500\ndepth = 300"))
    assert plate.table == Table(half_width=250.0, half_depth=150.0)
    assert plate.nose == ()


@pytest.mark.parametrize("name", machine_names())
def test_every_shipped_machine_has_a_nose_and_a_table(name):
    machine = read_machine(name)
    assert machine.nose
    assert math.isfinite(machine.table.radius)


def test_all_faults_of_a_machine_file_are_told_at_once(tmp_path):
    text = (
        CHAINS["table-table"].replace("speed = 10000.0", 'speed = "fast"', 1).replace("endless = true", "endless = 1")
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


def test_a_jerk_is_read_per_minute_and_needs_an_acceleration(tmp_path):
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
def test_every_machine_that_ships_has_what_times_need_and_says_what_is_assumed(name):
    machine = read_machine(name)
    assert machine.knows_accelerations
    assert machine.seconds is not None
    assert bool(machine.time_assumed) is not name.startswith("linuxcnc")


def test_the_seconds_of_a_machine_are_read():
    assert read_machine("mikron-ucp600").seconds == SecondsTable(tool_change=6.0, spindle_start=2.0, retract=2.0)


@pytest.mark.parametrize("name", machine_names())
def test_every_shipped_machine_has_a_source_and_tells_what_is_assumed(name):
    found = check_machine(name)
    assert found.source
    assert found.assumed
    assert not found.doubtful
    assert "the tool leans from the part's Z by" in str(found)


def test_what_the_tool_reaches_is_a_band_a_circle_or_a_region(tmp_path):
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


def test_what_a_file_leaves_out_is_assumed(tmp_path):
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
def test_a_figure_in_another_unit_is_asked_about(right, wrong, asked, tmp_path):
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
def test_a_table_turned_over_and_a_pivot_out_of_reach_are_asked_about(right, wrong, asked, tmp_path):
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
def test_what_no_machine_is_like_is_asked_about(name, right, wrong, asked, tmp_path):
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
def test_an_axis_that_leans_nothing_is_refused(name, right, wrong, told, tmp_path):
    text = (MACHINES / f"{name}.toml").read_text()
    assert right in text
    path = tmp_path / "own.toml"
    path.write_text(text.replace(right, wrong, 1))
    with pytest.raises(MachineError, match=told):
        check_machine(path)
