"""Where the program's zero is, in the words that a control reads."""

from typing import NamedTuple

from jaxtyping import Float
from numpy import ndarray

from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect


class ZeroWords(NamedTuple):
    """X, Y and Z of the tip (mm, as texts) that stands on the program's zero, all rotary axes at zero."""

    x: str
    y: str
    z: str

    @property
    def over(self) -> str:
        """The place over the zero, as the texts of the setup tell it."""
        return f"{_word('X', self.x)} {_word('Y', self.y)}"

    @property
    def height(self) -> str:
        """The height of the zero, as the texts of the setup tell it."""
        return _word("Z", self.z)


def zero_words(machine: Machine, dialect: Dialect) -> ZeroWords:
    """0 0 0 under tool-centre control, whose datum is the program's zero; in machine coordinates `part_zero`."""
    if dialect.tool_centre:
        return ZeroWords("0", "0", "0")
    decimals = dialect.numbers.length.decimals
    x, y, z = (f"{round(value, decimals) + 0.0:.12g}" for value in machine.part_zero)
    return ZeroWords(x, y, z)


def over_zero(machine: Machine, dialect: Dialect, start: Float[ndarray, "3"]) -> str:
    """The words of X and Y where tools `start` (X, Y and Z of the tip in the machine's frame, mm)."""
    x, y, _ = start - machine.part_zero if dialect.tool_centre else start
    length = dialect.numbers.length
    return f"X{length.text(float(x))} Y{length.text(float(y))}"


def zero_texts(machine: Machine, dialect: Dialect) -> list[str]:
    """What X 0 Y 0 Z 0 is where words are machine coordinates, which do not turn with the part."""
    if dialect.tool_centre:
        return []
    zero = zero_words(machine, dialect)
    if zero == ZeroWords("0", "0", "0"):
        return ["X 0 Y 0 Z 0: program zero with all rotary axes at 0, the words do not turn with the part"]
    return [
        "X 0 Y 0 Z 0: zero of the machine file, not on the part, which stands as told at rotary axes 0",
        "Z of stock, post and clamping: heights over program zero",
    ]


def _word(letter: str, number: str) -> str:
    """A letter and its number, apart where that is zero."""
    return f"{letter} 0" if number == "0" else f"{letter}{number}"
