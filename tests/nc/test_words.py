import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bonecam.errors import ProgramError
from bonecam.nc.schema import NumberFormat
from bonecam.nc.words import plain_text, wrapped


@given(st.floats(-1e6, 1e6), st.integers(1, 6), st.booleans())
def test_a_word_is_plain_and_within_half_its_last_decimal(value, decimals, sign):
    form = NumberFormat(decimals=decimals, sign=sign)
    text = form.text(value)
    assert re.fullmatch(rf"{'[+-]' if sign else '-?'}\d+\.\d{{{decimals}}}", text)
    assert not re.fullmatch(r"-0\.0*", text)
    assert abs(float(text) - value) <= 0.5 * form.step + 1e-9


@given(st.floats(-1e-3, 1e-3))
def test_a_small_number_has_no_exponent_and_zero_no_minus(value):
    assert NumberFormat(decimals=3, sign=True).text(value) in ("+0.000", "+0.001", "-0.001")


@given(st.floats(-1e5, 1e5))
def test_rounding_twice_is_rounding_once(value):
    form = NumberFormat(decimals=3, sign=True)
    once = form.rounded(np.array([value]))
    assert np.array_equal(form.rounded(once), once)
    assert form.text(float(once[0])) == form.text(value)


@given(st.floats(-1e5, 1e5))
def test_a_wrapped_angle_points_the_same_way(angle):
    short = wrapped(np.array([angle]))[0]
    assert -180 <= short < 180
    assert abs((short - angle) / 360 - round((short - angle) / 360)) < 1e-9


@given(st.floats(-1e5, 1e5))
def test_an_angle_is_wrapped_from_any_lowest_on(angle):
    assert 0 <= wrapped(np.array([angle]), 0.0)[0] < 360


def test_an_angle_a_rounding_below_a_whole_turn_is_zero():
    assert wrapped(np.array([-1e-14, -0.0, 360.0]), 0.0).tolist() == [0.0, 0.0, 0.0]


def test_what_a_control_cannot_take_is_refused():
    with pytest.raises(ProgramError, match="range"):
        NumberFormat(decimals=0, sign=False, lowest=1.0, highest=9999.0).text(10000.0)
    with pytest.raises(ProgramError, match="word 1 is not a finite"):
        NumberFormat(decimals=3, sign=True).steps(np.array([1.0, np.nan]))


def test_a_comment_cannot_end_itself():
    assert plain_text("Bone (left); 2 µm", "ABCDEFGHIJKLMNOPQRSTUVWXYZ 0123456789") == "BONE  LEFT   2  M"


def test_a_feed_is_rounded_down_into_the_range_of_its_word():
    feed = NumberFormat(decimals=1, sign=False, lowest=0.5, highest=900.0)
    found = feed.rounded_down(np.array([12.39, 0.3 * 3, 0.04, 1e6]))
    assert found.tolist() == [12.3, 0.9, 0.5, 900.0]
