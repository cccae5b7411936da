"""Feet of points on a T-spline: seeds from a grid of surface points, then damped Newton (kernels.projection).

Newton's full Hessian converges quadratically; Gauss-Newton takes over where it is not positive; every step
must bring the foot nearer. A closed direction wraps, a step over a pole goes on on its other side, an open
border holds the foot. Points nearly as near to another part of the surface start there as well, and the
nearest foot wins. The answer is always a foot; that it is the nearest one is not proved where two lie within
about the seeds' spacing of equally near.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.errors import SurfaceError
from bonecam.kernels import projection
from bonecam.surface.tmesh.rows import RowTMesh
from bonecam.surface.tmesh.surface import Seeds, Surface

AROUND = 128  # seeds round a closed surface
ALONG = (4, 40)  # fewest and most seeds across an element strip
POLE_AROUND = 16  # seeds of each ring nearer to a pole
POLE_RINGS = 0.5 ** np.arange(1, 6)
SEEDS = 8000  # about as many on a surface of general elements
ELEMENT_SEEDS = (3, 32)  # fewest and most along an element's side
CANDIDATES = 12  # nearest seeds looked at for each point


class Projection(NamedTuple):
    """Foot parameters (s, t), feet in mm and distances in mm (>= 0); s of a foot on a pole is arbitrary."""

    parameters: Float[ndarray, "n 2"]
    feet: Float[ndarray, "n 3"]
    distances: Float[ndarray, " n"]

    @property
    def s(self) -> Float[ndarray, " n"]:
        """First parameters."""
        return self.parameters[:, 0]

    @property
    def t(self) -> Float[ndarray, " n"]:
        """Second parameters."""
        return self.parameters[:, 1]


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
    points = surface.positions(np.tile(s, len(breaks)), np.repeat(breaks, AROUND)).reshape(
        len(breaks), AROUND, 3
    )
    around = np.linalg.norm(np.diff(points, axis=1), axis=2).mean()
    across = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1)
    return [int(count) for count in np.clip(np.ceil(across / around), *ALONG)]


def project(surface: Surface, points: Float[ndarray, "n 3"]) -> Projection:
    """The nearest point of the surface for each point. Raises ValueError for points that are not finite."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    if surface.elements().degree != 3:
        raise SurfaceError(
            f"the elements have degree {surface.elements().degree}: points are projected on cubic ones"
        )
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points {points.shape}: give one a row, shape (n, 3)")
    if not np.isfinite(points).all():
        raise ValueError(f"point {int(np.argmin(np.isfinite(points).all(axis=1)))} is not finite")
    seeds = surface.seeds
    nearest = seeds.parameters[seeds.tree.query(points, CANDIDATES)[1]]
    elements, count = surface.elements(), len(points)
    s, t, squared = np.empty(count), np.empty(count), np.empty(count)
    domain, period, poles = surface.domain, np.array(elements.period), np.array(surface.poles)
    parts = (surface.patches, elements.boxes, elements.strips, domain, period, poles, seeds.step_limit)
    projection.feet(*parts, points, nearest, s, t, squared)
    return Projection(np.column_stack([s, t]), surface.positions(s, t), np.sqrt(squared))
