"""The oblique elliptic cone, the envelope of admissible tool axes at a contact, as a NURBS surface.

    x(u, phi) = A + u (D + cos(phi) U + sin(phi) V),    0 <= u <= 1

with the apex A, the oblique axis D and the conjugate semi-diameters U, V of the section at its end: any two
vectors that span a plane D does not lie in. Degrees are 2 and 2, the weights round the cone those of a circle
(Xu et al. 2013, Eq. 15). Differs from the paper in:

1. Both lines of Eq. 16 have weights: as printed, without them in the second, the surface misses the cone by an eighth
   of its radius.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.interpolate import BSpline

from bonecam.arrays import frozen
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.tool.elliptic_cones import EllipticCones

CIRCLE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
"""Control points of the unit circle."""
CIRCLE_WEIGHTS = np.array([1, np.sqrt(0.5)] * 4 + [1])
"""Their weights (Eq. 15)."""
CIRCLE_KNOTS = np.array([0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1])
"""Knots round the cone (Eq. 15)."""
GENERATRIX_KNOTS = np.array([0.0, 0, 0, 1, 1, 1])
"""Knots from the apex to the end."""
DEGREE = 2
"""Of both directions."""
FLATTEST = 1e-9
"""D, U and V, at unit length, span less than this volume: no cone."""


@dataclass(frozen=True, eq=False)
class ObliqueEllipticCone:
    """The cone with `apex` A (mm), `axis` D, and semi-diameters `first` U and `second` V of its end, mm.

    ValueError where a vector is not finite, or D, U and V lie in one plane.
    """

    apex: Float[ndarray, "3"]
    axis: Float[ndarray, "3"]
    first: Float[ndarray, "3"]
    second: Float[ndarray, "3"]

    def __post_init__(self) -> None:
        for name in ("apex", "axis", "first", "second"):
            value = frozen(getattr(self, name))
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ValueError(f"{name} = {value.tolist()}: give three finite numbers")
            object.__setattr__(self, name, value)
        sizes = np.linalg.norm(self._frame, axis=0)
        if not (sizes.min() > 0 and abs(np.linalg.det(self._frame / sizes)) > FLATTEST):
            raise ValueError("the axis lies in the plane of the semi-diameters, or these on one line: no cone")

    @property
    def _frame(self) -> Float[ndarray, "3 3"]:
        """U, V and D as columns."""
        return np.column_stack([self.first, self.second, self.axis])

    @cached_property
    def _inverse(self) -> Float[ndarray, "3 3"]:
        return np.linalg.inv(self._frame)

    @cached_property
    def control_points(self) -> Float[ndarray, "3 9 3"]:
        """The net P_ij = A + i/2 (D + x_j U + y_j V), from the apex to the end, round the cone."""
        ring = self.axis + CIRCLE[:, :1] * self.first + CIRCLE[:, 1:] * self.second
        return self.apex + np.array([0, 0.5, 1])[:, None, None] * ring

    @property
    def weights(self) -> Float[ndarray, "3 9"]:
        """The weights of the control points: round the cone those of a circle, along a generatrix all equal."""
        return np.tile(CIRCLE_WEIGHTS, (3, 1))

    @property
    def knots(self) -> tuple[Float[ndarray, "6"], Float[ndarray, "12"]]:
        """Along a generatrix and round the cone, each over 0 .. 1."""
        return GENERATRIX_KNOTS, CIRCLE_KNOTS

    def evaluate(self, u: Float[ndarray, " n"], v: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Points of the NURBS surface at parameters in 0 .. 1: u from the apex to the end, v round the cone."""
        along, around = (
            BSpline.design_matrix(np.asarray(x, dtype=float), knots, DEGREE).toarray()
            for x, knots in zip((u, v), self.knots)
        )
        points = np.concatenate([self.control_points, np.ones((3, 9, 1))], axis=2) * self.weights[:, :, None]
        homogeneous = np.einsum("ni,nj,ijk->nk", along, around, points)
        return homogeneous[:, :3] / homogeneous[:, 3:]

    def implicit(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """q1^2 + q2^2 - q3^2 with q = [U V D]^-1 (x - A): zero on the cone and its opposite, negative inside."""
        q = (points - self.apex) @ self._inverse.T
        return q[:, 0] ** 2 + q[:, 1] ** 2 - q[:, 2] ** 2

    def gradient(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Gradient of `implicit`."""
        q = (points - self.apex) @ self._inverse.T
        return 2 * (q * [1, 1, -1]) @ self._inverse

    def heights(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """q3: 0 in the apex, 1 in the plane of the end; negative on the opposite cone."""
        return (points - self.apex) @ self._inverse[2]

    def contains(self, directions: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether rays from the apex in these directions run inside the cone or on it."""
        q = directions @ self._inverse.T
        return (q[:, 2] > 0) & (q[:, 0] ** 2 + q[:, 1] ** 2 <= q[:, 2] ** 2)

    @cached_property
    def principal(self) -> tuple[Float[ndarray, "3 3"], Float[ndarray, "2"]]:
        """Unit rows: the axis of symmetry, on the side of D, and the directions of the largest and the smallest
        opening; and these two semi-angles in radians."""
        quadric = self._inverse.T @ np.diag([1.0, 1.0, -1.0]) @ self._inverse
        values, vectors = np.linalg.eigh(quadric)
        axes = vectors.T
        if axes[0] @ self.axis < 0:
            axes[0] = -axes[0]
        return axes, np.arctan(np.sqrt(-values[0] / values[1:]))

    def tessellate(self, sides: int = 48, *, circumscribed: bool) -> TriangleMesh:
        """The closed cone with its end as a mesh of `sides` sides, outward: about the cone where it must
        contain it, inscribed where the cone must contain it. ValueError for fewer than three sides."""
        if sides < 3:
            raise ValueError(f"sides = {sides}: give 3 or more")
        angle = 2 * np.pi * np.arange(sides) / sides
        scale = 1 / np.cos(np.pi / sides) if circumscribed else 1.0
        ring = np.cos(angle)[:, None] * self.first + np.sin(angle)[:, None] * self.second
        end = self.apex + self.axis
        vertices = np.vstack([self.apex, end, end + scale * ring])
        here = 2 + np.arange(sides)
        following = np.roll(here, -1)
        wall = np.column_stack([np.zeros(sides, dtype=int), following, here])
        cap = np.column_stack([np.ones(sides, dtype=int), here, following])
        faces = np.vstack([wall, cap]).astype(np.int32)
        return TriangleMesh(vertices, faces if np.linalg.det(self._frame) > 0 else faces[:, ::-1])


def elliptic_cone(apex: Float[ndarray, "3"], cones: EllipticCones, which: int, length: float) -> ObliqueEllipticCone:
    """One of several cones, from `apex` to `length` (mm) along its axis."""
    axis, side = cones.axes[which], cones.sides[which]
    first, second = length * np.tan(cones.angles[which])
    return ObliqueEllipticCone(apex, length * axis, first * side, second * np.cross(axis, side))
