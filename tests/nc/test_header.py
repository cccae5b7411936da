"""What a machinist reads before the start, the safe start, and the end.

What the air check says is what someone before the machine sees: held against rotations of scipy, composed from the
machine file itself.
"""

import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from controls import KINDS, PAIRS
from machine_files import CHAINS
from scipy.spatial.transform import Rotation
from small_parts import UPRIGHT_CAPSULE
from tool_paths import TWO_PATHS

from bonecam.errors import ProgramError
from bonecam.job import Job
from bonecam.machine import forward, machine_names, read_machine
from bonecam.machine.control import Control
from bonecam.machine.kinematics import inverse_linear
from bonecam.machine.machine import MACHINES
from bonecam.mesh import TriangleMesh
from bonecam.nc import read_dialect, read_program, write_program
from bonecam.nc.header import (
    air_check_texts,
    part_texts,
    record_checks,
    record_simulation,
    second_setup_texts,
    zero_words,
)
from bonecam.nc.words import contour_tolerance, rotary_tolerance_deg
from bonecam.report.page.contents import program_contents
from bonecam.tool import Cutter, MoveKind
from bonecam.verify import Tolerances
from bonecam.verify.readback import compare_moves

MIKRON, HEIDENHAIN = read_machine("mikron-ucp600"), read_dialect("heidenhain")


@pytest.fixture(scope="module")
def text():
    job = Job().with_values(holding={"diameter": 4.0})
    return write_program(TWO_PATHS, MIKRON, HEIDENHAIN, job, stock=UPRIGHT_CAPSULE).text


def comments(text: str) -> str:
    """What the comments tell, without the ends of their lines."""
    return " ".join(line.strip() for line in re.findall(r"^(?:N?\d+ )?[;(](.*?)\)?$", text, re.MULTILINE))


def blocks(text: str) -> list[str]:
    """The blocks without numbers and comments."""
    plain = [re.sub(r"^\d+ ", "", line) for line in text.splitlines()]
    return [line for line in plain if not line.startswith(";")]


def test_the_header_says_what_to_mount_and_how_to_set_the_control(text):
    head = text[: text.index("TOOL CALL")]
    told = comments(head)
    for said in (
        "STOCK: CAPSULE, DIAMETER 13.20, LENGTH 15.20 MM",
        "STOCK: FROM Z -15.20 TO Z 0.00",
        "A BAR TURNED TO A CYLINDER WITH HALF A BALL AT EITHER END",
        "POST BELOW IT: DIAMETER 4.00 MM, FROM Z -44.60 TO Z -14.89, TURNED BEFORE",
        "NOTHING OF CHUCK, COLLET OR VICE MAY STAND ABOVE Z -44.60",
        "X 0 Y 0 ON THE AXIS OF THE POST, Z 0 ON THE END OF THE BAR AS IT IS CLAMPED",
        "TOUCH: THE END OF THE BAR AT Z 0.00",
        "RUN-OUT: 0.020 MM AT MOST, A DIAL ON THE BAR AT Z -6.60 AND Z -8.60",
        "TOOL 1: CUTTER TO 8.00 DIAMETER 4.00, SHANK TO 25.00 DIAMETER 4.00",
        "TOOL 1: HOLDER TO 75.00 DIAMETER 20.00",
        "TOOL 2: STICK-OUT 25.00 MM, S12000, F900 AT MOST, ABOUT",
        "CUTTING FEEDS: MEDIAN",
        "KEPT CLEAR OF: A SPINDLE NOSE OF 100 MM OF DIAMETER 80; A TABLE OF DIAMETER 280 MM",
        "NEEDS: FUNCTION TCPM OR M128",
        "FUNCTION TCPM KEEPS THE TIP",
        "TOOL TABLE: L FROM THE SPINDLE NOSE TO THE TIP",
        "RAPIDS: THE CONTROL MUST DRIVE THEM STRAIGHT",
        "C WORDS: WRAPPED TO -180..180 UNDER M126",
        "C MUST BE A MODULO AXIS",
        "CHECKS PASSED: NONE, THIS TEXT WAS NOT READ BACK",
        "REMOVAL NOT SIMULATED",
    ):
        assert said in told, said
    assert max(map(len, head.splitlines())) <= 80


