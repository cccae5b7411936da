"""Templates as data: texts with named fields, `{feed}` or `{tool:03d}`, and nothing else of Python's format language.

No attributes or items of a field, no conversions, no fields inside fields, widths of at most two digits: a
template of a stranger reaches nothing but its fields, and what it makes is not much longer than they are.
"""

import re
import string
from collections.abc import Mapping

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
