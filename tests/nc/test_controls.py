"""Fanuc 30i and what is like it: rotary axes at zero where G43.4 is read, the ways under it, the frame.

Siemens 840D: what the control is told before the first move, at a tool change and at the end, and C by DC().
"""

import re

import numpy as np
import pytest
from machine_files import axis, machine_text, write_machine
from small_parts import capsule_path, path_of
from tool_paths import TWO_PATHS

from bonecam.errors import MachineError, ProgramError
from bonecam.job import Job
from bonecam.machine import read_machine
from bonecam.machine.kinematics import inverse_linear
from bonecam.nc import Motions, read_dialect, read_program, write_program
from bonecam.nc.dialect import DIALECTS
from bonecam.nc.program import program_number
from bonecam.verify import Tolerances
from bonecam.verify.readback import compare_moves

MIKRON = read_machine("mikron-ucp600")
SWITCHES = {
    "fanuc-30i": (["G05.1 Q1"], ["G49", "G05.1 Q0"]),
    "makino": (["M250", "G05 P10000"], ["G49", "G05 P0"]),
    "mitsubishi": (["G05.1 Q1"], ["G49", "G05.1 Q0"]),
}


@pytest.fixture(scope="module", params=SWITCHES)
def name(request):
    return str(request.param)


@pytest.fixture(scope="module")
def text(name):
    return write_program(TWO_PATHS, MIKRON, read_dialect(name), Job(), name="O77").text


def blocks(text: str) -> list[str]:
    """The blocks without numbers and comments."""
    return [re.sub(r"^N\d+ ", "", line) for line in text.splitlines() if not line.startswith("(")]


def heights(motions: Motions) -> np.ndarray:
    """Machine Z of the tip (mm) at each move."""
    return np.asarray(inverse_linear(MIKRON, motions.tips, motions.words[:, 3:])[:, 2])


def test_frame_number_and_safe_start(text, name):
    body = blocks(text)
    _, off = SWITCHES[name]
    assert body[:2] == ["%", "O0077"]
    assert body[2 : 2 + len(off) + 2] == [*off, "G21 G17 G40 G49 G80 G90 G94", "G64 G69 G97"]
    assert body[-7:] == [*off, "G28 G91 Z0.", "G90", "M05", "M30", "%"]
    numbered = [line for line in text.splitlines() if line[0] not in "%O("]
    assert [line.split()[0] for line in numbered] == [f"N{k}" for k in range(1, len(numbered) + 1)]


def test_every_coordinate_and_feed_has_a_decimal_point_and_comments_are_capitals(text):
    for line in text.splitlines():
        if line.startswith("("):
            assert re.fullmatch(r"\([A-Z0-9 .,=-]*\)", line)
        else:
            assert not re.search(r"[XYZBCF]-?\d+(?![\d.])", line)


def test_g43_4_is_read_with_its_length_and_all_rotary_axes_at_zero(text, name):
    body = blocks(text)
    on, _ = SWITCHES[name]
    starts = [k for k, block in enumerate(body) if "G43.4" in block]
    assert [body[k] for k in starts] == ["G00 G43.4 Z150.000 H01", "G00 G43.4 Z150.000 H02"]
    for k in starts:
        assert body[k - len(on) : k] == on
        assert body[k - len(on) - 1] == "G00 B0.000 C0.000"
        assert body[k + 1].startswith("G01 X0.000 Y0.000 Z150.000 B0.000 C0.000 F")
        before = body[: k - len(on) - 1][::-1]
        assert [block for block in before if not block.startswith("S")][:3] == [
            "G00 X0.000 Y0.000",
            f"T{1 + starts.index(k)} M06",
            "G90",
        ]