def test_a_part_that_is_mirrored_and_scaled_is_told_to_be():
    job = Job().with_values(mesh={"mirror": "y", "scale": 1.25})
    text = write_program(TWO_PATHS, MIKRON, HEIDENHAIN, job, stock=UPRIGHT_CAPSULE).text
    assert "THE PART IS MIRRORED IN Y OF ITS FILE\n" in text
    assert "THE PART IS SCALED BY 1.25\n" in text
    assert part_texts(Job()) == []
    shell = TriangleMesh(np.eye(3), np.array([[0, 1, 2]], dtype=np.int32))
    zero = zero_words(read_machine("mikron-ucp600"), read_dialect("heidenhain"))
    second = second_setup_texts(job, shell, 5.0, zero)
    assert second[-2:] == part_texts(job)


def test_a_chuck_and_a_conical_holder_are_told():
    job = Job().with_values(
        holding={"chuck_diameter": 30.0, "chuck_height": 12.0}, roughing={"holder": "35 10 17, 20 40"}
    )
    cutter = Cutter.from_job(1, "roughing", job.tool("roughing"), MIKRON.nose)
    told = write_program([replace(TWO_PATHS[0], cutter=cutter)], MIKRON, HEIDENHAIN, job, stock=UPRIGHT_CAPSULE).text
    assert "A CHUCK OR COLLET OF AT MOST DIAMETER 30.00 MM ROUND THE POST, UP TO Z -32.60" in comments(told)
    assert "TABLE: Z -44.60 UNDER THE CHUCK" in told
    assert "TOOL 1: HOLDER TO 55.00 DIAMETER 10.00 TO 17.00, HOLDER TO 75.00 DIAMETER 40.00" in comments(told)
    assert max(map(len, told[: told.index("TOOL CALL")].splitlines())) <= 80


def test_riser_collet_stub_and_neck_are_told():
    holding = {"riser_diameter": 60.0, "riser_height": 5.0, "chuck_diameter": 28.0, "chuck_height": 12.0}
    stub = {"stub_diameter": 13.0, "stub_length": 8.0}
    job = Job().with_values(holding=holding | stub | {"diameter": 4.0})
    told = write_program(TWO_PATHS, MIKRON, HEIDENHAIN, job, stock=UPRIGHT_CAPSULE).text
    for said in (
        "NECK BELOW IT: DIAMETER 4.00 MM, FROM Z -24.60 TO Z ",
        "STUB BELOW THE NECK: BAR OF DIAMETER 13.00 MM, FROM Z -32.60 TO Z -24.60, STOCK AND NECK ARE TURNED FROM IT",
        "CLAMPING: A RISER OF AT MOST DIAMETER 60.00 MM, UP TO Z -39.60",
        "CLAMPING: A CHUCK OR COLLET OF AT MOST DIAMETER 28.00 MM ROUND THE STUB, UP TO Z -32.60",
        "TABLE: Z -44.60 UNDER THE RISER",
        "BAR: STANDS OUT 32.60 MM, ITS END OVER WHAT CLAMPS IT",
        "TOUCH: THE SHOULDER ROUND THE NECK AT Z -24.60",
        "RUN-OUT: 0.020 MM AT MOST, A DIAL ON THE BAR AT Z -6.60 AND Z -26.60",
    ):
        assert said in comments(told), said
    assert max(map(len, told[: told.index("TOOL CALL")].splitlines())) <= 80


def test_the_extents_in_the_header_are_those_of_the_blocks(text):
    motions = read_program(text, MIKRON, HEIDENHAIN)
    found = re.search(r"ROTARY AXES, DEGREES UNWOUND: B (\S+) TO (\S+), C (\S+) TO (\S+)", comments(text))
    assert found
    told = np.array([float(value) for value in found.groups()]).reshape(2, 2)
    angles = np.degrees(motions.words[:, 3:])
    # a wound axis is known up to whole turns from the text
    assert told[0].tolist() == pytest.approx([angles[:, 0].min(), angles[:, 0].max()], abs=1e-6)
    assert np.ptp(told[1]) == pytest.approx(np.ptp(angles[:, 1]), abs=1e-6)


