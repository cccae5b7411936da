"""Words that are numbers in files."""

import math

import pytest

from bonecam.text.numbers import number, told_apart, whole_number


def test_what_other_programs_write_is_read():
    assert [number(word) for word in "1 -2.5 +.5 1e3 1E-3 007".split()] == [1, -2.5, 0.5, 1000, 0.001, 7]
    assert number("inf") == math.inf
    assert [whole_number(word) for word in "0 -3 +12".split()] == [0, -3, 12]


@pytest.mark.parametrize("word", ["1_0", "one", "", "1,5", "x" * 5000])
def test_any_other_word_is_no_number(word):
    with pytest.raises(ValueError, match=r"^'.{0,40}' is no number$"):
        number(word)


@pytest.mark.parametrize("word", ["1_0", "1.0", "", "- 1", "9" * 5000])
def test_any_other_word_is_no_whole_number(word):
    with pytest.raises(ValueError, match=r"^'.{0,40}' is no whole number$"):
        whole_number(word)


def test_figures_of_a_refusal_have_the_digits_in_which_they_differ():
    assert told_apart(90.0, 89.99999) == ("90.00000", "89.99999")
    assert told_apart(300.4, 300.0) == ("300.4", "300.0")
    assert told_apart(12.0, 3.0) == ("12", "3")
    assert told_apart(0.5, 0.5, decimals=2) == ("0.50", "0.50")
