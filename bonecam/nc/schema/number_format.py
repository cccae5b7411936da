"""The numbers of NC words: fixed decimals, no exponent, no negative zero."""

import math
from typing import Annotated

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import Field, model_validator

from bonecam.errors import ProgramError
from bonecam.text.record import KeyFault, Record

LARGEST_NUMBER = 1e9
"""No number of a program is larger."""
Bound = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]


class NumberFormat(Record):
    """How numbers of a kind are written: decimals, whether a plus is written, and the range that the control takes."""

    decimals: Annotated[int, Field(ge=0, le=8)]
    sign: bool
    lowest: Bound = -math.inf
    highest: Bound = math.inf

    @model_validator(mode="after")
    def _has_a_range(self) -> "NumberFormat":
        if self.lowest >= self.highest:
            raise KeyFault("lowest", f"{self.lowest:g}: give less than highest ({self.highest:g})")
        return self

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
                f"{value:g} leaves the control's range {self.lowest:g} .. {self.highest:g}: change the job", value=value
            )

    def text(self, value: float) -> str:
        """One number; ProgramError outside the control's range."""
        self.check(np.array([value], dtype=np.float64))
        # whole steps divided have no negative zero
        return self.spec % float(self.rounded(np.array([value], dtype=np.float64))[0])


class NumbersTable(Record):
    """The kinds of numbers: lengths (mm), angles (deg), feeds and spindle speeds."""

    length: NumberFormat
    angle: NumberFormat
    feed: NumberFormat
    spindle: NumberFormat
