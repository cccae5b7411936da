"""What the proof takes for granted of a control is stated by the text, in every dialect; a text that leaves it out or
states another is refused.

Five-axis programs as posts of other systems begin are refused by their first word that is unknown, or by what is
missing, at its line.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from controls import KINDS, PAIRS
from small_parts import capsule_path

from bonecam.errors import ProgramError
from bonecam.job import Job, read_job
from bonecam.machine import Machine, read_machine
from bonecam.nc import Dialect, Tool, dialect_names, read_dialect, read_program, write_program
from bonecam.nc.requirements import job_dialect


@pytest.fixture(scope="module")
def texts():
    """A short program by the name of its dialect."""
    path = capsule_path(count=24, turns=1.0)
    return {name: write_program([path], *PAIRS[name], Job()).text for name in KINDS}


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


@pytest.mark.parametrize("name", KINDS)
def test_a_text_cut_off_anywhere_is_refused(texts, name):
    text = texts[name]
    for size in range(1, len(text), 37):
        with pytest.raises(ProgramError):
            read_program(text[:size], *PAIRS[name])


def test_the_short_way_must_be_switched_on(texts):
    text = texts["heidenhain"].replace(" M126\n", " M3\n")
    with pytest.raises(ProgramError, match="C turns before the short way is switched on or off"):
        read_program(text, *PAIRS["heidenhain"])


def test_across_the_retracted_spindle_only_rapids_need_no_tool_centre_control(texts):
    text = texts["heidenhain"]
    assert "L X+0.000 Y+0.000 R0 FMAX" in text
    for wrong in ("L X+0.000 Y+0.000 R0 F900", "L X+0.000 Y+0.000 Z+9.000 R0 FMAX"):
        with pytest.raises(ProgramError, match="without tool-centre control"):
            read_program(text.replace("L X+0.000 Y+0.000 R0 FMAX", wrong), *PAIRS["heidenhain"])


@pytest.mark.parametrize("instead", ["", "G49\n", "G43\n"])
def test_a_tool_must_not_move_without_its_length(texts, instead):
    text = texts["linuxcnc"].replace("G43 H1\n", instead)
    with pytest.raises(ProgramError, match="tool 1 moves without its length"):
        read_program(text, *PAIRS["linuxcnc"])


def test_given_tools_replace_those_of_the_comments(texts):
    motions = read_program(texts["heidenhain"], *PAIRS["heidenhain"], tools=[Tool(1, 3.0, 99.0)])
    assert motions.controls[1].radius == 3.0


GOLDEN = Path(__file__).parents[1] / "golden"
ISO_OTHERS = (
    ("G17", "G18"), ("G21", "G20"), ("G40", "G41"), ("G54", "G55"), ("G80", "G81"), ("G90", "G91"), ("G94", "G95"),
    ("G97", "G96"),
)  # fmt: skip
FANUC_OTHERS = (*ISO_OTHERS, ("G64", "G63"), ("G69", "G68"))
OTHERS = {
    "heidenhain-mikron": (
        ("MM", "INCH"),
        ("CYCL DEF 7.1 X+0", "CYCL DEF 7.1 X+5"),
        ("CYCL DEF 7.3 Z+0", "CYCL DEF 7.3 IZ+0"),
        ("PLANE RESET STAY", "PLANE SPATIAL SPA+10 SPB+0 SPC+0 STAY"),
        ("PATHCTRL AXIS", "PATHCTRL VECTOR"),
        ("AXIS POS", "AXIS SPAT"),
        ("F TCP", "F CONT"),
    ),
    "linuxcnc-xyzbc": (*ISO_OTHERS, ("G92.1", "G92"), ("G64", "G61")),
    "siemens-mikron": (
        ("G17", "G18"),
        ("G40", "G41"),
        ("G90", "G91"),
        ("G94", "G95"),
        ("G710", "G700"),
        ("G54", "G55"),
        ("TRANS", "TRANS X5"),
        ("RTLION", "RTLIOF"),
        ("ORIAXES", "ORIVECT"),
        ("ORIMKS", "ORIWKS"),
        ("D1", "D2"),
    ),
    "fanuc-mikron": FANUC_OTHERS,
}
"""By golden case: what is stated, and what contradicts it."""
MOVE = r"^(N?\d+ )?(L|G0|G00) (.* )?[XYZBC][-+\d](?!.*D0$)"
"""The line of a move to a known place."""
BLOCKS = {
    "BEGIN PGM .. MM": "BEGIN PGM GOLDEN MM",
    "the end of TCPM or M128": "FUNCTION RESET TCPM",
    "CYCL DEF 247": "CYCL DEF 247 DATUM SETTING ~\n  Q339=1 ; DATUM NUMBER",
    "PLANE RESET": "PLANE RESET STAY",
}
"""The Klartext blocks that state what is called otherwise."""


def golden(case: str) -> tuple[str, Machine, Dialect]:
    job = read_job(GOLDEN / case / "job.toml")
    dialect = job_dialect(job.nc)
    text = (GOLDEN / case / f"expected{dialect.extension}").read_text()
    return text, read_machine(job.nc.machine), dialect


CASES = [(case, stated, other) for case, pairs in OTHERS.items() for stated, other in pairs]


@pytest.mark.parametrize(("case", "stated", "other"), CASES)
def test_what_contradicts_a_stated_mode_is_refused_with_its_line(case, stated, other):
    text, machine, dialect = golden(case)
    comment = re.escape(dialect.comment.partition("{text}")[0].strip())
    pattern = rf"^(?!(?:\d+ )?{comment})(.*)(?<![A-Z0-9.]){re.escape(stated)}(?![0-9.A-Z])"
    line = line_of(text, MOVE) if other in dialect.effect_of else line_of(text, pattern)
    wrong = re.sub(pattern, rf"\1{other}", text, flags=re.MULTILINE)
    with pytest.raises(ProgramError, match=f"line {line}: "):
        read_program(wrong, machine, dialect)


@pytest.mark.parametrize("case", OTHERS)
def test_no_axis_moves_before_all_is_stated(case):
    text, machine, dialect = golden(case)
    assert dialect.stated.moves
    leave_out = without_blocks if dialect.grammar == "klartext" else without_words
    for name in dialect.stated.moves:
        rest = leave_out(text, name)
        line = line_of(rest, MOVE)
        with pytest.raises(ProgramError, match=f"line {line}: an axis moves ") as caught:
            read_program(rest, machine, dialect)
        assert name in str(caught.value) or "by increments" in str(caught.value)


def without_blocks(text: str, name: str) -> str:
    """A Klartext program with M5 instead of the blocks that state `name`."""
    block = re.escape(BLOCKS.get(name, name))
    return re.sub(rf"^(\d+) {block}.*$", r"\1 M5", text, flags=re.MULTILINE)


def without_words(text: str, name: str) -> str:
    """An ISO program without the code `name`, with M5 or M05 where it stood alone."""
    lines = text.split("\n")
    stop = "M05" if "M05" in text else "M5"
    for at, line in enumerate(lines):
        if line[:1] not in ("(", ";"):
            number, *words = line.split() if re.match(r"N\d", line) else ["", *line.split()]
            kept = [word for word in words if word.partition("(")[0] != name]
            if kept and kept[0].startswith("P"):
                kept = []
            if kept != words:
                lines[at] = " ".join([number, *(kept or [stop])]).strip()
    return "\n".join(lines)


@pytest.mark.parametrize("name", ["G54 D1", "ORIMKS", "ORIAXES"])
def test_each_start_of_traori_is_followed_by_datum_and_interpolation(name):
    text, machine, dialect = golden("siemens-mikron")
    assert text.count(f" {name}\n") == 2
    at = text.rindex(f" {name}\n")
    wrong = text[:at] + text[at:].replace(f" {name}\n", " D1\n", 1)
    moves = text[:at].count("\n") + 1 + line_of(text[at:], r" G0 X.* Z") - 1
    why = f"line {moves}: an axis moves before {name.split()[0]} is stated under tool-centre control"
    with pytest.raises(ProgramError, match=why):
        read_program(wrong, machine, dialect)


@pytest.mark.parametrize("name", dialect_names())
def test_every_shipped_dialect_states_unit_plane_and_datum(name):
    stated = " ".join(read_dialect(name).stated.moves)
    words = ("MM", "CYCL DEF 247", "PLANE RESET") if name == "heidenhain" else ("G17", "G54", "G9")
    assert all(word in stated for word in words)
    assert re.search(r"MM|G21|G710", stated)


MIKRON, TRT = read_machine("mikron-ucp600"), read_machine("linuxcnc-xyzbc")

FOREIGN = {
    "heidenhain, as of Fusion": (
        "heidenhain",
        """\
