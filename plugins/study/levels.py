"""The published program of one level (Gan et al. 2014, section 4.2), with sampled points S_l = R_l P and their
moves R_l x:

    min  c_int (P+x)' M (P+x) + c_ext int |R (P+x) - H|^2      Eqs. (8), (9)
    s.t. |R_l x| <= eps_k                                      the depth, Eq. (11)
         |R_l (P + x) - O - tau_l A| <= phi / 2                the capsule about the segment from O to O + A, Eq. (12),
                                                               0 <= tau_l <= 1
         n_l . R_l x >= 0                                      nesting, which the paper leaves out

a convex quadratic program with second-order cones. A stock that is no capsule is held by planes at its nearest
points. With `hull` the depth is held at the control points instead (|x_i| <= eps_k), and so everywhere.

The published program of one level solved exactly over all of the surface.

The paper samples and stops there. Here every watched sample that breaks a limit joins the program, which is
solved again: an exchange method. Seconds a level.

The levels of the published program, solved exactly: the reference of the default ones. Seconds a level.

Clarabel, an interior-point solver, is the exact reference of the others: it solves the default program of a level
(`solve`), and the published one with its second-order cones (`solve_cones`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import clarabel
import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.errors import LevelError, place_name
from bonecam.levels import (
    DEPTH_TOLERANCE,
    LevelProgram,
    LinearLimits,
    Method,
    Stop,
    creases,
    integration_points,
    join,
    level_grid,
    levels_to_stock,
    ring_pattern,
    samples_of,
    solve_linearised,
    stalls,
    thin_plate,
)
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.progress import Progress
from bonecam.setup import Capsule, Schedule, Stock
from bonecam.surface import TSpline


@dataclass(frozen=True, eq=False)
class Cones:
    """|R_l x - centre_l - tau_l axis| <= radius_l, 0 <= tau_l <= 1, for moves x (c, 3) of the control points,
    lengths in mm.

    With `axis` None there is no tau: balls. With one: capsules, exactly (their nearest axis point moves
    along).
    """

    R: sp.csr_array
    centres: Float[ndarray, "k 3"]
    radii: Float[ndarray, " k"]
    axis: Float[ndarray, "3"] | None = None

    @property
    def slides(self) -> int:
        """How many tau there are."""
        return 0 if self.axis is None else len(self.radii)


@dataclass(frozen=True, eq=False)
class Planes:
    """normal_l . R_l x <= high_l, mm."""

    R: sp.csr_array
    normals: Float[ndarray, "k 3"]
    high: Float[ndarray, " k"]

    def and_planes(self, other: "Planes") -> "Planes":
        """The planes of both."""
        R = sp.csr_array(sp.vstack([self.R, other.R]))
        return Planes(R, np.vstack([self.normals, other.normals]), np.concatenate([self.high, other.high]))


ACCURACY = 1e-6
"""Clarabel's tolerance of residuals and of the duality gap, relative and in mm."""
GAP = 1e-4
"""The largest duality gap of an answer that is accepted, as a share of its value."""


def solve(program: LevelProgram) -> Float[ndarray, "m 3"]:
    """The free moves of a level's program by Clarabel, every limit a row: exact, and many times slower than
    `admm`."""
    energy = sp.block_diag([program.matrix] * 3)

    def minimum(limits: LinearLimits, start: Float[ndarray, " v"]) -> Float[ndarray, " v"]:
        high = np.concatenate([limits.high, -limits.low])
        finite = np.isfinite(high)
        A = sp.csr_array(sp.vstack([limits.A, -limits.A]))[finite]
        kinds = [clarabel.NonnegativeConeT(int(finite.sum()))]
        return _minimum(energy, program.gradient.T.ravel(), A, high[finite], kinds)

    return solve_linearised(program, minimum)


