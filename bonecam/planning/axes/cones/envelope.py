"""What a section of the tool sweeps for all axes of an elliptic cone: a closed mesh that holds it.

A section is a cylinder of radius r between the heights h and H above the apex, which may lie anywhere within `growth`
of its place. For all axes of the cone its points x (from the place of the apex) have

    n . x <= r + growth             for the outward normals n of the planes tangent to the cone,
    |x| <= |(H, r)| + growth,
    x . a >= h - growth             for an axis a of the cone.

The mesh has these planes as its sides. Its upper facets are no nearer than the bound; its lower vertices, and so its
lower facets, lie in the convex set of all x for which the last line holds for no a.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots, lengths, unit
from bonecam.mesh.solids.revolution import ring_faces

ARC_STEP = np.radians(20.0)
"""Longest edge of those that stand for the spheres below and above, as an angle."""
LEAST_GROWTH = 1e-3
"""Growth is no less (mm), so that no face is without an area."""
RIM_STEPS = 16
"""Directions of the rim for each side, where the lower bound is taken; between them it is less by this share"""
RIM_SHARE = 3e-4
"""of the distance from the apex."""
LEAST_ANGLE = np.radians(0.1)
"""No semi-angle is less: a cone is no plane, nor a line."""


@dataclass(frozen=True)
class Sweep:
    """What a cylinder from `start` to `end` above the apex sweeps for all axes of a cone with the semi-angles `first`
    and `second` (radians, less than a right one) and apexes within `growth` of its place; mm, `start` not negative."""

    start: float
    end: float
    radius: float
    first: float
    second: float
    growth: float

    def mesh(self, sides: int) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]]:
        """Vertices and outward faces of a mesh that holds it, of `sides` sides, the apex in the origin, the cone's axis
        along Z, and its largest opening along X."""
        foot, along = self._edges(sides)
        lower, bottom = self._lower(foot, along)
        upper, top = self._upper(foot, along)
        rings = np.concatenate([lower, upper])
        poles = np.array([[0.0, 0.0, bottom], [0.0, 0.0, top]])
        return np.vstack([rings.reshape(-1, 3), poles]), ring_faces(len(rings), sides)

    def holds(self, points: Float[ndarray, "n 3"], sides: int) -> Bool[ndarray, " n"]:
        """Which points, in the frame of the mesh, lie within the bounds that it has."""
        wide = self.radius + self._growth
        beside = (points @ self._normals(sides).T <= wide).all(axis=1)
        distance = lengths(points)
        axes = self._rim(np.arange(RIM_STEPS * sides) / RIM_STEPS, sides)
        q = points / [*np.tan(self._angles), 1.0]
        inside = (q[:, 2] > 0) & (lengths(q[:, :2]) <= q[:, 2])
        highest = np.where(inside, distance, (points @ axes.T).max(axis=1) + RIM_SHARE * distance)
        return np.asarray(beside & (distance <= self._top) & (highest >= self.start - self._growth))

    def reach(self, height: float) -> float:
        """No point is further off the cone's axis at this height (mm) than this, mm."""
        cosine = np.cos(self._angles.max())
        ends = [t * t + height * height - 2 * t * height * cosine for t in (self.start, self.end)]
        return float(np.sqrt(max(ends))) + self.radius + self._growth

    @property
    def _growth(self) -> float:
        return max(self.growth, LEAST_GROWTH)

    @property
    def _angles(self) -> Float[ndarray, "2"]:
        return np.maximum([self.first, self.second], LEAST_ANGLE)

    @property
    def _top(self) -> float:
        return float(np.hypot(self.radius, self.end)) + self._growth

    def _turns(self, number: Float[ndarray, " n"], sides: int) -> Float[ndarray, " n"]:
        """Turns about the axis of the sides with these numbers: somewhat denser where their normals turn faster."""
        first, second = np.tan(self._angles) ** 0.25
        even = 2 * np.pi * number / sides
        return np.arctan2(second * np.sin(even), first * np.cos(even))

    def _rim(self, number: Float[ndarray, " n"], sides: int) -> Float[ndarray, "n 3"]:
        """Unit directions of the rim at these sides."""
        turns = self._turns(number, sides)
        first, second = np.tan(self._angles)
        return unit(np.column_stack([first * np.cos(turns), second * np.sin(turns), np.ones(len(turns))]))

    def _normals(self, sides: int) -> Float[ndarray, "s 3"]:
        """Outward unit normals of the sides."""
        turns = self._turns(np.arange(float(sides)), sides)
        first, second = np.tan(self._angles)
        flat = np.column_stack(
            [second * np.cos(turns), first * np.sin(turns), np.full(sides, -first * second)]
        )
        return unit(flat)

    def _edges(self, sides: int) -> tuple[Float[ndarray, "s 3"], Float[ndarray, "s 3"]]:
        """The edges between each side and the next: the point nearest to the apex, and the unit direction upward."""
        normals = self._normals(sides)
        following = np.roll(normals, -1, axis=0)
        wide = (self.radius + self._growth) / (1 + dots(normals, following))
        along = unit(np.cross(normals, following))
        return wide[:, None] * (normals + following), along * np.sign(along[:, 2:])

    def _lower(
        self, foot: Float[ndarray, "s 3"], along: Float[ndarray, "s 3"]
    ) -> tuple[Float[ndarray, "r s 3"], float]:
        """The rings from the lower pole to the edges of the sides, and the height of the pole."""
        sides = len(foot)
        bottom = (
            self.start - self._growth - RIM_SHARE * float(np.hypot(self.start, self.radius + self._growth))
        )
        rim = self._rim(np.arange(RIM_STEPS * sides) / RIM_STEPS, sides)
        slope = along @ rim.T
        least = np.where(slope > 0, (bottom - foot @ rim.T) / np.where(slope > 0, slope, 1.0), np.inf).min(
            axis=1
        )
        outer = foot + least[:, None] * along
        if bottom <= 0:
            return outer[None], bottom / np.cos(self._angles.max())
        count = 1 + int(self._angles.max() / ARC_STEP)
        directions = self._rim(np.arange(sides) + 0.5, sides)
        inner = [bottom * _leaning(directions, (k + 1) / count) for k in range(count)]
        return np.stack([*inner, outer]), bottom

    def _upper(
        self, foot: Float[ndarray, "s 3"], along: Float[ndarray, "s 3"]
    ) -> tuple[Float[ndarray, "r s 3"], float]:
        """The rings from the edges of the sides to the upper pole, and the height of the pole."""
        sides, radius = len(foot), self._top
        square = dots(foot, foot)
        for _ in range(3):  # each time nearer to facets that touch the sphere
            outer = foot + np.sqrt(radius**2 - square)[:, None] * along
            directions = unit(outer)
            count = 1 + int(np.arccos(directions[:, 2].min()) / ARC_STEP)
            rings = np.stack([radius * _leaning(directions, 1 - k / count) for k in range(count)])
            corners = np.vstack([rings.reshape(-1, 3), [[0, 0, -radius], [0, 0, radius]]])
            faces = ring_faces(count, sides)
            faces = corners[faces[(faces != count * sides).all(axis=1)]]  # without those about the lower pole
            nearest = _least_distance(faces)
            radius *= 1e-6 + self._top / nearest
        return rings, float(rings[0, 0] @ rings[0, 0]) ** 0.5


def _leaning(directions: Float[ndarray, "n 3"], share: float) -> Float[ndarray, "n 3"]:
    """Unit vectors that lean from Z by a share of the angle by which these do."""
    angle = np.arccos(np.clip(directions[:, 2], -1.0, 1.0))
    flat = directions[:, :2] / np.maximum(np.sin(angle), 1e-12)[:, None]
    return np.column_stack([np.sin(share * angle)[:, None] * flat, np.cos(share * angle)])


def _least_distance(triangles: Float[ndarray, "n 3 3"]) -> float:
    """Of triangles whose corners are equally far from the origin, that of the nearest point."""
    edges = np.sort(((triangles - np.roll(triangles, 1, axis=1)) ** 2).sum(axis=2), axis=1)
    normals = unit(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]))
    obtuse = (
        edges[:, 2] >= edges[:, 0] + edges[:, 1]
    )  # the middle of the longest edge is nearest, not that of the plane
    middle = np.sqrt((triangles[:, 0] ** 2).sum(axis=1) - edges[:, 2] / 4)
    return float(np.where(obtuse, middle, np.abs(dots(normals, triangles[:, 0]))).min())
