"""The registry: names are unique, filters are of a verb family, third parties come in by entry points, a
broken one is named."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import pymeshlab
import pytest

from bonecam.errors import FilterError
from bonecam.filters import filter
from bonecam.filters.filter import GROUP, Filter, Registry, filters_of, installed

PLUGIN = """
from bonecam.filters.filter import Filter
FILTERS = [Filter("generate_offset", "Generate Offset", "Does nothing.", "Test", (), lambda *_: {})]
"""


@pytest.fixture
def plugin_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.syspath_prepend(str(tmp_path))
    installed.cache_clear()
    yield tmp_path
    for name in [name for name in sys.modules if name.startswith("stranger")]:
        del sys.modules[name]
    installed.cache_clear()


def install(folder: Path, name: str, text: str) -> EntryPoint:
    """What a third party's wheel leaves in site-packages: a module and an entry point."""
    (folder / f"{name}.py").write_text(text)
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\n{name} = {name}:FILTERS\n")
    return EntryPoint(name, f"{name}:FILTERS", GROUP)


def test_third_party_filter_is_found_through_its_entry_point(plugin_folder: Path) -> None:
    assert "generate_offset" not in installed()
    install(plugin_folder, "stranger_good", PLUGIN)
    installed.cache_clear()
    theirs = installed()["generate_offset"]
    assert [theirs] == sys.modules["stranger_good"].FILTERS
    assert installed()["Generate Offset"] is theirs


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("import no_such_module_at_all\n", "ModuleNotFoundError: No module named 'no_such_module_at_all'"),
        ("FILTER = []\n", "AttributeError"),
        ("FILTERS = 3\n", "TypeError"),
        ("raise RuntimeError('broken')\n", "RuntimeError: broken"),
        ("FILTERS = ['generate']\n", "'generate', which is no Filter"),
    ],
)
def test_broken_plugin_is_left_out_with_a_warning_that_names_it(
    plugin_folder: Path, text: str, reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    plugin = install(plugin_folder, "stranger_broken", text)
    with pytest.raises(FilterError, match="stranger_broken") as caught:
        filters_of(plugin)
    assert reason in str(caught.value)
    installed.cache_clear()
    assert "generate_morph_levels" in installed()
    assert "stranger_broken" in caplog.text
    assert reason in caplog.text


def test_a_plugin_with_a_name_of_ours_is_left_out(plugin_folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    ours = installed()["generate_morph_levels"]
    install(plugin_folder, "stranger_double", PLUGIN.replace("generate_offset", ours.name))
    installed.cache_clear()
    assert installed()["generate_morph_levels"].act is ours.act
    assert "two filters are called 'generate_morph_levels'" in caplog.text


def test_two_filters_of_one_name_are_an_error(offset_filter: Filter) -> None:
    for other in (
        offset_filter,
        replace(offset_filter, name="generate_other"),
        replace(offset_filter, display_name="Other"),
    ):
        with pytest.raises(FilterError, match=r"two filters are called '(generate_offset|Generate Offset)'"):
            Registry([offset_filter, other])


@pytest.mark.parametrize("name", ["Box/Cube", "generate_alpha_wrap"])
def test_a_name_of_meshlab_s_is_taken(offset_filter: Filter, name: str) -> None:
    clash = replace(offset_filter, name=name) if name.islower() else replace(offset_filter, display_name=name)
    with pytest.raises(FilterError, match=name):
        Registry([clash], taken=filter.all_names())


@pytest.mark.parametrize(
    "wrong",
    [
        {"name": "make_offset"},
        {"name": "generate"},
        {"name": "generate_Offset"},
        {"documentation": " "},
        {"category": ""},
    ],
)
def test_records_without_verb_family_or_words_are_refused(offset_filter: Filter, wrong: dict[str, str]) -> None:
    with pytest.raises(ValueError, match="filter"):
        replace(offset_filter, **wrong)  # type: ignore[arg-type]


def test_parameter_stated_twice_is_refused(offset_filter: Filter) -> None:
    with pytest.raises(ValueError, match="'distance' is there twice"):
        replace(offset_filter, parameters=(*offset_filter.parameters, offset_filter.parameters[0]))


def test_unknown_filters_and_parameters_are_errors_with_the_known_ones(
    offset_filter: Filter, recall_filter: Filter
) -> None:
    with pytest.raises(FilterError, match="there is no filter 'nope'"):
        Registry([offset_filter])["nope"]
    with pytest.raises(FilterError, match=r"generate_offset knows no parameter 'nope': use one of distance, how"):
        offset_filter.values({"nope": 1}, None)
    with pytest.raises(FilterError, match=r"compute_recall knows no parameter 'nope': use one of none"):
        recall_filter.values({"nope": 1}, None)


def test_every_filter_of_meshlab_has_a_shown_name_that_leads_to_it() -> None:
    led_to = {filter.python_name(name) for name in filter.all_names() if filter.python_name(name) != name}
    assert set(pymeshlab.filter_list()) <= led_to
    assert filter.python_name("Remeshing: Isotropic Explicit Remeshing") == "meshing_isotropic_explicit_remeshing"
    assert filter.python_name("Box/Cube") == "create_cube"
