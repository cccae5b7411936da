"""What a machine allows a tool axis to do, as a plain record: its polar angle from +Z."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.errors import MachineError


@dataclass(frozen=True)
class AxisLimits:
    """Smallest and largest angle of the axis from +Z, radians (B -115..30 with an endless C: 0 .. 115
    degrees)."""

    largest: float
    smallest: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.smallest < self.largest <= np.pi:
            raise MachineError(
                f"tool axis limits {np.degrees(self.smallest):g} .. {np.degrees(self.largest):g} deg: keep 0 <= smallest < largest <= 180"
            )

    def allow(self, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether each unit axis lies within the limits (rounding let through)."""
        angle = polar(axes)
        return (angle <= self.largest + 1e-9) & (angle >= self.smallest - 1e-9)


def polar(axes: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Angle from +Z of unit axes, radians."""
    return np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2])


def with_polar(axes: Float[ndarray, "n 3"], angle: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """The same azimuths with the given angles from +Z; an upright axis takes azimuth 0."""
    level = np.hypot(axes[:, 0], axes[:, 1])
    flat = level <= np.finfo(float).eps
    x, y = np.where(flat, 1.0, axes[:, 0]), np.where(flat, 0.0, axes[:, 1])
    level = np.where(flat, 1.0, level)
    return np.column_stack([np.sin(angle) * x / level, np.sin(angle) * y / level, np.cos(angle)])


def angles_between(a: Float[ndarray, "n 3"], b: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Angles between unit vectors, radians, exact for small ones."""
    return 2 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))


def unit(vectors: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """The vectors at length one."""
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
