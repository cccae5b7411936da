"""Cutting profiles: ball, flat, bull (torus) and drum (barrel) as arcs of a half plane, revolved about the tool axis.

A place of the half plane is (r, h): its distance from the axis and its height above the tip, mm. On an arc of
radius a about (r0, h0) the outward normal at the angle phi from straight down is (sin phi, -cos phi), and the place
that has it is

    (r0 + a sin phi, h0 - a cos phi).

The profiles are convex, so that phi, which is the angle between the tool axis and the normal of the part, tells the
place that touches.
"""

from dataclasses import dataclass

import numpy as np

QUARTER = np.pi / 2


@dataclass(frozen=True)
class Arc:
    """An arc of a profile about (`centre`, `height`) from angle `first` to `last` (radians); a corner has the
    `radius` 0."""

    centre: float
    height: float
    radius: float
    first: float
    last: float


@dataclass(frozen=True)
class CuttingProfile:
    """The profile from the tip up: a flat bottom as far as the first arc begins, its `arcs`, and above them a
    cylinder. `name` is ball, flat, bull or drum; mm."""

    name: str
    arcs: tuple[Arc, ...]

    @property
    def bottom(self) -> float:
        """Radius of the flat bottom; 0 of a profile that ends in a point of the axis."""
        first = self.arcs[0]
        return first.centre + first.radius * float(np.sin(first.first))

    @property
    def radius(self) -> float:
        """The largest radius."""
        return max(arc.centre + arc.radius for arc in self.arcs if arc.first <= QUARTER <= arc.last)

    @property
    def top(self) -> tuple[float, float]:
        """Radius and height of the end of the last arc."""
        last = self.arcs[-1]
        r = last.centre + last.radius * float(np.sin(last.last))
        return r, last.height - last.radius * float(np.cos(last.last))

    @property
    def steepest(self) -> float:
        """The largest angle between tool axis and normal at which an arc touches, radians."""
        return self.arcs[-1].last


def ball(radius: float) -> CuttingProfile:
    """A ball-end cutter. ValueError where the radius is not positive."""
    _require(radius > 0, f"a ball of radius {radius:g} mm: give a positive one")
    return CuttingProfile("ball", (Arc(0.0, radius, radius, 0.0, QUARTER),))


def flat(radius: float) -> CuttingProfile:
    """A flat-end cutter. ValueError where the radius is not positive."""
    _require(radius > 0, f"a flat end of radius {radius:g} mm: give a positive one")
    return CuttingProfile("flat", (Arc(radius, 0.0, 0.0, 0.0, QUARTER),))


def bull(radius: float, corner: float) -> CuttingProfile:
    """A bull-nose cutter: a flat end whose `corner` is rounded (a torus). ValueError unless 0 < corner < radius."""
    _require(
        0 < corner < radius,
        f"a corner of {corner:g} mm on a radius of {radius:g} mm: give a smaller, positive one",
    )
    return CuttingProfile("bull", (Arc(radius - corner, corner, corner, 0.0, QUARTER),))


def drum(radius: float, side: float, nose: float, *, over: float = 0.0) -> CuttingProfile:
    """A drum (barrel) cutter: an arc of radius `side` that bulges to `radius`, and a ball `nose` that touches it.

    The arc goes on above its widest place by the angle `over` (radians). ValueError unless nose < radius < side.
    """
    _require(
        0 < nose < radius < side,
        f"a drum of radius {radius:g} mm, nose {nose:g} mm and side {side:g} mm: give 0 < nose < radius < side",
    )
    _require(0 <= over < QUARTER, f"over = {over:g} rad: give an angle from 0 to a quarter turn")
    joint = float(np.arcsin((side - radius) / (side - nose)))
    widest = nose + (side - nose) * float(np.cos(joint))
    arcs = (
        Arc(0.0, nose, nose, 0.0, joint),
        Arc(radius - side, widest, side, joint, QUARTER + over),
    )
    return CuttingProfile("drum", arcs)


def _require(holds: bool, message: str) -> None:
    """ValueError with the message where something does not hold."""
    if not holds:
        raise ValueError(message)
