"""The published problem, one level at a time, solved exactly: the reference of the default method. The only
door to Clarabel.

Gan et al. 2014, section 4.2, with sampled points S_l = R_l P and their moves R_l x:

    min  c_int (P+x)' M (P+x) + c_ext int |R (P+x) - H|^2      Eqs. (8), (9)
    s.t. |R_l x| <= eps_k                                  the depth, Eq. (11)
         |R_l (P + x) - O - tau_l A| <= phi / 2            the capsule about the segment from O to O + A, 0 <=
         tau_l <= 1, Eq. (12) n_l . R_l x >= 0                                  each level encloses the one
         before (the paper leaves this out)

a convex quadratic program with second-order cones. A stock that is no capsule is held by planes at its
nearest points. The paper samples and stops there; here every point of a denser pattern that breaks a limit
joins the samples and the program is solved again (to TOLERANCE mm; after ROUNDS what verification allows is
taken), so that the answer is the optimum over the whole surface. `hull` states the depth on the control
points instead (|x_i| <= eps_k), which holds everywhere by itself. Needs the extra `reference`. Slow: seconds
a level.
"""

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.errors import LevelError, place_name
from bonecam.job import field_error
from bonecam.levels.measure.check import DEPTH_TOLERANCE
from bonecam.levels.problem.samples import (
    Samples,
    creases,
    integration_points,
    joined,
    ring_pattern,
    samples_of,
    thin_plate,
)
from bonecam.progress import Progress, report
from bonecam.setup.schedule import Schedule
from bonecam.setup.stock import Capsule, Stock
from bonecam.surface.tspline import TSpline

TOLERANCE, ROUNDS, PER_POINT, CLEAR = 1e-3, 12, 3, 6e-3
ACCURACY, GAP, INTERIOR = 1e-6, 1e-4, 2e-4
"""A level may fall this far behind the one before, mm: at the wall the limits would leave the solver no
inside otherwise."""
STALL, SOFTEN, SOFTEST, STILL, MOST_TIMES = 0.25, 0.5, 1e-9, 0.05, 4
PATIENCE = 10
"""So many levels in turn may stall, which is as many as it takes to soften: with nesting kept and every place
watched the bounding sphere's pull brings 3midph no nearer than 0.57 mm to its capsule, in 20 s a level."""
WATCH_ALONG, WATCH_AROUND, SPARSE_ALONG, SPARSE_AROUND = 8, 6, 4, 5
Source = Callable[[ndarray, Stock], ndarray]


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

    def and_these(self, other: "Planes") -> "Planes":
        """Both."""
        R = sp.csr_array(sp.vstack([self.R, other.R]))
        return Planes(R, np.vstack([self.normals, other.normals]), np.concatenate([self.high, other.high]))


def bounding_sphere(points: Float[ndarray, "n 3"], stock: Stock) -> Float[ndarray, "n 3"]:
    """The published source of attraction: the nearest points of the sphere about the stock's middle that
    holds the stock."""
    away = points - stock.middle
    size = np.linalg.norm(away, axis=1, keepdims=True)
    return np.asarray(stock.middle + stock.length / 2 * away / np.maximum(size, np.finfo(float).tiny))


def nearest_stock(points: Float[ndarray, "n 3"], stock: Stock) -> Float[ndarray, "n 3"]:
    """The nearest stock points, CLEAR mm inside."""
    distance, out = stock.way_out(points)
    return np.asarray(points - (distance + CLEAR)[:, None] * out)


SOURCES: dict[str, Source] = {"sphere": bounding_sphere, "stock": nearest_stock}


def require_clarabel() -> ModuleType:
    """Clarabel; JobError where the extra that brings it is not installed."""
    try:
        import clarabel
    except ImportError as error:
        raise field_error(
            "levels",
            "method",
            "qcqp",
            "needs Clarabel: pip install 'bonecam[reference]', or take method 'qp'",
        ) from error
    return clarabel  # type: ignore[no-any-return]


