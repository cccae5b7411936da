import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bonecam.errors import ProgramError
from bonecam.nc.schema import NumberFormat
from bonecam.nc.words import wrapped


@given(st.floats(-1e6, 1e6), st.integers(1, 6), st.booleans())
def test_a_word_is_plain_and_within_half_its_last_decimal(value, decimals, sign):
    form = NumberFormat(decimals=decimals, sign=sign)
    text = form.text(value)
    assert re.fullmatch(rf"{'[+-]' if sign else '-?'}\d+\.\d{{{decimals}}}", text)
    assert not re.fullmatch(r"-0\.0*", text)
    assert abs(float(text) - value) <= 0.5 * form.step + 1e-9


@given(st.floats(-1e5, 1e5))
def test_a_wrapped_angle_points_the_same_way(angle):
    short = wrapped(np.array([angle]))[0]
    assert -180 <= short < 180
    assert abs((short - angle) / 360 - round((short - angle) / 360)) < 1e-9


def test_an_angle_a_rounding_below_a_whole_turn_is_zero():
    assert wrapped(np.array([-1e-14, -0.0, 360.0]), 0.0).tolist() == [0.0, 0.0, 0.0]


def test_what_a_control_cannot_take_is_refused():
    with pytest.raises(ProgramError, match="range"):
        NumberFormat(decimals=0, sign=False, lowest=1.0, highest=9999.0).text(10000.0)
    with pytest.raises(ProgramError, match="word 1 is not a finite"):
        NumberFormat(decimals=3, sign=True).steps(np.array([1.0, np.nan]))
