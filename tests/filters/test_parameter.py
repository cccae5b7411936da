"""Parameters take values and percentages the MeshLab way, refuse the rest by name, and survive their text."""

from dataclasses import fields

import numpy as np
import pymeshlab
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bonecam.errors import FilterError
from bonecam.filters.filter import FilterParameter, Kind, Percentage, parameters_of, section_of
from bonecam.job import Job, LevelsJob, StockJob
from bonecam.job.parameter import record
from bonecam.mesh.triangle_mesh import TriangleMesh

BOX = TriangleMesh(np.array([[0.0, 0, 0], [30, 0, 0], [0, 40, 0]]), np.array([[0, 1, 2]], dtype=np.int32))
LENGTH = FilterParameter("depth", Kind.LENGTH, 0.5, "Depth", "How deep.", "mm", 0.01, 20.0)
SHARE = FilterParameter("share", Kind.LENGTH, 5.0, "Share", "Of the range.", "mm", 2.0, 12.0, percentage_of_range=True)
COUNT = FilterParameter("count", Kind.INT, 3, "Count", "How many.", low=1, high=9)
CHOICE = FilterParameter("how", Kind.ENUM, "up", "How", "Which way.", choices=("up", "down"))


def test_percentage_is_of_the_bounding_box_diagonal() -> None:
    assert LENGTH.resolved(pymeshlab.PercentageValue(2), BOX) == pytest.approx(1.0)
    assert LENGTH.resolved(Percentage(2.0), BOX) == pytest.approx(1.0)


def test_percentage_is_of_the_parameter_range_where_it_says_so() -> None:
    assert SHARE.resolved(pymeshlab.PercentageValue(25), None) == pytest.approx(4.5)


def test_pure_values_numbers_and_numpy_scalars_are_mm() -> None:
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
def test_bad_values_are_refused_with_name_value_and_remedy(
    parameter: FilterParameter, value: object, reason: str
) -> None:
    with pytest.raises(FilterError, match=reason):
        parameter.resolved(value, BOX)


def test_percentage_without_a_layer_is_refused() -> None:
    with pytest.raises(FilterError, match="load a mesh first"):
        LENGTH.resolved(Percentage(2.0), None)


def test_enumerations_take_names_and_numbers() -> None:
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
def test_records_that_contradict_themselves_are_refused(wrong: dict[str, object]) -> None:
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
def test_lengths_survive_their_text_bit_for_bit(value: object) -> None:
    assert LENGTH.read(LENGTH.written(value)) == value


@given(st.text(alphabet=st.characters(blacklist_categories=["Cs"])))
def test_texts_survive_as_they_are(value: str) -> None:
    text = FilterParameter("name", Kind.STRING, "", "Name", "Any text.")
    assert text.read(text.written(value)) == value


@pytest.mark.parametrize("stage", fields(Job), ids=lambda item: item.name)
def test_stage_parameters_are_the_job_fields(stage: object) -> None:
    job = getattr(Job(), stage.name)  # type: ignore[attr-defined]
    found = {item.name: item for item in parameters_of(job)}
    assert list(found) == [item.name for item in fields(job)]
    for item in fields(job):
        known, parameter = record(item), found[item.name]
        assert (parameter.label, parameter.tooltip, parameter.unit) == (known.label, known.tooltip, known.unit)
        assert parameter.default == getattr(job, item.name)
        assert (parameter.kind is Kind.LENGTH) == (known.unit == "mm" and isinstance(parameter.default, float))


def test_values_lead_back_to_the_stage() -> None:
    assert section_of(LevelsJob(), {"roughing_depth": 0.7, "other": 1}) == LevelsJob(roughing_depth=0.7)
    assert section_of(StockJob(), {"stock_diameter": 15.0, "diameter": 4.0}, prefix="stock_") == StockJob(diameter=15.0)