0 BEGIN PGM 1001 MM
1 BLK FORM 0.1 Z X-20 Y-20 Z-40
2 BLK FORM 0.2 X+20 Y+20 Z+0
3 ;T1 D=2 CR=1 - ZMIN=-10 - BALL END MILL
4 * - 5-AXIS SWARF1
5 TOOL CALL 1 Z S12000
6 L M126
7 L X+0 Y+0 R0 FMAX M3
8 M128
9 L X+10.5 Y-3.25 Z+15 B-30 C+45 FMAX
10 M30
11 END PGM 1001 MM
""",
        2,
        "unknown block 'BLK FORM 0.1 Z X-20 Y-20 Z-40'",
    ),
    "heidenhain, as of hyperMILL": (
        "heidenhain",
        """\
0 BEGIN PGM BLADE MM
1 ; HYPERMILL
2 BLK FORM 0.1 Z X-20.000 Y-20.000 Z-40.000
3 BLK FORM 0.2 X+20.000 Y+20.000 Z+0.000
4 CYCL DEF 247 DATUM SETTING ~
  Q339=+1 ; DATUM NUMBER
5 TOOL CALL "KUGEL_2" Z S12000 F900
6 FN 0: Q1=+900
7 LN X+1.000 Y+2.000 Z+3.000 TX+0.1 TY+0.2 TZ+0.97 F Q1 M128
8 END PGM BLADE MM
""",
        5,
        "unknown block 'CYCL DEF 247 DATUM SETTING Q339=+1'",
    ),
    "heidenhain, words behind a move": (
        "heidenhain",
        """\
