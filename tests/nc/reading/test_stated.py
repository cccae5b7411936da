"""What the proof takes for granted of a control is stated by the text, in every dialect; a text that leaves it out or
states another is refused."""

import re
from pathlib import Path

import pytest

from bonecam.errors import MachineError, ProgramError
from bonecam.job import read_job
from bonecam.machine.machine import Machine, read_machine
from bonecam.nc.dialect import DIALECTS, Dialect, dialect_names, read_dialect
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import job_dialect

GOLDEN = Path(__file__).parents[2] / "golden"
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
    "makino-mikron": FANUC_OTHERS,
    "mitsubishi-mikron": FANUC_OTHERS,
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


def first_line(text: str, pattern: str) -> int:
    return next(number for number, line in enumerate(text.splitlines(), 1) if re.search(pattern, line))


CASES = [(case, stated, other) for case, pairs in OTHERS.items() for stated, other in pairs]


@pytest.mark.parametrize(("case", "stated", "other"), CASES)
def test_what_contradicts_a_stated_mode_is_refused_with_its_line(case: str, stated: str, other: str) -> None:
    text, machine, dialect = golden(case)
    comment = re.escape(dialect.comment.partition("{text}")[0].strip())
    pattern = rf"^(?!(?:\d+ )?{comment})(.*)(?<![A-Z0-9.]){re.escape(stated)}(?![0-9.A-Z])"
    line = first_line(text, MOVE) if other in dialect.effect_of else first_line(text, pattern)
    wrong = re.sub(pattern, rf"\1{other}", text, flags=re.MULTILINE)
    with pytest.raises(ProgramError, match=f"line {line}: "):
        read_program(wrong, machine, dialect)


@pytest.mark.parametrize("case", OTHERS)
def test_no_axis_moves_before_all_is_stated(case: str) -> None:
    text, machine, dialect = golden(case)
    assert dialect.stated.moves
    leave_out = without_blocks if dialect.grammar == "klartext" else without_words
    for name in dialect.stated.moves:
        rest = leave_out(text, name)
        line = first_line(rest, MOVE)
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
def test_each_start_of_traori_is_followed_by_datum_and_interpolation(name: str) -> None:
    text, machine, dialect = golden("siemens-mikron")
    assert text.count(f" {name}\n") == 2
    at = text.rindex(f" {name}\n")
    wrong = text[:at] + text[at:].replace(f" {name}\n", " D1\n", 1)
    moves = text[:at].count("\n") + 1 + first_line(text[at:], r" G0 X.* Z") - 1
    why = f"line {moves}: an axis moves before {name.split()[0]} is stated under tool-centre control"
    with pytest.raises(ProgramError, match=why):
        read_program(wrong, machine, dialect)


@pytest.mark.parametrize("name", dialect_names())
def test_every_shipped_dialect_states_unit_plane_and_datum(name: str) -> None:
    stated = " ".join(read_dialect(name).stated.moves)
    words = ("MM", "CYCL DEF 247", "PLANE RESET") if name == "heidenhain" else ("G17", "G54", "G9")
    assert all(word in stated for word in words)
    assert re.search(r"MM|G21|G710", stated)


def test_what_no_word_states_is_refused_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text((DIALECTS / "siemens-840d.toml").read_text().replace('moves = ["TRAFOOF", ', 'moves = ["G71", '))
    with pytest.raises(MachineError, match=r"stated\.moves: 'G71' is no code and no statement states it"):
        read_dialect(path)
