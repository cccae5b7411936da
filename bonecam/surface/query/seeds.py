"""Points of a surface, about evenly spaced, from which the search for closest points starts."""

import numpy as np
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tmesh.surface import Seeds, Surface

AROUND = 128
"""Seeds round a closed surface."""

ALONG = (4, 40)
"""Fewest and most seeds across a strip of elements."""

POLE_AROUND = 16
"""Seeds of each ring next to a pole."""

POLE_RINGS = 0.5 ** np.arange(1, 6)
"""Distances in t of the rings next to a pole, share of that of the first regular ring."""

SEEDS = 8000
"""About as many seeds on a surface of general elements as on a row-structured one."""

ELEMENT_SEEDS = (3, 32)
"""Fewest and most seeds along an element's side."""


def seeds_on(surface: Surface) -> Seeds:
    """Points over the whole surface, about evenly spaced; closer together next to a pole."""
    if isinstance(surface.tmesh, RowTMesh):
        return _seeds_on_rows(surface)
    return _seeds_on_elements(surface)


def _seeds_on_elements(surface: Surface) -> Seeds:
    """A grid on every element: the domain need not be a rectangle."""
    boxes = surface.elements().boxes
    count = int(np.clip(np.ceil(np.sqrt(SEEDS / len(boxes))), *ELEMENT_SEEDS))
    u, v = (x.ravel() for x in np.meshgrid(*[(np.arange(count) + 0.5) / count] * 2))
    width = boxes[:, 1] - boxes[:, 0]
    height = boxes[:, 3] - boxes[:, 2]
    s = boxes[:, :1] + width[:, None] * u
    t = boxes[:, 2:3] + height[:, None] * v
    parameters = np.column_stack([s.ravel(), t.ravel()])
    step_limit = 2 * np.array([width.max(), height.max()]) / count
    return Seeds(parameters, KDTree(surface.positions(*parameters.T)), step_limit)


def _seeds_on_rows(surface: Surface) -> Seeds:
    """A grid over the whole domain, and coarser rings between its first and last row and the poles."""
    breaks = np.unique(surface.elements().boxes[:, 2:])
    strips = zip(breaks[:-1], breaks[1:], _counts_along(surface, breaks))
    t = np.concatenate([a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in strips])
    low, high = surface.domain[0]
    s = low + (high - low) * (np.arange(AROUND) + 0.5) / AROUND
    near = (high - low) * (np.arange(POLE_AROUND) + 0.5) / POLE_AROUND + low
    ends = [breaks[0] + (t[0] - breaks[0]) * POLE_RINGS, breaks[-1] - (breaks[-1] - t[-1]) * POLE_RINGS]
    grids = [(s, t)] + [(near, end) for end, pole in zip(ends, surface.tmesh.poles) if pole]
    parameters = np.vstack([np.column_stack([np.tile(a, len(b)), np.repeat(b, len(a))]) for a, b in grids])
    step_limit = np.array([2 * (high - low) / AROUND, 2 * float(np.diff(t).max())])
    return Seeds(parameters, KDTree(surface.positions(*parameters.T)), step_limit)


def _counts_along(surface: Surface, breaks: ndarray) -> list[int]:
    """How many seeds each strip of t needs to space them as along s."""
    s = np.linspace(float(surface.domain[0, 0]), float(surface.domain[0, 1]), AROUND, endpoint=False)
    points = surface.positions(np.tile(s, len(breaks)), np.repeat(breaks, AROUND)).reshape(len(breaks), AROUND, 3)
    around = np.linalg.norm(np.diff(points, axis=1), axis=2).mean()
    across = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1)
    return [int(count) for count in np.clip(np.ceil(across / around), *ALONG)]
