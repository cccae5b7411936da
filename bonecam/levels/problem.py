"""The program of one level: discretisation, energies and limits.

How far a finished level may exceed the limits of its cut, mm.

Where each point of a level is pulled: unit directions, along which the attracting points H of the energy
lie.

`stock`   between the level's own normal and the shortest way to the stock: the nearer to the stock (within
BLEND mm), the more
          of the latter. Normals alone meet in hollows; the shortest ways of a convex stock never do.
`sphere`  as published (Gan et al. 2014): radially from the middle of the stock to its bounding sphere. Drags
the points
          along the axis and needs more levels.
`nearest` the shortest way to the stock from the start.

Matrices of an open surface over its own Bezier elements, by Gauss points: the thin plate M, int R'R, and
what moves its edges.

Samples of a surface, fixed patterns in its parameters, and the integrals over it as matrices over the
control points.

    thin plate   int |S_ss|^2 + 2 |S_st|^2 + |S_tt|^2      = P' M P          (Gan et al. 2014, section 4.2)
    pull         int |S - H|^2                             = P' N P - 2 P' L + const

M and N are the same for every level of one surface; L = int R'H changes with the attracting points H. The
integrals are sums over `SurfaceSamples`: Gauss points in every t-span, evenly spaced points round s (both parameters
run over [0, 1]).

What all levels of one morph share: the samples of the energy, the denser ones on which limits are watched,
the matrices.

A pole that is smooth stays smooth: the ring of control points next to it moves as one affine map of
itself.

Each of the ring's points alone could leave the plane they share with the pole, which then becomes the tip of
a cone, and folds.

Cholesky factors of banded matrices over the control points of a surface.

One cut, and how its level is made: the numbers that energies and limits are made from.

How far the stock is from a level: over points of the stock, the distance to the nearest sample's
neighbourhood.

No level lies behind the one before, so a point's distance only falls: of the points of the stock only those
are measured again that were farther from the level before than the farthest is from this one, until they are
known not to be from this one. At the part a point is not farther than a neighbour that is measured and the
way to it.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.linalg.lapack import dpbtrf, dpbtrs
from scipy.spatial import cKDTree

from bonecam.arrays import dots, lengths, unit
from bonecam.errors import LevelError
from bonecam.kernels import matrices
from bonecam.setup.stock import Stock
from bonecam.surface.basis import element_points, span_points
from bonecam.surface.query import closest_points_near, thin_plate_matrix
from bonecam.surface.tspline import TSpline

DEPTH_TOLERANCE = 0.002
"""mm by which a cut may be deeper than its limit: a fifth of the default gouge and chord tolerance, 0.01 mm."""
NESTING_TOLERANCE = 0.001
"""mm by which a level may lie outside the next one."""
STOCK_TOLERANCE = 0.001
"""mm by which a level may leave the stock."""


BLEND = 4.0
"""Distance (mm) from the stock from which on the shortest way to it counts, as much as the normal where it is
reached."""

Attraction = Callable[[ndarray, ndarray, Stock], ndarray]


def towards_stock(points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], stock: Stock) -> Float[ndarray, "n 3"]:
    """The level's normals, half way to the shortest way to the stock where they are at it."""
    distance, out = stock.distances_and_normals(points)
    return unit(normals + np.clip(1 + distance / BLEND, 0, 1)[:, None] * out)


def towards_nearest(
    points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], stock: Stock
) -> Float[ndarray, "n 3"]:
    """The shortest way to the stock."""
    return stock.normals(points)


def towards_sphere(
    points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], stock: Stock
) -> Float[ndarray, "n 3"]:
    """Away from the middle of the stock, where the published bounding sphere has its centre."""
    return unit(points - stock.middle)


ATTRACTIONS: dict[str, Attraction] = {"stock": towards_stock, "sphere": towards_sphere, "nearest": towards_nearest}


GAUSS = 4
"""Gauss points each way on an element: exact to degree seven, the squares of bicubics have six."""
BORDER = 400
"""Points along an edge on which control points are looked for that move it."""
ON_BORDER = 1e-6
"""Control points move an edge where they have a larger share than this of one of its points: rounding has less."""