0 BEGIN PGM A MM
1 L X+10.000 Y+2.000 R0 FMAX M3
2 END PGM A MM
""",
        2,
        "'M3' in 'L X+10.000 Y+2.000 R0 FMAX M3' is no word of this place",
    ),
    "heidenhain, numbers in another form": (
        "heidenhain",
        """\
0 BEGIN PGM A MM
1 L X+10.5 Y+2.000 R0 FMAX
2 END PGM A MM
""",
        2,
        "'X+10.5' in ",
    ),
    "heidenhain, no numbers of blocks": (
        "heidenhain",
        "BEGIN PGM A MM\nL X+10.000 R0 FMAX\nEND PGM A MM\n",
        1,
        "block number 0 expected, found 'BEGIN'",
    ),
    "siemens, as of Fusion": (
        "siemens-840d",
        """\
; %_N_1001_MPF
; Made in another system
N10 G90 G94
N20 G71
N30 G64
N40 G17
""",
        4,
        "unknown word G71",
    ),
    "siemens, as of hyperMILL": (
        "siemens-840d",
        """\
N10 G17 G40 G90 G94 G710
N20 T="BALL_2"
N30 M6
""",
        2,
        "'T=\"BALL_2\"' is no word",
    ),
    "siemens, as of NX": (
        "siemens-840d",
        """\
%_N_BLADE_MPF
N10 DEF REAL _camtolerance
N20 G40 G17 G710 G94 G90 G60 G601 FNORM
""",
        1,
        "block number N10 expected, found '%_N_BLADE_MPF'",
    ),
    "siemens, vectors": (
        "siemens-840d",
        """\
N10 G17 G40 G90 G94 G710
N20 TRAORI
N30 G1 X1.0 Y2.0 Z3.0 A3=0.5 B3=0.0 C3=0.866 F900
""",
        3,
        "'A3=0.5' is no word",
    ),
    "siemens, inches": ("siemens-840d", "N10 G17 G40 G90 G94 G700\n", 1, "unknown word G700 (inches)"),
    "fanuc, as of Fusion": (
        "fanuc-30i",
        """\
%
O1001 (BLADE)
(T1 D=2. CR=1. - ZMIN=-10. - BALL END MILL)
N10 G90 G94 G17 G49 G40 G80
N15 G21
N20 G28 G91 Z0.
N25 G90
N30 T1 M06
%
""",
        4,
        "block number N1 expected, found 'N10'",
    ),
    "fanuc, as of Mastercam": (
        "fanuc-30i",
        """\
%
O0001(BLADE)
(DATE=DD-MM-YY - 01-01-26 TIME=HH:MM - 10:00)
N1 G21
N2 G0 G17 G40 G49 G80 G90
N3 T1 M6
%
""",
        5,
        "unknown word G0 (a rapid)",
    ),
    "fanuc, as of NX": (
        "fanuc-30i",
        """\
%
O1234
N1 G40 G17 G90 G20
%
""",
        3,
        "unknown word G20 (inches)",
    ),
    "fanuc, a tilted plane": (
        "makino",
        """\
%
O1234
N1 G17 G21 G40 G49 G80 G90 G94
N2 G68.2 X0. Y0. Z0. I0. J30. K0.
%
""",
        4,
        "unknown word G68.2 (a tilted plane)",
    ),
    "fanuc, without %": ("mitsubishi", "O1234\nN1 G17 G21 G40 G49 G80 G90 G94\nN2 M30\n", 1, "a line of % is missing"),
    "fanuc, the last % cut off, and an unknown word before": (
        "fanuc-30i",
        "%\nO1234\nN1 G17 G21\nN2 G05.2 Q1",
        4,
        "unknown word G05.2",
    ),
    "linuxcnc, as of Fusion": (
        "linuxcnc",
        """\
%
(AXIS,stop)
N10 G90 G94 G17 G91.1
N15 G21
N20 G53 G0 Z0.
%
""",
        3,
        "unknown word N10",
    ),
    "linuxcnc, arcs": ("linuxcnc", "%\nG90 G94 G17\nG2 X1.0 Y1.0 I1.0 J0.0 F100\n%\n", 3, "unknown word G2 (an arc)"),
    "linuxcnc, variables": ("linuxcnc", "%\nG90 G94\n#100=5\n%\n", 3, "'#100=5' is no word"),
    "no end of the last line": ("linuxcnc", "%\nG90 G94\nM2\n%", 4, "the last line is not ended"),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_a_foreign_text_is_refused_by_its_first_fault(name):
    dialect, text, line, why = FOREIGN[name]
    machine = TRT if dialect == "linuxcnc" else MIKRON
    with pytest.raises(ProgramError) as caught:
        read_program(text, machine, read_dialect(dialect))
    assert str(caught.value).startswith(f"line {line}: {why}")
    assert caught.value.evidence["line"] == line
