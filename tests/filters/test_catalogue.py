"""The list of filters names every filter once, with its parameters, defaults, units and ranges."""

import pytest

from bonecam.errors import FilterError
from bonecam.filters.catalogue import catalogue, first_sentence
from bonecam.filters.filter import Registry


def test_overview_has_one_line_a_filter_by_category(registry: Registry) -> None:
    text = catalogue(registry=registry)
    assert "- `generate_offset` (Generate Offset): Moves a copy of the layer along z." in text.splitlines()
    assert text.count("\n- ") == len(registry.names)
    assert text.count("## ") == 1


def test_page_states_every_parameter(registry: Registry) -> None:
    lines = catalogue("Generate Offset", registry).splitlines()
    assert "| `distance` | length | `1.0` | mm or % | 0 .. 20 | **Distance.** How far. |" in lines
    assert "| `how` | enum | `up` | - | `up`, `down` | **How.** Which way. |" in lines
    assert "| `size` | float | from the mesh | mm | - | **Size.** Of the mesh. |" in lines
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
