"""The registry: names are unique, filters are of a verb family, third parties come in by entry points, a
broken one is named.

The list of filters names every filter once, with its parameters, defaults, units and ranges.

Parameters take values and percentages the MeshLab way, refuse the rest by name, and survive their text.
"""

import re
import sys
from dataclasses import fields, replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pymeshlab
import pytest
from bonecam_plugins.meshlab import FilterParameter, Kind, Percentage, Registry, filter, installed
from bonecam_plugins.meshlab.filter import GROUP, catalogue, filters_of, first_sentence, parameters_of, section_of
from hypothesis import given
from hypothesis import strategies as st

from bonecam.errors import FilterError
from bonecam.job import Job, LevelsJob, StockJob
from bonecam.job.parameter import record
from bonecam.mesh import TriangleMesh

PLUGIN = """
from bonecam_plugins.meshlab.filter import Filter
FILTERS = [Filter("generate_offset", "Generate Offset", "Does nothing.", "Test", (), lambda *_: {})]
"""


@pytest.fixture
def plugin_folder(tmp_path, monkeypatch):
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


def test_third_party_filter_is_found_through_its_entry_point(plugin_folder):
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
def test_broken_plugin_is_left_out_with_a_warning_that_names_it(plugin_folder, text, reason, caplog):
    plugin = install(plugin_folder, "stranger_broken", text)
    with pytest.raises(FilterError, match="stranger_broken") as caught:
        filters_of(plugin)
    assert reason in str(caught.value)
    installed.cache_clear()
    assert "generate_morph_levels" in installed()
    assert "stranger_broken" in caplog.text
    assert reason in caplog.text


def test_a_plugin_with_a_name_of_ours_is_left_out(plugin_folder, caplog):
    ours = installed()["generate_morph_levels"]
    install(plugin_folder, "stranger_double", PLUGIN.replace("generate_offset", ours.name))
    installed.cache_clear()
    assert installed()["generate_morph_levels"].act is ours.act
    assert "two filters are called 'generate_morph_levels'" in caplog.text


def test_two_filters_of_one_name_are_an_error(offset_filter):
    for other in (
        offset_filter,
        replace(offset_filter, name="generate_other"),
        replace(offset_filter, display_name="Other"),
    ):
        with pytest.raises(FilterError, match=r"two filters are called '(generate_offset|Generate Offset)'"):
            Registry([offset_filter, other])


@pytest.mark.parametrize("name", ["Box/Cube", "generate_alpha_wrap"])
def test_a_name_of_meshlab_s_is_taken(offset_filter, name):
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
def test_records_without_verb_family_or_words_are_refused(offset_filter, wrong):
    with pytest.raises(ValueError, match="filter"):
        replace(offset_filter, **wrong)  # type: ignore[arg-type]


def test_parameter_stated_twice_is_refused(offset_filter):
    with pytest.raises(ValueError, match="'distance' is there twice"):
        replace(offset_filter, parameters=(*offset_filter.parameters, offset_filter.parameters[0]))


def test_unknown_filters_and_parameters_are_errors_with_the_known_ones(offset_filter, recall_filter):
    with pytest.raises(FilterError, match="there is no filter 'nope'"):
        Registry([offset_filter])["nope"]
    with pytest.raises(FilterError, match=r"generate_offset knows no parameter 'nope': use one of distance, how"):
        offset_filter.values({"nope": 1}, None)
    with pytest.raises(FilterError, match=r"compute_recall knows no parameter 'nope': use one of none"):
        recall_filter.values({"nope": 1}, None)


def test_every_filter_of_meshlab_has_a_shown_name_that_leads_to_it():
    led_to = {filter.python_name(name) for name in filter.all_names() if filter.python_name(name) != name}
    assert set(pymeshlab.filter_list()) <= led_to
    assert filter.python_name("Remeshing: Isotropic Explicit Remeshing") == "meshing_isotropic_explicit_remeshing"
    assert filter.python_name("Box/Cube") == "create_cube"


def test_overview_has_one_entry_a_filter_by_category(registry):
    lines = catalogue(registry=registry).splitlines()
    assert "      Moves a copy of the layer along z." in lines
    assert lines.index("  generate_offset (Generate Offset)") + 1 == lines.index(
        "      Moves a copy of the layer along z."
    )
    assert len([line for line in lines if re.match(r"  \w+ \(", line)]) == len(registry.names)
    assert len([line for line in lines if line and not line.startswith(" ")]) == 1


def test_page_states_every_parameter(registry):
    lines = catalogue("Generate Offset", registry).splitlines()
    for told, meant in (
        ("  distance: length = 1.0 mm or %, 0 .. 20", "      Distance. How far."),
        ("  how: enum = up, one of up, down", "      How. Which way."),
        ("  size: float = from the mesh mm", "      Size. Of the mesh."),
    ):
        assert lines[lines.index(told) + 1] == meant
    assert "The current layer's mesh is not changed." in lines
    assert "Changes the current layer." in catalogue("apply_turn", registry).splitlines()


def test_unknown_filter_is_an_error():
    with pytest.raises(FilterError, match="'nope'"):
        catalogue("nope")


