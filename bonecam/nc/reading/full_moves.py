"""Full moves: successive blocks that have all five words, read at once as arrays.

Blocks of any other form are left to the readers of single blocks (`klartext.py`, `iso.py`), which say what is
wrong.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.nc.dialect import Dialect

MAX_LINES = 50_000
"""Lines read at once: bounds the memory for long programs."""
WHOLE = "[0-9]{1,9}"
"""The pattern of a whole number; it fits 32 bits."""
ISO_NUMBER = rf"[+-]?{WHOLE}(?:\.[0-9]{{1,9}})?"
"""The pattern of a number of a word, as ISO 6983 writes it."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """Successive full moves. `words` (n, 5) in mm and degrees as written; `feeds` are NaN where `rapid`.

    `numbers` are the block numbers, -1 where blocks have none.
    """

    words: Float[ndarray, "n 5"]
    rapid: Bool[ndarray, "n"]
    feeds: Float[ndarray, "n"]
    numbers: Int[ndarray, "n"]

    def first(self, count: int) -> "Blocks":
        """The first `count` blocks."""
        return Blocks(self.words[:count], self.rapid[:count], self.feeds[:count], self.numbers[:count])


def klartext_number(decimals: int) -> str:
    """The pattern of a number as it must be written: sign, digits, all decimals."""
    return rf"[+-]{WHOLE}\.[0-9]{{{decimals}}}"


def full_move(dialect: Dialect, letters: str) -> re.Pattern[str]:
    """The pattern of a whole line with all five words: block number or G code, the words, the feed."""
    if dialect.grammar == "klartext":
        length, angle = (klartext_number(dialect.numbers[key].decimals) for key in ("length", "angle"))
        words = "".join(f" {letter}({length if letter in 'XYZ' else angle})" for letter in letters)
        return re.compile(rf"({WHOLE}) L{words} R0 F(MAX|{WHOLE})")
    codes = "|".join(re.escape(code) for code, effect in dialect.codes.items() if effect in ("rapid", "feed"))
    words = "".join(f" {letter}({ISO_NUMBER})" for letter in letters)
    return re.compile(rf"({codes}){words}(?: F({ISO_NUMBER}))?")


def read_full_moves(
    lines: Sequence[str], start: int, pattern: re.Pattern[str], dialect: Dialect
) -> Blocks | None:
    """The full moves from line `start` on, up to the first line of another form; None where there is no full
    move."""
    found: list[str] = []
    for line in islice(lines, start, start + MAX_LINES):
        matched = pattern.fullmatch(line)
        if matched is None:
            break
        found.extend(matched.groups())
    if not found:
        return None
    first, *words, feed = (found[k :: pattern.groups] for k in range(pattern.groups))
    if dialect.grammar == "klartext":
        rapid = np.array([value == "MAX" for value in feed])
        numbers = np.array(first, dtype=np.int64)
        feeds = np.array(["nan" if value == "MAX" else value for value in feed], dtype=np.float64)
    else:
        rapid = np.array([dialect.codes[code] == "rapid" for code in first])
        numbers = np.full(len(first), -1)
        feeds = np.where(rapid, np.nan, np.array([value or "0" for value in feed], dtype=np.float64))
    columns = [np.array(column, dtype=np.float64) for column in words]
    return Blocks(np.column_stack(columns), rapid, feeds, numbers)


def unwound(before: float, words: Float[ndarray, "n"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n"]]:
    """Angles that an endless axis reaches from `before` by wrapped words, and the turn of each; degrees.

    Every turn is the short way, less than half a turn.
    """
    turns = (np.diff(words, prepend=before) + 180.0) % 360.0 - 180.0
    # whole turns are added to the words, so that no rounding builds up
    return words + 360.0 * np.round((before + np.cumsum(turns) - words) / 360.0), turns