def test_after_a_tool_call_x_and_y_come_first_and_the_way_down_is_along_the_tool(text):
    body = blocks(text)
    calls = [i for i, line in enumerate(body) if line.startswith("TOOL CALL")]
    assert len(calls) == 2
    motions = read_program(text, MIKRON, HEIDENHAIN)
    for call in calls:
        moves = [line for line in body[call:] if line.startswith("L ")][:5]
        assert moves[0] == "L M140 MB MAX"
        assert moves[1] == "L X+0.000 Y+0.000 R0 FMAX"
        assert re.fullmatch(r"L B\S+ C\S+ R0 FMAX", moves[2])
        assert all(re.fullmatch(r"L X\S+ Y\S+ Z\S+ R0 FMAX", move) for move in moves[3:])
    starts = np.flatnonzero(~motions.known_start)
    assert len(starts) == 2
    # the table's edge, 140 mm from the pivot, may stand upright beside the part
    assert (inverse_linear(MIKRON, motions.tips[starts], motions.words[starts, 3:])[:, 2] >= 150.0 - 0.002).all()
    for row in starts:
        down = motions.tips[row] - motions.tips[row + 1]
        assert down @ motions.axes[row] == pytest.approx(np.linalg.norm(down), abs=2e-3)
        assert down @ motions.axes[row] > 9.9


@pytest.mark.parametrize(("radius", "finishing", "angle"), [(2.0, True, 0.114), (1.0, True, 0.229)])
def test_the_rotary_tolerance_swings_the_ball_by_no_more_than_the_tolerance(radius, finishing, angle):
    job = Job()
    assert rotary_tolerance_deg(HEIDENHAIN, job, finishing, radius) == pytest.approx(angle)
    assert radius * math.sin(math.radians(angle)) <= job.path.chord_tolerance
    assert radius * math.sin(math.radians(angle + 0.001)) > job.path.chord_tolerance


def test_roughing_has_its_own_tolerance_and_never_a_finer_one_than_finishing():
    job = Job()
    assert contour_tolerance(HEIDENHAIN, job, finishing=False) == 0.02
    assert contour_tolerance(HEIDENHAIN, job, finishing=True) == pytest.approx(1.3 * 0.004)
    coarse = Job().with_values(path={"chord_tolerance": 0.1})
    assert contour_tolerance(HEIDENHAIN, coarse, finishing=False) == pytest.approx(0.13)
    assert rotary_tolerance_deg(HEIDENHAIN, job, False, 2.0) == pytest.approx(0.572)


@pytest.mark.parametrize(
    ("name", "short_way", "told"),
    [("heidenhain", "M126", "C WORDS: WOUND UP OVER MANY TURNS UNDER M127"), ("siemens-840d", "DC(", "C WORDS: WOUND")],
)
def test_wound_words_make_the_same_moves_without_the_short_way(name, short_way, told):
    dialect, job = read_dialect(name), Job().with_values(nc={"endless_words": "wound"})
    text = write_program(TWO_PATHS, MIKRON, dialect, job).text
    assert short_way not in text
    assert told in text
    assert max(abs(float(word)) for word in re.findall(r" C([+-]?\d+\.\d+)", text)) > 1000
    wound = read_program(text, MIKRON, dialect)
    compare_moves(wound, TWO_PATHS, dialect, Tolerances())
    wrapped = read_program(write_program(TWO_PATHS, MIKRON, dialect, Job()).text, MIKRON, dialect)
    assert np.allclose(np.diff(wound.words, axis=0)[:200], np.diff(wrapped.words, axis=0)[:200], atol=1e-9)


PLACED = """
[X]
travel = 900.0
speed = 22000.0
[Y]
travel = 900.0
speed = 22000.0
[Z]
travel = 900.0
speed = 22000.0
[A]
direction = [1.0, 0.0, 0.0]
pivot = [-310.0, -204.63, -443.7]
sign = -1
limits_deg = [-115.0, 30.0]
speed_deg_s = 90.0
[C]
direction = [0.0, 0.0, 1.0]
pivot = [-310.0, -205.0, 0.0]
sign = -1
endless = true
speed_deg_s = 120.0
"""


