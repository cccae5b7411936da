"""One level from the one before: a quadratic program on the control points' moves, tightened until what is measured holds.

The depth box holds each control point's move; because blending functions are non-negative and sum to one, the surface moves
by no more. Where directions spread (on convex places) it moves by less, so a control point may be allowed more than the
depth as long as no sample moves further: the allowance learns how much, from level to level. Near the wall a control
point lands where the fitted wall has it; what still breaks a limit on the watched samples is tightened and solved again,
and what is left after that is shortened, for a level that does not move breaks nothing.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.limits import depth_box, frames, planes
from bonecam.levels.setting import SHRINK, Place, Setting, place_of
from bonecam.levels.solve import Rows, solve, stacked

ROUNDS, SWEEPS, RELAXATION, DAMPINGS, REACH = 2, 100, 1.0, 20, 2.0
SIDE, LANDING_SIDE = 0.05, 0.1
MOMENTUM = 0.7
INSIDE, NEST_LIMIT = 0.006, 0.0004
DEPTH_SLACK, WALL_SLACK, NEST_SLACK, SOLVER_TOLERANCE = 0.002, 0.0002, 0.0001, 5e-5
LEAST_GAIN, MOST_GAIN, GENTLE, HALF = 0.9, 3.0, 0.9, 0.5
LEAST_SPEED = 0.72
AIM, AIM_SHARE = 0.0005, 0.02


@dataclass(frozen=True, eq=False)
class Step:
    """The control points' moves and the allowance learnt; lengths in mm, measured on the watched samples."""

    moves: Float[ndarray, "c 3"]
    allowance: Float[ndarray, "c"]
    outside: float
    behind: float


@dataclass(frozen=True, eq=False)
class _Watched:
    """What moves do to the watched samples: how far they go, how far outside the stock and how far ahead they end."""

    size: ndarray
    outside: ndarray
    ahead: ndarray

    def holds(self, depth: float) -> bool:
        return bool(self.size.max() <= (1 + DEPTH_SLACK) * depth and self.outside.max() <= WALL_SLACK and self.ahead.min() >= -NEST_SLACK)


def _watch(setting: Setting, place: Place, moves: ndarray) -> _Watched:
    move = setting.watch.R @ moves
    outside = setting.stock.signed_distance(place.watched + move) + INSIDE
    return _Watched(np.linalg.norm(move, axis=1), outside, (place.normals * move).sum(1))


def _control_rows(place: Place, reach: ndarray, room: ndarray) -> Rows:
    """Depth boxes, for control points about to land along their shortest way to the wall; and the wall itself."""
    lands = room < reach
    frame = np.where(lands[:, None, None], frames(place.outward), place.frame)
    up = np.where(lands, room, reach)
    box = depth_box(frame, up, np.where(lands, LANDING_SIDE, SIDE) * up)
    return stacked(box, planes(place.outward, np.full(len(room), -np.inf), room))


def next_level(setting: Setting, P: Float[ndarray, "c 3"], depth: float, stiffness: float, allowance: Float[ndarray, "c"]) -> Step:
    """The moves of the control points that bring the level one `depth` closer to the stock."""
    samples, place = setting.samples, place_of(setting, P)
    H = place.points + np.clip(place.gap - SHRINK, 0, REACH * depth)[:, None] * place.pull
    energy = sp.csc_array(sp.block_diag([stiffness * setting.M + samples.N] * 3))
    gradient = (stiffness * (setting.M @ P) + samples.N @ P - samples.moments(H)).T.ravel()
    room = place.room
    for _ in range(ROUNDS):
        rows = _control_rows(place, depth * allowance, np.maximum(room, 0.0))
        moves = solve(energy, gradient, rows, SOLVER_TOLERANCE).x.reshape(3, -1).T
        found = _watch(setting, place, moves)
        allowance = _learnt(setting, allowance, np.linalg.norm(moves, axis=1) / depth, found.size / depth)
        if found.holds(depth):
            break
        room = room - np.maximum(setting.over_support(found.outside), 0)
    return _damped(setting, place, _projected(setting, place, moves, depth), depth, allowance)


def _projected(setting: Setting, place: Place, moves: ndarray, depth: float) -> ndarray:
    """Moves close to these that keep every limit on the watched samples: simultaneous projections onto the broken ones.

    x += C R'v with v the shortest correction of each broken sample and C the reciprocal column sums (SIRT; rows sum to one).
    """
    R = setting.watch.R
    wall_limit = np.maximum(setting.stock.signed_distance(place.watched) + INSIDE, 0)
    aim = np.clip(-AIM_SHARE * setting.stock.signed_distance(place.watched), 0, AIM)
    push = np.zeros_like(moves)
    for _ in range(SWEEPS):
        move = R @ moves
        found = _watch(setting, place, moves)
        out = np.maximum(found.outside - wall_limit, 0)
        behind = np.maximum(aim - found.ahead, 0)
        beyond = np.maximum(found.size - depth, 0)
        broken = np.flatnonzero((out > WALL_SLACK / 2) | (behind > NEST_SLACK) | (beyond > DEPTH_SLACK * depth))
        if not len(broken):
            break
        part, here = R[broken], place.watched[broken] + move[broken]
        v = behind[broken, None] * place.normals[broken] - out[broken, None] * setting.stock.outward(here)
        v -= (beyond / np.maximum(found.size, depth))[broken, None] * move[broken]
        columns = np.asarray(part.sum(axis=0)).ravel()
        push = MOMENTUM * push + RELAXATION * (part.T @ v) / np.where(columns > 0, columns, 1.0)[:, None]
        moves = moves + push
    return moves


def _damped(setting: Setting, place: Place, moves: ndarray, depth: float, allowance: ndarray) -> Step:
    """Shorten the moves round every sample that still breaks a limit; where nothing moves every limit holds."""
    before = setting.stock.signed_distance(place.watched) + INSIDE
    most_outside = np.maximum(before, INSIDE)
    for _ in range(DAMPINGS):
        found = _watch(setting, place, moves)
        share = depth / np.maximum(found.size, depth)
        less = np.clip(1 - (found.outside - most_outside) / np.maximum(found.outside - before, WALL_SLACK), 0, GENTLE)
        share = np.where(found.outside > most_outside, np.minimum(share, less), share)
        share = np.where(found.ahead < -NEST_LIMIT, np.minimum(share, HALF), share)
        if share.min() >= 1:
            break
        moves = moves * setting.least_share(share)[:, None]
    found = _watch(setting, place, moves)
    return Step(moves * min(1.0, depth / float(found.size.max())), allowance, float(found.outside.max()), float(found.ahead.min()))


def _learnt(setting: Setting, allowance: ndarray, moved: ndarray, speed: ndarray) -> ndarray:
    """Allow more where the limit held a control point and no sample near it used the depth up, less where one exceeded it."""
    most = setting.over_support(np.maximum(speed, LEAST_SPEED))
    held = (moved > LEAST_GAIN * allowance) | (most > 1)
    return np.where(held, np.clip(allowance / most, LEAST_GAIN, MOST_GAIN), allowance)
