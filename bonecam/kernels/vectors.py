"""Vectors in space, tuples or arrays of three numbers: written out where they are called, so that these sums and
products keep the rules for floating point numbers of the kernel that calls.
"""

from typing import TypeAlias

import numpy as np

from bonecam.kernels import njit

Three: TypeAlias = tuple[float, float, float]


@njit(inline="always")
def dot(a: Three, b: Three) -> float:
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(inline="always")
def cross(a: Three, b: Three) -> Three:
    """The vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(inline="always")
def times(factor: float, a: Three) -> Three:
    """A vector so many times as long."""
    return factor * a[0], factor * a[1], factor * a[2]


@njit(inline="always")
def minus(a: Three, b: Three) -> Three:
    """The way from b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(inline="always")
def length(a: Three) -> float:
    """The Euclidean norm."""
    return np.sqrt(dot(a, a))


@njit(inline="always")
def unit(a: Three) -> Three:
    """A vector of length 1; zero stays zero."""
    size = length(a)
    return times(1.0 / size, a) if size > 0.0 else a


@njit(inline="always")
def distance(a: Three, b: Three) -> float:
    """The distance of two points."""
    return length(minus(a, b))


@njit(inline="always")
def squared_segment_distance(p: Three, a: Three, b: Three) -> float:
    """The square of the distance of a point from the segment from a to b."""
    way, off = minus(b, a), minus(p, a)
    square = dot(way, way)
    share = min(max(dot(off, way) / square, 0.0), 1.0) if square > 0.0 else 0.0
    away = minus(off, times(share, way))
    return dot(away, away)