def solve_cones(
    energy: sp.csc_array, gradient: Float[ndarray, "c 3"], cones: tuple[Cones, ...], planes: Planes
) -> Float[ndarray, "c 3"]:
    """The moves x (c, 3) that minimise x'Ex / 2 + gradient . x within all cones and planes.

    `energy` E (c, c) is the same for the three coordinates. LevelError where the duality gap is more than GAP.
    """
    count = energy.shape[0]
    below_planes = sp.hstack([sp.diags_array(planes.normals[:, j]) @ planes.R for j in range(3)])
    blocks = [(sp.csr_array(below_planes), planes.high)]
    blocks += [_cone_rows(one) for one in cones]
    for one in cones:
        # 0 <= tau <= 1
        tau = sp.eye_array(one.slides, format="csr")
        before = sp.csr_array((one.slides, 3 * count))
        rows = sp.csr_array(sp.vstack([sp.hstack([before, tau]), sp.hstack([before, -tau])]))
        blocks.append((rows, np.concatenate([np.ones(one.slides), np.zeros(one.slides)])))
    width = max(rows.shape[1] for rows, _ in blocks)
    A = sp.vstack(
        [sp.csr_array((rows.data, rows.indices, rows.indptr), shape=(rows.shape[0], width)) for rows, _ in blocks]
    )
    b = np.concatenate([high for _, high in blocks])

    balls = sum(len(one.radii) for one in cones)
    slides = sum(one.slides for one in cones)
    below, cone = clarabel.NonnegativeConeT, clarabel.SecondOrderConeT
    kinds = [below(len(planes.high)), *[cone(4)] * balls, *[below(2 * slides)] * bool(slides)]

    P = sp.block_diag([energy] * 3 + [sp.csc_array((width - 3 * count,) * 2)] * (width > 3 * count))
    q = np.concatenate([gradient.T.ravel(), np.zeros(width - 3 * count)])
    return _minimum(P, q, A, b, kinds)[: 3 * count].reshape(3, count).T


def _minimum(P: sp.sparray, q: ndarray, A: sp.sparray, b: ndarray, kinds: list[object]) -> Float[ndarray, " v"]:
    """x of least x'Px / 2 + q.x with b - A x in the cones `kinds`; LevelError where there is none."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.direct_solve_method = "qdldl"
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = ACCURACY
    upper = sp.csc_matrix(sp.triu(P, format="csc"))
    answer = clarabel.DefaultSolver(upper, q, sp.csc_matrix(A), b, kinds, settings).solve()
    gap = abs(answer.obj_val - answer.obj_val_dual) / max(1.0, abs(answer.obj_val))
    if str(answer.status) not in ("Solved", "AlmostSolved") or not gap <= GAP:
        raise LevelError(
            f"this level's program ends as {answer.status}: raise levels.stiffness or surface.max_control_points"
        )
    return np.array(answer.x)


def _cone_rows(cones: Cones) -> tuple[sp.csr_array, ndarray]:
    """Rows [radius, R_l x - centre - tau axis] of each cone in turn, as b - A z, z = (x, tau)."""
    k, c = cones.R.shape
    R = sp.coo_array(cones.R)
    rows: list[ndarray] = [4 * R.row + 1 + j for j in range(3)]
    columns: list[ndarray] = [R.col + j * c for j in range(3)]
    values: list[ndarray] = [-R.data] * 3
    if cones.axis is not None:
        rows += [4 * np.arange(k) + 1 + j for j in range(3)]
        columns += [3 * c + np.arange(k)] * 3
        values += [np.full(k, cones.axis[j]) for j in range(3)]
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    A = sp.csr_array(entries, shape=(4 * k, 3 * c + cones.slides))
    return A, np.column_stack([cones.radii, -cones.centres]).ravel()


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
        self._watch = join(type(even), even, samples_of(surface, s, t, np.zeros(len(s))))
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
            # The wall of a capsule, at the samples R that may come to it.
            points = R @ P
            outside = self.stock.signed_distance(points)
            near = np.flatnonzero(outside > -depth - 2 * CLEAR)
            radii = self.stock.radius + np.maximum(outside[near], -CLEAR)
            axis = self.stock.end - self.stock.start
            return (balls, Cones(sp.csr_array(R[near]), self.stock.start - points[near], radii, axis)), nesting
        return (balls,), nesting.and_planes(walls)

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


ROUNDS = 12
"""So often at most; what the check of levels allows is taken then."""


def next_moves(
    program: PublishedProgram, P: Float[ndarray, "c 3"], depth: float, stiffness: float
) -> Float[ndarray, "c 3"]:
    """The moves (c, 3) from the level with control points P to the next, at most `depth` mm.

    LevelError where the limits cannot be held to DEPTH_TOLERANCE mm.
    """
    energy, gradient = program.terms(P, stiffness)
    active = program.first
    # Planes of the stock at the watched samples that are less than `depth` mm inside it.
    gap = -program.stock.signed_distance(program.watched(P))
    walls = program.walls(P, P, np.flatnonzero(gap < depth))
    for _ in range(ROUNDS):
        cones, planes = program.limits(P, depth, active, walls)
        moves = solve_cones(energy, gradient, cones, planes)
        broken, outside = program.broken(P, moves, depth)
        if broken.max() <= TOLERANCE or program.printed:
            return moves
        active = np.union1d(active, program.worst(broken))
        walls = walls.and_planes(program.walls(P, P + moves, program.worst(outside)))
    if broken.max() <= DEPTH_TOLERANCE:
        return moves
    place = program.watched(P + moves)[np.argmax(broken)]
    what = (
        f"the published program leaves its limits by {broken.max():.4f} mm at {place_name(place)} after {ROUNDS} rounds"
    )
    raise LevelError(f"{what}: raise surface.max_control_points", place=place)


CHORD = 0.02
"""Chord tolerance (mm) of the meshes on which the distance left to the stock is measured."""
SOFTEN, SOFTEST = 0.5, 1e-9
"""Where a level stalls the stiffness falls to this share, down to this (parameters in [0, 1])."""
STILL = 0.05
"""A sequence ends where all control points of a level move less than this share of its depth."""
MOST_TIMES = 4
"""So many times K_min levels are made at most."""
MAX_STALLED = 10
"""So many levels in turn may stall, which is as many as it takes to soften: with nesting kept and every place
watched the bounding sphere's pull brings 3midph no nearer than 0.57 mm to its capsule, in 20 s a level."""


