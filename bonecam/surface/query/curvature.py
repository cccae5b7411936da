"""Normals and principal curvatures from the first and second fundamental forms, and their limits at a pole.

With n the outward normal, E = S_s.S_s, F = S_s.S_t, G = S_t.S_t and L = -n.S_ss, M = -n.S_st, N = -n.S_tt: a
curvature is positive where the part bulges outward (towards the cutter), 1/R everywhere on a ball of radius
R.

At a pole S_s vanishes. The directions S_t(s) round it span the tangent plane (its normal is the area vector
of the closed curve S_t(s), exact where the next row is coplanar with the pole, the mean elsewhere) and the
normal curvatures -n.S_tt / S_t.S_t in those directions are met by one quadratic form in the least squares
sense: exact where the surface is C2 at the pole.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.mesh.facets.curvature import Curvature, principal, surface_curvature, tangent_axes
from bonecam.surface.tmesh.surface import Surface

POLE_RANGE = 1e-9
"""Share of the t-range: a sample nearer to a pole takes the pole's limit, as its S_s is rounding."""

POLE_DIRECTIONS = 256
"""Parameters s, evenly spaced, from which the limits at a pole are taken."""


def unit(vectors: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Vectors scaled to length 1. Raises SurfaceError where one is zero: the surface has no normal there."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if len(length) and not length.min() > 0:
        n = int(np.argmin(length))
        raise SurfaceError(
            f"the surface has no normal at sample {n}: move control points that coincide apart", sample=n
        )
    return vectors / length


def pole_normal(S_t: Float[ndarray, "n 3"], upper: bool) -> Float[ndarray, "3"]:
    """Outward unit normal of a pole from the derivatives S_t at n parameters s round it."""
    area = np.cross(S_t, np.roll(S_t, -1, axis=0)).sum(axis=0)
    return unit((area if upper else -area)[None])[0]


def pole_curvature(S_t: Float[ndarray, "n 3"], S_tt: Float[ndarray, "n 3"], normal: Float[ndarray, "3"]) -> Curvature:
    """Curvature (one row) of a pole from S_t and S_tt at n parameters s round it."""
    axes = tangent_axes(normal[None], S_t[:1])
    x, y = (S_t @ axis for axis in axes[0])
    length = x * x + y * y
    form = np.linalg.lstsq(
        np.column_stack([x * x, 2 * x * y, y * y]) / length[:, None], -(S_tt @ normal) / length, rcond=None
    )[0]
    return principal(form[[0, 1, 1, 2]].reshape(1, 2, 2), axes)


def normals_at(surface: Surface, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """Outward unit normals; at a pole their limit. Raises SurfaceError where the surface has no normal."""
    _, S_s, S_t = surface.derivatives(s, t, 1)
    normals = np.cross(S_s, S_t)
    for end, here in _samples_at_poles(surface, t):
        normals[here] = _pole_limits(surface, end)[0]
    return unit(normals)


def curvature_at(surface: Surface, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Curvature:
    """Principal curvatures and directions; at a pole their limit."""
    derivatives = surface.derivatives(s, t, 2)
    poles = _samples_at_poles(surface, t)
    regular = np.arange(len(s))
    if poles:
        regular = np.setdiff1d(regular, np.concatenate([here for _, here in poles]))
    normals = unit(np.cross(derivatives[1][regular], derivatives[2][regular]))
    curvatures = [(regular, surface_curvature(tuple(d[regular] for d in derivatives[1:]), normals))]
    for end, here in poles:
        normal, S_t, S_tt = _pole_limits(surface, end)
        curvatures.append((here, pole_curvature(S_t, S_tt, normal)))

    # One curvature of all samples from those at some of their indices; of a pole one row stands for all
    count = len(s)
    whole = Curvature(np.empty(count), np.empty(count), np.empty((count, 3)), np.empty((count, 3)))
    for where, part in curvatures:
        whole.k1[where] = part.k1
        whole.k2[where] = part.k2
        whole.direction1[where] = part.direction1
        whole.direction2[where] = part.direction2
    return whole


def _samples_at_poles(surface: Surface, t: ndarray) -> list[tuple[int, ndarray]]:
    """Indices of the samples on the lower (0) and the upper (1) pole, where there are some."""
    low, high = surface.domain[1]
    distances = (np.asarray(t) - low, high - np.asarray(t))
    samples = []
    for end in (0, 1):
        here = np.flatnonzero(distances[end] <= POLE_RANGE * (high - low))
        if surface.poles[end] and len(here):
            samples.append((end, here))
    return samples


def _pole_limits(surface: Surface, end: int) -> tuple[ndarray, ndarray, ndarray]:
    """The normal at a pole, and S_t and S_tt at POLE_DIRECTIONS parameters s round it."""
    low, high = surface.domain[0]
    s = low + (high - low) * (np.arange(POLE_DIRECTIONS) / POLE_DIRECTIONS)
    derivatives = surface.derivatives(s, np.full(len(s), surface.domain[1, end]), 2)
    S_t, S_tt = derivatives[2], derivatives[5]
    return pole_normal(S_t, end == 1), S_t, S_tt
