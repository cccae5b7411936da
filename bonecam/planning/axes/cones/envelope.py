"""What a section of the tool sweeps for all axes of a cone: a closed mesh, a spherical sector.

A section is a cylinder of radius r between the heights h and H above the apex. Turned to every axis within the angle
rho of the cone's, it sweeps a body of revolution: below, the sphere of radius h; beside, the cylinder that leans by
rho; above, the sphere through its upper rim. The apex may lie anywhere within `growth` of its place: the cylinder is
then thicker by that all over, with round rims. The mesh holds all of this: polygons stand outside of circles where the
surface looks away from the axis, and inside of them where it looks at it.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, lengths, unit
from bonecam.mesh.solids.revolution import ring_faces

RIM_STEPS = 3
"""Edges that stand for a quarter of a round rim."""
ARC_STEP = np.radians(10.0)
"""Longest edge of those that stand for the spheres below and above, as an angle."""
LEAST_GROWTH = 1e-3
"""Growth is no less (mm), so that no face is without an area."""


@dataclass(frozen=True)
class Sweep:
    """What a cylinder from `start` to `end` above the apex sweeps for all axes within `angle` (radians, less than a
    right one) of the cone's and apexes within `growth` of its place; mm."""

    start: float
    end: float
    radius: float
    angle: float
    growth: float

    def rounded(self, step: float, turn: float) -> "Sweep":
        """One that holds it, its lengths rounded to a multiple of `step` (mm), its angle to one of `turn`."""
        return replace(
            self,
            start=step * np.floor(self.start / step),
            angle=turn * np.ceil(self.angle / turn),
            growth=step * np.ceil(self.growth / step),
        )

    def mesh(self, sides: int) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]]:
        """Vertices and outward faces of a mesh that holds it, of `sides` sides, the apex in the origin and the cone's
        axis upward."""
        inner, outer = self._profile()
        rings = np.vstack([inner, outer / [np.cos(np.pi / sides), 1.0]])
        turn = 2 * np.pi * np.arange(sides) / sides
        points = np.empty((len(rings), sides, 3))
        points[:, :, :2] = rings[:, None, :1] * np.column_stack([np.cos(turn), np.sin(turn)])
        points[:, :, 2] = rings[:, 1:]
        bottom = self.start - self._growth
        poles = [[0, 0, bottom / np.cos(self.angle) if bottom < 0 else bottom], [0, 0, rings[-1, 1]]]
        return np.vstack([points.reshape(-1, 3), poles]), ring_faces(len(rings), sides)

    @property
    def _growth(self) -> float:
        return max(self.growth, LEAST_GROWTH)

    def _profile(self) -> tuple[Float[ndarray, "a 2"], Float[ndarray, "b 2"]]:
        """(radius, height) of the rings from the lower pole to the lowest point of the lower rim, where the surface
        looks at the axis, and on from there to the upper pole."""
        growth = self._growth
        turns = np.pi / 2 * (np.arange(RIM_STEPS) + 0.5) / RIM_STEPS - np.pi / 2
        out = growth / np.cos(np.pi / 4 / RIM_STEPS)
        corners = [self.radius, self.start] + out * np.column_stack([np.cos(turns), np.sin(turns)])
        rim = _lean(corners, self.angle)
        lowest = int(rim[:, 1].argmin())
        bottom = self.start - growth
        below = bottom * _arc(self.angle)[1:] if bottom > 0 else np.zeros((0, 2))

        side_end = np.array([[self.radius + growth, self.end]])
        arc = _arc(self.angle + np.arctan2(self.radius + growth, self.end))
        top = np.hypot(self.radius, self.end) + growth
        beyond = top / np.cos(np.arccos(arc[1, 1]) / 2)
        above = beyond * arc[:0:-1]
        above[-1, 1] = beyond  # flat to the pole
        return np.vstack([below, rim[: lowest + 1]]), np.vstack(
            [rim[lowest:], _lean(side_end, self.angle), above]
        )


def held(
    point: Float[ndarray, "3"],
    apexes: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    sweeps: Sequence[Sweep],
) -> Bool[ndarray, " n"]:
    """Whether a point lies inside each of these sweeps, with their apexes and the unit axes of their cones there."""
    start, end, radius, most, growth = (np.array(part) for part in zip(*(astuple(sweep) for sweep in sweeps)))
    growth = np.maximum(growth, LEAST_GROWTH)
    off = point - apexes
    distance = lengths(off)
    # as the nearest axis of the cone sees it
    angle = np.maximum(angles_between(unit(off), axes) - most, 0.0)
    along = distance * np.cos(angle)
    across = np.where(along > 0, distance * np.sin(angle), 0.0)  # of the few below the apex no more is asked
    below_top = distance <= np.hypot(radius, end) + growth
    return below_top & (along >= start - growth) & (across <= radius + growth)


def _arc(angle: float) -> Float[ndarray, "n 2"]:
    """(radius, height) of points of the unit circle, from the top outward by `angle`, evenly."""
    at = np.linspace(0.0, angle, 1 + max(1, int(np.ceil(angle / ARC_STEP))))
    return np.column_stack([np.sin(at), np.cos(at)])


def _lean(points: Float[ndarray, "n 2"], angle: float) -> Float[ndarray, "n 2"]:
    """(radius, height) turned outward by an angle."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cosine, -sine], [sine, cosine]]))
