"""Closest points on a T-spline: of any points, of points near the surface, and of points followed by a fit.

All three take the steps of `kernels.closest.newton`, and go over a pole, round a closed direction and along
an open border by its one rule. They differ in the start and in when they stop:

    project                 from the nearest seeds, damped Newton until rounding; of several the nearest
    closest_points_near     from given parameters, few Gauss-Newton steps, each damped; with normals
    follow_closest_points   from given parameters, a fixed number of Gauss-Newton steps; the nearest passed

The result is always a point whose distance is stationary or which is the nearest that was passed; that no
other part of the surface is nearer is not proved where two are about equally near.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import dots
from bonecam.errors import SurfaceError
from bonecam.kernels.closest import gauss_newton, newton
from bonecam.surface.tmesh.surface import Surface

CANDIDATES = 12
"""Nearest seeds that are looked at for each point."""

RING_DISTANCE = 1e-4
"""Distance of the rings from the poles, share of the t-range: at a pole itself S_s vanishes."""

CLEAR_OF = 0.02
"""mm: farther than this from its closest point, the direction to a point replaces the normal."""

FOLLOWING_STEPS = 4
"""Steps of `follow_closest_points` where no other number is given."""


class Projection(NamedTuple):
    """Parameters (s, t) of the closest surface points, these points in mm and their distances in mm (>= 0).

    At a pole s is arbitrary.
    """

    parameters: Float[ndarray, "n 2"]
    points: Float[ndarray, "n 3"]
    distances: Float[ndarray, " n"]

    @property
    def s(self) -> Float[ndarray, " n"]:
        """First parameters."""
        return self.parameters[:, 0]

    @property
    def t(self) -> Float[ndarray, " n"]:
        """Second parameters."""
        return self.parameters[:, 1]


class ClosestPoints(NamedTuple):
    """Parameters s and t of surface points, the points in mm and the outward unit normals there."""

    s: Float[ndarray, " n"]
    t: Float[ndarray, " n"]
    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]


def project(surface: Surface, points: Float[ndarray, "n 3"]) -> Projection:
    """The closest point of the surface for each point. Raises ValueError for points that are not finite."""
    points = np.require(points, np.float64, ["C", "W"])  # one kind of array, for which kernels are compiled once
    elements = surface.elements()
    if elements.degree != 3:
        raise SurfaceError(f"the elements have degree {elements.degree}: points are projected on cubic ones")
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points {points.shape}: give one a row, shape (n, 3)")
    if not np.isfinite(points).all():
        raise ValueError(f"point {int(np.argmin(np.isfinite(points).all(axis=1)))} is not finite")
    seeds = surface.seeds
    nearest = seeds.parameters[seeds.tree.query(points, CANDIDATES)[1]]
    s = np.empty(len(points))
    t = np.empty(len(points))
    squared = np.empty(len(points))
    parts = (surface.patches, elements.boxes, elements.strips, *_topology(surface), seeds.step_limit)
    newton.closest_of_seeds(*parts, points, nearest, s, t, squared)
    return Projection(np.column_stack([s, t]), surface.positions(s, t), np.sqrt(squared))


def _topology(surface: Surface) -> tuple[ndarray, ndarray, ndarray]:
    """Domain, period and poles, as `kernels.closest.newton.into_domain` takes them."""
    return surface.domain, np.array(surface.elements().period), np.array(surface.poles)


def rings(surface: Surface) -> tuple[float, float]:
    """Lowest and highest t at which `closest_points_near` evaluates a surface: at a pole it has no normal."""
    low, high = (float(end) for end in surface.domain[1])
    return low + RING_DISTANCE * (high - low), high - RING_DISTANCE * (high - low)


def closest_points_near(
    surface: Surface,
    points: Float[ndarray, "n 3"],
    s: Float[ndarray, " n"],
    t: Float[ndarray, " n"],
    steps: int,
    near_enough: Float[ndarray, " n"] | None = None,
) -> ClosestPoints:
    """The closest points that `steps` Gauss-Newton steps from (s, t) pass, on a surface closed in s with
    poles.

    A surface point no farther than `near_enough` (mm) ends the search, where that is given. The distance to
    the whole surface is never understated, as the nearest point that was passed is returned. Farther than
    CLEAR_OF from it the direction to the point replaces the normal: at a closest point that is the same, and
    where none was found, or at the tip of a pole, the signed distance is not understated either.
    """
    elements = surface.elements()
    s = s.copy()
    t = t.copy()
    closest = np.empty((len(points), 3))
    normals = np.empty((len(points), 3))
    enough = np.zeros(len(points)) if near_enough is None else near_enough
    # one thread: among two the levels of a phalanx took a fifth longer
    gauss_newton.walk(
        patches=surface.patches,
        boxes=elements.boxes,
        strips=elements.strips,
        domain=surface.domain[1],
        ends=rings(surface),
        y=np.ascontiguousarray(points),
        steps=steps,
        s=s,
        t=t,
        foot=closest,
        normal=normals,
        clear_of=CLEAR_OF,
        enough=enough,
    )
    return ClosestPoints(s, t, closest, normals)


def grid_parameters(surface: Surface, around: int, along: int) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """s and t of a regular grid over the whole domain, poles included: n = around * (along + 1)."""
    low, high = surface.domain[1]
    s, t = np.meshgrid(np.arange(around) / around, np.linspace(low, high, along + 1))
    return s.ravel(), t.ravel()


def nearest_on_grid(
    surface: Surface, points: Float[ndarray, "n 3"], around: int = 96, along: int = 128
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """s and t of the nearest point of a regular grid on the surface: a start for `follow_closest_points`."""
    s, t = grid_parameters(surface, around, along)
    _, nearest = cKDTree(surface.positions(s, t)).query(points)
    return s[nearest], t[nearest]


def follow_closest_points(
    surface: Surface,
    points: Float[ndarray, "n 3"],
    s: Float[ndarray, " n"],
    t: Float[ndarray, " n"],
    steps: int = FOLLOWING_STEPS,
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
    """s, t and distances (mm) of the closest points that `steps` Gauss-Newton steps from (s, t) pass.

    None is farther away than its start.
    """
    topology = _topology(surface)
    nearest = s, t, np.full(len(s), np.inf)
    for _ in range(steps):
        S, S_s, S_t = surface.derivatives(s, t, 1)
        away = points - S
        nearest = _nearer(nearest, (s, t, np.linalg.norm(away, axis=1)))
        products = dots(S_s, S_s), dots(S_s, S_t), dots(S_t, S_t), dots(away, S_s), dots(away, S_t)
        s, t = gauss_newton.advance(*products, *topology, s, t)
    distances = np.linalg.norm(points - surface.positions(s, t), axis=1)
    return _nearer(nearest, (s, t, distances))


def _nearer(
    first: tuple[ndarray, ndarray, ndarray], second: tuple[ndarray, ndarray, ndarray]
) -> tuple[ndarray, ndarray, ndarray]:
    """Sample by sample the s, t and distance of the nearer one."""
    better = second[2] < first[2]
    s, t, distances = (np.where(better, b, a) for a, b in zip(first, second))
    return s, t, distances
