"""What planning must know of a machine: the limits of its tool axis, the speeds of its rotary axes, and its bodies.

A machine's tool axes are a band of polar angles (from +Z) all round the part, or a curve or a region.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import frozen, lengths, runs_of
from bonecam.errors import MachineError
from bonecam.machine.bodies import MachineBodies
from bonecam.machine.kinematics import inverse_rotary, tool_axes, within_limits
from bonecam.machine.machine import Machine
from bonecam.machine.machine_file import RotaryAxis

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
    degrees), how fast the machine changes its polar angle and azimuth, rad/min, and how fast it speeds these up,
    rad/min^2. A machine of four axes that turns the part about its own Z has one polar angle. Where the machine does
    not reach these angles all round, `reached` are its tool axes. `lift_places` tells where the machine's rotary axes
    come to their limits within a path; None: nowhere. The tool is kept clear of the `bodies`. MachineError where the
    angles do not lie in order within 0 .. 180 degrees."""

    largest: float
    smallest: float = 0.0
    tilt_speed: float = math.inf
    turn_speed: float = math.inf
    tilt_acceleration: float = math.inf
    turn_acceleration: float = math.inf
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


AXIS_MARGIN = np.radians(1.0)
"""Kept from the machine's tilt limit, radians: a turn of up to 30 degrees between two axes at the limit
bulges past it by less."""
STEP = np.radians(2.0)
"""Between the joints at which the tool axes of a machine are sampled, radians."""
ON_CURVE = 1e-7
"""A unit axis this near to one that a machine has is that."""
ROUND = 360
"""Sides of a stock that are tried."""
EVEN = 1e-9
"""Polar angles that differ by less, radians, are one."""


def tilt_band(machine: Machine) -> tuple[float, float] | None:
    """The lowest and the highest angle (rad) from +Z of the widest band that the tool axis reaches in every direction
    round the part; None where there is no such angle."""
    free = [axis for axis in machine.rotary if not axis.locked]
    if len(free) < 2:  # one angle, where the only free axis turns the part about its Z, all the way round
        if not free or (free[0].bounded and not free[0].has_choice):
            return None
        samples = _sampled(machine)
        angles = polar_angles(samples)
        if np.ptp(angles) > EVEN or np.ptp(samples, axis=0).max() < ON_CURVE:
            return None
        return float(angles.mean()), float(angles.mean())
    azimuths = np.linspace(0, 2 * np.pi, 73)[:-1]
    tilts = np.radians(np.arange(0.0, 180.01, 0.25))
    tilt, azimuth = (grid.ravel() for grid in np.meshgrid(tilts, azimuths, indexing="ij"))
    axes = np.column_stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    solutions, _ = inverse_rotary(machine, axes)
    reached = within_limits(machine, solutions).any(1).reshape(len(tilts), -1).all(1)
    bands = runs_of(np.asarray(reached)) - [0, 1]
    if not len(bands):
        return None
    low, high = bands[np.argmax(np.diff(bands, axis=1))]
    return (float(tilts[low]), float(tilts[high])) if low < high else None


def _sampled(machine: Machine) -> Float[ndarray, "k 3"]:
    """Unit tool axes all over those that a machine has, about STEP apart in its joints."""
    joints = []
    for axis in machine.rotary:
        low, high = axis.limits
        if not axis.bounded or axis.has_choice:
            joints.append(np.arange(0.0, 2 * np.pi - STEP / 2, STEP))
        else:
            joints.append(np.linspace(low, high, 1 + int(np.ceil((high - low) / STEP))))
    return tool_axes(machine, np.stack(np.meshgrid(*joints, indexing="ij"), axis=-1).reshape(-1, 2))


def planned_band(machine: Machine) -> tuple[float, float] | None:
    """The band of `tilt_band` that paths may use, rad: AXIS_MARGIN within it; None where it is too narrow for that."""
    band = tilt_band(machine)
    if band is None or band[0] == band[1]:
        return band
    low, high = band[0] + AXIS_MARGIN if band[0] > 0 else 0.0, band[1] - AXIS_MARGIN
    return (low, high) if low < high else None


def reached_axes(machine: Machine) -> ReachedAxes:
    """The tool axes of a machine, its joints AXIS_MARGIN within their limits."""
    inner = replace(
        machine,
        part_axes=tuple(map(_within_margin, machine.part_axes)),
        tool_axes=tuple(map(_within_margin, machine.tool_axes)),
    )
    samples = _sampled(inner)
    if np.ptp(samples, axis=0).max() < ON_CURVE:
        what = f"{machine.name}: its tool has a single direction in the part"
        remedy = "give one of its rotary axes room, or correct direction: one along the spindle leans nothing"
        raise MachineError(f"{what}: {remedy}", machine=machine.name)
    tree = scipy.spatial.KDTree(samples)

    def brought(axes: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n 3"], Bool[ndarray, " n"]]:
        """Of each axis the one of the machine by its first solution within the limits, and whether there is one."""
        solutions, _ = inverse_rotary(inner, axes, lock_guard=np.pi)
        usable = within_limits(inner, solutions)
        first = solutions[np.arange(len(axes)), np.argmax(usable, axis=1)]
        some = np.asarray(usable.any(axis=1))
        return tool_axes(inner, np.where(some[:, None], first, 0.0)), some

    def contains(axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        own, reached = brought(axes)
        return reached & (lengths(own - axes) <= ON_CURVE)

    def nearest(axes: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        own, reached = brought(axes)
        near = samples[tree.query(axes)[1]]
        return np.where(reached[:, None], own, near)

    return ReachedAxes(contains, nearest, frozen(samples))


def farthest_side(axes: Float[ndarray, "k 3"]) -> float:
    """The largest angle (rad) of a level direction, which the side of a stock faces, from all of these unit axes."""
    azimuths = np.radians(np.arange(ROUND))
    sides = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.zeros(ROUND)])
    return float(np.arccos(np.clip((axes @ sides.T).max(axis=0), -1, 1)).max())


def _within_margin(axis: RotaryAxis) -> RotaryAxis:
    """The axis with limits AXIS_MARGIN narrower, or as wide as they are where there is no room for it."""
    low, high = axis.limits
    if axis.locked or high - low <= 2 * AXIS_MARGIN:
        return axis
    return replace(axis, limits=(low + AXIS_MARGIN, high - AXIS_MARGIN))