@pytest.mark.parametrize(
    ("text", "first"), [("One. Two.", "One."), ("0.1 mm deep", "0.1 mm deep."), ("a ... b. C", "a ... b.")]
)
def test_first_sentence(text, first):
    assert first_sentence(text) == first


BOX = TriangleMesh(np.array([[0.0, 0, 0], [30, 0, 0], [0, 40, 0]]), np.array([[0, 1, 2]], dtype=np.int32))
LENGTH = FilterParameter("depth", Kind.LENGTH, 0.5, "Depth", "How deep.", "mm", 0.01, 20.0)
SHARE = FilterParameter("share", Kind.LENGTH, 5.0, "Share", "Of the range.", "mm", 2.0, 12.0, percentage_of_range=True)
COUNT = FilterParameter("count", Kind.INT, 3, "Count", "How many.", low=1, high=9)
CHOICE = FilterParameter("how", Kind.ENUM, "up", "How", "Which way.", choices=("up", "down"))


def test_percentage_is_of_the_parameter_range_where_it_says_so():
    assert SHARE.resolved(pymeshlab.PercentageValue(25), None) == pytest.approx(4.5)


def test_pure_values_numbers_and_numpy_scalars_are_mm():
    for value in (pymeshlab.PureValue(2), 2, 2.0, np.float64(2), np.int64(2)):
        assert LENGTH.resolved(value, BOX) == 2.0
        assert type(LENGTH.resolved(value, BOX)) is float


@pytest.mark.parametrize(
    ("parameter", "value", "reason"),
    [
        (LENGTH, 0.0, r"depth = 0: keep it within 0\.01 \.\. 20 mm"),
        (LENGTH, Percentage(90.0), r"depth = 45: keep it within"),
        (LENGTH, float("nan"), r"depth = nan: give a number of mm"),
        (LENGTH, "deep", r"depth = 'deep': give a number of mm"),
        (SHARE, Percentage(101.0), r"share = 101 %: keep it within 0 \.\. 100 %"),
        (COUNT, 2.5, r"count = 2.5: give a whole number"),
        (COUNT, True, r"count = True: give a whole number"),
        (COUNT, Percentage(3.0), r"count = 3 %: give a whole number"),
        (COUNT, 10, r"count = 10: keep it within 1 \.\. 9"),
        (CHOICE, "left", r"how = 'left': choose one of up, down"),
        (CHOICE, 2, r"how = 2: choose one of up, down"),
    ],
)
def test_bad_values_are_refused_with_name_value_and_remedy(parameter, value, reason):
    with pytest.raises(FilterError, match=reason):
        parameter.resolved(value, BOX)


def test_percentage_without_a_layer_is_refused():
    with pytest.raises(FilterError, match="load a mesh first"):
        LENGTH.resolved(Percentage(2.0), None)


def test_enumerations_take_names_and_numbers():
    assert CHOICE.checked(1) == CHOICE.checked("down") == CHOICE.read("1") == CHOICE.read("down") == "down"


@pytest.mark.parametrize(
    "wrong",
    [
        {"label": ""},
        {"tooltip": ""},
        {"name": "Depth"},
        {"default": 50.0},
        {"default": "x"},
        {"choices": ("a",)},
        {"percentage_of_range": True, "high": float("inf")},
    ],
)
def test_records_that_contradict_themselves_are_refused(wrong):
    right = {
        "name": "depth",
        "kind": Kind.LENGTH,
        "default": 0.5,
        "label": "Depth",
        "tooltip": "How deep.",
        "low": 0.0,
        "high": 20.0,
    }
    FilterParameter(**right)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"parameter|default"):
        FilterParameter(**{**right, **wrong})  # type: ignore[arg-type]


@given(st.one_of(st.floats(0.01, 20.0), st.floats(0.0, 100.0).map(Percentage)))
def test_lengths_survive_their_text_bit_for_bit(value):
    assert LENGTH.read(LENGTH.written(value)) == value


@given(st.text(alphabet=st.characters(blacklist_categories=["Cs"])))
def test_texts_survive_as_they_are(value):
    text = FilterParameter("name", Kind.STRING, "", "Name", "Any text.")
    assert text.read(text.written(value)) == value


@pytest.mark.parametrize("stage", fields(Job), ids=lambda item: item.name)
def test_stage_parameters_are_the_job_fields(stage):
    job = getattr(Job(), stage.name)  # type: ignore[attr-defined]
    found = {item.name: item for item in parameters_of(job)}
    assert list(found) == [item.name for item in fields(job)]
    for item in fields(job):
        known, parameter = record(item), found[item.name]
        assert (parameter.label, parameter.tooltip, parameter.unit) == (known.label, known.tooltip, known.unit)
        assert parameter.default == getattr(job, item.name)
        assert (parameter.kind is Kind.LENGTH) == (known.unit == "mm" and isinstance(parameter.default, float))


def test_values_lead_back_to_the_stage():
    assert section_of(LevelsJob(), {"roughing_depth": 0.7, "other": 1}) == LevelsJob(roughing_depth=0.7)
    assert section_of(StockJob(), {"stock_diameter": 15.0, "diameter": 4.0}, prefix="stock_") == StockJob(diameter=15.0)
