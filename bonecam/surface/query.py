"""Questions to a surface: area and volume, normals and curvature, closest points.

Measures come by Gauss quadrature on the Bezier elements: area = int |S_s x S_t| ds dt; volume = int S . (S_s x S_t) / 3
ds dt (divergence theorem; closed, outward surfaces).

Principal curvatures come from the first and second fundamental forms. With n the outward normal,
E = S_s.S_s, F = S_s.S_t, G = S_t.S_t and L = -n.S_ss, M = -n.S_st, N = -n.S_tt: a
curvature is positive where the part bulges outward (towards the cutter), 1/R everywhere on a ball of radius
R.

At a pole S_s vanishes. The directions S_t(s) round it span the tangent plane (its normal is the area vector
of the closed curve S_t(s), exact where the next row is coplanar with the pole, the mean elsewhere) and the
normal curvatures -n.S_tt / S_t.S_t in those directions are met by one quadratic form in the least squares
sense: exact where the surface is C2 at the pole.

The thin-plate energy of a surface is a matrix over its control points,

    int |S_ss|^2 + 2 |S_st|^2 + |S_tt|^2 = P' M P        (Gan et al. 2014, section 4.2)

over the parameters. That of a fit (`fitting.Quadrature`) is another one: it is taken in lengths, and weighs what is
along the normal and what is in the tangent plane apart.

Searches for closest points take the steps of `kernels.closest_points`, and go over a pole, round a closed direction and
along an open border by its one rule. They differ in the start and in when they stop:

    project                 from the nearest of points spread over the surface (seeds), damped Newton until rounding;
                            of several the nearest
    closest_points_near     from given parameters, few Gauss-Newton steps, each damped; with normals
    follow_closest_points   from given parameters, a fixed number of Gauss-Newton steps; the nearest passed

The result is always a point whose distance is stationary or which is the nearest that was passed; that no
other part of the surface is nearer is not proved where two are about equally near.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree, cKDTree

from bonecam.arrays import dots
from bonecam.errors import SurfaceError
from bonecam.kernels import closest_points
from bonecam.mesh.facets import Curvature, principal, surface_curvature, tangent_axes
from bonecam.surface.basis import element_points
from bonecam.surface.tmesh import RowTMesh, Surface

AREA_POINTS = 12
"""Gauss points each way: |S_s x S_t| is the root of a rational function, which no finite number integrates."""

VOLUME_POINTS = 6
"""Gauss points each way that are exact where the weights are equal; rational surfaces take twice as many."""


def area(surface: Surface) -> float:
    """Surface area, mm^2."""
    _, S_s, S_t, weights = _at_gauss_points(surface, AREA_POINTS)
    return float(np.linalg.norm(np.cross(S_s, S_t), axis=1) @ weights)


def volume(surface: Surface) -> float:
    """Enclosed volume, mm^3, > 0 where S_s x S_t points outward; of a closed surface only."""
    rational = np.ptp(surface.weights) > 0
    S, S_s, S_t, weights = _at_gauss_points(surface, 2 * VOLUME_POINTS if rational else VOLUME_POINTS)
    S = S - surface.control_points.mean(axis=0)
    return float(np.einsum("ni,ni->n", S, np.cross(S_s, S_t)) @ weights / 3)


def _at_gauss_points(
    surface: Surface, count: int
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, " n"]]:
    """S, S_s, S_t at count x count Gauss points of every element, and their weights."""
    elements = surface.elements()
    s, t, weights = element_points(elements.boxes, count)
    element = np.repeat(np.arange(len(elements.boxes), dtype=np.int32), count * count)
    S, S_s, S_t = elements.derivatives(surface.patches, element, s, t, 1)
    return S, S_s, S_t, weights


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


class Seeds(NamedTuple):
    """Surface points from which the search for closest points starts."""

    parameters: Float[ndarray, "n 2"]
    """(s, t) of the points."""
    tree: KDTree
    """The points in mm, for the nearest of them."""
    step_limit: Float[ndarray, "2"]
    """Longest step of the search in s and in t: about two spacings of the points."""


def seeds_on(surface: Surface) -> Seeds:
    """Points over the whole surface, about evenly spaced; closer together next to a pole."""
    boxes = surface.elements().boxes
    if not isinstance(surface.tmesh, RowTMesh):
        # A grid on every element: the domain need not be a rectangle
        count = int(np.clip(np.ceil(np.sqrt(SEEDS / len(boxes))), *ELEMENT_SEEDS))
        u, v = (x.ravel() for x in np.meshgrid(*[(np.arange(count) + 0.5) / count] * 2))
        width = boxes[:, 1] - boxes[:, 0]
        height = boxes[:, 3] - boxes[:, 2]
        s = boxes[:, :1] + width[:, None] * u
        t = boxes[:, 2:3] + height[:, None] * v
        parameters = np.column_stack([s.ravel(), t.ravel()])
        step_limit = 2 * np.array([width.max(), height.max()]) / count
        return Seeds(parameters, KDTree(surface.positions(*parameters.T)), step_limit)

    # A grid over the whole domain, as many seeds in each strip of t as space them as along s, and coarser rings between
    # its first and last row and the poles
    low, high = surface.domain[0]
    breaks = np.unique(boxes[:, 2:])
    s = np.linspace(float(low), float(high), AROUND, endpoint=False)
    points = surface.positions(np.tile(s, len(breaks)), np.repeat(breaks, AROUND)).reshape(len(breaks), AROUND, 3)
    around = np.linalg.norm(np.diff(points, axis=1), axis=2).mean()
    across = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1)
    strips = zip(breaks[:-1], breaks[1:], np.clip(np.ceil(across / around), *ALONG).astype(int))
    t = np.concatenate([a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in strips])
    s = low + (high - low) * (np.arange(AROUND) + 0.5) / AROUND
    near = (high - low) * (np.arange(POLE_AROUND) + 0.5) / POLE_AROUND + low
    ends = [breaks[0] + (t[0] - breaks[0]) * POLE_RINGS, breaks[-1] - (breaks[-1] - t[-1]) * POLE_RINGS]
    grids = [(s, t)] + [(near, end) for end, pole in zip(ends, surface.tmesh.poles) if pole]
    parameters = np.vstack([np.column_stack([np.tile(a, len(b)), np.repeat(b, len(a))]) for a, b in grids])
    step_limit = np.array([2 * (high - low) / AROUND, 2 * float(np.diff(t).max())])
    return Seeds(parameters, KDTree(surface.positions(*parameters.T)), step_limit)


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
        axes = tangent_axes(normal[None], S_t[:1])
        x, y = (S_t @ axis for axis in axes[0])
        length = x * x + y * y
        form = np.linalg.lstsq(
            np.column_stack([x * x, 2 * x * y, y * y]) / length[:, None], -(S_tt @ normal) / length, rcond=None
        )[0]
        curvatures.append((here, principal(form[[0, 1, 1, 2]].reshape(1, 2, 2), axes)))

    # One curvature of all samples from those at some of their indices; of a pole one row stands for all
    count = len(s)
    whole = Curvature(np.empty(count), np.empty(count), np.empty((count, 3)), np.empty((count, 3)))
    for where, part in curvatures:
        for name, values in vars(whole).items():
            values[where] = getattr(part, name)
    return whole


def _samples_at_poles(surface: Surface, t: ndarray) -> list[tuple[int, ndarray]]:
    """Indices of the samples on the lower (0) and the upper (1) pole, where there are some."""
    low, high = surface.domain[1]
    t = np.asarray(t)
    near = [np.flatnonzero(distance <= POLE_RANGE * (high - low)) for distance in (t - low, high - t)]
    return [(end, here) for end, here in enumerate(near) if surface.poles[end] and len(here)]


def _pole_limits(surface: Surface, end: int) -> tuple[ndarray, ndarray, ndarray]:
    """The normal at a pole, and S_t and S_tt at POLE_DIRECTIONS parameters s round it."""
    low, high = surface.domain[0]
    s = low + (high - low) * (np.arange(POLE_DIRECTIONS) / POLE_DIRECTIONS)
    derivatives = surface.derivatives(s, np.full(len(s), surface.domain[1, end]), 2)
    S_t, S_tt = derivatives[2], derivatives[5]
    area = np.cross(S_t, np.roll(S_t, -1, axis=0)).sum(axis=0)
    return unit((area if end else -area)[None])[0], S_t, S_tt


def thin_plate_matrix(
    surface: Surface, s: Float[ndarray, " n"], t: Float[ndarray, " n"], weights: Float[ndarray, " n"]
) -> sp.csc_array:
    """M by quadrature at (s, t): the sum of weights (R_ss'R_ss + 2 R_st'R_st + R_tt'R_tt)."""
    *_, R_ss, R_st, R_tt = surface.basis(s, t, 2)
    W = sp.diags_array(weights)
    return sp.csc_array(R_ss.T @ W @ R_ss + 2 * (R_st.T @ W @ R_st) + R_tt.T @ W @ R_tt)


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
    closest_points.closest_of_seeds(*parts, points, nearest, s, t, squared)
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
    closest_points.walk(
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
        s, t = closest_points.advance(*products, *topology, s, t)
    distances = np.linalg.norm(points - surface.positions(s, t), axis=1)
    return _nearer(nearest, (s, t, distances))


def _nearer(
    first: tuple[ndarray, ndarray, ndarray], second: tuple[ndarray, ndarray, ndarray]
) -> tuple[ndarray, ndarray, ndarray]:
    """Sample by sample the s, t and distance of the nearer one."""
    better = second[2] < first[2]
    s, t, distances = (np.where(better, b, a) for a, b in zip(first, second))
    return s, t, distances
