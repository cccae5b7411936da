"""The axes of a machine."""

import math
from dataclasses import dataclass

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class LinearAxis:
    """One of X, Y, Z: limits of the spindle nose in mm (infinite where unknown), travel in mm, speed in mm/min,
    acceleration in mm/min^2 and jerk in mm/min^3, infinite where they are not known."""

    letter: str
    limits: tuple[float, float]
    travel: float
    speed: float
    acceleration: float = math.inf
    jerk: float = math.inf


@dataclass(frozen=True)
class RotaryAxis:
    """A rotary axis; `direction` already carries the sign: a positive angle turns what it carries
    right-handed about it.

    Limits in radians, speed in rad/min; acceleration in rad/min^2 and jerk in rad/min^3, infinite where not known.
    `endless`: the axis may wind; its limits, if any, bound the winding. One without a letter stands for the second axis
    of a machine that has one: it has no words.
    """

    letter: str
    direction: Vector
    pivot: Vector
    limits: tuple[float, float]
    endless: bool
    speed: float
    acceleration: float = math.inf
    jerk: float = math.inf

    @property
    def bounded(self) -> bool:
        """Whether it has limits."""
        return math.isfinite(self.limits[0])

    @property
    def locked(self) -> bool:
        """Whether it stands at one angle."""
        return bool(self.limits[0] == self.limits[1])

    @property
    def has_choice(self) -> bool:
        """Whether its limits are a turn or more apart: it can stand in some direction in more than one turn."""
        return bool(self.bounded and self.limits[1] - self.limits[0] >= 2 * math.pi * (1 - 1e-9))
