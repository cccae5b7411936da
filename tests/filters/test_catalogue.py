"""The list of filters names every filter once, with its parameters, defaults, units and ranges."""

import re

import pytest

from bonecam.errors import FilterError
from bonecam.filters.filter import Registry, catalogue, first_sentence


def test_overview_has_one_entry_a_filter_by_category(registry: Registry) -> None:
    lines = catalogue(registry=registry).splitlines()
    assert "      Moves a copy of the layer along z." in lines
    assert lines.index("  generate_offset (Generate Offset)") + 1 == lines.index(
        "      Moves a copy of the layer along z."
    )
    assert len([line for line in lines if re.match(r"  \w+ \(", line)]) == len(registry.names)
    assert len([line for line in lines if line and not line.startswith(" ")]) == 1


def test_page_states_every_parameter(registry: Registry) -> None:
    lines = catalogue("Generate Offset", registry).splitlines()
    for told, meant in (
        ("  distance: length = 1.0 mm or %, 0 .. 20", "      Distance. How far."),
        ("  how: enum = up, one of up, down", "      How. Which way."),
        ("  size: float = from the mesh mm", "      Size. Of the mesh."),
    ):
        assert lines[lines.index(told) + 1] == meant
    assert "The current layer's mesh is not changed." in lines
    assert "Changes the current layer." in catalogue("apply_turn", registry).splitlines()


def test_unknown_filter_is_an_error() -> None:
    with pytest.raises(FilterError, match="'nope'"):
        catalogue("nope")


@pytest.mark.parametrize(
    ("text", "first"), [("One. Two.", "One."), ("0.1 mm deep", "0.1 mm deep."), ("a ... b. C", "a ... b.")]
)
def test_first_sentence(text: str, first: str) -> None:
    assert first_sentence(text) == first