def test_the_table_turns_above_everything_and_there_is_no_g00_under_g43_4(text, name):
    motions = read_program(text, MIKRON, read_dialect(name))
    checked = compare_moves(motions, TWO_PATHS, read_dialect(name), Tolerances())
    first = np.flatnonzero(~motions.known_start)
    assert len(first) == 2
    assert not motions.rapid.any()
    for row, end in zip(first, np.flatnonzero(checked.source == 0).tolist() * 2, strict=False):
        turning = np.flatnonzero(np.diff(motions.words[row:, 3:], axis=0).any(1))
        assert heights(motions)[row] == pytest.approx(150.0)
        assert (heights(motions)[row : row + 1 + turning[0]] > 149.9).all()
        assert end > 0


def test_a_tool_dropped_by_its_length_at_g49_stays_above_everything(text, name):
    motions = read_program(text, MIKRON, read_dialect(name))
    lines = text.splitlines()
    ends = [k for k, line in enumerate(lines, start=1) if line.endswith(" G49")][1:]
    for end in ends:
        last = np.flatnonzero(motions.lines < end)[-1]
        tool = motions.controls[int(motions.tools[last])]
        assert heights(motions)[last] - tool.tool_length == pytest.approx(150.0, abs=0.001)
        rise = motions.tips[last] - motions.tips[last - 1]
        assert rise @ motions.axes[last] == pytest.approx(np.linalg.norm(rise), abs=1e-3)


def test_a_table_that_does_not_stand_at_zero_is_refused(text, name):
    for wrong, why in (("B0.000 C45.000", "C is 45.000"), ("B-1.000 C0.000", "B is -1.000")):
        turned = text.replace("G00 B0.000 C0.000", f"G00 {wrong}", 1)
        with pytest.raises(ProgramError, match=f"{why} where tool-centre control is switched on"):
            read_program(turned, MIKRON, read_dialect(name))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (" G90\n", " G40\n", "moves by increments"),
        (" G49\n", " G40\n", "machine coordinates while tool-centre control is on"),
        (" H01\n", " H00\n", "moves without its length"),
        (" M30\n", " M05\n", "no end"),
    ],
)
def test_a_mode_that_is_missing_is_refused(text, name, old, new, why):
    assert old in text
    with pytest.raises(ProgramError, match=why):
        read_program(text.replace(old, new), MIKRON, read_dialect(name))


def test_a_machine_that_cannot_stand_at_zero_is_refused(name, tmp_path):
    rotary = {"C": axis([0, 0, 1], [0, 0, 0], -1, -300, 300), "B": axis([0, 1, 0], [0, 0, 0], -1, -100, -5)}
    machine = read_machine(write_machine(tmp_path, machine_text(["C", "B", "XYZ"], rotary)))
    tilt = np.radians(np.linspace(20, 50, 20))
    axes = np.column_stack([np.sin(tilt), np.zeros(20), np.cos(tilt)])
    tips = np.column_stack([np.linspace(0, 5, 20), np.zeros(20), np.full(20, 60.0)])
    what = "B of test cannot stand at zero, .*: take another controller, or machine"
    with pytest.raises(MachineError, match=what):
        write_program([path_of(tips, axes)], machine, read_dialect(name), Job())


def test_words_that_are_always_wrapped_cannot_be_wound(name):
    job = Job().with_values(nc={"endless_words": "wound"})
    with pytest.raises(MachineError, match=f"{name} has no blocks that switch the short way"):
        write_program(TWO_PATHS, MIKRON, read_dialect(name), job)


def test_a_limited_table_that_is_rewound_starts_from_zero_again(tmp_path):
    rotary = {"C": axis([0, 0, 1], [0, 0, 0], -1, -300, 300), "B": axis([0, 1, 0], [0, 0, 0], -1, -100, 0)}
    machine = read_machine(write_machine(tmp_path, machine_text(["C", "B", "XYZ"], rotary)))
    path, dialect = capsule_path(turns=1.4, count=200), read_dialect("fanuc-30i")
    program = write_program([path], machine, dialect, Job())
    assert program.rewinds > 0
    assert program.text.count("G43.4 Z") == program.rewinds + 1
    motions = read_program(program.text, machine, dialect)
    compare_moves(motions, [path], dialect, Tolerances())
    assert program.moves == motions.blocks


