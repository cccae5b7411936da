"""One level from the one before: a quadratic program on the control points' moves, tightened until what is measured holds.

The depth box holds each control point's move; because blending functions are non-negative and sum to one, the surface moves
by no more. Where directions spread (on convex places) it moves by less, so a control point may be allowed more than the
depth as long as no sample moves further: `Allowance` learns how much, from level to level. Samples that would leave the
stock or fall behind the level before get rows of their own.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.sparse.linalg import SuperLU, splu

from bonecam.levels.attraction import Attraction, unit
from bonecam.levels.energy import Samples, integration_points, thin_plate, with_poles
from bonecam.levels.limits import depth_box, frames, planes, sample_planes
from bonecam.levels.solve import Rows, solve, stacked
from bonecam.levels.stock import Stock
from bonecam.surface.tspline import TSpline

ROUNDS, LANDING_ROUNDS, SIDE, LANDING_SIDE, REACH, SHRINK = 3, 8, 0.05, 0.1, 2.0, 0.012
CLEAR, DAMPINGS = 0.008, 12
DIRECTION_STIFFNESS, FIT_STIFFNESS = 1e-6, 1e-9
DEPTH_SLACK, WALL_SLACK, NEST_SLACK, SOLVER_TOLERANCE = 0.002, 0.0005, 0.0005, 5e-5
DRAW_IN = 1.5
LEAST_GAIN, MOST_GAIN, SUPPORT = 0.9, 1.25, 0.1


@dataclass(frozen=True, eq=False)
class Setting:
    """What all levels of one morph share."""

    stock: Stock
    attraction: Attraction
    samples: Samples
    M: sp.csc_array
    support: sp.csc_array
    fit: SuperLU
    smooth: SuperLU

    def over_support(self, values: Float[ndarray, "n"]) -> Float[ndarray, "c"]:
        """For each control point the largest value among the samples it matters to."""
        return np.asarray(np.maximum.reduceat(values[self.support.indices], self.support.indptr[:-1]))


@dataclass(frozen=True, eq=False)
class Step:
    """The control points' moves and the allowance learnt; lengths in mm, measured on the samples."""

    moves: Float[ndarray, "c 3"]
    allowance: Float[ndarray, "c"]
    rounds: int
    outside: float
    behind: float


def setting_of(surface: TSpline, stock: Stock, attraction: Attraction) -> Setting:
    """The matrices and factors of one morph."""
    samples, M = with_poles(surface, *integration_points(surface)), thin_plate(surface)
    R = sp.csc_array(samples.R)
    largest = R.max(axis=0).toarray().ravel()
    R.data[R.data < SUPPORT * np.repeat(largest, np.diff(R.indptr))] = 0
    R.eliminate_zeros()
    fit, smooth = (splu(sp.csc_matrix(samples.N + stiffness * M)) for stiffness in (FIT_STIFFNESS, DIRECTION_STIFFNESS))
    return Setting(stock, attraction, samples, M, R, fit, smooth)


@dataclass(frozen=True, eq=False)
class _Place:
    """The level before, on the samples and the control points."""

    P: ndarray
    points: ndarray
    normals: ndarray
    gap: ndarray
    wall: ndarray
    pull: ndarray
    frame: ndarray
    to_wall: ndarray
    outward: ndarray


def _place(setting: Setting, P: ndarray) -> _Place:
    samples, stock = setting.samples, setting.stock
    points, normals = samples.R @ P, samples.normals(P)
    gap, wall = -stock.signed_distance(points), stock.outward(points)
    landing = _landing(setting, P, points + (gap - SHRINK)[:, None] * wall)
    direction = setting.smooth.solve(samples.moments(setting.attraction(points, normals, stock)))
    return _Place(P, points, normals, gap, wall, unit(samples.R @ direction), frames(direction), landing - P, stock.outward(P))


def _landing(setting: Setting, P: ndarray, nearest: ndarray) -> ndarray:
    """Where the control points lie once the level has landed: the best fit to the wall, drawn in until it is inside."""
    landing = setting.fit.solve(setting.samples.moments(nearest) + FIT_STIFFNESS * (setting.M @ P))
    for _ in range(LANDING_ROUNDS):
        outside = setting.over_support(setting.stock.signed_distance(setting.samples.R @ landing) + CLEAR)
        if outside.max() <= 0:
            break
        landing -= np.maximum(outside, 0)[:, None] * setting.stock.outward(landing)
    return landing