def test_in_machine_coordinates_the_header_tells_where_the_part_stands(tmp_path):
    chain = 'title = "trunnion"\nchain = ["C", "A", "XYZ"]\npart_zero = [-310.0, -205.0, -402.5]\n'
    (tmp_path / "trunnion.toml").write_text(chain + PLACED)
    machine, dialect = read_machine(tmp_path / "trunnion.toml"), read_dialect("linuxcnc")
    text = write_program(TWO_PATHS, machine, dialect, Job()).text
    assert "PROGRAM ZERO: X-310 Y-205 ON THE AXIS OF THE POST, Z-402.5 ON THE TABLE" in text
    assert "X 0 Y 0 Z 0: ZERO OF THE MACHINE FILE, NOT ON THE PART" in text
    place = np.array([[-310.0, -205.0, -402.5, 0.0, 0.0]])
    assert forward(machine, place, 75.0)[0] == pytest.approx(np.zeros((1, 3)), abs=1e-12)
    # words of the moves are of the same frame
    words = [re.match(r"G1 X(\S+) Y(\S+) Z(\S+) A", line) for line in text.splitlines()]
    places = np.array([[float(value) for value in found.groups()] for found in words if found])
    assert np.abs(places - place[0, :3]).max() < 150


def test_over_zero_is_over_the_part_in_machine_coordinates_too(tmp_path):
    chain = 'title = "trunnion"\nchain = ["C", "A", "XYZ"]\npart_zero = [-310.0, -205.0, -402.5]\n'
    (tmp_path / "trunnion.toml").write_text(chain + PLACED)
    dialect = read_dialect("linuxcnc")
    tool = dialect.templates.tool + "\nG0 {over_zero}"
    dialect = dialect.model_copy(update={"templates": dialect.templates.model_copy(update={"tool": tool})})
    text = write_program(TWO_PATHS, read_machine(tmp_path / "trunnion.toml"), dialect, Job()).text
    assert text.count("\nG0 X-310.00000 Y-205.00000\n") == 2
    with_zero = write_program(TWO_PATHS, read_machine("linuxcnc-xyzbc"), dialect, Job()).text
    assert with_zero.count("\nG0 X0.00000 Y0.00000\n") == 2
    assert "X 0 Y 0 Z 0: PROGRAM ZERO WITH ALL ROTARY AXES AT 0" in with_zero


@pytest.mark.parametrize("name", ["heidenhain", "linuxcnc"])
def test_where_rapids_may_be_bent_they_are_feeds_beside_the_part(name):
    machine = MIKRON if name == "heidenhain" else read_machine("linuxcnc-xyzbc")
    dialect = read_dialect(name).model_copy(update={"straight_rapids": False})
    program = write_program(TWO_PATHS, machine, dialect, Job())
    assert "RAPIDS: ONLY ABOVE THE PART" in program.text
    motions = read_program(program.text, machine, dialect)
    checked = compare_moves(motions, TWO_PATHS, dialect, Tolerances())
    kinds = np.concatenate([path.kinds for path in TWO_PATHS])
    reached = checked.source >= 0
    begins = (
        ~motions.known_start | np.r_[False, ~motions.known_start[:-1]] | np.r_[[False] * 2, ~motions.known_start[:-2]]
    )
    assert (kinds[checked.source[reached & ~begins]] == MoveKind.RAPID).any()
    assert not motions.rapid[reached & ~begins].any()
    with pytest.raises(Exception, match="meant rapid"):
        compare_moves(motions, TWO_PATHS, read_dialect(name), Tolerances())


