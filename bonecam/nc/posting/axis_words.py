"""The words of the axes in a block: their numbers as the control reads them, and their form."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.schema.dialect_file import PLAIN_WORD
from bonecam.nc.tool_vectors import vector_formats, written_vectors
from bonecam.nc.words import wrapped


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
