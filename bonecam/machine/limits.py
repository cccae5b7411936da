"""What planning must know of a machine: the limits of its tool axis, the speeds of its rotary axes, and its bodies.

The polar angle of a tool axis is its angle from +Z."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.errors import MachineError
from bonecam.machine.bodies import MachineBodies

ANGLE_ROUNDING = 1e-9
"""Angles this little (radians) beyond a limit are on it."""


LiftPlaces = Callable[[ndarray, ndarray, ndarray], tuple[Float[ndarray, " k"], Float[ndarray, "k 3"]]]
"""The places from which a path must be lifted so that its rotary axes can be rewound, and the unit axes there, from its
axes (n, 3), the kinds of its moves (n,) and places that cannot be left. Place i + f is at f of the way from row i to
the next: f is 0 but between two cuts, to whose place the tool comes back."""


@dataclass(frozen=True)
class ReachedAxes:
    """The tool axes of a machine that are no band of polar angles: `contains` tells of unit axes (n, 3) whether each is
    one of them, `nearest` brings each to one near it, and `samples` (k, 3) are some of them all over, read-only."""

    contains: Callable[[ndarray], Bool[ndarray, " n"]]
    nearest: Callable[[ndarray], Float[ndarray, "n 3"]]
    samples: Float[ndarray, "k 3"] = field(compare=False)


@dataclass(frozen=True)
class MachineLimits:
    """Smallest and largest polar angle of the tool axis, radians (B -115..30 with an endless C: 0 .. 115
    degrees), and how fast the machine changes its polar angle and azimuth, rad/min. A machine of four axes that turns
    the part about its own Z has one polar angle. Where the machine does not reach these angles all round, `reached` are
    its tool axes. `lift_places` tells where the machine's rotary axes come to their limits within a path; None:
    nowhere. The tool is kept clear of the `bodies`. MachineError where the angles do not lie in order within
    0 .. 180 degrees."""

    largest: float
    smallest: float = 0.0
    tilt_speed: float = math.inf
    turn_speed: float = math.inf
    lift_places: LiftPlaces | None = None
    bodies: MachineBodies = field(default_factory=MachineBodies)
    reached: ReachedAxes | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.smallest <= self.largest <= np.pi:
            given = f"{np.degrees(self.smallest):g} .. {np.degrees(self.largest):g} deg"
            raise MachineError(f"tool axis limits {given}: keep 0 <= smallest <= largest <= 180")

    @property
    def narrow(self) -> bool:
        """Whether an axis between two that are within the limits may be beyond them: it is then brought to them."""
        return self.reached is not None or bool(self.smallest == self.largest)

    def allow(self, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether each unit axis lies within the limits."""
        angle = polar_angles(axes)
        within = (angle <= self.largest + ANGLE_ROUNDING) & (angle >= self.smallest - ANGLE_ROUNDING)
        return within if self.reached is None else within & self.reached.contains(axes)

    def nearest(self, axes: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """The unit axes, those beyond the limits brought to them."""
        angle = polar_angles(axes)
        bounded = np.clip(angle, self.smallest, self.largest)
        kept = np.where((bounded == angle)[:, None], axes, with_polar_angles(axes, bounded))
        return kept if self.reached is None else self.reached.nearest(kept)

    def turning_minutes(self, axes: Float[ndarray, "n 3"]) -> Float[ndarray, " m"]:
        """Minutes that the slower rotary axis needs from each tool axis to the next; accelerations are left out."""
        turn, tilt = np.abs(rotary_turns(axes)).T
        return np.maximum(turn / self.turn_speed, tilt / self.tilt_speed)


def polar_angles(axes: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Angle from +Z of unit axes, radians."""
    return np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2])


def rotary_turns(axes: Float[ndarray, "n 3"]) -> Float[ndarray, "m 2"]:
    """Turn of the azimuth and of the polar angle from each tool axis to the next, radians."""
    azimuth = np.angle(np.exp(1j * np.diff(np.arctan2(axes[:, 1], axes[:, 0]))))
    return np.column_stack([azimuth, np.diff(polar_angles(axes))])


def with_polar_angles(axes: Float[ndarray, "n 3"], angles: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """Unit axes of the given polar angles (radians) that keep their azimuth; an upright axis takes azimuth
    0."""
    horizontal = np.hypot(axes[:, 0], axes[:, 1])
    upright = horizontal <= np.finfo(float).eps
    x = np.where(upright, 1.0, axes[:, 0])
    y = np.where(upright, 0.0, axes[:, 1])
    length = np.where(upright, 1.0, horizontal)
    return np.column_stack([np.sin(angles) * x / length, np.sin(angles) * y / length, np.cos(angles)])
