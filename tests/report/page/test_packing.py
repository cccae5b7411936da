"""The packed contents of a page."""

import gzip
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bonecam.errors import FileError
from bonecam.report.page.contents import FLOAT_BYTES, VERSION, Contents, pack, unpack


@settings(max_examples=40)
@given(arrays(np.float64, st.tuples(st.integers(1, 30), st.integers(1, 3)), elements=st.floats(-500, 500)))
def test_floats_come_back_within_half_a_step_of_their_range(values: np.ndarray) -> None:
    back = unpack(pack(Contents({}, {"values": values})), "view.gz").arrays["values"]
    step = np.ptp(values, axis=0).max() / (2 ** (8 * FLOAT_BYTES) - 1)
    assert np.abs(back - values).max() <= step / 2 + 1e-9


@settings(max_examples=40)
@given(st.lists(st.integers(0, 2**24 - 1), min_size=1, max_size=40), st.text(min_size=1))
def test_whole_numbers_bytes_and_facts_come_back_as_they_were(numbers: list[int], text: str) -> None:
    raw = np.frombuffer(text.encode("utf-16-le", "surrogatepass"), np.uint8)
    back = unpack(pack(Contents({"text": text}, {"n": np.array(numbers), "raw": raw})), "view.gz")
    assert back.arrays["n"].tolist() == numbers
    assert back.arrays["raw"].tobytes() == raw.tobytes()
    assert back.facts["text"] == text


def test_equal_contents_are_equal_bytes_and_empty_arrays_are_left_out() -> None:
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
def test_what_is_damaged_or_of_another_version_is_told_in_one_line(packed: bytes, told: str) -> None:
    with pytest.raises(FileError, match=told) as caught:
        unpack(packed, "look/view.gz")
    assert str(caught.value).startswith("look/view.gz: ")
    assert "\n" not in str(caught.value)
