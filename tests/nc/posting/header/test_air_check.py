"""What the air check says is what someone before the machine sees: held against rotations of scipy, composed from the
machine file itself."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bonecam.job import Job
from bonecam.machine.control import Control
from bonecam.machine.machine import MACHINES, machine_names, read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.header import air_check_texts
from bonecam.nc.posting import write_program
from bonecam.report.page.contents import program_contents
from bonecam.setup.capsule import Capsule

KINDS = ("table-table", "head-table", "head-head", "nutating")
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


@pytest.fixture(params=[*SHIPPED, "wrong-b", *KINDS])
def text(request: pytest.FixtureRequest, chains: dict[str, str]) -> str:
    return {**SHIPPED, "wrong-b": WRONG_B, **chains}[request.param]


def texts_of(text: str, tmp_path: Path) -> list[str]:
    path = tmp_path / "machine.toml"
    path.write_text(text)
    control = Control(read_machine(path), tool_centre=True, radius=1.0, tool_length=75.0)
    return air_check_texts(control, read_dialect("heidenhain"), 33.2)


def test_every_sentence_is_what_is_seen(text: str, tmp_path: Path) -> None:
    seen, letters = Seen(text), set()
    told = [line for line in texts_of(text, tmp_path) if " to " in line and ": " in line]
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


def test_a_wrong_direction_of_any_axis_is_told_otherwise(text: str, tmp_path: Path) -> None:
    right = texts_of(text, tmp_path)
    for letter in set("ABC") & set(Seen(text).file):
        head, table = text.split(f"[{letter}]")
        sign = re.search(r"sign = (-?1)", table)
        assert sign
        wrong = f"{head}[{letter}]" + table.replace(sign[0], f"sign = {-int(sign[1])}", 1)
        differ = [line for line in right if line not in texts_of(wrong, tmp_path)]
        assert any(f"{letter} to " in line for line in differ)


def test_the_check_of_the_mikron_and_of_its_wrong_b(tmp_path: Path) -> None:
    assert texts_of(SHIPPED["mikron-ucp600"], tmp_path)[3:] == [
        "at B 0 and C 0 the tool must stand square to the table, X+ of the blank towards X+",
        "B to +30: a mark at X+ of the table must go to Z+",
        "B to +30: the tool, from tip to spindle, leans to X+ of the table",
        "C to +90: a mark at X+ of the table must go to Y-",
    ]
    assert texts_of(WRONG_B, tmp_path)[4:6] == [
        "B to +30: a mark at X+ of the table must go to Z-",
        "B to +30: the tool, from tip to spindle, leans to X- of the table",
    ]


def test_a_head_is_watched_at_its_tip_and_its_turn_by_the_tilt(chains: dict[str, str], tmp_path: Path) -> None:
    assert texts_of(chains["head-head"], tmp_path)[4:] == [
        "A to +30: the tip of the tool must swing to Y+",
        "A to +30: the tool, from tip to spindle, leans to Y- of the table",
        "A at +30 and C to +90: the tip of the tool must swing from Y+ to X-",
    ]


def test_turns_stay_within_limits_and_begin_at_them(tmp_path: Path) -> None:
    text = SHIPPED["mikron-ucp600"]
    short = texts_of(text.replace("[-115.0, 30.0]", "[-115.0, 12.0]"), tmp_path)
    assert "B to -30: a mark at X+ of the table must go to Z-" in short
    narrow = texts_of(text.replace("[-115.0, 30.0]", "[-5.0, 12.0]"), tmp_path)
    assert "B to +12: a mark at X+ of the table must go to Z+" in narrow
    beyond = texts_of(text.replace("[-115.0, 30.0]", "[-115.0, -20.0]"), tmp_path)
    assert "at B -20 and C 0 the tool must stand 20.000 degrees from square to the table" in beyond
    assert "B from -20 to -50: a mark at X+ of the table must go to Z-" in beyond


@pytest.mark.parametrize("kind", ["linuxcnc-xyzbc", *KINDS])
def test_words_of_the_place_check_keep_the_tip_on_it(kind: str, chains: dict[str, str], tmp_path: Path) -> None:
    text = {**SHIPPED, **chains}[kind]
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


def test_poses_beyond_a_limit_are_left_out(chains: dict[str, str], tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    path.write_text(chains["head-table"].replace("[X]\ntravel = 4000.0", "[X]\nlimits = [-50.0, 50.0]"))
    control = Control(read_machine(path), tool_centre=False, radius=1.0, tool_length=75.0)
    told = [line for line in air_check_texts(control, read_dialect("linuxcnc"), 33.2) if is_place(line)]
    assert [re.search(r"B\S+", line)[0] for line in told[1:]] == ["B0.00000", "B0.00000"]  # type: ignore[index]


@pytest.mark.parametrize("name", ["heidenhain", "siemens-840d", "fanuc-30i", "makino", "mitsubishi", "linuxcnc"])
def test_every_dialect_tells_the_check_and_which_way_it_goes(name: str, paths, upright_capsule: Capsule) -> None:
    machine, dialect = read_machine("mikron-ucp600"), read_dialect(name)
    text = write_program(paths, machine, dialect, Job(), stock=upright_capsule).text
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
def test_the_page_leans_the_tool_as_the_check_tells(name: str, paths) -> None:
    machine = read_machine(name)
    dialect = read_dialect("linuxcnc" if name.startswith("linuxcnc") else "heidenhain")
    program = write_program(paths, machine, dialect, Job())
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
