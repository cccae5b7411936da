"""Principal curvatures, from the first and second fundamental forms, and the shapes they stand for.

With n the outward normal and L = -n.S_ss, M = -n.S_st, N = -n.S_tt, a curvature is positive where the part
bulges outward, towards the cutter: 1/R everywhere on a ball of radius R. (Xu et al. 2013 take the other sign:
there H < 0 is convex.)
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import unit

FLAT_SHARE = 0.05
"""A curvature below this share of the mean size of all is none."""


class SurfaceShape(IntEnum):
    """The shape of a surface round a point, by the signs of k1 >= k2."""

    CONVEX = 0
    CONCAVE = 1
    SADDLE = 2
    PARABOLIC = 3
    PLANAR = 4


@dataclass(frozen=True, eq=False)
class Curvature:
    """Principal curvatures k1 >= k2 in 1/mm (positive: bulges outward) and their unit directions."""

    k1: Float[ndarray, " n"]
    k2: Float[ndarray, " n"]
    direction1: Float[ndarray, "n 3"]
    direction2: Float[ndarray, "n 3"]

    @property
    def mean(self) -> Float[ndarray, " n"]:
        """H = (k1 + k2) / 2."""
        return (self.k1 + self.k2) / 2

    @property
    def gaussian(self) -> Float[ndarray, " n"]:
        """K = k1 k2."""
        return self.k1 * self.k2

    @property
    def shapes(self) -> Int[ndarray, " n"]:
        """The Shape of each point; a curvature is zero below FLAT_SHARE of the mean of all |k1| and |k2|."""
        flat = FLAT_SHARE * float(np.mean(np.abs([self.k1, self.k2]))) if len(self.k1) else 0.0
        sign1, sign2 = (np.where(np.abs(k) <= flat, 0, np.sign(k)) for k in (self.k1, self.k2))
        cases = [(sign1 == 0) & (sign2 == 0), (sign1 == 0) | (sign2 == 0), sign1 > sign2, sign1 > 0]
        return np.select(
            cases,
            [SurfaceShape.PLANAR, SurfaceShape.PARABOLIC, SurfaceShape.SADDLE, SurfaceShape.CONVEX],
            SurfaceShape.CONCAVE,
        )


def principal(forms: Float[ndarray, "n 2 2"], axes: Float[ndarray, "n 2 3"]) -> Curvature:
    """Principal curvatures of second forms given in orthonormal tangent axes."""
    values, vectors = np.linalg.eigh(forms)
    directions = np.einsum("nki,nkd->nid", vectors, axes)
    return Curvature(values[:, 1], values[:, 0], directions[:, 1], directions[:, 0])


def tangent_axes(normals: Float[ndarray, "n 3"], along: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2 3"]:
    """Orthonormal axes of the tangent planes, the first one in the direction of `along`."""
    first = unit(along - np.einsum("ni,ni->n", along, normals)[:, None] * normals)
    return np.stack([first, np.cross(normals, first)], axis=1)


def surface_curvature(derivatives: tuple[Float[ndarray, "n 3"], ...], normals: Float[ndarray, "n 3"]) -> Curvature:
    """Curvature where S_s and S_t are independent, from S_s, S_t, S_ss, S_st, S_tt and the outward unit
    normals."""
    S_s, S_t, S_ss, S_st, S_tt = derivatives
    axes = tangent_axes(normals, S_t)
    J = np.stack([np.einsum("nki,ni->nk", axes, S_s), np.einsum("nki,ni->nk", axes, S_t)], axis=2)
    L, M, N = (-np.einsum("ni,ni->n", normals, v) for v in (S_ss, S_st, S_tt))
    second = np.stack([np.stack([L, M], axis=1), np.stack([M, N], axis=1)], axis=1)
    inverse = np.linalg.inv(J)
    return principal(np.swapaxes(inverse, 1, 2) @ second @ inverse, axes)