def _control_rows(place: _Place, reach: ndarray, room: ndarray) -> Rows:
    """Depth boxes, for control points about to land along their shortest way to the wall; and the wall itself."""
    lands = room < reach
    frame = np.where(lands[:, None, None], frames(place.outward), place.frame)
    up = np.where(lands, room, reach)
    box = depth_box(frame, up, np.where(lands, LANDING_SIDE, SIDE) * up)
    return stacked(box, planes(place.outward, np.full(len(room), -np.inf), room))


def next_level(setting: Setting, P: Float[ndarray, "c 3"], depth: float, stiffness: float, allowance: Float[ndarray, "c"]) -> Step:
    """The moves of the control points that bring the level one `depth` closer to the stock."""
    samples, R, place = setting.samples, setting.samples.R, _place(setting, P)
    H = place.points + np.clip(place.gap - SHRINK, 0, REACH * depth)[:, None] * place.pull
    energy = sp.csc_array(sp.block_diag([stiffness * setting.M + samples.N] * 3))
    gradient = (stiffness * (setting.M @ P) + samples.N @ P - samples.moments(H)).T.ravel()
    lags, none = np.zeros(len(H), dtype=bool), np.full(len(H), np.inf)
    room = (place.to_wall * place.outward).sum(1)
    for rounds in range(1, ROUNDS + 1):
        rows = _control_rows(place, depth * allowance, np.maximum(room, 0.0))
        if lags.any():
            rows = stacked(rows, sample_planes(R, lags, place.normals, np.zeros(len(H)), none))
        moves = solve(energy, gradient, rows, SOLVER_TOLERANCE).x.reshape(3, -1).T
        move = R @ moves
        size = np.linalg.norm(move, axis=1)
        outside, ahead = setting.stock.signed_distance(place.points + move), (place.normals * move).sum(1)
        allowance = _learnt(setting, allowance, np.linalg.norm(moves, axis=1) / depth, size / depth)
        if size.max() <= (1 + DEPTH_SLACK) * depth and outside.max() <= WALL_SLACK and ahead.min() >= -NEST_SLACK:
            break
        room -= np.maximum(setting.over_support(outside), 0) * DRAW_IN
        lags |= ahead < -NEST_SLACK
    return _damped(setting, place, moves, depth, allowance, rounds)


def _damped(setting: Setting, place: _Place, moves: ndarray, depth: float, allowance: ndarray, rounds: int) -> Step:
    """Shorten the moves round every sample that still breaks a limit; where nothing moves every limit holds."""
    for _ in range(DAMPINGS + 1):
        move = setting.samples.R @ moves
        size = np.linalg.norm(move, axis=1)
        outside, ahead = setting.stock.signed_distance(place.points + move), (place.normals * move).sum(1)
        share = np.minimum(1.0, depth / np.maximum(size, depth))
        risen = np.maximum(outside + place.gap, np.finfo(float).tiny)
        share = np.where(outside > 0, np.minimum(share, np.clip(1 - (outside + WALL_SLACK) / risen, 0, 0.9)), share)
        share = np.where(ahead < -NEST_SLACK, np.minimum(share, 0.5), share)
        if share.min() >= 1:
            break
        moves = moves * -setting.over_support(-share)[:, None]
    size = np.linalg.norm(setting.samples.R @ moves, axis=1)
    return Step(moves * min(1.0, depth / float(size.max())), allowance, rounds, float(outside.max()), float(ahead.min()))


def _learnt(setting: Setting, allowance: ndarray, moved: ndarray, speed: ndarray) -> ndarray:
    """Allow more where the limit held a control point and no sample near it used the depth up, less where one exceeded it."""
    most = setting.over_support(np.maximum(speed, LEAST_GAIN / MOST_GAIN))
    held = (moved > LEAST_GAIN * allowance) | (most > 1)
    return np.where(held, np.clip(allowance / most, LEAST_GAIN, MOST_GAIN), allowance)
