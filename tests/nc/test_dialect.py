import pytest

from bonecam.errors import MachineError
from bonecam.machine.machine import MACHINES, read_machine
from bonecam.nc.dialect import DIALECTS, dialect_names, read_dialect
from bonecam.nc.schema import FIELDS

GOOD = (DIALECTS / "linuxcnc.toml").read_text()
KLARTEXT = (DIALECTS / "heidenhain.toml").read_text()
SIEMENS = (DIALECTS / "siemens-840d.toml").read_text()


@pytest.mark.parametrize("name", dialect_names())
def test_every_shipped_dialect_has_every_template_and_says_what_is_proved(name):
    dialect = read_dialect(name)
    assert set(FIELDS) <= set(type(dialect.templates).model_fields)
    comment = (DIALECTS / f"{name}.toml").read_text().split("title", 1)[0]
    assert "PROVED" in comment or "READ ONLY" in comment


@pytest.mark.parametrize(
    ("text", "key"),
    [
        (GOOD.replace('grammar = "iso"', 'grammar = "apt"'), "grammar"),
        (GOOD.replace('extension = ".ngc"', ""), "extension"),
        (GOOD.replace("length = {", "size = {"), "numbers.length"),
        (GOOD.replace("decimals = 5, sign", "decimals = 5, plus = 1, sign", 1), "numbers.length.plus"),
        (GOOD.replace('tool_end = "M5"', ""), "templates.tool_end"),
        (GOOD.replace("G0 {words}", "G0 {wrods}"), "'wrods'"),
        (GOOD.replace("per_minute = ", "per_hour = "), "codes.per_hour"),
        (GOOD.replace('"joints"', '"tool-centre"'), "tool_centre_control"),
        ("colour = 1\n" + GOOD, "colour"),
        (GOOD + '[[statements]]\npattern = "("\neffect = "none"\n', "statements[0].pattern"),
        (GOOD + '[[statements]]\npattern = "a"\neffect = "dance"\n', "statements[0].effect"),
        (GOOD + "\n=", "correct the file"),
    ],
)
def test_a_wrong_dialect_file_is_refused_with_file_and_key(text, key, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(MachineError) as caught:
        read_dialect(path)
    assert str(path) in str(caught.value)
    assert key in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('comment = "({text})"', 'comment = "{text.__class__}"', "comment: field 'text.__class__' is unknown"),
        ('comment = "({text})"', 'comment = "({text:>20000000000})"', "comment: field 'text' has the format"),
        (
            'comment = "({text})"',
            'comment = "({text!r})"',
            "comment: field 'text' has the conversion '!r': leave it out",
        ),
        ('comment = "({text})"', 'comment = "({text:{text}})"', "comment: field 'text' has the format"),
        ('comment = "({text})"', 'comment = "({text"', "comment: expected '}'"),
        ("T{tool} M6", "T{tool[0]} M6", "templates.tool: field 'tool[0]' is unknown"),
        ("T{tool} M6", "T{tool:.99} M6", "templates.tool: field 'tool' has the format ':.99'"),
        ("T{tool} M6", "T{words} M6", "templates.tool: field 'words' is unknown"),
        ("G1 {words} F{feed}", "G1 F{feed} {words}", "templates.feed: give {words} and then {feed}"),
        ("G1 {words} F{feed}", "G1 {words}", "templates.feed: give {words} and then {feed}"),
        ("G0 {words}", "G0 {words:>40}", "templates.rapid: give {words}"),
        ('coolant_on = "M8"', 'coolant_on = "M8\\u0007"', "templates.coolant_on: has the character"),
        ('extension = ".ngc"', 'extension = "/../x.ngc"', "extension: '/../x.ngc'"),
        ('"G17", ', '"17", ', "codes.none[0]: '17'"),
        ("decimals = 5", "decimals = 99999999999", "numbers.length.decimals: 99999999999: give at most 8"),
        ("highest = 99999.0", "highest = inf", "numbers.feed.highest: inf: give a finite number"),
        ("[codes]", "[numbering]\nformat = '{number}'\n[codes]", "numbering.format"),
        ("[codes]", "[numbering]\nfirst = -1\n[codes]", "numbering.first: -1: give 0 or more"),
    ],
)
def test_templates_and_numbers_hold_data_only(old, new, key, tmp_path):
    assert old in GOOD
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(MachineError) as caught:
        read_dialect(path)
    assert f"{path}: {key}" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("{letter}=DC({number})", "{number}=DC({letter})", "endless_word: '{number}=DC({letter})': give {letter} and"),
        ("{letter}=DC({number})", "{letter}= DC({number})", "endless_word: '{letter}= DC({number})': give"),
        ("{letter}=DC({number})", "{letter}=DC({number:>9})", "endless_word: '{letter}=DC({number:>9})': give"),
        ("{letter}=DC({number})", "{letter.upper}{number}", "endless_word: field 'letter.upper' is unknown"),
        ("endless_from_deg = 0.0", "endless_from_deg = 90.0", "endless_from_deg: 90.0: give at most 0"),
        (
            "G54 D1\n",
            "G54 D{length}\n",
            "tool_centre_control.TRAORI.on: field 'length' is unknown: use one of height, tool",
        ),
        ('off = "TRAFOOF"', 'off = "TRAFOOF {tool}"', "tool_centre_control.TRAORI.off: field 'tool' is unknown"),
        ("first = 10\nstep = 10", "first = 10\nstep = 0", "numbering.step: 0: give 1 or more"),
        ("highest = 99999990", "highest = 10", "numbering.highest: 10: give more than first (10)"),
        ('format = "N{number} {text}"', 'format = "{text} N{number}"', "numbering.format: '{text} N{number}': give"),
        ('["G0"]', '["G0", "G1"]', "codes.rapid: G1 is a feed move: list it in feed"),
        ('["G0"]', '["G0", "G17"]', "codes.rapid: G17 is in none too: a code does one thing"),
        ('["TRAORI"]', '["TRAORI(1)"]', "codes.tool_centre_on[0]: 'TRAORI(1)'"),
        ('frame = ""', 'frame = "%\\n%"', "frame: has a line end"),
        ('_ORI_FINISH" }', '_ORI_FINISH", semi = "" }', "machining.semi: unknown key"),
    ],
)
def test_what_the_iso_grammar_is_told_is_checked(old, new, key, tmp_path):
    assert old in SIEMENS
    path = tmp_path / "mine.toml"
    path.write_text(SIEMENS.replace(old, new, 1))
    with pytest.raises(MachineError) as caught:
        read_dialect(path)
    assert f"{path}: {key}" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_statements_are_matched_in_linear_time(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(KLARTEXT.replace("pattern = 'M30'", "pattern = '(M+)+30'"))
    (pattern,) = (item for item, told in read_dialect(path).patterns if told.effect == "program end")
    assert pattern.match("M" * 100_000) is None


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("';(?P<comment>.*)'", "';.*'"),
        ("(?P<tool>\\d+)", "(?P<number>\\d+)"),
        ("pattern = 'M30'", "pattern = '(a)\\1'"),
        ("pattern = 'M30'", "pattern = 'a{1000000}'"),
        ("pattern = 'M30'", f"pattern = '{'a' * 501}'"),
    ],
)
def test_a_statement_that_cannot_be_read_is_refused(old, new, tmp_path):
    assert old in KLARTEXT
    path = tmp_path / "mine.toml"
    path.write_text(KLARTEXT.replace(old, new))
    with pytest.raises(MachineError, match=r"statements\[\d+\]\.pattern: "):
        read_dialect(path)


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
