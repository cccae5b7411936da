import pytest

from bonecam.errors import MachineError
from bonecam.nc.dialect import FOLDER, TEMPLATES, dialect_names, read_dialect

GOOD = (FOLDER / "linuxcnc.toml").read_text()


@pytest.mark.parametrize("name", dialect_names())
def test_every_shipped_dialect_has_every_template_and_says_what_is_proved(name):
    dialect = read_dialect(name)
    assert set(TEMPLATES) <= set(dialect.templates)
    comment = (FOLDER / f"{name}.toml").read_text().split("title", 1)[0]
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


def test_an_unknown_controller_is_refused_with_the_known_ones():
    with pytest.raises(MachineError, match="'nosuch' is unknown: use one of heidenhain, linuxcnc"):
        read_dialect("nosuch")
