"""The ball that holds the end of a cutter and touches the part where it does, whichever way the cutter leans.

A bull nose of radius R with corners of radius r (a torus) that leans from the normal of the part by the lead angle phi
touches with the circle of its corner whose normals make phi with the axis. All these normals meet on the axis:

    rho = r + (R - r) / sin(phi)    from the contact,
    H   = r + (R - r) cot(phi)      above the tip.

The ball of radius rho about that place holds the end of the cutter, for it is at least as wide as the corner on the
circle where they touch, and cuts the same cusps where the cutter leans along the feed. So a path of its centre that
keeps the ball out of the part keeps the cutter out, and centre and tip lie H apart on every axis. Where the axis leans
by delta more or less the cutter stays off the surface by (R - r) / sin(phi) (1 - cos(delta)).
A ball-end cutter has R = r, and is its own. A flat end has r = 0: its rim lies on the ball.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class EnvelopingBall:
    """A ball of `radius` with its centre at a `height` above the tip, mm."""

    radius: float
    height: float


def enveloping_ball(radius: float, corner: float, lead: float) -> EnvelopingBall:
    """The ball that holds a cutter of this radius with a `corner` (mm) and touches where it leans by `lead` (radians).

    ValueError unless 0 <= corner <= radius and 0 < lead <= a quarter turn.
    """
    if not 0 <= corner <= radius:
        raise ValueError(f"a corner of {corner:g} mm on a radius of {radius:g} mm: give at most that, and 0 or more")
    if not 0 < lead <= math.pi / 2:
        raise ValueError(f"a lead of {lead:g} rad: give more than 0, and at most a quarter turn")
    flat = radius - corner
    return EnvelopingBall(corner + flat / math.sin(lead), corner + flat / math.tan(lead))
