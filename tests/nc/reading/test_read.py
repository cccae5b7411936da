import re
from collections.abc import Callable

import numpy as np
import pytest

from bonecam.errors import ProgramError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.motions import Tool
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.tool.path import ToolPath

PAIRS = {
    name: (read_machine(machine), read_dialect(name))
    for name, machine in (
        ("heidenhain", "mikron-ucp600"),
        ("linuxcnc", "linuxcnc-xyzbc"),
        ("siemens-840d", "mikron-ucp600"),
        ("fanuc-30i", "mikron-ucp600"),
    )
}


@pytest.fixture(scope="module")
def texts(capsule_path: Callable[..., ToolPath]) -> dict[str, str]:
    """A short program by the name of its dialect."""
    path = capsule_path(count=24, turns=1.0)
    return {name: write_program([path], *pair, Job()).text for name, pair in PAIRS.items()}


def line_of(text: str, pattern: str) -> int:
    return next(number for number, line in enumerate(text.splitlines(), 1) if re.search(pattern, line))


def broken(texts: dict[str, str], name: str, pattern: str, replacement: str) -> tuple[str, int]:
    """The text with the first match replaced, and the line of it."""
    text = texts[name]
    assert re.search(pattern, text, re.MULTILINE)
    return re.sub(pattern, replacement, text, count=1, flags=re.MULTILINE), line_of(text, pattern)


