"""Reading many plain moves at once: blocks with all five words, one after the other, as arrays.

Only what is beyond doubt is read here; whatever differs in anything is left to the reader of single blocks,
which says what is wrong.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.nc.dialect import Dialect

MOST_LINES = 50_000
ISO_NUMBER = r"[+-]?\d+(?:\.\d+)?"


@dataclass(frozen=True, eq=False)
class Blocks:
    """`words` (n, 5) in mm and degrees as written; `feeds` NaN where `rapid`; `numbers` of the blocks, -1
    where there are none."""

    words: Float[ndarray, "n 5"]
    rapid: Bool[ndarray, "n"]
    feeds: Float[ndarray, "n"]
    numbers: Int[ndarray, "n"]

    def first(self, count: int) -> "Blocks":
        """The first few of them."""
        return Blocks(self.words[:count], self.rapid[:count], self.feeds[:count], self.numbers[:count])


def klartext_number(decimals: int) -> str:
    """The pattern of a number as it must be written: sign, digits, all decimals."""
    return rf"[+-]\d+\.\d{{{decimals}}}"


def full_move(dialect: Dialect, letters: str) -> re.Pattern[str]:
    """The pattern of a whole line with all five words: block number or G code, the words, the feed."""
    if dialect.grammar == "klartext":
        length, angle = (klartext_number(dialect.numbers[key].decimals) for key in ("length", "angle"))
        words = "".join(f" {letter}({length if letter in 'XYZ' else angle})" for letter in letters)
        return re.compile(rf"(\d+) L{words} R0 F(MAX|\d+)")
    codes = "|".join(re.escape(code) for code, effect in dialect.codes.items() if effect in ("rapid", "feed"))
    words = "".join(f" {letter}({ISO_NUMBER})" for letter in letters)
    return re.compile(rf"({codes}){words}(?: F({ISO_NUMBER}))?")


def read_full_moves(
    lines: Sequence[str], start: int, pattern: re.Pattern[str], dialect: Dialect
) -> Blocks | None:
    """The full moves from line `start` on, up to the first line that is none; None where that is the
    first."""
    found: list[str] = []
    for line in islice(lines, start, start + MOST_LINES):
        matched = pattern.fullmatch(line)
        if matched is None:
            break
        found.extend(matched.groups())
    if not found:
        return None
    first, *words, feed = (found[k :: pattern.groups] for k in range(pattern.groups))
    if dialect.grammar == "klartext":
        rapid, numbers = np.array([value == "MAX" for value in feed]), np.array(first, dtype=np.int64)
        feeds = np.array(["nan" if value == "MAX" else value for value in feed], dtype=np.float64)
    else:
        rapid, numbers = np.array([dialect.codes[code] == "rapid" for code in first]), np.full(len(first), -1)
        feeds = np.where(rapid, np.nan, np.array([value or "0" for value in feed], dtype=np.float64))
    return Blocks(
        np.column_stack([np.array(column, dtype=np.float64) for column in words]), rapid, feeds, numbers
    )


def unwound(before: float, words: Float[ndarray, "n"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n"]]:
    """Where wrapped words send an endless axis that comes from `before` the short way, and the turn of each;
    degrees."""
    turns = (np.diff(words, prepend=before) + 180.0) % 360.0 - 180.0
    # whole turns are added to the words, so that no rounding builds up
    return words + 360.0 * np.round((before + np.cumsum(turns) - words) / 360.0), turns
