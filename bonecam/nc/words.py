"""Angles and texts as words of a program take them.

The words of the axes in a block: their numbers as the control reads them, and their form.

The numbers of the blocks of a program.

The comments CUT and LINK of a program: they stand where feed moves begin to cut, or to lead from one pass to
another, so that the text tells which moves are meant to remove material; and those of rewinds.

The tolerances that a program gives the control, level by level.

The contour tolerance of a finishing level is a multiple of the path's chord tolerance (the dialect's
`tolerance_factor`; a control smooths best between 1.1 and 2 of it: Heidenhain, iTNC 530 cycle programming, section
12.5 on cycle 32), that of a roughing level ROUGHING_TOLERANCE.

The rotary tolerance: with tool-centre control the programmed tip stays while the rotary axes deviate, and the
centre of the ball, R above it, swings by R sin(TA). So TA is at most asin(T / R), T being the chord tolerance
(finishing) or the roughing tolerance.
"""

import math
import re
import textwrap
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.program import vector_formats, written_vectors
from bonecam.nc.schema import PLAIN_WORD, block_numbers, has_number
from bonecam.text.numbers import shortened
from bonecam.tool.path import MoveKind

NUMBER = 12
"""Characters that a comment's line keeps free for its number."""
LEGIBLE, HEAD_NUMBER = 80, 6
"""Characters of a line of the header, of these so many for its number: it is read on the screen of a control."""


def wrapped(angles_deg: Float[ndarray, "*n"], lowest: float = -180.0) -> Float[ndarray, "*n"]:
    """Angles brought into [lowest, lowest + 360)."""
    turned = (np.asarray(angles_deg) - lowest) % 360.0 + lowest
    # an angle less than a rounding below the lowest comes out as a whole turn above it
    return np.where(turned >= lowest + 360.0, lowest, turned)


def plain_text(text: str, characters: str) -> str:
    """`text` in capitals, with a blank for every character that the control's comments cannot have; of these the + of a
    direction such as X+, which would be lost beside X-, becomes PLUS, % PERCENT, and brackets commas."""
    if "%" not in characters:
        text = re.sub(r" ?%", " percent", text)
    if "(" not in characters and "," in characters:
        text = re.sub(r" ?\((.*?)\)(?=(.?))", lambda match: f", {match[1]}{',' if match[2] == ' ' else ''}", text)
    if "+" not in characters:
        text = re.sub(r"(?<=[XYZ])\+", " PLUS", text)
    return "".join(letter if letter in characters else " " for letter in text.upper()).strip()


def comment(text: str, dialect: Dialect) -> str:
    """A comment in the form and the characters of the dialect, cut where its control loads no longer line."""
    plain = plain_text(text, dialect.comment_characters)
    return dialect.comment.format(text=shortened(plain, _room(dialect)))


def comments_of(text: str, dialect: Dialect) -> list[str]:
    """A text in as many comments as it takes for no line to be longer than LEGIBLE, or than the control loads."""
    plain = plain_text(text, dialect.comment_characters)
    legible = LEGIBLE - len(dialect.comment.format(text="")) - HEAD_NUMBER
    pieces = textwrap.wrap(plain, min(_room(dialect), legible), break_on_hyphens=False)
    return [dialect.comment.format(text=piece) for piece in pieces]


def _room(dialect: Dialect) -> int:
    """Characters of a comment's text."""
    return dialect.longest_line - len(dialect.comment.format(text="")) - NUMBER


def written_words(machine: Machine, dialect: Dialect, words: Float[ndarray, "n 5"]) -> Float[ndarray, "n m"]:
    """Words (mm, deg) as the numbers of the text, of the m axes that have letters: endless axes wrapped where the
    dialect does, no negative zero. ProgramError where one leaves the control's range."""
    length, angle = dialect.numbers.length, dialect.numbers.angle
    written = words.copy()
    if dialect.endless_words == "wrapped":
        lowest = dialect.endless_from_deg
        for column, axis in enumerate(machine.rotary, start=3):
            if axis.endless:
                # wrapped twice: what is less than half a decimal below the end is rounded to it
                turned = angle.rounded(wrapped(words[:, column], lowest))
                written[:, column] = wrapped(turned, lowest)
    length.check(written[:, :3])
    angle.check(written[:, 3:])
    # whole steps and no negative zero
    return written[:, : len(machine.letters)] + 0.0


def word_formats(machine: Machine, dialect: Dialect) -> list[str]:
    """The printf format of the word of each axis that has a letter."""
    length, angle = dialect.numbers.length.spec, dialect.numbers.angle.spec
    endless = {axis.letter for axis in machine.rotary if axis.endless}
    formats = []
    for column, letter in enumerate(machine.letters):
        form = dialect.word_of_endless if letter in endless else PLAIN_WORD
        number = length if column < 3 else angle
        formats.append(form.replace("%", "%%").format(letter=letter, number=number))
    return formats


