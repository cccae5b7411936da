"""Five-axis programs as posts of other systems begin are refused by their first word that is unknown, or by what is
missing, at its line."""

import pytest

from bonecam.errors import ProgramError
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.reading import read_program

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
