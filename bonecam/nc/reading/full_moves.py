"""Full moves: successive blocks that have all five words, read at once as arrays.

The comments that tell links from cuts may stand between them. Blocks of any other form are left to the readers of
single blocks (`klartext.py`, `iso.py`), which say what is wrong.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from itertools import islice

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.schema.dialect_file import VectorTable
from bonecam.nc.schema.number_format import NumbersTable
from bonecam.nc.schema.numbering import WHOLE, block_number, has_number, numbered_pattern
from bonecam.nc.tool_vectors import vector_patterns

MAX_LINES = 50_000
"""Lines read at once: bounds the memory for long programs."""
ISO_NUMBER = rf"[+-]?{WHOLE}(?:\.[0-9]{{0,9}})?"
"""The pattern of a number of a word, as ISO 6983 writes it."""
POINTED_NUMBER = rf"[+-]?{WHOLE}\.[0-9]{{0,9}}"
"""The pattern of a number that must have its decimal point."""
MARKS = {"CUT": False, "LINK": True}
"""Comments, and whether the feed moves after them are links."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """Successive full moves. `words` (n, 5) in mm and degrees as written; `feeds` are NaN where `rapid`, or none is
    known; `modal` is the last feed that was written.

    `offsets` (n,): how many lines each is behind the first one; `ordinals`: how many numbered blocks there are before
    it in the program; `links`: it stands behind a comment LINK. `numbers` are the block numbers, -1 where blocks have
    none.
    """

    words: Float[ndarray, "n 5"]
    rapid: Bool[ndarray, "n"]
    feeds: Float[ndarray, "n"]
    numbers: Int[ndarray, "n"]
    offsets: Int[ndarray, "n"]
    ordinals: Int[ndarray, "n"]
    links: Bool[ndarray, "n"]
    modal: Float[ndarray, "n"]

    def first(self, count: int) -> "Blocks":
        """The first `count` blocks."""
        return Blocks(*(getattr(self, column.name)[:count] for column in fields(self)))

    def outside(self, numbers: NumbersTable) -> Bool[ndarray, "n"]:
        """Which have a number that the control does not take, or no feed where they need one."""
        kinds = [numbers.length] * 3 + [numbers.angle] * 2
        lowest = [kind.lowest for kind in kinds]
        highest = [kind.highest for kind in kinds]
        fits = (self.feeds >= numbers.feed.lowest) & (self.feeds <= numbers.feed.highest) & (self.feeds > 0)
        within = (self.words >= lowest) & (self.words <= highest)
        return ~(self.rapid | fits) | ~within.all(axis=1)


def klartext_number(decimals: int) -> str:
    """The pattern of a number as it must be written: sign, digits, all decimals."""
    return rf"[+-]{WHOLE}\.[0-9]{{{decimals}}}"


def full_move(dialect: Dialect, machine: Machine, short_way: bool) -> re.Pattern[str]:
    """The pattern of a whole line with all five words: block number, G code, the words, any feed; the words of endless
    axes have the form of the dialect where they take the `short_way`."""
    letters = machine.letters
    if dialect.grammar == "klartext":
        if dialect.vector is not None:
            return re.compile(rf"({WHOLE}) {vector_move(dialect, dialect.vector)}")
        words = " ".join(axis_words(dialect, letters))
        return re.compile(rf"({WHOLE}) (L) {words}(?: R0)?(?: F(MAX|{WHOLE}))?")
    codes = "|".join(re.escape(code) for code, effect in dialect.effect_of.items() if effect in ("rapid", "feed"))
    endless = endless_letters(machine) if short_way else ""
    number = POINTED_NUMBER if dialect.decimal_point else ISO_NUMBER
    patterns = [
        endless_word_pattern(dialect, letter) if letter in endless else f"{letter}({number})" for letter in letters
    ]
    if dialect.vector is not None:
        patterns = patterns[:3] + vector_patterns(dialect.vector, number)
    words = "".join(f" {pattern}" for pattern in patterns)
    text = rf"({codes}){words}(?: F({number}))?"
    return re.compile(numbered_pattern(dialect.numbering, text))


def axis_words(dialect: Dialect, letters: str) -> list[str]:
    """The patterns of the words of an `L` block's axes, with their numbers in groups."""
    length, angle = (klartext_number(kind.decimals) for kind in (dialect.numbers.length, dialect.numbers.angle))
    return [f"{letter}({length if letter in 'XYZ' else angle})" for letter in letters]


