"""One level from the one before: its program solved (`program.py`), and what is still broken on the denser
watched samples projected away.

A level's limits are planes at feet on the level before: a place may slide along, what counts is its distance.
Near the stock levels do not all end in one surface, which no limit could tell apart: they stay `landing` mm
away from it, and every level may go a little further than the one before.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.kernels import admm as kernel
from bonecam.levels.problem.cut import Cut, StepParameters
from bonecam.levels.problem.discretisation import Setting
from bonecam.levels.problem.factorisation import factorise
from bonecam.levels.problem.limits.planes import limits_at
from bonecam.levels.problem.limits.reverse_depth import behind
from bonecam.levels.problem.program import program_of
from bonecam.levels.problem.remaining import Remaining
from bonecam.levels.problem.samples import combined
from bonecam.levels.solvers.solver import solve
from bonecam.surface.query.closest_point import rings

MENDABLE = 0.03
"""How far (mm) a level may break a limit as it is made, or as it is mended; the places measured show what
that comes to."""
ROUNDS, SWEEPS, NEAR, ENOUGH, FOOT_STEPS = 4, 20, 0.005, 2e-4, 3
STILL, MOVED = 1e-5, 0.005
"""A sample that has moved less (mm) in a turn is not farther from the new level than before, and one that has
moved less since its foot was found keeps the planes there."""


@dataclass(frozen=True, eq=False)
class Step:
    """The control points' moves, how far the watched samples break a limit afterwards, mm, where, and which
    control points shape the level where it folds or breaks one by more than MENDABLE."""

    moves: Float[ndarray, "c 3"]
    broken: float
    place: Float[ndarray, "3"]
    amiss: Bool[ndarray, " c"]


def next_level(
    setting: Setting,
    P: Float[ndarray, "c 3"],
    rest: Remaining,
    cut: Cut,
    parameters: StepParameters,
    ease: Float[ndarray, " c"] | None = None,
    solver: str = "admm",
) -> Step:
    """The moves of the control points to the next level; what is nearer to the stock than `cut.landing`
    already stays.

    `ease` is a factor of the pull on each control point (1 unless given), less where the level would fold.
    """
    program = program_of(setting, P, rest, cut, parameters, ease)
    return _kept(setting, P, solve(program, solver), cut)


def kept_level(setting: Setting, P: Float[ndarray, "c 3"], level: Float[ndarray, "c 3"], cut: Cut) -> Step:
    """The moves from P to about that level, which keep the limits of the watched samples."""
    free = setting.free
    return _kept(
        setting, P, np.asarray(factorise(sp.csc_array(free.T @ free)).solve(free.T @ (level - P))), cut
    )


def _kept(setting: Setting, P: ndarray, D: ndarray, cut: Cut) -> Step:
    """The free moves, projected onto what the watched samples still break."""
    free, stock, level = setting.free, setting.stock, P + setting.free @ D
    watch, before = setting.watched(level, P), setting.surface.with_control_points(P)
    x, y = combined(watch.R, P), combined(watch.R, level)
    gap = -stock.signed_distance(x)
    limits = limits_at(before, stock, cut, gap, y, watch.s, watch.t, FOOT_STEPS)
    set_up, broken, far = y, limits.broken(y), limits.high
    for turn in range(ROUNDS + 1):
        after = before.with_control_points(level)
        back = behind(after, x, y, watch.s, watch.t, limits.s, limits.t, far, FOOT_STEPS)
        broken_back = back.away - limits.high[back.which]
        if max(broken.max(), broken_back.max(initial=0)) <= ENOUGH or turn == ROUNDS:
            break
        near, R_back = np.flatnonzero(broken > -NEAR), after.basis(back.s, back.t)[0]
        some, start = (
            sp.csr_array(sp.vstack([watch.R[near], R_back]) @ free),
            np.vstack([x[near], R_back @ P]),
        )
        planes = limits.only(near).planes_with(x[back.which], back.n, limits.high[back.which])
        kernel.project(some.indptr, some.indices, some.data, start, D, *planes, SWEEPS, ENOUGH)
        level = P + free @ D
        there, y = y, combined(watch.R, level)
        far = np.where(lengths(y - there) > STILL, limits.high, np.inf)
        moved = np.flatnonzero(lengths(y - set_up) > MOVED)
        limits = limits.again(moved, y, 1)
        set_up[moved] = y[moved]
        broken = limits.broken(y)
    broken[back.which] = np.maximum(broken[back.which], broken_back)
    worst = int(np.argmax(broken))
    _, along, across = after.derivatives(watch.s, np.clip(watch.t, *rings(before)), 1)
    folded = dots(np.cross(along, across), limits.n) <= 0
    return Step(
        np.asarray(level - P), float(broken[worst]), y[worst], watch.near(folded | (broken > MENDABLE))
    )