def solve_cones(
    energy: sp.csc_array, gradient: Float[ndarray, "c 3"], cones: tuple[Cones, ...], planes: Planes
) -> Float[ndarray, "c 3"]:
    """The moves x (c, 3) that minimise x'Ex / 2 + gradient . x within all cones and planes, to a duality gap
    of GAP (else LevelError).

    `energy` (c, c) is the same for the three coordinates.
    """
    clarabel = require_clarabel()
    count = energy.shape[0]
    blocks = [
        _plane_rows(planes),
        *(_cone_rows(one) for one in cones),
        *(_slide_rows(one, count) for one in cones),
    ]
    width = max(block[0].shape[1] for block in blocks)
    A = sp.csc_matrix(sp.vstack([_widened(block[0], width) for block in blocks]))
    balls, slides = sum(len(one.radii) for one in cones), sum(one.slides for one in cones)
    below, cone = clarabel.NonnegativeConeT, clarabel.SecondOrderConeT
    kinds = [below(len(planes.high)), *[cone(4)] * balls, *[below(2 * slides)] * bool(slides)]
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.direct_solve_method = False, "qdldl"
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = ACCURACY
    P = sp.block_diag([energy] * 3 + [sp.csc_array((width - 3 * count,) * 2)] * (width > 3 * count))
    q = np.concatenate([gradient.T.ravel(), np.zeros(width - 3 * count)])
    b = np.concatenate([block[1] for block in blocks])
    answer = clarabel.DefaultSolver(sp.csc_matrix(sp.triu(P, format="csc")), q, A, b, kinds, settings).solve()
    gap = abs(answer.obj_val - answer.obj_val_dual) / max(1.0, abs(answer.obj_val))
    if str(answer.status) not in ("Solved", "AlmostSolved") or not gap <= GAP:
        raise LevelError(
            f"the published program of this level ends as {answer.status}: raise levels.stiffness or surface.max_control_points"
        )
    return np.array(answer.x)[: 3 * count].reshape(3, count).T


def _widened(A: sp.csr_array, width: int) -> sp.csr_array:
    return sp.csr_array((A.data, A.indices, A.indptr), shape=(A.shape[0], width))


def _plane_rows(planes: Planes) -> tuple[sp.csr_array, ndarray]:
    rows = sp.hstack([sp.diags_array(planes.normals[:, j]) @ planes.R for j in range(3)])
    return sp.csr_array(rows), planes.high


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


def _slide_rows(cones: Cones, count: int) -> tuple[sp.csr_array, ndarray]:
    """0 <= tau <= 1."""
    one, before = sp.eye_array(cones.slides, format="csr"), sp.csr_array((cones.slides, 3 * count))
    A = sp.csr_array(sp.vstack([sp.hstack([before, one]), sp.hstack([before, -one])]))
    return A, np.concatenate([np.ones(cones.slides), np.zeros(cones.slides)])


def cone_sequence(
    surface: TSpline,
    stock: Stock,
    schedule: Schedule,
    stiffness: float,
    attraction: str,
    left: Callable[[ndarray], tuple[float, ndarray]],
    progress: Progress,
) -> list[ndarray]:
    """Control points of levels 0, 1, 2, ... up to the last below the stock, by the published program.

    `left` gives the largest distance (mm) from the stock to the level with these control points, and where.
    The stiffness falls where progress stalls. LevelError where progress ends.
    """
    program, made = ConeLevels(surface, stock, attraction), [np.array(surface.control_points)]
    rest, place = left(made[0])
    whole, most, stalls = rest, MOST_TIMES * schedule.lower_bound(rest), 0
    remedy = f"raise surface.max_control_points{', or take levels.attraction stock' if attraction == 'sphere' else ''}"
    while rest > schedule.limit(len(made)):
        k, before = len(made), rest
        report(progress, 1 - rest / whole, f"level {k} by cones")
        try:
            moves = program.next_moves(made[-1], schedule.limit(k), stiffness)
        except LevelError as error:
            raise LevelError(f"level {k}: {error}", level=k, **error.evidence) from error
        made.append(made[-1] + moves)
        rest, place = left(made[-1])
        stalled = rest > before - STALL * schedule.limit(k)
        stalls, stiffness = (stalls + 1, max(SOFTEST, stiffness * SOFTEN)) if stalled else (0, stiffness)
        if k >= most or stalls > PATIENCE or np.linalg.norm(moves, axis=1).max() < STILL * schedule.limit(k):
            raise LevelError(
                f"level {k} gets no nearer to the stock than {rest:.3f} mm at {place_name(place)}: {remedy}",
                level=k,
                place=place,
            )
    return made


