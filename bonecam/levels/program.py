"""The quadratic program of one level, on the free moves D of the control points (`poles.py`), and its solution.

    min  int |S_new - H|^2 + stiffness D'MD + bending P_new'M P_new        S_new = S + R D, the integrals over the surface
    s.t. depth, nesting and stock at samples                              (`limits.py`)

H lies along the pull; where the level should go as far as it may, beyond the depth. It should where the way to the stock needs all the
depth the cuts to come have (at the feet of the farthest points of the stock above all, which are samples of their own); a place with
less to go takes at least `haste` of the depth, so that all come to the stock together: where some come early, levels crowd into what is
left between them and fold. Bending (the published thin plate) fills hollows as the level goes and keeps walls from standing up.

The program is solved by splitting (ADMM, as OSQP does it): samples go to the nearest point of their own limits, control points to the
least-squares fit of the samples, and the matrix of that fit is the same for x, y and z and for all iterations: one small factor a level.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.sparse.linalg import SuperLU, splu

from bonecam.kernels import splitting
from bonecam.levels.attraction import unit
from bonecam.levels.limits import Limits, feet, limits_at, unset
from bonecam.levels.remaining import Remaining
from bonecam.levels.setting import Setting
from bonecam.levels.solve import solve
from bonecam.levels.stock import Stock
from bonecam.surface.tspline import TSpline

ITERATIONS, RENEW, RHO, RELAXATION = 100, 20, 8.0, 1.6
BEYOND, LONGEST, LEAST_COSINE = 2.0, 2.0, 0.3
EVEN = 0.05
RENEWALS, OSQP_TOLERANCE = 3, 1e-5
DEPTH_MARGIN, DEPTH_SHARE, NEST_MARGIN, NEST_SHARE, SPARE = 0.001, 0.01, 0.001, 0.05, 0.02
FARTHEST, MOST_FARTHEST, THEIR_WEIGHT = 1.0, 600, 0.3
"""Points of the stock less than so many depths nearer than the farthest pull at their feet; so many of them; with so much of the weight."""
ROUGH, ALL_OUT = 0.5, 8
"""The depth (mm) `bending` is stated for, its weight falls with the depth squared; how sharply pull beyond the depth sets in."""


@dataclass(frozen=True)
class Manner:
    """How levels are made: `stiffness` of the moves, `bending` of the surface at a depth of ROUGH mm, `smoothing` of the field of
    directions (all weights of the thin plate in parameters over [0, 1]), `haste` the least share of the depth."""

    stiffness: float
    bending: float
    smoothing: float
    haste: float


@dataclass(frozen=True)
class Cut:
    """One cut: its `depth` and how far the levels can still go in all, this one included, both mm; `landing` inside the stock."""

    depth: float
    left: float
    landing: float

    def clearance(self, gap: Float[ndarray, " k"]) -> Float[ndarray, " k"]:
        """How far inside the stock samples stay that are `gap` inside it now."""
        return np.minimum(gap, self.landing - SPARE)

    def heights(self, gap: Float[ndarray, " k"]) -> tuple[ndarray, ndarray]:
        """Lowest and largest height of each sample over the level before: a little more than nested where there is room."""
        room = np.clip(NEST_SHARE * (gap - (self.landing - SPARE)), 0, NEST_MARGIN)
        return room, np.full(len(gap), self.depth - min(DEPTH_MARGIN, DEPTH_SHARE * self.depth))


@dataclass(frozen=True, eq=False)
class Program:
    """min sum_l w_l |x_l + R_l D - H_l|^2 + D'(plate)D + 2 bend.D within `limits`: one level, its limits set up at the targets."""

    before: TSpline
    stock: Stock
    R: sp.csr_array
    x: Float[ndarray, "k 3"]
    weights: Float[ndarray, " k"]
    H: Float[ndarray, "k 3"]
    start: Float[ndarray, "k 3"]
    clearance: Float[ndarray, " k"]
    limits: Limits
    N: sp.csc_array
    plate: sp.csc_array
    bend: Float[ndarray, "m 3"]

    @property
    def matrix(self) -> sp.csc_array:
        """Half the energy's second derivative, for each of x, y and z."""
        return sp.csc_array(self.N + self.plate)

    def energy(self, moves: Float[ndarray, "m 3"]) -> float:
        """What is made least."""
        pull = self.weights @ ((self.x - self.H) ** 2).sum(1) + 2 * np.einsum("ij,ij->", self.gradient, moves)
        return float(np.einsum("ij,ij->", moves, self.matrix @ moves) + pull)

    @property
    def gradient(self) -> Float[ndarray, "m 3"]:
        """Half the energy's gradient at D = 0."""
        return np.asarray(self.R.T @ (self.weights[:, None] * (self.x - self.H)) + self.bend)


