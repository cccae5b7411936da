"""The numbers of NC words: fixed decimals, no exponent, no negative zero."""

import re
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.errors import ProgramError


@dataclass(frozen=True)
class NumberFormat:
    """The form of a kind of number: decimals, whether a plus is written, and the range that the control
    takes."""

    decimals: int
    sign: bool
    lowest: float = -np.inf
    highest: float = np.inf

    @property
    def step(self) -> float:
        """The value of one unit in the last decimal."""
        return 10.0**-self.decimals

    @property
    def spec(self) -> str:
        """The printf format of a number that is already rounded."""
        return f"%{'+' if self.sign else ''}.{self.decimals}f"

    def steps(self, values: Float[ndarray, "*n"]) -> Int[ndarray, "*n"]:
        """Values in units of the last decimal; ProgramError where one is not finite."""
        if not np.isfinite(values).all():
            raise ProgramError(
                f"word {int(np.argmin(np.isfinite(values)))} is not a finite number: the path before it is wrong"
            )
        return np.rint(np.asarray(values) * 10.0**self.decimals).astype(np.int64)

    def rounded(self, values: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
        """The values as the control will read them."""
        return np.asarray(self.steps(values) / 10.0**self.decimals)

    def rounded_down(self, values: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
        """The largest numbers of this kind that are no larger than the values, within the control's range: a feed that
        is rounded up may be beyond what an axis can."""
        whole = np.floor(np.asarray(values) / self.step + 1e-6) * self.step
        return self.rounded(np.clip(whole, self.lowest, self.highest))

    def check(self, values: Float[ndarray, "*n"]) -> None:
        """ProgramError where a value leaves the control's range."""
        outside = ~((values >= self.lowest) & (values <= self.highest))
        if outside.any():
            value = float(values[outside].flat[0])
            raise ProgramError(
                f"{value:g} leaves the control's range {self.lowest:g} .. {self.highest:g}: change the job",
                value=value,
            )

    def text(self, value: float) -> str:
        """One number; ProgramError outside the control's range."""
        self.check(np.array([value], dtype=np.float64))
        # whole steps divided have no negative zero
        return self.spec % float(self.rounded(np.array([value], dtype=np.float64))[0])


def wrapped(angles_deg: Float[ndarray, "*n"], lowest: float = -180.0) -> Float[ndarray, "*n"]:
    """Angles brought into [lowest, lowest + 360)."""
    turned = (np.asarray(angles_deg) - lowest) % 360.0 + lowest
    # an angle less than a rounding below the lowest comes out as a whole turn above it
    return np.where(turned >= lowest + 360.0, lowest, turned)


def plain_text(text: str, characters: str) -> str:
    """`text` in capitals, with a blank for every character that the control's comments cannot have; the + of a
    direction such as X+, which would be lost beside X-, becomes PLUS."""
    if "+" not in characters:
        text = re.sub(r"(?<=[XYZ])\+", " PLUS", text)
    return "".join(letter if letter in characters else " " for letter in text.upper()).strip()