@dataclass(frozen=True, eq=False)
class ElementMatrices:
    """Gauss samples R with their weights and normals, the thin plate M, N = int R'R, and the control points
    that move an edge."""

    R: sp.csr_array
    weights: Float[ndarray, " n"]
    normals: Float[ndarray, "n 3"]
    M: sp.csc_array
    N: sp.csc_array
    edge: Bool[ndarray, " c"]


def element_matrices(surface: TSpline) -> ElementMatrices:
    """The matrices of a surface."""
    s, t, weights = element_points(surface.elements().boxes, GAUSS)
    R, R_s, R_t = surface.basis(s, t, 1)
    n = np.cross(R_s @ surface.control_points, R_t @ surface.control_points)
    normals = n / np.linalg.norm(n, axis=1, keepdims=True)
    M = thin_plate_matrix(surface, s, t, weights)
    N = sp.csc_array(R.T @ sp.diags_array(weights) @ R)

    # Control points that move an edge of the surface
    ends = surface.domain
    period = surface.elements().period
    reached = np.zeros(surface.tmesh.size)
    for across in (0, 1):
        if period[across]:
            continue
        along = np.linspace(ends[1 - across, 0], ends[1 - across, 1], BORDER)
        for end in ends[across]:
            pair = (np.full(BORDER, end), along) if across == 0 else (along, np.full(BORDER, end))
            reached = np.maximum(reached, surface.basis(*pair)[0].max(axis=0).toarray().ravel())
    return ElementMatrices(R, weights, normals=normals, M=M, N=N, edge=reached > ON_BORDER)


SPAN_GAUSS = 3
"""Gauss points in every t-span; points round s for every knot of the densest row, too. Three integrate polynomials of
degree five exactly; the squares of cubics have six."""
MOST_AROUND = 400
"""Points round s of an integral at most."""
LEAST_AROUND = 12
"""Points on a ring of a pattern at least: one every 30 degrees near the poles, where rows have few knots."""
NEAR_POLE = 1e-3
"""How far from a pole the normal there is taken, as a share of the range of t: at it S_s vanishes."""
CLOSE_TO_POLE = (0.005, 0.02, 0.05)
"""More rings close to the poles, where a level may fold over the pole, as shares of the span there."""
BENT, HOLLOW, MOST_BETWEEN = 0.0005, 0.001, 8
"""Between neighbours of a ring pattern a level may sag by so much (mm) more than the one before, and by so
much in a hollow; there are so many more places there at most."""
SHAPED = 0.3
"""Share of the surface at a sample that control points together have where they shape it."""


@dataclass(frozen=True, eq=False)
class Places:
    """Parameters (s, t) on a surface, and the basis there: all levels share them."""

    s: Float[ndarray, "n"]
    t: Float[ndarray, "n"]
    R: sp.csr_array

    def near(self, which: Bool[ndarray, "n"]) -> Bool[ndarray, "c"]:
        """Control points that shape the surface at some of the places, and those that do where these do."""
        if not which.any():
            return np.zeros(self.R.shape[1], dtype=bool)
        own = self.R[which].sum(axis=0) > 0
        return np.asarray(self.R[self.R @ own > SHAPED].sum(axis=0) > 0)


P = TypeVar("P", bound=Places)


@dataclass(frozen=True, eq=False)
class SurfaceSamples(Places):
    """Places in one fixed pattern, their integration weights, and the derivatives of the basis there."""

    weights: Float[ndarray, "n"]
    R_s: sp.csr_array
    R_t: sp.csr_array

    def normals(self, control_points: Float[ndarray, "c 3"]) -> Float[ndarray, "n 3"]:
        """Outward unit normals of the surface with these control points."""
        n = self.area_vectors(control_points)
        return n / np.linalg.norm(n, axis=1, keepdims=True)

    def area_vectors(self, control_points: Float[ndarray, "c 3"]) -> Float[ndarray, "n 3"]:
        """S_s x S_t: outward, as long as the area per unit of the parameters."""
        return np.cross(multiply(self.R_s, control_points), multiply(self.R_t, control_points))

    @cached_property
    def N(self) -> sp.csc_array:
        """int R'R (control points squared)."""
        return gram(self.R, self.weights)

    def moments(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "c 3"]:
        """int R'H for one attracting point a sample."""
        return self.R.T @ (self.weights[:, None] * points)


