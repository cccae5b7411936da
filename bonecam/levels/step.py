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
from bonecam.levels.energy import Samples, integration_points, samples_of, thin_plate
from bonecam.levels.limits import depth_box, frames, planes, sample_planes
from bonecam.levels.solve import Rows, solve, stacked
from bonecam.levels.stock import Stock
from bonecam.surface.tspline import TSpline

ROUNDS, SIDE, REACH, SHRINK = 4, 0.2, 2.0, 0.01
DIRECTION_STIFFNESS, FIT_STIFFNESS = 1e-6, 1e-9
DEPTH_SLACK, WALL_SLACK, NEST_SLACK, SOLVER_TOLERANCE = 0.002, 0.0005, 0.0005, 5e-5
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
    samples, M = samples_of(surface, *integration_points(surface)), thin_plate(surface)
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
    landing = setting.fit.solve(samples.moments(points + (gap - SHRINK)[:, None] * wall) + FIT_STIFFNESS * (setting.M @ P))
    direction = setting.smooth.solve(samples.moments(setting.attraction(points, normals, stock)))
    return _Place(P, points, normals, gap, wall, unit(samples.R @ direction), frames(direction), landing - P, stock.outward(P))


def _control_rows(place: _Place, reach: ndarray) -> Rows:
    """Depth boxes, those of control points about to land in the frame of their way to the wall; and the wall itself."""
    way, room = np.linalg.norm(place.to_wall, axis=1), (place.to_wall * place.outward).sum(1)
    lands = way < reach
    frame = np.where(lands[:, None, None], frames(place.to_wall), place.frame)
    up = np.where(lands, np.where(room > 0, way, 0.0), reach)
    box = depth_box(frame, up, SIDE * up)
    return stacked(box, planes(place.outward, np.full(len(room), -np.inf), np.maximum(room, 0.0)))


def next_level(setting: Setting, P: Float[ndarray, "c 3"], depth: float, stiffness: float, allowance: Float[ndarray, "c"]) -> Step:
    """The moves of the control points that bring the level one `depth` closer to the stock."""
    samples, R, place = setting.samples, setting.samples.R, _place(setting, P)
    H = place.points + np.clip(place.gap - SHRINK, 0, REACH * depth)[:, None] * place.pull
    energy = sp.csc_array(sp.block_diag([stiffness * setting.M + samples.N] * 3))
    gradient = (stiffness * (setting.M @ P) + samples.N @ P - samples.moments(H)).T.ravel()
    leaves, lags = np.zeros(len(H), dtype=bool), np.zeros(len(H), dtype=bool)
    back, free = np.zeros(len(H)), np.full(len(H), np.inf)
    for rounds in range(1, ROUNDS + 1):
        rows = [_control_rows(place, depth * allowance)]
        if leaves.any():
            rows.append(sample_planes(R, leaves, place.wall, -free, np.maximum(place.gap - back, 0)))
        if lags.any():
            rows.append(sample_planes(R, lags, place.normals, np.zeros(len(H)), free))
        moves = solve(energy, gradient, stacked(*rows), SOLVER_TOLERANCE).x.reshape(3, -1).T
        move = R @ moves
        size = np.linalg.norm(move, axis=1)
        outside, ahead = setting.stock.signed_distance(place.points + move), (place.normals * move).sum(1)
        allowance = _learnt(setting, allowance, np.linalg.norm(moves, axis=1) / depth, size / depth)
        if size.max() <= (1 + DEPTH_SLACK) * depth and outside.max() <= WALL_SLACK and ahead.min() >= -NEST_SLACK:
            break
        back = np.where(outside > 0, back + outside + WALL_SLACK / 2, back)
        leaves |= outside > 0
        lags |= ahead < 0
    shrink = min(1.0, depth / float(size.max()))
    return Step(shrink * moves, allowance, rounds, float(outside.max()), float(ahead.min()))


def _learnt(setting: Setting, allowance: ndarray, moved: ndarray, speed: ndarray) -> ndarray:
    """Allow more where the limit held a control point and no sample near it used the depth up, less where one exceeded it."""
    most = setting.over_support(np.maximum(speed, LEAST_GAIN / MOST_GAIN))
    held = (moved > LEAST_GAIN * allowance) | (most > 1)
    return np.where(held, np.clip(allowance / most, LEAST_GAIN, MOST_GAIN), allowance)