@pytest.mark.parametrize("name", ["heidenhain", "linuxcnc"])
def test_checks_and_simulation_are_written_into_their_lines_and_nowhere_else(name):
    machine, dialect = PAIRS[name]
    posted = write_program(TWO_PATHS, machine, dialect, Job())
    proved = record_checks(posted, dialect, "text read back, gouge 1.00 um")
    simulated = record_simulation(proved, dialect, 0.1)
    both = zip(posted.text.splitlines(), simulated.text.splitlines(), strict=True)
    changed = [(before, after) for before, after in both if before != after]
    wanted = [
        ("CHECKS PASSED: NONE, THIS TEXT WAS NOT READ BACK", "CHECKS PASSED: TEXT READ BACK, GOUGE 1.00 UM"),
        ("REMOVAL NOT SIMULATED", "REMOVAL SIMULATED IN CELLS OF 0.1 MM"),
    ]
    assert len(changed) == 2
    for found, told in zip(changed, wanted, strict=True):
        for line, text in zip(found, told, strict=True):
            assert text in line
    with pytest.raises(ValueError, match=r"has no line .*CHECKS PASSED: NONE"):
        record_checks(proved, dialect, "again")
    with pytest.raises(ValueError, match=r"has no line .*REMOVAL NOT SIMULATED"):
        record_simulation(simulated, dialect, 0.2)


@pytest.mark.parametrize("name", KINDS)
def test_a_zero_on_the_end_of_the_bar_moves_the_words_and_not_the_part(name):
    machine, dialect = PAIRS[name]
    texts = [
        write_program(
            TWO_PATHS, machine, dialect, Job().with_values(nc={"part_zero": zero}), stock=UPRIGHT_CAPSULE
        ).text
        for zero in ("table", "bar")
    ]
    on_table, on_bar = (read_program(text, machine, dialect) for text in texts)
    high = UPRIGHT_CAPSULE.bounds[1, 2]
    np.testing.assert_allclose(on_table.words[:, 2] - on_bar.words[:, 2], high, atol=1e-9)
    np.testing.assert_allclose(on_bar.tips, on_table.tips, atol=1e-9)
    np.testing.assert_array_equal(on_bar.axes, on_table.axes)
    for one, other in zip(on_table.partial, on_bar.partial, strict=True):
        np.testing.assert_allclose(other.joints, one.joints, atol=1e-9)
    height = f"ZERO HEIGHT {high:.6f} OVER TABLE OR CLAMPING"
    assert texts[1].count(height) == 1
    with pytest.raises(ProgramError, match="the height of the program's zero stands twice"):
        read_program(texts[1].replace("REMOVAL NOT SIMULATED", height), machine, dialect)


def test_the_simulation_is_told_in_short_lines_that_begin_with_a_warning():
    posted = write_program(TWO_PATHS, MIKRON, HEIDENHAIN, Job(), stock=UPRIGHT_CAPSULE)
    told = "error kept 9.5 um; stress 67 of 490 N/mm2; warning: 12 % (95 % at 16 um) of the part " + "kept " * 20
    text = record_simulation(posted, HEIDENHAIN, 0.05, told).text
    assert "12 PERCENT, 95 PERCENT AT 16 UM, OF THE PART" in comments(text)
    assert re.search(r"^\d+ ; WARNING: 12 PERCENT", text, re.MULTILINE)
    assert max(map(len, text[: text.index("TOOL CALL")].splitlines())) <= 80
    assert text.count("\n") == posted.text.count("\n")


CHAIN_KINDS = ("table-table", "head-table", "head-head", "nutating")
WAYS = {letter + sign: float(sign + "1") * row for row, letter in zip(np.eye(3), "XYZ") for sign in "+-"}
SHIPPED = {name: (MACHINES / f"{name}.toml").read_text() for name in machine_names()}
WRONG_B = SHIPPED["mikron-ucp600"].replace("sign = -1", "sign = 1", 1)


def is_place(line: str) -> bool:
    """Whether a line belongs to the poses of one place."""
    return "one and the same place" in line or (line.startswith("X") and " Y" in line and "," not in line)