@pytest.mark.parametrize(
    ("name", "pattern", "replacement"),
    [
        ("heidenhain", r" F900$", " F900 M91"),
        ("heidenhain", r" F900$", " F9e2"),
        ("heidenhain", r" F\d+$", ""),
        ("heidenhain", r" F900$", " RL F900"),
        ("heidenhain", r" F900$", " F900 R0"),
        ("heidenhain", r" X\+(\d+\.\d+) (?=.*F900$)", r" X\1 "),
        ("heidenhain", r" B-(\d+\.\d\d)\d (?=.*F900$)", r" B-\1 "),
        ("heidenhain", r" Z\+(?=.*F900$)", " W+"),
        ("heidenhain", r" M126$", " M125"),
        ("heidenhain", r" M3$", " M4"),
        ("heidenhain", r"^9 ", "10 "),
        ("heidenhain", r"TOOL CALL 1 ", "TOOL CALL 7 "),
        ("heidenhain", r"F900$", "F0"),
        ("heidenhain", r"FUNCTION TCPM F", "FUNCTION TCPM X F"),
        ("linuxcnc", r" F[\d.]+$", ""),
        ("linuxcnc", r"^G1 (?=X)", "G2 "),
        ("linuxcnc", r"^G1 (?=X)", ""),
        ("linuxcnc", r"^G1 X", "G1 X1 X"),
        ("linuxcnc", r"^G1 X", "G1 U0.0 X"),
        ("linuxcnc", r"^G1 X-?[\d.]+", "G1 X1e-05"),
        ("linuxcnc", r"^G93$", "G95"),
        ("linuxcnc", r"^T1 M6", "T3 M6"),
        ("linuxcnc", r"^M8$", "M8 N"),
        ("linuxcnc", r"^G43 H1$", "G43 H2"),
        ("siemens-840d", r" F\d+$", ""),
        ("siemens-840d", r" F900$", " F900 M88"),
        ("siemens-840d", r"C=DC\(([\d.]+)\) F900$", r"C=ACP(\1) F900"),
        ("siemens-840d", r"C=DC\([\d.]+\) F900$", "C=DC(-10.000) F900"),
        ("siemens-840d", r"C=DC\([\d.]+\) F900$", "C=DC(360.000) F900"),
        ("siemens-840d", r"C=DC\([\d.]+\) F900$", "A3=0.5 F900"),
        ("siemens-840d", r"C=DC\([\d.]+\) F900$", "C=DC(1.0) C=DC(1.0) F900"),
        ("siemens-840d", r" G1 (?=.*F900$)", " G2 "),
        ("siemens-840d", r" G1 (?=.*F900$)", " G91 G1 "),
        ("siemens-840d", r"^N170 ", "N171 "),
        ("siemens-840d", r"^N170 ", ""),
        ("siemens-840d", r" TRAORI$", " TRANSMIT"),
        ("siemens-840d", r" ORIAXES$", " ORIVECT"),
        ("siemens-840d", r" M6$", " M6 T7"),
        ("siemens-840d", r" T1$", " T1=3"),
        ("siemens-840d", r" CYCLE832\([\d.]+,", " CYCLE832("),
        ("siemens-840d", r" SUPA Z0 D0$", " SUPA Z10 D0"),
        ("siemens-840d", r" SUPA Z0 D0$", " SUPA X0 Z0 D0"),
        ("siemens-840d", r" G54 D1$", " G0 SUPA Z0 D0"),
        ("fanuc-30i", r" F\d+\.$", ""),
        ("fanuc-30i", r" F900\.$", " F900. H01"),
        ("fanuc-30i", r" F900\.$", " F900. P1"),
        ("fanuc-30i", r" F900\.$", " F9.0.0"),
        ("fanuc-30i", r" C-?[\d.]+ F900\.$", " I0.0 J0.0 K1.0 F900."),
        ("fanuc-30i", r" G01 (?=.*F900\.$)", " G02 "),
        ("fanuc-30i", r" G01 (?=.*F900\.$)", " G91 G01 "),
        ("fanuc-30i", r"^N13 ", "N14 "),
        ("fanuc-30i", r"^N13 ", ""),
        ("fanuc-30i", r"^O\d{4}$", "O12345"),
        ("fanuc-30i", r"^N3 ", "O1001\nN3 "),
        ("fanuc-30i", r" T1 M06$", " T7 M06"),
        ("fanuc-30i", r" T1 M06$", " M06"),
        ("fanuc-30i", r" G43\.4 Z", " G43.5 Z"),
        ("fanuc-30i", r" G43\.4 Z([\d.]+) H01$", r" G43.4 Z\1"),
        ("fanuc-30i", r" G43\.4 Z([\d.]+) H01$", r" G43.4 Z\1 H02"),
        ("fanuc-30i", r" G28 G91 Z0\.$", " G28 Z0."),
        ("fanuc-30i", r" G28 G91 Z0\.$", " G28 G91 Z10."),
        ("fanuc-30i", r" G28 G91 Z0\.$", " G28 G91 X0. Z0."),
        ("fanuc-30i", r" G05\.1 Q1$", " G05.1 Q3"),
    ],
)
def test_what_the_dialect_does_not_know_is_refused_with_its_line(texts, name, pattern, replacement):
    text, line = broken(texts, name, pattern, replacement)
    with pytest.raises(ProgramError, match=rf"line {line}: ") as caught:
        read_program(text, *PAIRS[name])
    assert caught.value.evidence["line"] == line


@pytest.mark.parametrize("name", ["heidenhain", "siemens-840d", "fanuc-30i"])
def test_a_feed_holds_until_another_is_written(texts, name):
    motions = read_program(texts[name], *PAIRS[name])
    point = "." if name == "fanuc-30i" else ""
    number, line = next(item for item in enumerate(texts[name].splitlines(), 1) if item[1].endswith(f" F900{point}"))
    cuts = np.flatnonzero(motions.lines >= number)[:20]
    assert (motions.feed_rates[cuts] == 900.0).all()
    assert sum(" F" in one for one in texts[name].splitlines()[number : number + 19]) == 0
    text = texts[name].replace(line, line.removesuffix(f" F900{point}"), 1)
    before = read_program(text, *PAIRS[name]).feed_rates[cuts]
    assert (before != 900.0).all()
    assert len({*before.tolist()}) == 1


def test_r0_is_stated_before_an_axis_moves(texts):
    text = texts["heidenhain"].replace(" R0", "")
    with pytest.raises(ProgramError, match="an axis moves before R0 is stated"):
        read_program(text, *PAIRS["heidenhain"])


