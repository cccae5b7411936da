"""Elliptic cones of directions.

The directions of an oblique elliptic cone (Xu et al. 2013, section 3) are those of an upright one about its axis of
symmetry: so each cone is kept as that axis e, the direction u of its largest opening, and the two semi-angles. With
v = e x u a direction a lies inside where

    q1^2 + q2^2 <= q3^2,    q = (a . u / tan(first), a . v / tan(second), a . e),    q3 > 0.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, dots, frozen, lengths, perpendicular

RIM = 24
"""Directions of a rim that stand for it."""


@dataclass(frozen=True, eq=False)
class EllipticCones:
    """Cones about unit `axes` (k, 3), widest towards the unit `sides` (k, 3) perpendicular to these, with semi-angles
    `angles` (k, 2), the larger first, radians; not positive where there is no cone."""

    axes: Float[ndarray, "k 3"]
    sides: Float[ndarray, "k 3"]
    angles: Float[ndarray, "k 2"]

    def __post_init__(self) -> None:
        for name in ("axes", "sides", "angles"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.axes)

    @classmethod
    def circular(cls, axes: Float[ndarray, "k 3"], angles: Float[ndarray, " k"]) -> "EllipticCones":
        """Circular ones: both semi-angles are equal."""
        return cls(axes, perpendicular(axes), np.column_stack([angles, angles]))

    @classmethod
    def none(cls, count: int) -> "EllipticCones":
        """So many places without a cone."""
        up = np.tile([0.0, 0.0, 1.0], (count, 1))
        return cls.circular(up, np.full(count, -1.0))

    @classmethod
    def oblique(cls, frames: Float[ndarray, "k 3 3"], found: Bool[ndarray, " k"]) -> "EllipticCones":
        """Cones of the directions along D + r (cos(t) U + sin(t) V), r <= 1, where they are `found`; the rows of each
        of the `frames` are D, U and V (the axis and two conjugate semi-diameters of the ellipse at its end)."""
        rows = np.flatnonzero(found)
        columns = np.swapaxes(frames[rows][:, [1, 2, 0]], 1, 2)
        inverse = np.linalg.inv(columns)
        values, vectors = np.linalg.eigh(np.swapaxes(inverse, 1, 2) @ np.diag([1.0, 1.0, -1.0]) @ inverse)
        axes, sides = vectors[:, :, 0], vectors[:, :, 1]
        axes = axes * np.where(dots(axes, frames[rows, 0]) < 0, -1.0, 1.0)[:, None]
        angles = np.arctan(np.sqrt(-values[:, :1] / values[:, 1:]))
        return cls.none(len(frames)).with_rows(rows, cls(axes, sides, angles))

    @property
    def found(self) -> Bool[ndarray, " k"]:
        """Where there is a cone."""
        return np.asarray(self.angles[:, 1] > 0)

    @cached_property
    def matrices(self) -> Float[ndarray, "k 3 3"]:
        """From directions to q; of a place without a cone all zero."""
        across = np.cross(self.axes, self.sides)
        tangents = np.tan(np.where(self.found[:, None], self.angles, 1.0))
        rows = [self.sides / tangents[:, :1], across / tangents[:, 1:], self.axes]
        return np.asarray(np.stack(rows, axis=1) * self.found[:, None, None])

    @cached_property
    def mean_angles(self) -> Float[ndarray, " k"]:
        """The semi-angles of circular cones as wide in all, radians; -1 for none."""
        tangents = np.tan(np.where(self.found[:, None], self.angles, 0.5)).prod(axis=1)
        return np.where(self.found, np.arctan(np.sqrt(tangents)), -1.0)

    def take(self, which: Int[ndarray, " m"] | Bool[ndarray, " k"]) -> "EllipticCones":
        """Some of them."""
        return EllipticCones(self.axes[which], self.sides[which], self.angles[which])

    def with_rows(self, rows: Int[ndarray, " m"], others: "EllipticCones") -> "EllipticCones":
        """With others in these places."""
        parts = [self.axes.copy(), self.sides.copy(), self.angles.copy()]
        for part, of_rows in zip(parts, (others.axes, others.sides, others.angles)):
            part[rows] = of_rows
        return EllipticCones(*parts)

    def scaled(self, share: float | Float[ndarray, " k"]) -> "EllipticCones":
        """With these shares of their angles."""
        shares = np.broadcast_to(share, len(self))[:, None]
        return EllipticCones(self.axes, self.sides, np.where(self.angles > 0, shares * self.angles, -1.0))

    def off(self, directions: Float[ndarray, "k 3"]) -> Float[ndarray, " k"]:
        """How far each direction is off the axis of its cone, as an angle (radians) in a circular cone as wide: at
        the rim `mean_angles`."""
        q = np.einsum("kij,kj->ki", self.matrices, directions)
        flat = np.tan(np.maximum(self.mean_angles, 0.0)) * lengths(q[:, :2])
        return np.where(self.found, np.arctan2(flat, q[:, 2]), np.pi)

    def largest_angles(self, directions: Float[ndarray, "k 3"]) -> Float[ndarray, " k"]:
        """The largest angle from each direction to one in its cone, of RIM directions of the rim, radians."""
        turns = 2 * np.pi * np.arange(RIM) / RIM
        return np.max([angles_between(self.rims(np.full(len(self), turn)), directions) for turn in turns], axis=0)

    def rims(self, turns: Float[ndarray, " k"]) -> Float[ndarray, "k 3"]:
        """Unit directions at the rims, at these turns from `sides`, radians."""
        across = np.cross(self.axes, self.sides)
        tangents = np.tan(self.angles)
        flat = np.cos(turns)[:, None] * tangents[:, :1] * self.sides
        flat = flat + np.sin(turns)[:, None] * tangents[:, 1:] * across + self.axes
        return np.asarray(flat / lengths(flat)[:, None])
