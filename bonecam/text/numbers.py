"""Numbers in text files, as other programs write them."""

from bonecam.text.faults import shortened

MOST_DIGITS = 4000
"""Python reads whole numbers of 4300 digits at most: the time that takes grows with their square."""


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