def test_block_numbers_begin_again_behind_the_highest(tmp_path):
    file = tmp_path / "short.toml"
    file.write_text((DIALECTS / "fanuc-30i.toml").read_text().replace("highest = 99999\n", "highest = 100\n"))
    dialect = read_dialect(file)
    text = write_program(TWO_PATHS, MIKRON, dialect, Job()).text
    assert len(re.findall("^N100 ", text, re.MULTILINE)) == len(re.findall("^N1 ", text, re.MULTILINE)) - 1 > 1
    compare_moves(read_program(text, MIKRON, dialect), TWO_PATHS, dialect, Tolerances())


def test_the_number_of_a_program_is_that_of_its_name_or_drawn_from_it():
    assert [program_number(name) for name in ("O1", "O0077", "O7999")] == [1, 77, 7999]
    drawn = [program_number(name) for name in ("BONE", "BONE_SECOND", "O8000", "O0", "PHALANX")]
    assert all(1000 <= number <= 7999 for number in drawn)
    assert len(set(drawn)) == 5
    assert program_number("BONE") == drawn[0]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('like = "fanuc"', "like: 'fanuc': use one of fanuc-30i, heidenhain"),
        ("like = 3", "like: '3': use one of"),
        ('like = "makino"', "like: makino is itself like another: use fanuc-30i"),
        ('like = "fanuc-30i"\ntitel = "x"', "titel: unknown key"),
        ('like = "heidenhain"\ngrammar = "iso"\nstarts_at_zero = true', "starts_at_zero: true: only with"),
        ('like = "linuxcnc"\nstarts_at_zero = true', "starts_at_zero: true: only with"),
    ],
)
def test_a_dialect_like_another_is_checked_as_a_whole(text, why, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(MachineError) as caught:
        read_dialect(file)
    assert f"{file}: {why}" in str(caught.value)


def test_a_dialect_like_another_has_all_that_it_leaves_out(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('like = "siemens-840d"\ntitle = "Mine"\n[templates]\ncoolant_on = "M7"\n')
    mine, theirs = read_dialect(file), read_dialect("siemens-840d")
    assert mine.title == "Mine"
    assert mine.templates == theirs.templates.model_copy(update={"coolant_on": "M7"})
    assert mine.codes == theirs.codes


MIKRON_SIEMENS, SIEMENS = read_machine("mikron-ucp600"), read_dialect("siemens-840d")
DC = re.compile(r" C=DC\((-?\d+\.\d{3})\)")


@pytest.fixture(scope="module")
def siemens_text():
    return write_program(TWO_PATHS, MIKRON_SIEMENS, SIEMENS, Job()).text


def siemens_blocks(text: str) -> list[str]:
    """The blocks without numbers and comments."""
    return [re.sub(r"^N\d+ ", "", line) for line in text.splitlines() if not line.startswith(";")]


def test_blocks_are_numbered_in_tens_and_comments_are_not(siemens_text):
    numbered = [line for line in siemens_text.splitlines() if not line.startswith("; ")]
    assert [int(line.split()[0][1:]) for line in numbered] == [10 * (k + 1) for k in range(len(numbered))]


def test_the_program_begins_with_nothing_on_and_ends_so(siemens_text):
    body = siemens_blocks(siemens_text)
    assert body[:6] == [
        "TRAFOOF",
        "G17 G40 G90 G94 G710",
        "G54",
        "TRANS",
        "RTLION",
        "CYCLE832(0.005,_ORI_FINISH,0.229)",
    ]
    assert body[-6:] == ["M9", "TRAFOOF", "G0 SUPA Z0 D0", "M5", "CYCLE832()", "M30"]


def test_each_tool_has_datum_and_length_before_it_moves_down(siemens_text):
    body = siemens_blocks(siemens_text)
    changes = [k for k, block in enumerate(body) if block == "M6"]
    assert [body[k - 1] for k in changes] == ["T1", "T2"]
    for k in changes:
        assert body[k - 2] == "G0 SUPA Z0 D0"
        assert body[k + 1 : k + 4] == ["D1", "S12000 M3", "G0 X0.000 Y0.000"]
        assert body[k - 3].startswith("CYCLE832(")
        assert re.fullmatch(r"G0 B-?[\d.]+ C=DC\([\d.]+\)", body[k + 4])
        assert body[k + 5 : k + 9] == ["TRAORI", "G54 D1", "ORIMKS", "ORIAXES"]
        assert all(re.fullmatch(r"G0 X\S+ Y\S+ Z\S+", block) for block in body[k + 9 : k + 11])
    assert body.count("TRAORI") == 2
    assert "CYCLE832(0.020,_ORI_ROUGH,0.572)" in body


def test_words_of_c_are_within_a_turn_and_take_the_short_way(siemens_text):
    words = np.array([float(word) for word in DC.findall(siemens_text)])
    assert words.min() >= 0
    assert words.max() < 360
    assert (np.abs(np.diff(words)) > 180).any()
    motions = read_program(siemens_text, MIKRON_SIEMENS, SIEMENS)
    compare_moves(motions, TWO_PATHS, SIEMENS, Tolerances())
    turns = np.degrees(np.diff(motions.words[:, 4]))[motions.known_start[1:]]
    assert np.abs(turns).max() < 91
    assert "C WORDS: WRAPPED TO 0..360 AS C=DC(), THE CONTROL TAKES THE SHORT WAY" in siemens_text


def test_a_job_may_have_c_wound_by_plain_words():
    job = Job().with_values(nc={"endless_words": "wound"})
    text = write_program(TWO_PATHS, MIKRON_SIEMENS, SIEMENS, job).text
    assert "DC(" not in text
    assert max(abs(float(word)) for word in re.findall(r" C(-?\d+\.\d+)", text)) > 1000
    compare_moves(read_program(text, MIKRON_SIEMENS, SIEMENS), TWO_PATHS, SIEMENS, Tolerances())


def test_a_plain_word_of_c_is_driven_as_it_is(siemens_text):
    lines = siemens_text.splitlines()
    cut = next(k for k, line in enumerate(lines) if line.endswith("F900"))
    plain = DC.sub(" C720.000", lines[cut])
    with pytest.raises(ProgramError, match=rf"line {cut + 1}: C turns by .* half a turn is allowed"):
        read_program("\n".join([*lines[:cut], plain, *lines[cut + 1 :], ""]), MIKRON_SIEMENS, SIEMENS)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (" D1\n", " G54\n", "tool 1 moves without its length"),
        (" TRAORI\n", " ORIMKS\n", "without tool-centre control"),
        (" T1\n", " M5\n", "tool 0 is called but not described"),
        (" TRAFOOF\nN", " TRAORI\nN", "machine coordinates while tool-centre control is on"),
        (" M30\n", " M5\n", "no end"),
        (" M5\n", " M30\n", "a block after the program's end"),
    ],
)
def test_a_mode_of_siemens_that_is_missing_is_refused(siemens_text, old, new, why):
    assert old in siemens_text
    with pytest.raises(ProgramError, match=why):
        read_program(siemens_text.replace(old, new), MIKRON_SIEMENS, SIEMENS)


def test_a_tool_is_not_changed_while_tool_centre_control_is_on(siemens_text):
    first = re.search(r"^N\d+ TRAFOOF\nN\d+ G0 SUPA Z0 D0\nN\d+ M5\n(.*\n)*?(?=N\d+ T2\n)", siemens_text, re.MULTILINE)
    assert first
    kept = re.sub(r"^(N\d+) .*$", r"\1 M5", first[0], flags=re.MULTILINE)
    with pytest.raises(ProgramError, match="a tool change while tool-centre control is on"):
        read_program(siemens_text.replace(first[0], kept), MIKRON_SIEMENS, SIEMENS)
