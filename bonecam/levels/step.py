"""One level from the one before: a quadratic program on the control points' moves D.

    min  stiffness D'MD + int |S_new - H|^2      S_new = S + R D, the integral over the surface
    s.t. depth, nesting and stock at samples     (`limits.py`)

H lies along the pull, beyond the depth, so that every place goes as far as its limits let it. A level's limits are planes at
feet on the level before: a place may slide along, what counts is its distance. The program is solved by splitting (ADMM, as OSQP
does it): samples go to the nearest point of their own limits, control points to the least-squares fit of the samples, and the
matrix of that fit is the same for x, y and z and for all iterations: one small factor a level. What is left broken on the denser
watched samples is projected away.

Near the stock levels do not all end in one surface, which no limit could tell apart: they stay `landing` mm away from it, and
every level may go a little further than the one before.
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
from bonecam.levels.setting import Setting
from bonecam.levels.solve import solve
from bonecam.levels.stock import Stock
from bonecam.surface.tspline import TSpline

ITERATIONS, RENEW, RHO, RELAXATION = 100, 20, 8.0, 1.6
BEYOND, LONGEST, LEAST_COSINE = 2.0, 2.0, 0.3
EVEN = 0.05
RENEWALS, OSQP_TOLERANCE = 3, 1e-5
DEPTH_MARGIN, DEPTH_SHARE, NEST_MARGIN, NEST_SHARE, SPARE = 0.001, 0.01, 0.001, 0.05, 0.02
ROUNDS, SWEEPS, NEAR, ENOUGH, FOOT_STEPS = 4, 20, 0.005, 2e-4, 3


@dataclass(frozen=True, eq=False)
class Step:
    """The control points' moves, and how far the watched samples break a limit afterwards, mm."""

    moves: Float[ndarray, "c 3"]
    broken: float
    folded: bool


@dataclass(frozen=True, eq=False)
class Program:
    """min sum_l w_l |x_l + R_l D - H_l|^2 + D'(stiffness M)D within `limits`: one level, its limits set up at the targets."""

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

    @property
    def matrix(self) -> sp.csc_array:
        """Half the energy's second derivative, for each of x, y and z."""
        return sp.csc_array(self.N + self.plate)

    def energy(self, moves: Float[ndarray, "c 3"]) -> float:
        """What is made least."""
        pull = self.weights @ ((self.x - self.H) ** 2).sum(1) + 2 * np.einsum("ij,ij->", self.gradient, moves)
        return float(np.einsum("ij,ij->", moves, self.matrix @ moves) + pull)

    @property
    def gradient(self) -> Float[ndarray, "c 3"]:
        """Half the energy's gradient at D = 0."""
        return np.asarray(self.R.T @ (self.weights[:, None] * (self.x - self.H)))


def next_level(
    setting: Setting, P: Float[ndarray, "c 3"], depth: float, stiffness: float, smoothing: float, landing: float, method: str = "qp"
) -> Step:
    """The moves of the control points to the next level, at most `depth` mm away and at least `landing` mm inside the stock.

    What is nearer to the stock already stays. `smoothing` is the thin-plate weight on the field of directions.
    """
    program = program_of(setting, P, depth, stiffness, smoothing, landing)
    return _kept(setting, P, split(program) if method == "qp" else by_osqp(program), depth, landing)


def program_of(setting: Setting, P: Float[ndarray, "c 3"], depth: float, stiffness: float, smoothing: float, landing: float) -> Program:
    """The program of one level."""
    samples, stock, before = setting.samples, setting.stock, setting.surface.with_control_points(P)
    x, area = samples.R @ P, np.linalg.norm(stretched := samples.stretched(P), axis=1)
    weights = area * samples.weights
    weights = weights / weights.sum() + EVEN / len(x)
    N = sp.csc_array(samples.R.T @ sp.diags_array(weights) @ samples.R)
    gap = -stock.signed_distance(x)
    normals = stretched / np.maximum(area, np.finfo(float).tiny)[:, None]
    pull = setting.attraction(x, normals, stock)
    pull = unit(samples.R @ _factor(N + smoothing * setting.M).solve(samples.R.T @ (weights[:, None] * pull)))
    limits = unset(normals, samples.s, samples.t, *_heights(gap, depth, landing))
    target = _targets(before, stock, x, pull, limits, np.minimum(gap, landing))
    clearance = np.minimum(gap, landing - SPARE)
    limits = limits_at(before, stock, target, limits, clearance, 2)
    H = _inside(stock, limits.c + BEYOND * (target - limits.c), np.minimum(gap, landing))
    return Program(before, stock, samples.R, x, weights, H, target, clearance, limits, N, sp.csc_array(stiffness * setting.M))