def multiply(R: sp.csr_array, points: Float[ndarray, "c 3"]) -> Float[ndarray, "n 3"]:
    """R P, in a third of the time of scipy."""
    y = np.empty((R.shape[0], 3))
    matrices.times(R.indptr, R.indices, R.data, np.require(points, np.float64, ["C", "W"]), y)
    return y


def gram(R: sp.csr_array, weights: Float[ndarray, "n"]) -> sp.csc_array:
    """R'WR."""
    weighed = sp.csr_array((R.data * np.repeat(weights, np.diff(R.indptr)), R.indices, R.indptr), shape=R.shape)
    return sp.csc_array(R.T @ weighed)


def integration_points(surface: TSpline) -> tuple[ndarray, ndarray, ndarray]:
    """s, t and weights of the integrals."""
    around = min(MOST_AROUND, SPAN_GAUSS * max(len(knots) for knots in surface.tmesh.s_knots))
    t, across = span_points(np.unique(surface.tmesh.t_knots[3:-3]), SPAN_GAUSS)
    ss, tt = np.meshgrid(np.arange(around) / around, t)
    return ss.ravel(), tt.ravel(), np.repeat(across / around, around)


def ring_pattern(surface: TSpline, along: int, around: int) -> SurfaceSamples:
    """`along` rings in every t-span, on each `around` points for every knot of its densest control row; both
    ends of t and rings close to them.

    The weights are areas of the parameters (sum 1). Normals at the ends are those just inside.
    """
    knots, rows = surface.tmesh.t_knots, surface.tmesh.s_knots
    spans = np.unique(knots[3:-3])
    parts = (np.arange(along) + 0.5) / along
    rings = (spans[:-1, None] + np.diff(spans)[:, None] * parts).ravel()
    share = np.repeat(np.diff(spans), along) / along
    near = np.array(CLOSE_TO_POLE)
    rings = np.concatenate([spans[0] + near * (spans[1] - spans[0]), rings, spans[-1] - near * (spans[-1] - spans[-2])])
    share = np.concatenate([0 * near, share, 0 * near])
    first = np.searchsorted(knots, rings, side="right") - 4
    counts = np.array([max(LEAST_AROUND, around * max(len(row) for row in rows[j : j + 4])) for j in first])
    s = np.concatenate([np.arange(count) / count for count in counts])
    t = np.repeat(rings, counts)
    share = np.repeat(share / counts, counts)
    edge = NEAR_POLE * (spans[-1] - spans[0]) * np.array([1, -1])
    s = np.append(s, [0.0, 0.0])
    t = np.append(t, spans[[0, -1]])
    share = np.append(share, [0.0, 0.0])
    _, R_s, R_t = surface.basis(s, t + np.append(np.zeros(len(t) - 2), edge), 1)
    return SurfaceSamples(s, t, R=surface.basis(s, t)[0], weights=share / share.sum(), R_s=R_s, R_t=R_t)


def samples_of(surface: TSpline, s: ndarray, t: ndarray, weights: ndarray) -> SurfaceSamples:
    """The samples at these parameters."""
    R, R_s, R_t = surface.basis(s, t, 1)
    return SurfaceSamples(s, t, R=R, weights=weights, R_s=R_s, R_t=R_t)


def places_at(surface: TSpline, parameters: Float[ndarray, "k 2"]) -> Places:
    """The places at these (s, t), those at the poles left out."""
    low, high = surface.domain[1]
    s, t = parameters[(parameters[:, 1] > low) & (parameters[:, 1] < high)].T
    return Places(s, t, surface.basis(s, t)[0])


def join(kind: type[P], *parts: Places) -> P:
    """All places as one pattern of that kind."""
    values: list[list[Any]] = [[getattr(part, field.name) for part in parts] for field in fields(kind)]
    whole: list[Any] = [
        sp.csr_array(sp.vstack(some)) if sp.issparse(some[0]) else np.concatenate(some) for some in values
    ]
    return kind(*whole)


