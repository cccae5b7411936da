"""The packed contents of a page.

Paths with fewer rows.
"""

import gzip
import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy import ndarray

from bonecam.errors import FileError
from bonecam.report.page.contents import FLOAT_BYTES, VERSION, Contents, pack, thinned, unpack


@settings(max_examples=40)
@given(arrays(np.float64, st.tuples(st.integers(1, 30), st.integers(1, 3)), elements=st.floats(-500, 500)))
def test_floats_come_back_within_half_a_step_of_their_range(values):
    back = unpack(pack(Contents({}, {"values": values})), "view.gz").arrays["values"]
    step = np.ptp(values, axis=0).max() / (2 ** (8 * FLOAT_BYTES) - 1)
    assert np.abs(back - values).max() <= step / 2 + 1e-9


@settings(max_examples=40)
@given(st.lists(st.integers(0, 2**24 - 1), min_size=1, max_size=40), st.text(min_size=1))
def test_whole_numbers_bytes_and_facts_come_back_as_they_were(numbers, text):
    raw = np.frombuffer(text.encode("utf-16-le", "surrogatepass"), np.uint8)
    back = unpack(pack(Contents({"text": text}, {"n": np.array(numbers), "raw": raw})), "view.gz")
    assert back.arrays["n"].tolist() == numbers
    assert back.arrays["raw"].tobytes() == raw.tobytes()
    assert back.facts["text"] == text


def test_equal_contents_are_equal_bytes_and_empty_arrays_are_left_out():
    contents = Contents({"a": 1}, {"none": np.zeros((0, 3)), "one": np.ones((1, 3))})
    assert pack(contents) == pack(contents)
    assert list(unpack(pack(contents), "view.gz").arrays) == ["one"]


def other_version() -> bytes:
    head = json.dumps({"bonecam_view": VERSION + 1, "facts": {}, "arrays": {}}).encode()
    return gzip.compress(len(head).to_bytes(4, "little") + head)


WHOLE = pack(Contents({"name": "bone"}, {"points": np.arange(30.0).reshape(10, 3)}))


@pytest.mark.parametrize(
    ("packed", "told"),
    [
        (other_version(), f"version {VERSION + 1}, this bonecam reads {VERSION}"),
        (WHOLE[: len(WHOLE) // 2], "damaged"),
        (b"", "damaged"),
        (b"PK no gzip", "damaged"),
        (gzip.compress(b"\xff\xff\xff\x7f{}"), "damaged"),
        (gzip.compress(gzip.decompress(WHOLE)[:-20]), "damaged"),
    ],
    ids=["other version", "half", "empty", "no gzip", "huge head", "short arrays"],
)
def test_what_is_damaged_or_of_another_version_is_told_in_one_line(packed, told):
    with pytest.raises(FileError, match=told) as caught:
        unpack(packed, "look/view.gz")
    assert str(caught.value).startswith("look/view.gz: ")
    assert "\n" not in str(caught.value)


LENGTH = 10.0


def helix(rows: int) -> tuple[ndarray, ndarray]:
    """Tips on a helix of 5 mm, and axes that turn with it."""
    angle = np.linspace(0, 20 * np.pi, rows)
    tips = np.column_stack([5 * np.cos(angle), 5 * np.sin(angle), angle / 6])
    axes = np.column_stack([np.cos(angle), np.sin(angle), np.ones(rows)]) / np.sqrt(2)
    return tips, axes


def farthest(points: ndarray, kept: ndarray) -> float:
    """The largest distance of a point from the segment that takes its place, mm."""
    found = 0.0
    for first, last in pairwise(kept):
        along = points[last] - points[first]
        between = points[first : last + 1] - points[first]
        share = np.clip(between @ along / (along @ along), 0, 1)
        found = max(found, np.linalg.norm(between - share[:, None] * along, axis=1).max())
    return found


def test_every_row_left_out_lies_within_the_tolerance_of_the_lines_kept():
    tips, axes = helix(20_000)
    needed = np.zeros(len(tips), dtype=bool)
    needed[[777, 12_345]] = True
    for tolerance in (0.001, 0.01, 0.1):
        kept = thinned(tips, axes, needed, tolerance, LENGTH)
        assert farthest(tips, kept) <= tolerance
        assert farthest(tips + LENGTH * axes, kept) <= tolerance
        assert {0, 777, 12_345, len(tips) - 1} <= set(kept.tolist())
        assert len(kept) < 10_000


def test_a_turn_of_the_axis_in_one_place_keeps_its_rows():
    tips = np.column_stack([np.linspace(0, 1, 100), np.zeros(100), np.zeros(100)])
    tilt = np.where(np.arange(100) == 50, 0.3, 0.0)
    axes = np.column_stack([np.zeros(100), np.sin(tilt), np.cos(tilt)])
    kept = thinned(tips, axes, np.zeros(100, dtype=bool), 0.01, LENGTH)
    assert {49, 50, 51} <= set(kept.tolist())
    assert len(kept) < 20