def split(program: Program, iterations: int = ITERATIONS, renew: int = RENEW) -> Float[ndarray, "c 3"]:
    """The moves by splitting; every `renew` iterations the limits are set up again where the samples are."""
    limits, R, x = program.limits, program.R, program.x
    factor = _factor(program.N + program.plate / RHO)
    z, u = program.start.copy(), np.zeros_like(x)
    D = factor.solve(R.T @ (program.weights[:, None] * (z - x)))
    moments = np.empty_like(D)
    for k in range(1, iterations + 1):
        if k % renew == 0:
            limits = limits_at(program.before, program.stock, x + R @ D, limits, program.clearance, 1)
        planes = (limits.c, limits.n, limits.low, limits.high, limits.m, limits.h)
        splitting.sweep(R.indptr, R.indices, R.data, x, D, program.H, *planes, program.weights, RHO, RELAXATION, z, u, moments)
        D = factor.solve(moments)
    return np.asarray(D)


def by_osqp(program: Program) -> Float[ndarray, "c 3"]:
    """The moves by OSQP, with every limit a row: the same program, many times slower."""
    limits, count = program.limits, program.matrix.shape[0]
    energy, D = sp.csc_array(sp.block_diag([program.matrix] * 3)), np.zeros((count, 3))
    for _ in range(RENEWALS):
        rows = limits.rows(program.R, program.x)
        D = solve(energy, program.gradient.T.ravel(), rows, OSQP_TOLERANCE, D.T.ravel()).x.reshape(3, -1).T
        limits = limits_at(program.before, program.stock, program.x + program.R @ D, limits, program.clearance, 1)
    return D


def _kept(setting: Setting, P: ndarray, D: ndarray, depth: float, landing: float) -> Step:
    """The moves, projected onto what the watched samples still break."""
    watch, stock, before = setting.watch, setting.stock, setting.surface.with_control_points(P)
    x = watch.R @ P
    gap = -stock.signed_distance(x)
    limits, clearance = unset(np.zeros_like(x), watch.s, watch.t, *_heights(gap, depth, landing)), np.minimum(gap, landing - SPARE)
    for k in range(ROUNDS + 1):
        y = x + watch.R @ D
        limits = limits_at(before, stock, y, limits, clearance, FOOT_STEPS if k == 0 else 1)
        broken = limits.broken(y)
        if broken.max() <= ENOUGH or k == ROUNDS:
            break
        near = np.flatnonzero(broken > -NEAR)
        part, R = limits.only(near), sp.csr_array(watch.R[near])
        planes = (part.c, part.n, part.low, part.high, part.m, part.h)
        splitting.project(R.indptr, R.indices, R.data, x[near], D, *planes, SWEEPS, ENOUGH)
    folded = ((watch.stretched(P + D) * limits.n).sum(1) <= 0).any()
    return Step(D, float(broken.max()), bool(folded))


def _heights(gap: ndarray, depth: float, landing: float) -> tuple[ndarray, ndarray]:
    """Lowest and largest height of each sample over the level before: a little more than nested where there is room."""
    room = np.clip(NEST_SHARE * (gap - (landing - SPARE)), 0, NEST_MARGIN)
    return room, np.full(len(gap), depth - min(DEPTH_MARGIN, DEPTH_SHARE * depth))


def _targets(before: TSpline, stock: Stock, x: ndarray, pull: ndarray, limits: Limits, clearance: ndarray) -> ndarray:
    """Where each sample should be: along its pull so far that its distance to the level before is the depth, or at the stock."""
    depth, s, t = limits.high, limits.s, limits.t
    cosine = np.maximum((limits.n * pull).sum(1), LEAST_COSINE)
    reach = np.minimum(depth / cosine, LONGEST * depth)
    for _ in range(2):
        y = x + reach[:, None] * pull
        s, t, c, _ = feet(before, y, s, t, 1)
        distance = np.linalg.norm(y - c, axis=1)
        slope = ((y - c) * pull).sum(1) / np.maximum(distance, np.finfo(float).tiny)
        reach = np.clip(reach + (depth - distance) / np.maximum(slope, LEAST_COSINE), 0, LONGEST * depth)
    return _inside(stock, x + reach[:, None] * pull, clearance)


def _inside(stock: Stock, points: ndarray, clearance: ndarray) -> ndarray:
    """The points, those less than their clearance inside the stock taken there along the shortest way."""
    beyond = np.maximum(stock.signed_distance(points) + clearance, 0)
    return np.asarray(points - beyond[:, None] * stock.outward(points))


def _factor(matrix: sp.csc_array) -> SuperLU:
    """Symmetric, positive definite: no pivots."""
    return splu(sp.csc_matrix(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
