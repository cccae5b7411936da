"""TOML texts, bounded: one of a few kilobytes can neither take all memory nor all time nor exhaust the stack."""

import re
import tomllib
from collections.abc import Mapping
from copy import deepcopy
from functools import lru_cache
from typing import Any

import tomli_w

from bonecam.text.numbers import Faults

LARGEST = 100_000
"""Most characters of a text: machines and jobs have below 10,000."""
LONGEST_LINE = 10_000
"""Most characters of a line: the time that tomllib takes for a dotted name is quadratic in its parts (0.3 s for
this)."""
DEEPEST = 10
"""Most tables and lists within one another; machines, dialects and jobs have three."""
BITS = 64
"""Whole numbers of TOML have this many bits with their sign (TOML 1.0, section Integer)."""

_SECTION = re.compile(r"\s*\[\s*(\w+)\s*\]")
_KEY = re.compile(r"\s*(?:(\w+)\s*\.\s*)?(\w+)\s*=")


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text. Raises Faults (a ValueError), with the line where the text is no TOML."""
    return deepcopy(_parsed(text))


@lru_cache(maxsize=20)
def _parsed(text: str) -> dict[str, Any]:
    """The tables of a text: those of machine and material are asked for thousands of times while cutters are chosen."""
    if len(text) > LARGEST:
        raise Faults([("", f"the text has {len(text)} characters: {LARGEST} are allowed")])
    for number, line in enumerate(text.split("\n"), 1):
        if len(line) > LONGEST_LINE:
            why = f"line {number} has {len(line)} characters: {LONGEST_LINE} are allowed"
            raise Faults([("", why)])
    try:
        values = tomllib.loads(text)
    except RecursionError as error:
        raise Faults([("", f"tables and lists nest deeper than {DEEPEST}")]) from error
    except ValueError as error:
        raise Faults([("", str(error))]) from error
    faults = []
    waiting: list[tuple[str, Any, int]] = [("", values, 0)]
    while waiting:
        key, value, depth = waiting.pop()
        if depth > DEEPEST:
            raise Faults([(key, f"tables and lists nest deeper than {DEEPEST}")])
        if isinstance(value, dict):
            waiting += [(f"{key}.{name}".lstrip("."), item, depth + 1) for name, item in value.items()]
        elif isinstance(value, list):
            waiting += [(f"{key}[{index}]", item, depth + 1) for index, item in enumerate(value)]
        elif isinstance(value, int) and value.bit_length() >= BITS:
            faults.append((key, f"a whole number of more than {BITS} bits: give a number that fits"))
    if faults:
        raise Faults(sorted(faults))
    return values


def lines_of_keys(text: str) -> dict[tuple[str, str], int]:
    """The line (from 1) on which each key of each section is written, and each section itself (its key is empty).

    Keys are (section, key); in unusual spellings, quoted or in a table within a line, they are not found.
    """
    line_of_key: dict[tuple[str, str], int] = {}
    section = ""
    for number, line in enumerate(text.split("\n"), 1):
        head = _SECTION.match(line)
        key = _KEY.match(line)
        if head:
            section = head[1]
            line_of_key.setdefault((section, ""), number)
        elif key:
            line_of_key.setdefault((key[1] or section, key[2]), number)
    return line_of_key


def toml_lines(values: Mapping[str, bool | int | float | str]) -> list[str]:
    """The lines `key = value` of a table of plain values."""
    return tomli_w.dumps(dict(values)).removesuffix("\n").split("\n")