class MoveWords(NamedTuple):
    """The printf formats of the words of successive moves, and their numbers."""

    formats: list[str]
    numbers: Float[ndarray, "n m"]


def move_words(
    machine: Machine, dialect: Dialect, words: Float[ndarray, "n 5"]
) -> tuple[MoveWords, Bool[ndarray, "n"]]:
    """The words of successive moves as the dialect writes them, those of the axes, or X, Y, Z and the tool's direction;
    and which moves need those of the axes all the same."""
    if dialect.vector is None:
        return axis_moves(machine, dialect, words), np.zeros(len(words), dtype=bool)
    dialect.numbers.length.check(words[:, :3])
    numbers, off = written_vectors(machine, dialect.vector, words)
    return MoveWords(vector_formats(dialect, dialect.vector), numbers), off


def axis_moves(machine: Machine, dialect: Dialect, words: Float[ndarray, "n 5"]) -> MoveWords:
    """The words of the axes of successive moves."""
    return MoveWords(word_formats(machine, dialect), written_words(machine, dialect, words))


def word_texts(machine: Machine, dialect: Dialect, words: Float[ndarray, "5"]) -> list[str]:
    """The words of one position (mm, deg)."""
    row = written_words(machine, dialect, words[None])[0].tolist()
    return [form % value for form, value in zip(word_formats(machine, dialect), row, strict=True)]


def number_blocks(lines: list[str], dialect: Dialect) -> tuple[str, int]:
    """The text with block numbers where the dialect has them, and the number of blocks."""
    numbering = dialect.numbering
    mark = numbering.continuation
    before = zip(["", *lines], lines, strict=False)
    continued = [mark is not None and line.endswith(mark) for line, _ in before]
    pairs = zip(lines, continued, strict=True)
    numbered = [not behind and has_number(line, numbering) for line, behind in pairs]
    numbers = iter(block_numbers(numbering, np.arange(sum(numbered))).tolist())
    form = str(numbering.format)
    texts = [
        form.format(number=next(numbers), text=line) if counts else line
        for line, counts in zip(lines, numbered, strict=True)
    ]
    return "\n".join(texts) + "\n", len(lines) - sum(continued)


LIFTED = "LIFTED TO REWIND"
"""The comment of the way to the safe point and back, on which rotary axes are rewound."""
REWIND = "REWIND"
"""The comment of a retract for the rotary axes to be rewound."""


def with_marks(
    lines: Sequence[str],
    kinds: Int[ndarray, "n"],
    rapid: Bool[ndarray, "n"],
    lifted: Int[ndarray, " k"],
    dialect: Dialect,
) -> list[str]:
    """The blocks of one run with the comments before them; `kinds` are those of the path, `rapid` the moves that
    are written as rapids, `lifted` the moves that begin a lift."""
    states = np.where(rapid, MoveKind.RAPID, np.where(kinds == MoveKind.CUT, MoveKind.CUT, MoveKind.LINK))
    begins = np.flatnonzero((np.diff(states, prepend=MoveKind.RAPID) != 0) & ~rapid)
    marks = [(row, MoveKind(states[row]).name) for row in begins.tolist()]
    marks += [(row, LIFTED) for row in lifted.tolist()]
    marked = list(lines)
    # from the last row on, so that the rows before keep their places
    for row, name in sorted(marks, reverse=True):
        marked.insert(row, comment(name, dialect))
    return marked


ROUGHING_TOLERANCE = 0.02
"""How far the control may leave the path while roughing, mm: five times the usual chord tolerance of the path, and a
fifth of the usual finishing depth."""


def contour_tolerance(dialect: Dialect, job: Job, finishing: bool) -> float:
    """How far the control may leave the programmed points, mm."""
    fine = dialect.tolerance_factor * job.path.chord_tolerance
    return fine if finishing else max(ROUGHING_TOLERANCE, fine)


def rotary_tolerance_deg(dialect: Dialect, job: Job, finishing: bool, radius: float) -> float:
    """How far the rotary axes may leave their words, degrees, for a ball of `radius` mm; rounded down, but at least
    one last decimal of an angle."""
    allowed = job.path.chord_tolerance if finishing else max(ROUGHING_TOLERANCE, job.path.chord_tolerance)
    step = dialect.numbers.angle.step
    angle = math.degrees(math.asin(min(allowed / radius, 1.0)))
    return max(math.floor(angle / step + 1e-9) * step, step)