def program_of(
    setting: Setting, P: Float[ndarray, "c 3"], rest: Remaining, cut: Cut, manner: Manner, ease: Float[ndarray, " c"] | None = None
) -> Program:
    """The program of the level above P, from which `rest` is left to the stock; `ease` is a factor of the pull, a control point each."""
    samples, stock, before, free = setting.samples, setting.stock, setting.surface.with_control_points(P), setting.free
    far = _farthest(before, rest, cut.depth)
    own, area = samples.R @ P, np.linalg.norm(stretched := samples.stretched(P), axis=1)
    weights = area * samples.weights
    weights = weights / weights.sum() + EVEN / len(own)
    normals = stretched / np.maximum(area, np.finfo(float).tiny)[:, None]
    N = sp.csc_array(samples.R.T @ sp.diags_array(weights) @ samples.R)
    pull = samples.R.T @ (weights[:, None] * setting.attraction(own, normals, stock))
    pull = unit(samples.R @ _factor(N + manner.smoothing * setting.M).solve(pull))
    x, weights = np.vstack([own, far.feet]), np.concatenate([weights, far.weights])
    normals, pull = np.vstack([normals, far.towards]), np.vstack([pull, far.towards])
    R = sp.vstack([samples.R, far.R])
    weights = weights if ease is None else weights * (R @ ease)
    R = sp.csr_array(R @ free)
    gap = -stock.signed_distance(x)
    low, high = cut.heights(gap)
    share = np.clip(gap / cut.left, manner.haste, 1)
    share[len(own) :] = 1
    limits = unset(normals, np.concatenate([samples.s, far.s]), np.concatenate([samples.t, far.t]), low, high)
    target = _targets(before, stock, x, pull, limits, share * high, np.minimum(gap, cut.landing))
    clearance = cut.clearance(gap)
    limits = limits_at(before, stock, target, limits, clearance, 2)
    beyond = 1 + (BEYOND - 1) * share**ALL_OUT
    H = _inside(stock, limits.c + beyond[:, None] * (target - limits.c), np.minimum(gap, cut.landing))
    bending = manner.bending * (cut.depth / ROUGH) ** 2
    plate = sp.csc_array((manner.stiffness + bending) * (free.T @ setting.M @ free))
    bend = bending * (free.T @ (setting.M @ P))
    return Program(before, stock, R, x, weights, H, target, clearance, limits, sp.csc_array(R.T @ sp.diags_array(weights) @ R), plate, bend)


def split(program: Program, iterations: int = ITERATIONS, renew: int = RENEW) -> Float[ndarray, "m 3"]:
    """The free moves by splitting; every `renew` iterations the limits are set up again where the samples are."""
    limits, R, x, bend = program.limits, program.R, program.x, program.bend / RHO
    factor = _factor(program.N + program.plate / RHO)
    z, u = program.start.copy(), np.zeros_like(x)
    D = factor.solve(R.T @ (program.weights[:, None] * (z - x)) - bend)
    moments = np.empty_like(D)
    for k in range(1, iterations + 1):
        if k % renew == 0:
            limits = limits_at(program.before, program.stock, x + R @ D, limits, program.clearance, 1)
        planes = (limits.c, limits.n, limits.low, limits.high, limits.m, limits.h)
        splitting.sweep(R.indptr, R.indices, R.data, x, D, program.H, *planes, program.weights, RHO, RELAXATION, z, u, moments)
        D = factor.solve(moments - bend)
    return np.asarray(D)


def by_osqp(program: Program) -> Float[ndarray, "m 3"]:
    """The free moves by OSQP, with every limit a row: the same program, many times slower."""
    limits, count = program.limits, program.matrix.shape[0]
    energy, D = sp.csc_array(sp.block_diag([program.matrix] * 3)), np.zeros((count, 3))
    for _ in range(RENEWALS):
        rows = limits.rows(program.R, program.x)
        D = solve(energy, program.gradient.T.ravel(), rows, OSQP_TOLERANCE, D.T.ravel()).x.reshape(3, -1).T
        limits = limits_at(program.before, program.stock, program.x + program.R @ D, limits, program.clearance, 1)
    return D


@dataclass(frozen=True, eq=False)
class _Farthest:
    """The feet of the farthest points of the stock, as samples, and unit directions towards those points."""

    s: Float[ndarray, " f"]
    t: Float[ndarray, " f"]
    R: sp.csr_array
    feet: Float[ndarray, "f 3"]
    towards: Float[ndarray, "f 3"]
    weights: Float[ndarray, " f"]


def _farthest(before: TSpline, rest: Remaining, depth: float) -> _Farthest:
    least = rest.left - FARTHEST * depth
    candidates = np.flatnonzero(rest.at_most > least)
    candidates = candidates[:: 1 + len(candidates) // MOST_FARTHEST]
    start = rest.feet[candidates]
    s, t, c, _ = feet(before, rest.points[candidates], start[:, 0], start[:, 1], 3)
    across = rest.points[candidates] - c
    distance = np.linalg.norm(across, axis=1)
    weights = np.clip((distance - least) / (rest.left - least), 0, 1)
    kept = weights > 0
    weights = THEIR_WEIGHT * weights[kept] / weights.sum()
    return _Farthest(s[kept], t[kept], before.basis(s[kept], t[kept])[0], c[kept], unit(across[kept]), weights)


def _targets(
    before: TSpline, stock: Stock, x: ndarray, pull: ndarray, limits: Limits, height: ndarray, clearance: ndarray
) -> Float[ndarray, "k 3"]:
    """Where each sample should be: along its pull so far that its distance to the level before is `height`, or at the stock."""
    s, t = limits.s, limits.t
    cosine = np.maximum((limits.n * pull).sum(1), LEAST_COSINE)
    reach = np.minimum(height / cosine, LONGEST * height)
    for _ in range(2):
        y = x + reach[:, None] * pull
        s, t, c, _ = feet(before, y, s, t, 1)
        distance = np.linalg.norm(y - c, axis=1)
        slope = ((y - c) * pull).sum(1) / np.maximum(distance, np.finfo(float).tiny)
        reach = np.clip(reach + (height - distance) / np.maximum(slope, LEAST_COSINE), 0, LONGEST * height)
    return _inside(stock, x + reach[:, None] * pull, clearance)


def _inside(stock: Stock, points: ndarray, clearance: ndarray) -> Float[ndarray, "k 3"]:
    """The points, those less than their clearance inside the stock taken there along the shortest way."""
    beyond = np.maximum(stock.signed_distance(points) + clearance, 0)
    return np.asarray(points - beyond[:, None] * stock.outward(points))


def _factor(matrix: sp.csc_array) -> SuperLU:
    """Symmetric, positive definite: no pivots."""
    return splu(sp.csc_matrix(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