def creases(
    pattern: SurfaceSamples, level: Float[ndarray, "c 3"], before: Float[ndarray, "c 3"] | None = None
) -> Float[ndarray, "k 2"]:
    """Parameters (s, t) between neighbours of a ring pattern: more where a level bends more than the one
    before, if there is one, and where it is hollow.

    Where both bend alike what is between two samples keeps their distance; but in a hollow the sides meet
    between them.
    """
    rings, starts, counts = np.unique(pattern.t[:-2], return_index=True, return_counts=True)
    x, n = multiply(pattern.R, level), pattern.normals(level)
    turned = n if before is None else n - pattern.normals(before)
    place = np.arange(counts.sum())
    ring = np.repeat(np.arange(len(rings)), counts)
    s = pattern.s[:-2]
    above = np.minimum(ring + 1, len(rings) - 1)
    beside = starts[ring] + (place - starts[ring] + 1) % counts[ring]
    over = starts[above] + np.rint(s * counts[above]).astype(int) % counts[above]
    parameters = []
    for neighbour, ds, dt in ((beside, 1 / counts[ring], 0 * s), (over, 0 * s, rings[above] - rings[ring])):
        across = x[neighbour] - x[:-2]
        bent = lengths(across) * lengths(turned[neighbour] - turned[:-2]) / 8
        hollow = -dots(across, n[neighbour] - n[:-2]) / 8
        more = np.sqrt(np.maximum.reduce([bent / BENT, hollow / HOLLOW, 0 * s]))
        more = np.clip(np.ceil(more) - 1, 0, MOST_BETWEEN).astype(int)
        which = np.repeat(place, more)
        share = (np.arange(len(which)) - np.repeat(np.cumsum(more) - more, more) + 1) / (more[which] + 1)
        parameters.append(np.column_stack([(s[which] + share * ds[which]) % 1.0, pattern.t[which] + share * dt[which]]))
    return np.vstack(parameters)


def thin_plate(surface: TSpline) -> sp.csc_array:
    """M: int R_ss'R_ss + 2 R_st'R_st + R_tt'R_tt over the parameters."""
    return thin_plate_matrix(surface, *integration_points(surface))


FLAT = 1e-6
"""Thickness of a ring, as a share of its size, that counts as none."""


def free_moves(surface: TSpline) -> sp.csr_array:
    """B of moves = B d: the moves of all control points (c) from those d (m) that are free. Of a ring round a
    pole with two directions in its plane, two points are: the others are where the affine map of pole and
    ring that they give takes them."""
    starts, size = surface.tmesh.row_starts, surface.tmesh.size
    B = sp.lil_array(sp.eye_array(size))
    bound = np.zeros(size, dtype=bool)
    for has_pole, pole, ring in zip(
        surface.tmesh.poles, (0, size - 1), (range(starts[1], starts[2]), range(starts[-3], starts[-2]))
    ):
        points = np.array(ring)
        offsets = surface.control_points[points] - surface.control_points[pole]
        _, sizes, axes = np.linalg.svd(offsets, full_matrices=False)
        flat = offsets @ axes[sizes > FLAT * sizes[0]].T
        count = flat.shape[1]
        if not has_pole or len(points) <= count:
            continue

        # As many of the points as they have coordinates, the farthest first, each next one as independent of those as
        # can be
        leading: list[int] = []
        rest = flat.copy()
        for _ in range(flat.shape[1]):
            leading.append(int(np.argmax(np.linalg.norm(rest, axis=1))))
            away = rest[leading[-1]] / np.linalg.norm(rest[leading[-1]])
            rest = rest - (rest @ away)[:, None] * away

        shares = flat @ np.linalg.inv(flat[leading])
        B[points, :] = 0.0
        B[points, pole] = 1 - shares.sum(1)
        for k in range(count):
            B[points, points[leading[k]]] = shares[:, k]
        bound[np.delete(points, leading)] = True
    return sp.csr_array(sp.csc_array(B)[:, np.flatnonzero(~bound)])


ENERGY_PATTERN = (3, 3)
"""Samples of the energy: rings in every t-span, and points on each for every knot of its densest control row."""
WATCH_PATTERN = (5, 5)
"""Watched samples, counted alike: denser than those of the energy, between which levels break their limits."""


