"""What is wrong in a text, by its keys: all of it, in one line.

Numbers in text files, as other programs write them, and in messages.

Templates as data: texts with named fields, `{feed}` or `{tool:03d}`, and nothing else of Python's format language.

No attributes or items of a field, no conversions, no fields inside fields, widths of at most two digits: a
template of a stranger reaches nothing but its fields, and what it makes is not much longer than they are.
"""

import re
import string
from collections.abc import Iterable, Mapping, Sequence

MOST_CHARACTERS = 800
"""Characters of a message after which it tells only the number of further faults."""


class Faults(ValueError):
    """What is wrong in a text: (key, what and remedy) of each place; the key is empty where it is the whole."""

    def __init__(self, found: Sequence[tuple[str, str]]) -> None:
        self.found = tuple(found)
        texts: list[str] = []
        for key, why in self.found:
            text = f"{shortened(key, 200)}: {why}" if key else why
            if texts and len("; ".join([*texts, text])) > MOST_CHARACTERS:
                break
            texts.append(shortened(text, MOST_CHARACTERS))
        more = len(self.found) - len(texts)
        super().__init__("; ".join([*texts, f"and {more} more"] if more else texts))


def shown(value: object) -> str:
    """A value as messages show it: one short line, however long or deep the value is."""
    if isinstance(value, dict | list | tuple) and value:
        return "a table" if isinstance(value, dict) else f"a list of {len(value)}"
    if isinstance(value, int) and value.bit_length() > 64:
        return f"a number of {value.bit_length()} bits"
    text = repr(value)
    return shortened(text if isinstance(value, str) else " ".join(text.split()), 40)


def in_one_line(text: str) -> str:
    """A text for a terminal: in one line, with control characters, which it would obey, written as Python does."""
    line = " ".join(text.splitlines())
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in line)


def shortened(text: str, length: int) -> str:
    """A text cut to a length, with dots where it was cut."""
    return text if len(text) <= length else f"{text[: length - 3]}..."


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


LARGEST = 4000
"""Most characters of a template: the longest of ours has 250."""
FORM = re.compile(r"[<>^]?0?\d{0,2}d?", re.ASCII)
"""The formats of a field: alignment, zeros in front, width, whole number."""


def check_template(text: str, fields: Mapping[str, str | int]) -> str:
    """The template itself; ValueError where it has other than the named `fields`, of which samples are given."""
    check_printable(text)
    try:
        parts = list(string.Formatter().parse(text))
    except ValueError as error:
        raise ValueError(f"{error}: write a brace twice where none of a field is meant") from error
    for _, name, form, conversion in parts:
        if name is None:
            continue
        if name not in fields:
            known = f"use one of {', '.join(sorted(fields))}" if fields else "there are none here"
            raise ValueError(f"field {name[:40]!r} is unknown: {known}")
        if conversion:
            raise ValueError(f"field {name!r} has the conversion '!{conversion[:40]}': leave it out")
        if not FORM.fullmatch(form or ""):
            what = f"field {name!r} has the format {f':{form}'[:40]!r}"
            raise ValueError(f"{what}: give a width of two digits at most, like ':03d', or none")
    try:
        text.format(**fields)
    except ValueError as error:
        raise ValueError(f"{error}: give the field without that format") from error
    return text


def check_printable(text: str) -> str:
    """The text itself; ValueError where it is long, or has other than printable characters and line ends."""
    if len(text) > LARGEST:
        raise ValueError(f"has {len(text)} characters: give at most {LARGEST}")
    for line in text.split("\n"):
        if not line.isprintable():
            odd = next(letter for letter in line if not letter.isprintable())
            raise ValueError(f"has the character {odd!r}: give printable ones only")
    return text


def number_words(values: Iterable[float]) -> str:
    """Numbers in the shortest decimals that read back as the same doubles."""
    return " ".join(repr(float(value)) for value in values)