@dataclass(frozen=True, eq=False)
class _Rest:
    """What is left above a level: the largest distance from the stock to it, `left` mm at `place`; and the
    stiffness of the level above it."""

    left: float
    place: Float[ndarray, "3"]
    stiffness: float


def published_sequence(
    program: PublishedProgram, surface: TSpline, schedule: Schedule, stiffness: float, progress: Progress
) -> list[ndarray]:
    """Control points of levels 0, 1, 2, ... up to the last below the stock, by the `program` of a `surface`.

    The stiffness falls where progress stalls. LevelError where progress ends.
    """
    grid = level_grid(surface, [surface.control_points], CHORD)
    targets = program.stock.mesh(CHORD).vertices
    other = ", or take levels.attraction stock" if program.attraction == "sphere" else ""
    remedy = f"raise surface.max_control_points{other}"

    def next_level(P: ndarray, k: int, rest: _Rest) -> ndarray:
        moves = next_moves(program, P, schedule.limit(k), rest.stiffness)
        if np.linalg.norm(moves, axis=1).max() < STILL * schedule.limit(k):
            raise LevelError(f"the published program hardly moves it any more: {remedy}", place=rest.place)
        return P + moves

    def rest_above(P: ndarray, k: int, before: _Rest) -> _Rest:
        rest = _Rest(*distance_left(grid.mesh(P), targets), before.stiffness)
        softer = max(SOFTEST, SOFTEN * before.stiffness)
        return replace(rest, stiffness=softer) if stalls(before, rest, schedule.limit(k)) else rest

    first = np.array(surface.control_points)
    rest = _Rest(*distance_left(grid.mesh(first), targets), stiffness)
    lower_bound = schedule.lower_bound(rest.left)
    stop = Stop(remedy, MAX_STALLED, MOST_TIMES * lower_bound)
    return levels_to_stock(
        [first],
        rest,
        schedule=schedule,
        next_level=next_level,
        rest_above=rest_above,
        stop=stop,
        progress=progress,
        lower_bound=lower_bound,
    )


def distance_left(level: TriangleMesh, targets: Float[ndarray, "n 3"]) -> tuple[float, Float[ndarray, "3"]]:
    """The largest distance (mm) from points of the stock to a level, and where."""
    distance = MeshDistance(level).unsigned(targets)
    return float(distance.max()), targets[np.argmax(distance)]


def published_levels(
    surface: TSpline,
    stock: Stock,
    schedule: Schedule,
    attraction: str,
    stiffness: float,
    progress: Progress,
    *,
    printed: bool,
) -> list[ndarray]:
    """The levels of the published program of a part in its stock, as a method makes them."""
    program = PublishedProgram(surface, stock, attraction, printed=printed)
    return published_sequence(program, surface, schedule, stiffness, progress)


BEHIND = 0.02
"""A level may fall so far behind the one before, mm: the published program says nothing of that."""
OUTSIDE = 2 * Method.outside
"""And leave the stock so far, mm, as that is held at samples only."""
QCQP = Method(partial(published_levels, printed=False), BEHIND, OUTSIDE)
"""The published cone program, limits and nesting held everywhere."""
PRINTED = Method(partial(published_levels, printed=True), BEHIND, OUTSIDE, accepted=np.inf)
"""The program as the paper prints it, limits at samples and no nesting: what its levels break is told, not refused."""
