"""Script text: lines are known, a round trip gives equal calls, what is no script is refused with its
line."""

from pathlib import Path

import pytest
from bonecam_plugins.meshlab.meshlab_values import FilterCall, ScriptParameter, read_calls, script_text, write_script
from hypothesis import given
from hypothesis import strategies as st

from bonecam.errors import FileError, FilterError

TEXT = """<!DOCTYPE FilterScript>
<FilterScript>
 <filter name="Box/Cube">
  <Param type="RichFloat" name="size" tooltip="Scales the new mesh" description="Scale factor" value="1"/>
 </filter>
 <filter name="Delete Current Mesh"/>
</FilterScript>
"""

CHARACTERS = st.characters(blacklist_categories=["Cs", "Cc"], whitelist_characters="\n\t<>&\"'")
WORDS = st.text(CHARACTERS, min_size=1)
PARAMETERS = st.builds(
    ScriptParameter, WORDS, WORDS, st.dictionaries(st.sampled_from(["value", "r", "g", "val0"]), st.text(CHARACTERS))
)
CALLS = st.lists(st.builds(FilterCall, WORDS, st.lists(PARAMETERS, max_size=3).map(tuple)), max_size=4)


def write(folder: Path, text: str) -> Path:
    (folder / "script.mlx").write_text(text, encoding="utf-8")
    return folder / "script.mlx"


def test_filters_and_parameters_come_with_their_lines(tmp_path):
    cube, delete = read_calls(write(tmp_path, TEXT))
    assert (cube.name, cube.line, delete.name, delete.line, delete.parameters) == (
        "Box/Cube",
        3,
        "Delete Current Mesh",
        6,
        (),
    )
    assert cube.parameters == (ScriptParameter("size", "RichFloat", {"value": "1"}),)
    assert cube.parameters[0].line == 4


@given(CALLS)
def test_round_trip_gives_equal_calls(tmp_path_factory, calls):
    path = tmp_path_factory.mktemp("mlx") / "script.mlx"
    write_script(calls, path)
    assert read_calls(path) == calls
    assert script_text(read_calls(path)) == path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "kind", "reason"),
    [
        ("", FileError, r"line 1: no element found"),
        ("box the bone", FileError, r"line 1: syntax error"),
        (TEXT.replace(" </filter>\n", ""), FilterError, r"line 5: <filter> inside <filter>"),
        (TEXT.replace("</filter>", "</Filter>"), FileError, r"line 5: mismatched tag"),
        (TEXT.replace("</FilterScript>", ""), FileError, r"line 8: no element found"),
        (
            TEXT.replace("FilterScript>", "Script>"),
            FilterError,
            r"line 2: <Script> at the top: a script begins with <FilterScript>",
        ),
        (TEXT.replace("Param", "xmlparam"), FilterError, r"line 4: <xmlparam> inside <filter>: a filter holds <Param>"),
        (TEXT.replace(' name="Box/Cube"', ""), FilterError, r"line 3: <filter> without its name"),
        (TEXT.replace(' type="RichFloat"', ""), FilterError, r"line 4: <Param> without its name or type"),
        ('<!DOCTYPE F [<!ENTITY a "b">]><FilterScript/>', FileError, r"line 1: entity 'a'"),
    ],
)
def test_what_is_no_script_is_refused_with_its_line(tmp_path, text, kind, reason):
    with pytest.raises(kind, match=reason) as caught:
        read_calls(write(tmp_path, text))
    assert isinstance(caught.value.evidence["line"], int)
    assert str(tmp_path / "script.mlx") in str(caught.value)


def test_a_missing_script_is_a_file_error(tmp_path):
    with pytest.raises(FileError, match=r"none\.mlx: No such file"):
        read_calls(tmp_path / "none.mlx")


@pytest.mark.parametrize("encoding", ["rot13", "utf-7", "idna", "nope"])
def test_an_encoding_that_xml_cannot_have_is_refused(tmp_path, encoding):
    script = write(tmp_path, f'<?xml version="1.0" encoding="{encoding}"?><FilterScript/>')
    with pytest.raises(FileError, match=r"script\.mlx: its encoding cannot be read"):
        read_calls(script)