def vector_move(dialect: Dialect, vector: VectorTable) -> str:
    """The pattern of an `LN` block, which has X, Y, Z and the tool's direction."""
    length, component = (klartext_number(kind.decimals) for kind in (dialect.numbers.length, vector.number))
    words = [f"{letter}({length})" for letter in "XYZ"] + vector_patterns(vector, component)
    return rf"(LN) {' '.join(words)}(?: R0)?(?: F(MAX|{WHOLE}))?"


def endless_letters(machine: Machine) -> str:
    """The letters of the axes that turn without end."""
    return "".join(axis.letter for axis in machine.rotary if axis.endless)


def endless_word_pattern(dialect: Dialect, letter: str) -> str:
    """The pattern of a word that turns an endless axis the short way: its `letter`, which is a pattern, and in a group
    its number."""
    before, _, rest = dialect.endless_word.partition("{letter}")
    between, _, behind = rest.partition("{number}")
    number = POINTED_NUMBER if dialect.decimal_point else ISO_NUMBER
    return f"{re.escape(before)}{letter}{re.escape(between)}({number}){re.escape(behind)}"


def read_full_moves(
    lines: Sequence[str],
    start: int,
    ordinal: int,
    pattern: re.Pattern[str],
    dialect: Dialect,
    linking: bool,
    feed: float | None,
    solve: Callable[[Float[ndarray, "n 3"]], Float[ndarray, "n 2"]],
) -> Blocks | None:
    """The full moves from line `start` on, up to the first line of another form; None where there is no full
    move.

    `ordinal` numbered blocks stand before them; the first moves are links where `linking`. `feed` holds until
    another is written, None: every block needs its own. `solve` gives the rotary angles (degrees) of tool vectors.
    """
    groups: list[str] = []
    offsets: list[int] = []
    ordinals: list[int] = []
    links: list[bool] = []
    for offset, line in enumerate(islice(lines, start, start + MAX_LINES)):
        matched = pattern.fullmatch(line)
        if matched is None:
            mark = _mark(line, ordinal, dialect)
            if mark is None:
                break
            linking = mark
            ordinal += has_number(line, dialect.numbering)
            continue
        groups.extend(matched.groups())
        offsets.append(offset)
        ordinals.append(ordinal)
        ordinal += 1
        links.append(linking)
    if not groups:
        return None
    number, code, *words, written = (groups[k :: pattern.groups] for k in range(pattern.groups))
    if dialect.grammar == "klartext":
        rapid = np.array([value == "MAX" for value in written])
    else:
        rapid = np.array([dialect.effect_of[value] == "rapid" for value in code])
    modal = _modal([None if value == "MAX" else value for value in written], feed)
    table = np.array(words, dtype=np.float64).T
    # zeros for the second rotary axis of a machine that has only one
    rotary = np.pad(table[:, 3:], ((0, 0), (0, 5 - len(words)))) if dialect.vector is None else solve(table[:, 3:])
    return Blocks(
        words=np.column_stack([table[:, :3], rotary]),
        rapid=rapid,
        feeds=np.where(rapid, np.nan, modal),
        numbers=np.array([value or "-1" for value in number], dtype=np.int64),
        offsets=np.array(offsets),
        ordinals=np.array(ordinals),
        links=np.array(links),
        modal=modal,
    )


def _modal(written: Sequence[str | None], feed: float | None) -> Float[ndarray, "n"]:
    """The feed that holds at each block: the last one that was `written`, or the `feed` before; None: its own alone."""
    own = np.array([value or "nan" for value in written], dtype=np.float64)
    if feed is None:
        return own
    given = ~np.isnan(own)
    feeds = np.r_[feed, own]
    last = np.maximum.accumulate(np.where(given, np.arange(1, len(given) + 1), 0))
    return np.asarray(feeds[last])


def _mark(line: str, ordinal: int, dialect: Dialect) -> bool | None:
    """Whether links begin after a line that is a mark, with its block number if it has one; None where it is none."""
    form = dialect.numbering.format
    for text, linking in MARKS.items():
        comment = dialect.comment.format(text=text)
        if form and has_number(comment, dialect.numbering):
            comment = form.format(number=block_number(dialect.numbering, ordinal), text=comment)
        if line == comment:
            return linking
    return None


def unwound(before: float, words: Float[ndarray, "n"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n"]]:
    """Angles that an endless axis reaches from `before` by wrapped words, and the turn of each; degrees.

    Every turn is the short way, less than half a turn.
    """
    turns = (np.diff(words, prepend=before) + 180.0) % 360.0 - 180.0
    # whole turns are added to the words, so that no rounding builds up
    return words + 360.0 * np.round((before + np.cumsum(turns) - words) / 360.0), turns