class Seen:
    """A machine file's bodies, moved by its own numbers: points of the table and the tip of a tool."""

    def __init__(self, text: str) -> None:
        self.file = tomllib.loads(text)
        at = self.file["chain"].index("XYZ")
        self.part, self.head = self.file["chain"][:at], self.file["chain"][at + 1 :]

    def turn(self, letter: str, points: np.ndarray, angles_deg: dict[str, float]) -> np.ndarray:
        axis = self.file[letter]
        angle = np.radians(angles_deg.get(letter, 0.0)) * axis["sign"]
        return Rotation.from_rotvec(angle * np.array(axis["direction"])).apply(points - axis["pivot"]) + axis["pivot"]

    def of_table(self, points: np.ndarray, angles_deg: dict[str, float]) -> np.ndarray:
        """Places of the part's points in the machine."""
        points = points + self.file["part_zero"]
        for letter in self.part:
            points = self.turn(letter, points, angles_deg)
        return points

    def tool(self, points: np.ndarray, angles_deg: dict[str, float]) -> np.ndarray:
        """Places of the tool's points, measured from the spindle nose that stands still while the axes are at zero."""
        for letter in reversed(self.head):
            points = self.turn(letter, points, angles_deg)
        return points

    def from_middle(self, point: np.ndarray, angles_deg: dict[str, float]) -> np.ndarray:
        """A mark of the table as seen from its middle."""
        mark, middle = self.of_table(np.array([point, np.zeros(3)]), angles_deg)
        return mark - middle

    def tip(self, angles_deg: dict[str, float], length: float = 100.0) -> np.ndarray:
        """The tip as seen from the spindle nose."""
        tip, nose = self.tool(np.array([[0.0, 0.0, -length], np.zeros(3)]), angles_deg)
        return tip - nose

    def lean(self, angles_deg: dict[str, float]) -> np.ndarray:
        """The way from tip to spindle along X, Y and Z of the table."""
        frame = np.array([self.from_middle(row, angles_deg) for row in np.eye(3)])
        return frame @ -self.tip(angles_deg)


def ways_of(told: str) -> list[np.ndarray]:
    return [WAYS[name] for name in told.split(" and ")]


@pytest.fixture(params=[*SHIPPED, "wrong-b", *CHAIN_KINDS])
def machine_file(request):
    return {**SHIPPED, "wrong-b": WRONG_B, **CHAINS}[request.param]


def texts_of(text: str, tmp_path: Path) -> list[str]:
    path = tmp_path / "machine.toml"
    path.write_text(text)
    control = Control(read_machine(path), tool_centre=True, radius=1.0, tool_length=75.0)
    return air_check_texts(control, read_dialect("heidenhain"), 33.2)


def test_every_sentence_is_what_is_seen(machine_file, tmp_path):
    seen, letters = Seen(machine_file), set()
    told = [line for line in texts_of(machine_file, tmp_path) if " to " in line and ": " in line]
    for line in told:
        held = re.match(r"(\w) at ([+-][\d.]+) and ", line)
        before = {held[1]: float(held[2])} if held else {}
        turn = re.search(r"(\w) to ([+-][\d.]+): ", line)
        assert turn
        after = {**before, turn[1]: float(turn[2])}
        letters.add(turn[1])
        if mark := re.search(r"a mark at (..) of the table must go to (.*)", line):
            assert turn[1] in seen.part
            way = seen.from_middle(WAYS[mark[1]], after) - WAYS[mark[1]]
            across = way - (way @ WAYS[mark[1]]) * WAYS[mark[1]]
            assert across @ ways_of(mark[2])[0] == pytest.approx(np.abs(across).max())
            assert all(way @ one > 0.3 for one in ways_of(mark[2]))
        elif swing := re.search(r"must swing from (.*) to (.*)", line):
            assert turn[1] in seen.head
            assert all(seen.tip(before) @ one > 30 for one in ways_of(swing[1]))
            assert all(seen.tip(after) @ one > 30 for one in ways_of(swing[2]))
        elif swing := re.search(r"must swing to (.*)", line):
            assert turn[1] in seen.head
            assert all((seen.tip(after) - seen.tip(before)) @ one > 30 for one in ways_of(swing[1]))
        else:
            lean = re.search(r"from tip to spindle, leans to (.*) of the table", line)
            assert lean
            assert all(seen.lean(after) @ one > 0 for one in ways_of(lean[1]))
    assert letters == {*seen.part, *seen.head}


def test_turns_stay_within_limits_and_begin_at_them(tmp_path):
    text = SHIPPED["mikron-ucp600"]
    short = texts_of(text.replace("[-115.0, 30.0]", "[-115.0, 12.0]"), tmp_path)
    assert "B to -30: a mark at X+ of the table must go to Z-" in short
    narrow = texts_of(text.replace("[-115.0, 30.0]", "[-5.0, 12.0]"), tmp_path)
    assert "B to +12: a mark at X+ of the table must go to Z+" in narrow
    beyond = texts_of(text.replace("[-115.0, 30.0]", "[-115.0, -20.0]"), tmp_path)
    assert "at B -20 and C 0 the tool must stand 20.000 degrees from square to the table" in beyond
    assert "B from -20 to -50: a mark at X+ of the table must go to Z-" in beyond


