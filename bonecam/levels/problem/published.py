"""The published program of one level (Gan et al. 2014, section 4.2), with sampled points S_l = R_l P and their
moves R_l x:

    min  c_int (P+x)' M (P+x) + c_ext int |R (P+x) - H|^2      Eqs. (8), (9)
    s.t. |R_l x| <= eps_k                                      the depth, Eq. (11)
         |R_l (P + x) - O - tau_l A| <= phi / 2                the capsule about the segment from O to O + A, Eq. (12),
                                                               0 <= tau_l <= 1
         n_l . R_l x >= 0                                      nesting, which the paper leaves out

a convex quadratic program with second-order cones. A stock that is no capsule is held by planes at its nearest
points. With `hull` the depth is held at the control points instead (|x_i| <= eps_k), and so everywhere.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.levels.problem.cones import Cones, Planes
from bonecam.levels.problem.samples import (
    SurfaceSamples,
    creases,
    integration_points,
    join,
    ring_pattern,
    samples_of,
    thin_plate,
)
from bonecam.setup.capsule import Capsule
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline

TOLERANCE = 1e-3
"""Limits hold at all watched samples once they are broken by no more, mm."""
CLEAR = 6e-3
"""How far inside the stock the attracting points and its planes lie, mm."""
INTERIOR = 2e-4
"""A level may fall this far behind the one before, mm: at the wall the limits would leave the solver no inside
otherwise."""
PER_POINT = 3
"""Of the watched samples near a control point so many of the worst join the program in a round."""
WATCH_PATTERN = (8, 6)
"""Watched samples: rings in a t-span, points for each knot of the densest row."""
SPARSE_PATTERN = (4, 5)
"""Of the watched samples every so many rings, and every so many points on a ring, are in the first program."""
Source = Callable[[ndarray, Stock], ndarray]


def bounding_sphere(points: Float[ndarray, "n 3"], stock: Stock) -> Float[ndarray, "n 3"]:
    """The published source of attraction: the nearest points of the sphere about the stock's middle that
    holds the stock."""
    away = points - stock.middle
    size = np.linalg.norm(away, axis=1, keepdims=True)
    return stock.middle + stock.length / 2 * away / np.maximum(size, np.finfo(float).tiny)


def nearest_stock(points: Float[ndarray, "n 3"], stock: Stock) -> Float[ndarray, "n 3"]:
    """The nearest stock points, CLEAR mm inside."""
    distance, out = stock.distances_and_normals(points)
    return points - (distance + CLEAR)[:, None] * out


SOURCES: dict[str, Source] = {"sphere": bounding_sphere, "stock": nearest_stock}
"""By the name that `levels.attraction` has in a job."""


class PublishedProgram:
    """The published program of one part in one stock.

    `attraction` is `sphere` (as published) or `stock` (the nearest stock point); `stiffness` is c_int /
    c_ext. `printed` leaves it at what the paper prints: no nesting, and limits at one sparse set of samples.
    """

    def __init__(
        self, surface: TSpline, stock: Stock, attraction: str, *, hull: bool = False, printed: bool = False
    ) -> None:
        if attraction not in SOURCES:
            raise ValueError(f"attraction {attraction!r} of the published program: choose one of {', '.join(SOURCES)}")
        self.stock, self.attraction = stock, attraction
        self.printed = printed
        self.samples = samples_of(surface, *integration_points(surface))
        self.M = thin_plate(surface)
        self._source = SOURCES[attraction]
        self._hull = hull
        even = ring_pattern(surface, *WATCH_PATTERN)
        s, t = creases(even, surface.control_points).T
        self._watch = join(SurfaceSamples, even, samples_of(surface, s, t, np.zeros(len(s))))
        self._main = np.asarray(self._watch.R.argmax(axis=1)).ravel()

        # The rings of the watched samples that SPARSE_PATTERN tells, and the points on them; and both ends of t
        every_ring, every_point = SPARSE_PATTERN
        _, ring, count = np.unique(even.t[:-2], return_inverse=True, return_counts=True)
        place = np.round(even.s[:-2] * count[ring])
        kept = np.flatnonzero((ring % every_ring == every_ring // 2) & (place % every_point == 0))
        self.first = np.append(kept, [len(even.s) - 2, len(even.s) - 1])

    def terms(self, P: Float[ndarray, "c 3"], stiffness: float) -> tuple[sp.csc_array, Float[ndarray, "c 3"]]:
        """Matrix E (c, c) and gradient (c, 3) of the energy over the moves, halved: E(x) = x'Ex + 2 gradient
        . x + const."""
        E = sp.csc_array(stiffness * self.M + self.samples.N)
        return E, E @ P - self.samples.moments(self._source(self.samples.R @ P, self.stock))

    def energy(self, P: Float[ndarray, "c 3"], moves: Float[ndarray, "c 3"], stiffness: float) -> float:
        """The published energy / c_ext of the level P + moves, attracted by what attracts P."""
        H = self._source(self.samples.R @ P, self.stock)
        after = P + moves
        pull = self.samples.weights @ ((self.samples.R @ after - H) ** 2).sum(1)
        return float(stiffness * np.einsum("ij,ij->", after, self.M @ after) + pull)

    def watched(self, P: Float[ndarray, "c 3"]) -> Float[ndarray, "w 3"]:
        """The watched points of the level with control points P."""
        return self._watch.R @ P

    def limits(
        self, P: Float[ndarray, "c 3"], depth: float, active: Int[ndarray, " k"], walls: Planes
    ) -> tuple[tuple[Cones, ...], Planes]:
        """The cones and planes of the `active` watched samples; `walls` are planes of a stock that is no
        capsule."""
        R = sp.csr_array(self._watch.R[active])
        held = sp.eye_array(len(P), format="csr") if self._hull else R
        balls = Cones(held, np.zeros((held.shape[0], 3)), np.full(held.shape[0], depth))
        behind = np.full(len(active), np.inf if self.printed else INTERIOR)
        nesting = Planes(R, -self._watch.normals(P)[active], behind)
        if isinstance(self.stock, Capsule):
            return (balls, self._capsule(R, P, depth)), nesting
        return (balls,), nesting.and_planes(walls)

    def walls_near(self, P: Float[ndarray, "c 3"], depth: float) -> Planes:
        """Planes of the stock at the watched samples that are less than `depth` mm inside it."""
        gap = -self.stock.signed_distance(self.watched(P))
        return self.walls(P, P, np.flatnonzero(gap < depth))

    def walls(self, P: Float[ndarray, "c 3"], after: Float[ndarray, "c 3"], which: Int[ndarray, " k"]) -> Planes:
        """Planes that hold the watched samples `which` inside the stock: those that touch it nearest to where
        the level with control points `after` has them."""
        R = sp.csr_array(self._watch.R[which])
        points = R @ after
        distance, out = self.stock.distances_and_normals(points)
        room = ((points - R @ P) * out).sum(1) - distance - CLEAR
        return Planes(R, out, np.maximum(room, 0.0))

    def worst(self, broken: Float[ndarray, " w"]) -> Int[ndarray, " k"]:
        """Of the watched samples that break a limit the PER_POINT worst near each control point."""
        over = np.flatnonzero(broken > TOLERANCE / 2)
        order = over[np.lexsort((-broken[over], self._main[over]))]
        owner = self._main[order]
        place = np.arange(len(order)) - np.searchsorted(owner, owner)
        return order[place < PER_POINT]

    def broken(
        self, P: Float[ndarray, "c 3"], moves: Float[ndarray, "c 3"], depth: float
    ) -> tuple[Float[ndarray, " w"], Float[ndarray, " w"]]:
        """How far each watched sample breaks its worst limit, and how far it lies outside the stock, mm."""
        move = self._watch.R @ moves
        outside = self.stock.signed_distance(self.watched(P) + move)
        behind = -(self._watch.normals(P) * move).sum(1)
        return np.maximum.reduce([np.linalg.norm(move, axis=1) - depth, outside, behind]), outside

    def _capsule(self, R: sp.csr_array, P: Float[ndarray, "c 3"], depth: float) -> Cones:
        """The wall of a capsule, at the samples R that may come to it."""
        assert isinstance(self.stock, Capsule)
        points = R @ P
        outside = self.stock.signed_distance(points)
        near = np.flatnonzero(outside > -depth - 2 * CLEAR)
        radii = self.stock.radius + np.maximum(outside[near], -CLEAR)
        axis = self.stock.end - self.stock.start
        return Cones(sp.csr_array(R[near]), self.stock.start - points[near], radii, axis)
