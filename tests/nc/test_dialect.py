"""Codes with a meaning are never without effect, whatever a dialect's file says.

The words of a job in the dialect of its controller: work offset, coolant, block numbers, decimals.
"""

import pytest
from small_parts import capsule_path

from bonecam.errors import MachineError
from bonecam.job import Job
from bonecam.machine import read_machine
from bonecam.machine.machine import MACHINES
from bonecam.nc import dialect_names, read_dialect, read_program, write_program
from bonecam.nc.dialect import DIALECTS
from bonecam.nc.requirements import job_dialect
from bonecam.nc.schema import FIELDS, MEANINGS

GOOD = (DIALECTS / "linuxcnc.toml").read_text()
KLARTEXT = (DIALECTS / "heidenhain.toml").read_text()


@pytest.mark.parametrize("name", dialect_names())
def test_every_shipped_dialect_has_every_template_and_says_what_is_proved(name):
    dialect = read_dialect(name)
    assert set(FIELDS) <= set(type(dialect.templates).model_fields)
    comment = (DIALECTS / f"{name}.toml").read_text().split("title", 1)[0]
    assert "PROVED" in comment or "READ ONLY" in comment


@pytest.mark.parametrize(
    ("base", "old", "new", "told"),
    [
        (
            "linuxcnc",
            'comment = "({text})"',
            'comment = "{text.__class__}"',
            "comment: field 'text.__class__' is unknown",
        ),
        (
            "linuxcnc",
            'comment = "({text})"',
            'comment = "({text:>20000000000})"',
            "comment: field 'text' has the format",
        ),
        (
            "linuxcnc",
            'comment = "({text})"',
            'comment = "({text!r})"',
            "comment: field 'text' has the conversion '!r': leave it out",
        ),
        ("linuxcnc", 'comment = "({text})"', 'comment = "({text:{text}})"', "comment: field 'text' has the format"),
        ("linuxcnc", 'comment = "({text})"', 'comment = "({text"', "comment: expected '}'"),
        (
            "linuxcnc",
            'tool = """\nT{tool} M6',
            'tool = """\nT{tool[0]} M6',
            "templates.tool: field 'tool[0]' is unknown",
        ),
        (
            "linuxcnc",
            'tool = """\nT{tool} M6',
            'tool = """\nT{tool:.99} M6',
            "templates.tool: field 'tool' has the format ':.99'",
        ),
        ("linuxcnc", 'tool = """\nT{tool} M6', 'tool = """\nT{words} M6', "templates.tool: field 'words' is unknown"),
        ("linuxcnc", "G1 {words} F{feed}", "G1 F{feed} {words}", "templates.feed: give {words} and then {feed}"),
        ("linuxcnc", "G1 {words} F{feed}", "G1 {words}", "templates.feed: give {words} and then {feed}"),
        ("linuxcnc", "G0 {words}", "G0 {words:>40}", "templates.rapid: give {words}"),
        ("linuxcnc", 'coolant_on = "M8"', 'coolant_on = "M8\\u0007"', "templates.coolant_on: has the character"),
        ("linuxcnc", 'extension = ".ngc"', 'extension = "/../x.ngc"', "extension: '/../x.ngc'"),
        ("linuxcnc", '"G17", ', '"17", ', "codes.none[0]: '17'"),
        ("linuxcnc", "decimals = 5", "decimals = 99999999999", "numbers.length.decimals: 99999999999: give at most 8"),
        ("linuxcnc", "highest = 99999.0", "highest = inf", "numbers.feed.highest: inf: give a finite number"),
        ("linuxcnc", "[codes]", "[numbering]\nformat = '{number}'\n[codes]", "numbering.format"),
        ("linuxcnc", "[codes]", "[numbering]\nfirst = -1\n[codes]", "numbering.first: -1: give 0 or more"),
        (
            "siemens-840d",
            "{letter}=DC({number})",
            "{number}=DC({letter})",
            "endless_word: '{number}=DC({letter})': give {letter} and",
        ),
        (
            "siemens-840d",
            "{letter}=DC({number})",
            "{letter}= DC({number})",
            "endless_word: '{letter}= DC({number})': give",
        ),
        (
            "siemens-840d",
            "{letter}=DC({number})",
            "{letter}=DC({number:>9})",
            "endless_word: '{letter}=DC({number:>9})': give",
        ),
        (
            "siemens-840d",
            "{letter}=DC({number})",
            "{letter.upper}{number}",
            "endless_word: field 'letter.upper' is unknown",
        ),
        ("siemens-840d", "endless_from_deg = 0.0", "endless_from_deg = 90.0", "endless_from_deg: 90.0: give at most 0"),
        (
            "siemens-840d",
            "G54 D1\n",
            "G54 D{length}\n",
            "tool_centre_control.TRAORI.on: field 'length' is unknown: use one of height, tool",
        ),
        (
            "siemens-840d",
            'off = "TRAFOOF"',
            'off = "TRAFOOF {tool}"',
            "tool_centre_control.TRAORI.off: field 'tool' is unknown",
        ),
        ("siemens-840d", "first = 10\nstep = 10", "first = 10\nstep = 0", "numbering.step: 0: give 1 or more"),
        ("siemens-840d", "highest = 99999990", "highest = 10", "numbering.highest: 10: give more than first (10)"),
        (
            "siemens-840d",
            'format = "N{number} {text}"',
            'format = "{text} N{number}"',
            "numbering.format: '{text} N{number}': give",
        ),
        ("siemens-840d", '["G0"]', '["G0", "G1"]', "codes.rapid: G1 is a feed move: list it in feed"),
        ("siemens-840d", '["G0"]', '["G0", "G17"]', "codes.rapid: G17 is in none too: a code does one thing"),
        ("siemens-840d", '["TRAORI"]', '["TRAORI(1)"]', "codes.tool_centre_on[0]: 'TRAORI(1)'"),
        ("siemens-840d", 'frame = ""', 'frame = "%\\n%"', "frame: has a line end"),
        ("siemens-840d", '_ORI_FINISH" }', '_ORI_FINISH", semi = "" }', "machining.semi: unknown key"),
        ("heidenhain", "';(?P<comment>.*)'", "';.*'", "statements[2].pattern: has no group 'comment'"),
        ("heidenhain", "(?P<tool>\\d+)", "(?P<number>\\d+)", "statements[15].pattern: has no group 'tool'"),
        ("heidenhain", "pattern = 'M30'", "pattern = '(a)\\1'", "statements[27].pattern: invalid escape sequence"),
        ("heidenhain", "pattern = 'M30'", "pattern = 'a{1000000}'", "statements[27].pattern: invalid repetition size"),
        ("heidenhain", "pattern = 'M30'", f"pattern = '{'a' * 501}'", "statements[27].pattern: has 501 characters"),
        ("linuxcnc", 'grammar = "iso"', 'grammar = "apt"', "grammar"),
        ("linuxcnc", 'extension = ".ngc"', "", "extension"),
        ("linuxcnc", "length = {", "size = {", "numbers.length"),
        ("linuxcnc", "decimals = 5, sign", "decimals = 5, plus = 1, sign", "numbers.length.plus"),
        ("linuxcnc", 'tool_end = "M5"', "", "templates.tool_end"),
        ("linuxcnc", "G0 {words}", "G0 {wrods}", "templates.rapid: field 'wrods' is unknown"),
        ("linuxcnc", "per_minute = ", "per_hour = ", "codes.per_hour"),
        ("linuxcnc", '"joints"', '"tool-centre"', "tool_centre_control"),
        ("linuxcnc", "title = ", "colour = 1\ntitle = ", "colour"),
        ("linuxcnc", "title = ", "=\ntitle = ", "Invalid statement (at line 10, column 1): correct the file"),
        (
            "siemens-840d",
            'moves = ["TRAFOOF", ',
            'moves = ["G71", ',
            "forms.vectors.stated.moves: 'G71' is no code and no statement states it",
        ),
        (
            "heidenhain",
            '[A-Z0-9_]+) MM\'\neffect = "begin"',
            '[A-Z0-9_]+) (MM|INCH)\'\neffect = "begin"',
            "statements[0].pattern: takes BEGIN PGM A INCH, inches, for harmless: leave it out",
        ),
        ("", "", 'like = "fanuc"', "like: 'fanuc': use one of fanuc-30i, heidenhain"),
        ("", "", "like = 3", "like: '3': use one of"),
        ("", "", 'like = "makino"', "like: makino is itself like another: use fanuc-30i"),
        ("", "", 'like = "fanuc-30i"\ntitel = "x"', "titel: unknown key"),
        ("", "", 'like = "heidenhain"\ngrammar = "iso"\nstarts_at_zero = true', "starts_at_zero: true: only with"),
        ("", "", 'like = "linuxcnc"\nstarts_at_zero = true', "starts_at_zero: true: only with"),
        ("", "", 'like = "fanuc-30i"\n[forms.vectors]\ntitel = "x"', "forms.vectors.titel"),
        (
            "",
            "",
            'like = "fanuc-30i"\n[forms.vectors.vector]\nwords = ["I", "J{number}", "K{number}"]',
            "forms.vectors.vector.words",
        ),
        (
            "",
            "",
            'like = "fanuc-30i"\n[codes]\ntool_centre_on = ["G43.5"]',
            "codes.tool_centre_on: G43.5 takes vectors",
        ),
        ("", "", 'like = "fanuc-30i"\n[forms.joints]\nfeed_mode = "per-hour"', "forms.joints.feed_mode"),
        ("", "", 'like = "fanuc-30i"\n[forms.cones]\ntitle = "x"', "forms.cones"),
        ("", "", 'like = "linuxcnc"\n[probe]\nprogram = "G0 {words}"', "probe.program: field 'words' is unknown"),
        ("", "", 'like = "linuxcnc"\n[[statements]]\npattern = "("\neffect = "none"', "statements[0].pattern"),
        ("", "", 'like = "linuxcnc"\n[[statements]]\npattern = "a"\neffect = "dance"', "statements[0].effect"),
    ],
)
def test_a_wrong_dialect_file_is_refused_in_one_line_with_file_and_key(base, old, new, told, tmp_path):
    """The file of a dialect that ships with one change, or one like another."""
    text = (DIALECTS / f"{base}.toml").read_text() if base else ""
    assert old in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(MachineError) as caught:
        read_dialect(path)
    assert str(caught.value).startswith(f"{path}: {told}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("form", ["controller", "vectors"])
def test_a_dialect_like_another_has_all_that_it_leaves_out(form, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('like = "siemens-840d"\ntitle = "Mine"\n[templates]\ncoolant_on = "M7"\n')
    mine, theirs = read_dialect(file).in_form(form), read_dialect("siemens-840d").in_form(form)
    assert read_dialect(file).title == "Mine"
    assert mine.templates == theirs.templates.model_copy(update={"coolant_on": "M7"})
    assert (mine.codes, mine.own_form) == (theirs.codes, theirs.own_form)


def test_statements_are_matched_in_linear_time(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(KLARTEXT.replace("pattern = 'M30'", "pattern = '(M+)+30'"))
    (pattern,) = (item for item, told in read_dialect(path).patterns if told.effect == "program end")
    assert pattern.match("M" * 100_000) is None


def test_a_percent_sign_in_a_template_of_moves_is_written_as_it_is(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace("G0 {words}", "G0 {words} %d"))
    (line,) = read_dialect(path).move_lines("rapid", words="X%.1f")
    assert line % (1.0,) == "G0 X1.0 %d"


def test_an_unknown_controller_is_refused_with_the_known_ones():
    with pytest.raises(MachineError, match="'nosuch' is unknown: use one of fanuc-30i, heidenhain, linuxcnc, makino, "):
        read_dialect("nosuch")


def test_an_endless_axis_with_limits_is_written_wound_or_refused(tmp_path):
    file = (MACHINES / "mikron-ucp600.toml").read_text()
    path = tmp_path / "limited.toml"
    path.write_text(file.replace("endless = true", "endless = true\nlimits_deg = [-450.0, 450.0]"))
    machine, free = read_machine(path), read_machine("mikron-ucp600")
    heidenhain = read_dialect("heidenhain")
    assert heidenhain.writing_endless_words("controller", machine).endless_words == "wound"
    assert heidenhain.writing_endless_words("controller", free).endless_words == "wrapped"
    with pytest.raises(MachineError, match=r"C of Mikron.*winds within limits.*leave nc.endless_words"):
        heidenhain.writing_endless_words("wrapped", machine)
    with pytest.raises(MachineError, match="fanuc-30i wraps them: take endless = false"):
        read_dialect("fanuc-30i").writing_endless_words("controller", machine)


ISO = """like = "linuxcnc"
[codes]
none = ["G17", "G40", {code!r}]
"""
STATEMENT = """like = "linuxcnc"
[[statements]]
pattern = '{pattern}'
effect = "none"
"""


@pytest.mark.parametrize("code", MEANINGS)
def test_a_code_with_a_meaning_is_not_declared_harmless(code, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(ISO.format(code=code))
    with pytest.raises(MachineError, match=rf"codes\.none: {code} is .*: (list it in \w+|leave it out)"):
        read_dialect(path)


@pytest.mark.parametrize("code", ["G020", "G03", "M03", "G070"])
def test_leading_zeros_hide_no_meaning(code, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(ISO.format(code=code))
    with pytest.raises(MachineError, match=rf"codes\.none: {code} is "):
        read_dialect(path)


@pytest.mark.parametrize(
    "pattern", ["G20", "G2[01]", "[A-Z0-9]+", ".*", "G20 G90", "G(70|71)", r"G43\.4 H\d+", "M[345]"]
)
def test_a_statement_that_takes_such_a_code_is_refused(pattern, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(STATEMENT.format(pattern=pattern))
    with pytest.raises(MachineError, match=r"statements\[0\]\.pattern: takes \S+, .*, for harmless: "):
        read_dialect(path)


def job(controller: str, **nc: object) -> Job:
    return Job().with_values(nc={"controller": controller, **nc})


@pytest.mark.parametrize("controller", dialect_names())
def test_another_work_offset_is_written_and_asked_for_again_when_read(controller):
    asked = job(controller, work_offset=3)
    machine, dialect = read_machine("mikron-ucp600"), job_dialect(asked.nc)
    path = capsule_path(count=60)
    text = write_program([path], machine, dialect, asked).text
    first, third = ("Q339=1", "Q339=3") if controller == "heidenhain" else ("G54", "G56")
    assert third in text
    assert first not in text
    assert len(read_program(text, machine, dialect).tips) > 10
    with pytest.raises(Exception, match=r"line \d+"):
        read_program(text, machine, read_dialect(controller))


@pytest.mark.parametrize("controller", dialect_names())
def test_mist_is_switched_on_in_the_place_of_flood(controller):
    asked = job(controller, coolant_kind="mist")
    machine, dialect = read_machine("mikron-ucp600"), job_dialect(asked.nc)
    text = write_program([capsule_path(count=60)], machine, dialect, asked).text
    assert "M7" in text or "M07" in text
    assert read_program(text, machine, dialect).coolant.any()


def test_blocks_without_numbers_and_with_other_decimals_are_read_back():
    asked = job("fanuc-30i", block_numbers=False, decimals=4, program_number=4711)
    machine, dialect = read_machine("mikron-ucp600"), job_dialect(asked.nc)
    text = write_program([capsule_path(count=60)], machine, dialect, asked).text
    assert "\nO4711" in text
    assert not [line for line in text.split("\n") if line.startswith("N")]
    assert any(len(word.partition(".")[2]) == 4 for line in text.split("\n") for word in line.split())
    assert len(read_program(text, machine, dialect).tips) > 10


@pytest.mark.parametrize(
    ("controller", "asked", "why"),
    [
        ("siemens-840d", {"work_offset": 9}, "nc.work_offset = 9: siemens-840d has no such: give 1 to 4"),
        ("fanuc-30i", {"coolant_kind": "air"}, "nc.coolant_kind = 'air': fanuc-30i has no such: add it"),
        ("heidenhain", {"block_numbers": False}, "nc.block_numbers = false: heidenhain has no such"),
        ("heidenhain", {"axes": "joints"}, r"heidenhain has no \[forms.joints\]: give nc.axes = 'angles' or 'vectors'"),
        (
            "heidenhain",
            {"park": "home"},
            "nc.park = 'home': heidenhain has no such: leave it out, or add a template home",
        ),
        ("fanuc-30i", {"probe": True, "axes": "joints"}, r"nc.probe = true: .* has no such: .* add a table \[probe\]"),
        ("own", {"split": "level"}, r"^nc.split = 'level': own has no such: .* a table \[calls\]"),
    ],
)
def test_what_a_control_does_not_have_is_refused(controller, asked, why, tmp_path):
    text = GOOD[: GOOD.index("[calls]")] + GOOD[GOOD.index("[templates]") :]
    (tmp_path / "own.toml").write_text(text)
    named = str(tmp_path / "own.toml") if controller == "own" else controller
    with pytest.raises(MachineError, match=why):
        job_dialect(job(named, **asked).nc)