@pytest.mark.parametrize("name", PAIRS)
def test_a_text_cut_off_anywhere_is_refused(texts, name):
    text = texts[name]
    for size in range(1, len(text), 37):
        with pytest.raises(ProgramError):
            read_program(text[:size], *PAIRS[name])


def test_a_cut_without_tool_centre_control_is_refused(texts):
    text = texts["heidenhain"].replace("FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS", "M3")
    with pytest.raises(ProgramError, match="without tool-centre control"):
        read_program(text, *PAIRS["heidenhain"])


def test_the_short_way_must_be_switched_on(texts):
    text = texts["heidenhain"].replace(" M126\n", " M3\n")
    with pytest.raises(ProgramError, match="C turns before the short way is switched on or off"):
        read_program(text, *PAIRS["heidenhain"])


def test_words_of_the_short_way_are_refused_where_the_control_drives_them_as_they_are(texts):
    text = texts["heidenhain"]
    turned = re.sub(r"( M126\n)", " M127\n", text)
    lines = [line for line in turned.splitlines() if re.search(r" C\S+$", line)]
    jump = re.sub(r" C[+-]\d+\.\d{3}", " C+179.500", lines[5])
    back = re.sub(r" C[+-]\d+\.\d{3}", " C-179.500", lines[6])
    with pytest.raises(ProgramError, match=r"C turns by -?\d+\.\d+ deg in one block: half a turn is allowed"):
        read_program(turned.replace(lines[5], jump).replace(lines[6], back), *PAIRS["heidenhain"])


def test_across_the_retracted_spindle_only_rapids_need_no_tool_centre_control(texts):
    text = texts["heidenhain"]
    assert "L X+0.000 Y+0.000 R0 FMAX" in text
    for wrong in ("L X+0.000 Y+0.000 R0 F900", "L X+0.000 Y+0.000 Z+9.000 R0 FMAX"):
        with pytest.raises(ProgramError, match="without tool-centre control"):
            read_program(text.replace("L X+0.000 Y+0.000 R0 FMAX", wrong), *PAIRS["heidenhain"])


def test_a_wound_axis_may_turn_far_above_the_part(texts):
    text = texts["linuxcnc"]
    assert text.count("\nM5\n") == 1
    motions = read_program(text.replace("\nM5\n", "\nG0 C999.00000\nM5\n"), *PAIRS["linuxcnc"])
    assert motions.words[-1, 4] == pytest.approx(999 * 0.017453292519943295)


@pytest.mark.parametrize("instead", ["", "G49\n", "G43\n"])
def test_a_tool_must_not_move_without_its_length(texts, instead):
    text = texts["linuxcnc"].replace("G43 H1\n", instead)
    with pytest.raises(ProgramError, match="tool 1 moves without its length"):
        read_program(text, *PAIRS["linuxcnc"])


def test_given_tools_replace_those_of_the_comments(texts):
    motions = read_program(texts["heidenhain"], *PAIRS["heidenhain"], tools=[Tool(1, 3.0, 99.0)])
    assert motions.controls[1].radius == 3.0


def test_an_endless_axis_is_unwound_by_the_short_way(texts):
    head = texts["heidenhain"].splitlines()
    start = line_of(texts["heidenhain"], "L B")
    blocks = [
        "L B-30.000 C+170.000 R0 FMAX",
        "FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS",
        "L X+0.000 Y+0.000 Z+60.000 R0 FMAX",
    ]
    blocks += [
        f"L X+{i}.000 Y+0.000 Z+60.000 B-30.000 C{c} R0 F100" for i, c in enumerate(["-150.000", "-90.000", "+20.000"])
    ]
    blocks += ["FUNCTION RESET TCPM", "M30", "END PGM BONE MM"]
    lines = head[: start - 1] + [f"{start - 2 + i} {block}" for i, block in enumerate(blocks)]
    motions = read_program("\n".join(lines) + "\n", *PAIRS["heidenhain"])
    assert (motions.words[:, 4] * 57.29577951308232).round(6).tolist() == [170.0, 210.0, 270.0, 380.0]
