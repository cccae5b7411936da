"""Words of endless axes: which way the control turns by them, and the angle that it reaches."""

import numpy as np
from numpy import ndarray

from bonecam.machine.axes import RotaryAxis
from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.full_moves import unwound
from bonecam.nc.reading.line_error import line_error

AMBIGUOUS_TURN_DEG = 179.0
"""A word that turns an endless axis by more than this in one block is refused: by half a turn, either way is
short, and an axis that is wound goes the wrong way round."""


class EndlessAxes:
    """How a control reads the words of endless axes. `short_way`: they turn the short way, or as their words say; None
    before the program has said which."""

    def __init__(self, dialect: Dialect) -> None:
        self.dialect = dialect
        self.bounded_turns = dialect.chooses_way or dialect.endless_words == "wrapped"
        self.short_way: bool | None = None if dialect.chooses_way else dialect.endless_words == "wrapped"

    def are_wrapped(self, words: ndarray) -> ndarray:
        """Whether words (degrees) are among those that the dialect's form of the short way takes."""
        if not self.dialect.has_own_form:
            return np.ones(np.shape(words), dtype=bool)
        lowest = self.dialect.endless_from_deg
        return np.asarray((words >= lowest) & (words < lowest + 360.0))

    def reached(
        self, axis: RotaryAxis, word: float, before: float | None, *, moves_tip: bool, line: int
    ) -> float:
        """The angle (degrees) that an endless axis reaches by its word from `before` (None: not known). ProgramError
        where the way is not known; where the tip moves with it, a turn of half a turn too."""
        if self.short_way is None:
            raise line_error(line, f"{axis.letter} turns before the short way is switched on or off")
        if self.short_way and not self.are_wrapped(np.array(word)):
            lowest = self.dialect.endless_from_deg
            why = f"{axis.letter} {word:g}: give {lowest:g} or more, below {lowest + 360:g}"
            raise line_error(line, why)
        if before is None:
            return word
        turn = word - before
        if self.short_way:
            turn = (turn + 180.0) % 360.0 - 180.0
        if self.bounded_turns and abs(turn) > AMBIGUOUS_TURN_DEG and moves_tip:
            why = "either way is possible" if self.short_way else "half a turn is allowed"
            raise line_error(line, f"{axis.letter} turns by {turn:.3f} deg in one block: {why}")
        # whole turns are added to the word, so that no rounding builds up over many turns
        return word + 360.0 * round((before + turn - word) / 360.0)

    def reached_in_turn(self, words: ndarray, before: float) -> tuple[ndarray, ndarray]:
        """The angles (degrees) that successive words of one endless axis reach from `before`, and whether each is
        doubtful: `reached` says what is wrong with it."""
        if self.short_way is None:
            return words, np.ones(len(words), dtype=bool)
        doubtful = np.zeros(len(words), dtype=bool)
        turns = np.diff(words, prepend=before)
        if self.short_way:
            doubtful = ~self.are_wrapped(words)
            words, turns = unwound(before, words)
        return words, doubtful | (self.bounded_turns & (np.abs(turns) > AMBIGUOUS_TURN_DEG))
