"""Codes with a meaning are never without effect, whatever a dialect's file says."""

import pytest

from bonecam.errors import MachineError
from bonecam.nc.dialect import DIALECTS, dialect_names, read_dialect
from bonecam.nc.schema import CODES, MEANINGS

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


def test_a_program_in_inches_does_not_begin_in_klartext(tmp_path):
    path = tmp_path / "mine.toml"
    text = (DIALECTS / "heidenhain.toml").read_text()
    path.write_text(text.replace('[A-Z0-9_]+) MM\'\neffect = "begin"', '[A-Z0-9_]+) (MM|INCH)\'\neffect = "begin"'))
    with pytest.raises(MachineError, match="takes BEGIN PGM A INCH, inches, for harmless: leave it out"):
        read_dialect(path)


def test_each_effect_of_a_meaning_is_one_of_the_codes():
    assert {meaning.effect for meaning in MEANINGS.values()} <= {"", *CODES}


@pytest.mark.parametrize("name", dialect_names())
def test_every_shipped_dialect_starts_and_stops_spindle_and_coolant(name):
    dialect = read_dialect(name)
    effects = {item.effect for item in dialect.statements} | {
        one.replace("_", " ") for one in dialect.effect_of.values()
    }
    assert {"spindle on", "spindle stop", "coolant on", "coolant off"} <= effects