@dataclass(frozen=True, eq=False)
class Discretisation:
    """The part and its stock; `samples` (about ten a control point) carry the energy, `watch` only limits: an
    even pattern, to which each level has its creases added, and the places where levels broke limits when
    they were measured. M as in `samples`, `free` as in `free_moves`."""

    surface: TSpline
    stock: Stock
    attraction: Attraction
    samples: SurfaceSamples
    watch: SurfaceSamples
    broken: Places
    M: sp.csc_array
    free: sp.csr_array

    def watched(self, level: Float[ndarray, "c 3"], before: Float[ndarray, "c 3"]) -> Places:
        """All places on which the limits of a level are watched, given its control points and those
        before."""
        return join(Places, self.watch, places_at(self.surface, creases(self.watch, level, before)), self.broken)

    @cached_property
    def free_M(self) -> sp.csc_array:
        """M over the free moves."""
        return sp.csc_array(self.free.T @ self.M @ self.free)

    def also_watching(self, parameters: Float[ndarray, "n 2"]) -> "Discretisation":
        """The discretisation with more samples watched, at these parameters (s, t)."""
        return replace(self, broken=join(Places, self.broken, places_at(self.surface, parameters)))


def discretise(surface: TSpline, stock: Stock, attraction: Attraction) -> Discretisation:
    """The samples and matrices of one morph."""
    samples, watch = ring_pattern(surface, *ENERGY_PATTERN), ring_pattern(surface, *WATCH_PATTERN)
    none = places_at(surface, np.empty((0, 2)))
    return Discretisation(
        surface=surface,
        stock=stock,
        attraction=attraction,
        samples=samples,
        watch=watch,
        broken=none,
        M=thin_plate(surface),
        free=free_moves(surface),
    )


@dataclass(frozen=True, eq=False)
class BandedCholesky:
    """The Cholesky factor L of a banded matrix A = L L': its `lower` diagonals, the main one first."""

    lower: Float[ndarray, "d m"]

    def solve(self, b: Float[ndarray, "m 3"]) -> Float[ndarray, "m 3"]:
        """x of A x = b, for three right sides."""
        return dpbtrs(self.lower, b, lower=True)[0]


def factorise(
    matrix: sp.csc_array, R: sp.csr_array | None = None, weights: Float[ndarray, " k"] | None = None
) -> BandedCholesky:
    """The factor of `matrix` (m, m), or of `matrix` + R'WR with the rows R (k, m) and W = diag(weights).

    In the order of the control points both are banded. LevelError where the sum is not positive definite.
    """
    entries = matrix.tocoo()
    below = entries.row - entries.col
    lower_half = below >= 0
    diagonals = int(below.max()) + 1
    if R is not None:
        diagonals = max(diagonals, matrices.width(*matrices.csr_parts(R)[:2]))
    band = np.zeros((matrix.shape[0], diagonals))
    band[entries.col[lower_half], below[lower_half]] = entries.data[lower_half]
    if R is not None:
        matrices.add_weighted(band, *matrices.csr_parts(R), weights)

    lower, failed = dpbtrf(band.T, lower=True, overwrite_ab=True)
    if failed:
        raise LevelError("some control points hold no part of the level: give fewer of them")
    return BandedCholesky(lower)


SPARE = 0.02
"""How much nearer to the wall samples may come than they aim at, mm."""
ROUGH = 0.5
"""The depth (mm) `StepParameters.bending` is stated for."""


@dataclass(frozen=True)
class StepParameters:
    """How a level is made: weights of the thin plate, parameters over [0, 1], and of the pull.

    `stiffness` is that of the moves, `bending` that of the new surface at a depth of ROUGH mm. `uniform` is how
    much of the pull every sample has alike, against what goes by its area: samples are dense where control
    points are. A sample with less way to the stock than the farthest is pulled by less of the depth, but by
    `least_share` of it at least: below 1 all come to the stock together.
    """

    stiffness: float
    bending: float
    uniform: float
    least_share: float = 1.0


@dataclass(frozen=True)
class Cut:
    """One cut: its `depth` (mm), and how far inside the stock its level stays where it comes to the wall,
    `landing` (mm).

    `margin` is the share of their margins that limits keep: below zero they may be exceeded by as much.
    """

    depth: float
    landing: float
    margin: float = 1.0

    @property
    def clearance(self) -> float:
        """How far inside the stock (mm) samples have to stay, but for those that are nearer to it already:
        SPARE less than they aim at."""
        return self.landing - SPARE


