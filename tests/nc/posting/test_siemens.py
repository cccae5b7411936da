"""Siemens 840D: what the control is told before the first move, at a tool change and at the end, and C by DC()."""

import re

import numpy as np
import pytest

from bonecam.errors import ProgramError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.tool.path import ToolPath
from bonecam.verify.readback import Tolerances, compare_moves

MIKRON, SIEMENS = read_machine("mikron-ucp600"), read_dialect("siemens-840d")
DC = re.compile(r" C=DC\((-?\d+\.\d{3})\)")


@pytest.fixture(scope="module")
def text(paths: tuple[ToolPath, ToolPath]) -> str:
    return write_program(paths, MIKRON, SIEMENS, Job()).text


def blocks(text: str) -> list[str]:
    """The blocks without numbers and comments."""
    return [re.sub(r"^N\d+ ", "", line) for line in text.splitlines() if not line.startswith(";")]


def test_blocks_are_numbered_in_tens_and_comments_are_not(text: str) -> None:
    numbered = [line for line in text.splitlines() if not line.startswith("; ")]
    assert [int(line.split()[0][1:]) for line in numbered] == [10 * (k + 1) for k in range(len(numbered))]


def test_the_program_begins_with_nothing_on_and_ends_so(text: str) -> None:
    body = blocks(text)
    assert body[:6] == [
        "TRAFOOF",
        "G17 G40 G90 G94 G710",
        "G54",
        "TRANS",
        "RTLION",
        "CYCLE832(0.005,_ORI_FINISH,0.229)",
    ]
    assert body[-6:] == ["M9", "TRAFOOF", "G0 SUPA Z0 D0", "M5", "CYCLE832()", "M30"]


def test_each_tool_has_datum_and_length_before_it_moves_down(text: str) -> None:
    body = blocks(text)
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


def test_words_of_c_are_within_a_turn_and_take_the_short_way(text: str, paths) -> None:
    words = np.array([float(word) for word in DC.findall(text)])
    assert words.min() >= 0
    assert words.max() < 360
    assert (np.abs(np.diff(words)) > 180).any()
    motions = read_program(text, MIKRON, SIEMENS)
    compare_moves(motions, paths, SIEMENS, Tolerances())
    turns = np.degrees(np.diff(motions.words[:, 4]))[motions.known_start[1:]]
    assert np.abs(turns).max() < 91
    assert "C WORDS: WRAPPED TO 0..360 AS C=DC(), THE CONTROL TAKES THE SHORT WAY" in text


def test_a_job_may_have_c_wound_by_plain_words(paths) -> None:
    job = Job().with_values(nc={"endless_words": "wound"})
    text = write_program(paths, MIKRON, SIEMENS, job).text
    assert "DC(" not in text
    assert max(abs(float(word)) for word in re.findall(r" C(-?\d+\.\d+)", text)) > 1000
    compare_moves(read_program(text, MIKRON, SIEMENS), paths, SIEMENS, Tolerances())


def test_a_plain_word_of_c_is_driven_as_it_is(text: str) -> None:
    lines = text.splitlines()
    cut = next(k for k, line in enumerate(lines) if line.endswith("F900"))
    plain = DC.sub(" C720.000", lines[cut])
    with pytest.raises(ProgramError, match=rf"line {cut + 1}: C turns by .* half a turn is allowed"):
        read_program("\n".join([*lines[:cut], plain, *lines[cut + 1 :], ""]), MIKRON, SIEMENS)


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
def test_a_mode_that_is_missing_is_refused(text: str, old: str, new: str, why: str) -> None:
    assert old in text
    with pytest.raises(ProgramError, match=why):
        read_program(text.replace(old, new), MIKRON, SIEMENS)


def test_a_tool_is_not_changed_while_tool_centre_control_is_on(text: str) -> None:
    first = re.search(r"^N\d+ TRAFOOF\nN\d+ G0 SUPA Z0 D0\nN\d+ M5\n(.*\n)*?(?=N\d+ T2\n)", text, re.MULTILINE)
    assert first
    kept = re.sub(r"^(N\d+) .*$", r"\1 M5", first[0], flags=re.MULTILINE)
    with pytest.raises(ProgramError, match="a tool change while tool-centre control is on"):
        read_program(text.replace(first[0], kept), MIKRON, SIEMENS)