@pytest.mark.parametrize("kind", ["linuxcnc-xyzbc", *CHAIN_KINDS])
def test_words_of_the_place_check_keep_the_tip_on_it(kind, tmp_path):
    text = {**SHIPPED, **CHAINS}[kind]
    path = tmp_path / "machine.toml"
    path.write_text(text)
    control = Control(read_machine(path), tool_centre=False, radius=1.0, tool_length=75.0)
    told = [line for line in air_check_texts(control, read_dialect("linuxcnc"), 33.2) if is_place(line)]
    assert told[0].startswith("the tip must be at one and the same place, 84 mm over program zero")
    seen = Seen(text)
    assert len(told) == 4
    for line in told[1:]:
        words = {word[0]: float(word[1:]) for word in line.split()}
        angles = {letter: value for letter, value in words.items() if letter in "ABC"}
        # X Y Z are those of the tip with the head at zero: the spindle nose stands a length above them
        nose = np.array([words["X"], words["Y"], words["Z"] + 75.0])
        tip = nose + seen.tool(np.array([[0.0, 0.0, -75.0]]), angles)[0]
        place = seen.of_table(np.array([[0.0, 0.0, 84.0]]), angles)[0]
        assert tip == pytest.approx(place, abs=2e-5)


def test_poses_beyond_a_limit_are_left_out(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(CHAINS["head-table"].replace("[X]\ntravel = 4000.0", "[X]\nlimits = [-50.0, 50.0]"))
    control = Control(read_machine(path), tool_centre=False, radius=1.0, tool_length=75.0)
    told = [line for line in air_check_texts(control, read_dialect("linuxcnc"), 33.2) if is_place(line)]
    assert [re.search(r"B\S+", line)[0] for line in told[1:]] == ["B0.00000", "B0.00000"]  # type: ignore[index]


@pytest.mark.parametrize("name", KINDS)
def test_every_dialect_tells_the_check_and_which_way_it_goes(name):
    machine, dialect = read_machine("mikron-ucp600"), read_dialect(name)
    text = comments(write_program(TWO_PATHS, machine, dialect, Job(), stock=UPRIGHT_CAPSULE).text)
    plus = "X+" if "+" in dialect.comment_characters else "X PLUS"
    colon = ":" if ":" in dialect.comment_characters else " "
    assert (
        f"AIR CHECK{colon} C TO {'+' if plus == 'X+' else ' '}90{colon} A MARK AT {plus} OF THE TABLE MUST GO TO Y-"
        in text
    )
    assert f"LEANS TO {plus} OF THE TABLE" in text
    # where the control turns the words, its own comments tell how the tip is checked
    assert ("THE TIP MUST BE AT ONE AND THE SAME PLACE" in text) == (not dialect.tool_centre)


@pytest.mark.parametrize("name", ["mikron-ucp600", "linuxcnc-xyzbc"])
def test_the_page_leans_the_tool_as_the_check_tells(name):
    machine = read_machine(name)
    dialect = read_dialect("linuxcnc" if name.startswith("linuxcnc") else "heidenhain")
    program = write_program(TWO_PATHS, machine, dialect, Job())
    arrays = program_contents(program.text, {}, Job(), machine, dialect, surfaces={}).arrays
    told = re.search(r"leans to X(.) of the table", "\n".join(program.air_check))
    assert told
    lines = program.text.splitlines()
    checked = 0
    for line, axis in zip(arrays["move_line"], arrays["move_axis"], strict=True):
        words = dict(re.findall(r"([BC])([+-]?[\d.]+)", lines[int(line) - 1]))
        if set(words) == {"B", "C"} and np.cos(np.radians(float(words["C"]))) > 0.9 and abs(float(words["B"])) > 1:
            assert np.sign(axis[0]) == np.sign(float(words["B"])) * float(f"{told[1]}1")
            checked += 1
    assert checked
