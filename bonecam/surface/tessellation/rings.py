"""The coarse mesh a tessellation starts from: rings round a closed surface, each with its own number of
vertices, zipped.

Counts come from the normal curvature: an arc of parameter length d sags by |n.S_ss| d^2 / 8.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.tmesh.surface import Surface

SAG = 4.0
"""Share of the 8 in |n.S_ss| d^2 / 8: the diagonal of a cell sags by the sum of both directions."""

AROUND = 48
"""Samples of a ring from which its count is estimated."""

FEWEST = 16
"""Vertices of a ring: between fewer, what is straight in (s, t) bends so far round a pole that small faces
turn over."""

ASPECT = 3.0
"""Longest edges along a ring against the distance of the rings."""

TYPICAL = 0.75
"""This quantile of the sag sets the counts; sharper spots are split later."""


def ring_mesh(
    surface: Surface, chord_tolerance: float
) -> tuple[Float[ndarray, "n 2"], Bool[ndarray, " n"], Int[ndarray, "m 3"]]:
    """Parameters of the vertices, which of them are poles, and faces counter-clockwise from outside."""
    t, counts = _rings(surface, chord_tolerance)
    starts = np.concatenate([[0], np.cumsum(counts)]).tolist()
    parameters = np.vstack([np.column_stack([np.arange(n) / n, np.full(n, x)]) for n, x in zip(counts, t)])
    faces = [_zip(starts[k], counts[k], starts[k + 1], counts[k + 1]) for k in range(len(t) - 1)]
    poles = np.concatenate([np.full(n, n == 1) for n in counts])
    return parameters, poles, np.vstack(faces)


def _rings(surface: Surface, chord_tolerance: float) -> tuple[ndarray, list[int]]:
    """t of each ring, poles included, and its number of vertices (a pole: 1)."""
    breaks = np.unique(surface.elements().boxes[:, 2:])
    middle = (breaks[:-1] + breaks[1:]) / 2
    sag = _sag(surface, middle, 5)
    counts = np.maximum(1, np.ceil(np.diff(breaks) * np.sqrt(sag / (SAG * chord_tolerance)))).astype(int)
    t = np.concatenate(
        [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(breaks[:-1], breaks[1:], counts)] + [breaks[-1:]]
    )
    around = np.ceil(np.sqrt(_sag(surface, t, 3) / (SAG * chord_tolerance)))
    s = np.arange(AROUND) / AROUND
    points = surface.positions(np.tile(s, len(t)), np.repeat(t, AROUND)).reshape(len(t), AROUND, 3)
    length = np.linalg.norm(points - np.roll(points, -1, axis=1), axis=2).sum(axis=1)
    gap = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1)
    if not gap.min() > 0:
        place = t[np.argmin(gap)]
        raise SurfaceError(
            f"the rows near t = {place:.4f} lie on one point: move their control points apart", place=place
        )
    gap = np.maximum(np.concatenate([gap[:1], gap]), np.concatenate([gap, gap[-1:]]))
    ring = np.maximum(FEWEST, np.maximum(around, np.ceil(length / (ASPECT * gap)))).astype(int)
    for end, pole in zip((0, -1), surface.tmesh.poles):
        if pole:
            ring[end] = 1
    return t, ring.tolist()


def _sag(surface: Surface, t: ndarray, which: int) -> ndarray:
    """A typical |n.S_ss| (which = 3) or |n.S_tt| (5) on each line t = const."""
    inside = np.clip(t, *(surface.domain[1] + np.array([1e-6, -1e-6]) * np.ptp(surface.domain[1])))
    s = np.tile(np.arange(AROUND) / AROUND, len(t))
    along = np.repeat(inside, AROUND)
    derivatives = surface.derivatives(s, along, 2)
    normals = np.cross(derivatives[1], derivatives[2])
    length = np.linalg.norm(normals, axis=1)
    second = np.abs(np.einsum("ni,ni->n", normals, derivatives[which])) / np.where(length > 0, length, 1.0)
    return np.quantile(second.reshape(len(t), AROUND), TYPICAL, axis=1)


def _zip(lower: int, m: int, upper: int, n: int) -> ndarray:
    """Triangles between two rings of m and n even vertices that start at ids lower and upper; 1 is a pole."""
    if m == 1:
        return np.column_stack([np.full(n, lower), upper + (np.arange(n) + 1) % n, upper + np.arange(n)])
    if n == 1:
        return np.column_stack([lower + np.arange(m), lower + (np.arange(m) + 1) % m, np.full(m, upper)])
    step = np.concatenate([(np.arange(m) + 0.5) / m, (np.arange(n) + 0.5) / n])
    is_lower = np.concatenate([np.ones(m, dtype=bool), np.zeros(n, dtype=bool)])[np.argsort(step, kind="stable")]
    i, j = np.cumsum(is_lower) - is_lower, np.cumsum(~is_lower) - ~is_lower
    third = np.where(is_lower, lower + (i + 1) % m, upper + (j + 1) % n)
    return np.column_stack([lower + i % m, third, upper + j % n])
