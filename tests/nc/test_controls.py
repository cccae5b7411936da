"""Fanuc 30i and what is like it: rotary axes at zero where G43.4 is read, the ways under it, the frame.

Siemens 840D: what the control is told before the first move, at a tool change and at the end, and C by DC().
"""

import re
from functools import cache

import numpy as np
import pytest
from machine_files import axis, machine_text, write_machine
from small_parts import path_of
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

MIKRON, FANUC = read_machine("mikron-ucp600"), read_dialect("fanuc-30i")


@cache
def posted(name: str) -> str:
    return write_program(TWO_PATHS, MIKRON, read_dialect(name), Job(), name="O77").text


def heights(motions: Motions) -> np.ndarray:
    """Machine Z of the tip (mm) at each move."""
    return np.asarray(inverse_linear(MIKRON, motions.tips, motions.words[:, 3:])[:, 2])


def test_the_table_turns_above_everything_and_there_is_no_g00_under_g43_4():
    text = posted("fanuc-30i")
    motions = read_program(text, MIKRON, FANUC)
    checked = compare_moves(motions, TWO_PATHS, FANUC, Tolerances())
    first = np.flatnonzero(~motions.known_start)
    assert len(first) == 2
    assert not motions.rapid.any()
    for row, end in zip(first, np.flatnonzero(checked.source == 0).tolist() * 2, strict=False):
        turning = np.flatnonzero(np.diff(motions.words[row:, 3:], axis=0).any(1))
        assert heights(motions)[row] == pytest.approx(150.0)
        assert (heights(motions)[row : row + 1 + turning[0]] > 149.9).all()
        assert end > 0


def test_a_table_that_does_not_stand_at_zero_is_refused():
    text = posted("fanuc-30i")
    for wrong, why in (("B0.000 C45.000", "C is 45.000"), ("B-1.000 C0.000", "B is -1.000")):
        turned = text.replace("G00 B0.000 C0.000", f"G00 {wrong}", 1)
        with pytest.raises(ProgramError, match=f"{why} where tool-centre control is switched on"):
            read_program(turned, MIKRON, FANUC)


@pytest.mark.parametrize(
    ("name", "old", "new", "why"),
    [
        ("fanuc-30i", " G90\n", " G40\n", "moves by increments"),
        ("fanuc-30i", " G49\n", " G40\n", "machine coordinates while tool-centre control is on"),
        ("fanuc-30i", " H01\n", " H00\n", "moves without its length"),
        ("fanuc-30i", " M30\n", " M05\n", "no end"),
        ("siemens-840d", " D1\n", " G54\n", "tool 1 moves without its length"),
        ("siemens-840d", " TRAORI\n", " ORIMKS\n", "without tool-centre control"),
        ("siemens-840d", " T1\n", " M5\n", "tool 0 is called but not described"),
        ("siemens-840d", " TRAFOOF\nN", " TRAORI\nN", "machine coordinates while tool-centre control is on"),
        ("siemens-840d", " M30\n", " M5\n", "no end"),
        ("siemens-840d", " M5\n", " M30\n", "a block after the program's end"),
    ],
)
def test_a_mode_that_is_missing_is_refused(name, old, new, why):
    text = posted(name)
    assert old in text
    with pytest.raises(ProgramError, match=why):
        read_program(text.replace(old, new), MIKRON, read_dialect(name))


def test_a_machine_that_cannot_stand_at_zero_is_refused(tmp_path):
    rotary = {"C": axis([0, 0, 1], [0, 0, 0], -1, -300, 300), "B": axis([0, 1, 0], [0, 0, 0], -1, -100, -5)}
    machine = read_machine(write_machine(tmp_path, machine_text(["C", "B", "XYZ"], rotary)))
    tilt = np.radians(np.linspace(20, 50, 20))
    axes = np.column_stack([np.sin(tilt), np.zeros(20), np.cos(tilt)])
    tips = np.column_stack([np.linspace(0, 5, 20), np.zeros(20), np.full(20, 60.0)])
    what = "B of test cannot stand at zero, .*: take another controller, or machine"
    with pytest.raises(MachineError, match=what):
        write_program([path_of(tips, axes)], machine, FANUC, Job())


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


SIEMENS = read_dialect("siemens-840d")
DC = re.compile(r" C=DC\((-?\d+\.\d{3})\)")


def test_a_plain_word_of_c_is_driven_as_it_is():
    siemens_text = posted("siemens-840d")
    lines = siemens_text.splitlines()
    cut = next(k for k, line in enumerate(lines) if line.endswith("F900"))
    plain = DC.sub(" C720.000", lines[cut])
    with pytest.raises(ProgramError, match=rf"line {cut + 1}: C turns by .* half a turn is allowed"):
        read_program("\n".join([*lines[:cut], plain, *lines[cut + 1 :], ""]), MIKRON, SIEMENS)


def test_a_tool_is_not_changed_while_tool_centre_control_is_on():
    siemens_text = posted("siemens-840d")
    first = re.search(r"^N\d+ TRAFOOF\nN\d+ G0 SUPA Z0 D0\nN\d+ M5\n(.*\n)*?(?=N\d+ T2\n)", siemens_text, re.MULTILINE)
    assert first
    kept = re.sub(r"^(N\d+) .*$", r"\1 M5", first[0], flags=re.MULTILINE)
    with pytest.raises(ProgramError, match="a tool change while tool-centre control is on"):
        read_program(siemens_text.replace(first[0], kept), MIKRON, SIEMENS)