class ConeLevels:
    """The published program of one part in one stock; `next_moves` solves a level.

    `attraction` is `sphere` (as published) or `stock` (the nearest stock point); `stiffness` is c_int /
    c_ext. `printed` leaves it at what the paper prints: no nesting, and limits at one sparse set of samples.
    """

    def __init__(
        self, surface: TSpline, stock: Stock, attraction: str, *, hull: bool = False, printed: bool = False
    ) -> None:
        if attraction not in SOURCES:
            raise ValueError(
                f"attraction {attraction!r} of method 'qcqp': choose one of {', '.join(SOURCES)}"
            )
        self.stock, self._source, self._hull, self._printed = stock, SOURCES[attraction], hull, printed
        self.samples, self.M = samples_of(surface, *integration_points(surface)), thin_plate(surface)
        even = ring_pattern(surface, WATCH_ALONG, WATCH_AROUND)
        s, t = creases(even, surface.control_points).T
        self._watch, self._first = (
            joined(Samples, even, samples_of(surface, s, t, np.zeros(len(s)))),
            _sparse(even),
        )
        self._main = np.asarray(self._watch.R.argmax(axis=1)).ravel()

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

    def next_moves(self, P: Float[ndarray, "c 3"], depth: float, stiffness: float) -> Float[ndarray, "c 3"]:
        """The exact moves (c, 3) to the next level; raises LevelError where the limits cannot be held to
        DEPTH_TOLERANCE mm."""
        E, gradient = self.terms(P, stiffness)
        active = self._first
        walls = self._walls(P, self._watch.R @ P, np.flatnonzero(self._gap(P) < depth))
        for _ in range(ROUNDS):
            cones, planes = self._limits(P, depth, active)
            moves = solve_cones(
                E, gradient, cones, planes if isinstance(self.stock, Capsule) else planes.and_these(walls)
            )
            broken, outside = self._broken(P, moves, depth)
            if broken.max() <= TOLERANCE or self._printed:
                return moves
            active = np.union1d(active, self._worst(broken))
            walls = walls.and_these(self._walls(P, self._watch.R @ (P + moves), self._worst(outside)))
        if broken.max() <= DEPTH_TOLERANCE:
            return moves
        place = (self._watch.R @ (P + moves))[np.argmax(broken)]
        what = f"the published program leaves its limits by {broken.max():.4f} mm at {place_name(place)} after {ROUNDS} rounds"
        raise LevelError(f"{what}: raise surface.max_control_points", place=place)

    def _gap(self, P: ndarray) -> Float[ndarray, " w"]:
        return -self.stock.signed_distance(self._watch.R @ P)

    def _walls(self, P: ndarray, places: ndarray, which: Int[ndarray, " k"]) -> Planes:
        """Planes that hold the watched samples `which` inside the stock: those that touch it nearest to
        `places`."""
        R = sp.csr_array(self._watch.R[which])
        distance, out = self.stock.way_out(places[which])
        room = ((places[which] - R @ P) * out).sum(1) - distance - CLEAR
        return Planes(R, out, np.maximum(room, 0.0))

    def _limits(
        self, P: ndarray, depth: float, active: Int[ndarray, " k"]
    ) -> tuple[tuple[Cones, ...], Planes]:
        """The cones and planes of the samples `active` of the watched pattern."""
        R = sp.csr_array(self._watch.R[active])
        ball = sp.eye_array(len(P), format="csr") if self._hull else R
        cones = [Cones(ball, np.zeros((ball.shape[0], 3)), np.full(ball.shape[0], depth))]
        ahead = Planes(
            R, -self._watch.normals(P)[active], np.full(len(active), np.inf if self._printed else INTERIOR)
        )
        if isinstance(self.stock, Capsule):
            points = R @ P
            outside = self.stock.signed_distance(points)
            near = np.flatnonzero(outside > -depth - 2 * CLEAR)
            radii = self.stock.radius + np.maximum(outside[near], -CLEAR)
            cones.append(
                Cones(
                    sp.csr_array(R[near]),
                    self.stock.start - points[near],
                    radii,
                    self.stock.end - self.stock.start,
                )
            )
        return tuple(cones), ahead

    def _worst(self, broken: Float[ndarray, " w"]) -> Int[ndarray, " k"]:
        """Of the watched samples that break a limit the PER_POINT worst near each control point."""
        over = np.flatnonzero(broken > TOLERANCE / 2)
        order = over[np.lexsort((-broken[over], self._main[over]))]
        owner = self._main[order]
        place = np.arange(len(order)) - np.searchsorted(owner, owner)
        return np.asarray(order[place < PER_POINT])

    def _broken(
        self, P: ndarray, moves: ndarray, depth: float
    ) -> tuple[Float[ndarray, " w"], Float[ndarray, " w"]]:
        """How far each watched sample breaks its worst limit, and how far it lies outside the stock, mm."""
        move = self._watch.R @ moves
        outside = self.stock.signed_distance(self._watch.R @ P + move)
        behind = -(self._watch.normals(P) * move).sum(1)
        return np.maximum.reduce([np.linalg.norm(move, axis=1) - depth, outside, behind]), outside


def _sparse(watch: Samples) -> Int[ndarray, " k"]:
    """Every SPARSE_ALONG-th ring of the watched samples, on it every SPARSE_AROUND-th; and both ends of t."""
    _, ring, count = np.unique(watch.t[:-2], return_inverse=True, return_counts=True)
    place = np.round(watch.s[:-2] * count[ring])
    kept = np.flatnonzero((ring % SPARSE_ALONG == SPARSE_ALONG // 2) & (place % SPARSE_AROUND == 0))
    return np.append(kept, [len(watch.s) - 2, len(watch.s) - 1])
