"""Numbers in text files, as other programs write them, and in messages."""

from bonecam.text.faults import shortened

MOST_DIGITS = 4000
"""Python reads whole numbers of 4300 digits at most: the time that takes grows with their square."""
MOST_DECIMALS = 17
"""Decimals with which different numbers of about 1 differ."""


def number(word: str) -> float:
    """The number that a word is; it may be infinite or NaN.

    ValueError where it is none: `1_0` too, which is ten in Python only.
    """
    try:
        if "_" not in word:
            return float(word)
    except ValueError:
        pass
    raise ValueError(f"{shortened(word, 40)!r} is no number")


def whole_number(word: str) -> int:
    """The whole number that a word is; ValueError where it is none, or has too many digits."""
    if word.removeprefix("-").removeprefix("+").isdigit() and len(word) <= MOST_DIGITS:
        return int(word)
    raise ValueError(f"{shortened(word, 40)!r} is no whole number")


def told_apart(value: float, bound: float, decimals: int = 0) -> tuple[str, str]:
    """The texts of a value and of its bound with `decimals` decimals, or as many more as it takes to show that they
    differ."""
    while decimals < MOST_DECIMALS and value != bound and f"{value:.{decimals}f}" == f"{bound:.{decimals}f}":
        decimals += 1
    return f"{value:.{decimals}f}", f"{bound:.{decimals}f}"