CHORD = 0.01
"""Chord tolerance (mm) of the stock's mesh, whose points are measured from."""
FIRST = 200
"""So many points, the farthest from the level before, are measured first: their largest distance bounds the others."""
EVERY = 10
"""At the part, from which nothing was measured yet, one in so many points is measured first."""
STEPS = 4
"""Newton steps to a closest point on a level, from that on the level before or from the nearest sample."""


@dataclass(frozen=True, eq=False)
class Remaining:
    """Points of the stock, farthest first, for each a distance (mm) it is not farther than (the first one's
    is exact), and the parameters (s, t) of the foot at which that was found; and the watched point of the
    level that is `deepest` inside the stock, and how deep, mm: from the bottom of a hollow it is farther to
    the stock than from the stock to its sides."""

    points: Float[ndarray, "n 3"]
    at_most: Float[ndarray, " n"]
    feet: Float[ndarray, "n 2"]
    deepest: Float[ndarray, "3"]
    depth: float

    @property
    def farthest(self) -> float:
        """The largest distance of a point of the stock from the level, mm."""
        return float(self.at_most[0])

    @property
    def left(self) -> float:
        """The largest distance either way, mm."""
        return max(self.farthest, self.depth)

    @property
    def place(self) -> Float[ndarray, "3"]:
        """Where the distance left is largest."""
        return self.points[0] if self.farthest >= self.depth else self.deepest


def whole(stock: Stock) -> Remaining:
    """Points of the stock, from which nothing was measured yet."""
    mesh = stock.mesh(CHORD)
    points = stock.closest_points(np.vstack([mesh.vertices, mesh.vertices[mesh.faces].mean(1)]))
    return Remaining(points, np.full(len(points), np.inf), np.zeros((len(points), 2)), points[0], np.inf)


def remaining(discretisation: Discretisation, P: Float[ndarray, "c 3"], before: Remaining) -> Remaining:
    """What is left above the level with control points P, which encloses the one `before` was measured
    from."""
    known = np.isfinite(before.farthest)
    level = discretisation.surface.with_control_points(P)
    samples = discretisation.samples if known else discretisation.watch
    tree = cKDTree(multiply(samples.R, P))
    distance = before.at_most.copy()
    footpoints = before.feet.copy()

    def measure(which: ndarray) -> None:
        points = before.points[which]
        to_sample, nearest = tree.query(points)
        for start in (np.column_stack([samples.s, samples.t])[nearest], before.feet[which]):
            away, its = _nearest(level, points, start)
            nearer = away < distance[which]
            distance[which[nearer]], footpoints[which[nearer]] = away[nearer], its[nearer]
        distance[which] = np.minimum(to_sample, distance[which])

    every = np.arange(len(distance))
    first = every[:FIRST] if known else every[::EVERY]
    measure(first)
    if not known:
        apart, nearest = cKDTree(before.points[first]).query(before.points)
        distance = distance[first][nearest] + apart
        footpoints = footpoints[first][nearest]
    farthest = distance[first].max()
    others = np.flatnonzero(distance > farthest)
    distance[others], footpoints[others] = _nearest(level, before.points[others], footpoints[others], farthest)
    measure(others[distance[others] > farthest])
    order = np.argsort(-distance, kind="stable")
    own = multiply(discretisation.watch.R, P)
    depths = -discretisation.stock.signed_distance(own)
    deepest = int(np.argmax(depths))
    return Remaining(before.points[order], distance[order], footpoints[order], own[deepest], float(depths[deepest]))


def _nearest(level: TSpline, points: ndarray, start: ndarray, enough: float = 0.0) -> tuple[ndarray, ndarray]:
    """Distances of the feet found from these parameters, and their own; of places as near as `enough` where
    those are."""
    s, t, foot, _ = closest_points_near(
        level, points, s=start[:, 0], t=start[:, 1], steps=STEPS, near_enough=np.full(len(points), enough)
    )
    return lengths(points - foot), np.column_stack([s, t])
