"""One level from the one before: its program is solved, and moves that break limits on the denser watched samples
are projected onto these limits.

A level's limits are planes at the closest points on the level before: a sample may slide along, its distance counts.
Near the stock levels do not all end in one surface, which no limit could tell apart: they stay `landing` mm
away from it, and every level may go a little further than the one before.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.kernels import matrices
from bonecam.levels.problem import Cut, Discretisation, Remaining, StepParameters, factorise, multiply
from bonecam.levels.program import limits_at, program_of, reverse_depths
from bonecam.levels.solvers.solver import solve
from bonecam.surface.query import rings

LARGEST_VIOLATION = 0.03
"""How far (mm) a level may break a limit as it is made; the places measured show what that comes to."""
ROUNDS, SWEEPS = 4, 20
"""How often the planes of the watched samples are set up, and how often moves are projected onto each of them."""
NEAR, ENOUGH = 0.005, 2e-4
"""Samples this near to a limit are projected, until all break theirs by less, mm."""
FOOT_STEPS = 3
"""Newton steps to the closest point on a level."""
STILL, MOVED = 1e-5, 0.005
"""A sample that has moved less (mm) in a turn is not farther from the new level than before, and one that has
moved less since its closest point was found keeps the planes there."""


@dataclass(frozen=True, eq=False)
class ExchangeStep:
    """The `moves` of the control points; how far the watched samples break a limit afterwards at most, mm, and
    at which `place`; the `infeasible` control points shape the level where it folds or breaks a limit by more
    than LARGEST_VIOLATION."""

    moves: Float[ndarray, "c 3"]
    broken: float
    place: Float[ndarray, "3"]
    infeasible: Bool[ndarray, " c"]


def next_level(
    discretisation: Discretisation,
    P: Float[ndarray, "c 3"],
    rest: Remaining,
    cut: Cut,
    parameters: StepParameters,
    pull_factor: Float[ndarray, " c"] | None = None,
    solver: str = "admm",
) -> ExchangeStep:
    """The moves of the control points to the next level; what is nearer to the stock than `cut.landing`
    already stays.

    `pull_factor` is a factor of the pull on each control point (1 unless given), less where the level would fold.
    """
    program = program_of(discretisation, P, rest=rest, cut=cut, parameters=parameters, pull_factor=pull_factor)
    return _project_onto_limits(discretisation, P, solve(program, solver), cut)


def project_level(
    discretisation: Discretisation, P: Float[ndarray, "c 3"], level: Float[ndarray, "c 3"], cut: Cut
) -> ExchangeStep:
    """The moves from P nearest to those to `level` that keep the limits of the watched samples."""
    free = discretisation.free
    D = np.asarray(factorise(sp.csc_array(free.T @ free)).solve(free.T @ (level - P)))
    return _project_onto_limits(discretisation, P, D, cut)


def _project_onto_limits(discretisation: Discretisation, P: ndarray, D: ndarray, cut: Cut) -> ExchangeStep:
    """The step of the free moves D, which are projected onto the limits that watched samples break."""
    free, stock = discretisation.free, discretisation.stock
    level = P + free @ D
    before = discretisation.surface.with_control_points(P)
    watch = discretisation.watched(level, P)
    x, y = multiply(watch.R, P), multiply(watch.R, level)
    gap = -stock.signed_distance(x)
    limits = limits_at(before, stock, cut=cut, gap=gap, y=y, s=watch.s, t=watch.t, steps=FOOT_STEPS)
    set_up = y
    broken = limits.broken(y)
    far = limits.high
    for turn in range(ROUNDS + 1):
        after = before.with_control_points(level)
        back = reverse_depths(
            after, x, y=y, s=watch.s, t=watch.t, foot_s=limits.s, foot_t=limits.t, far=far, steps=FOOT_STEPS
        )
        broken_back = back.away - limits.high[back.which]
        if max(broken.max(), broken_back.max(initial=0)) <= ENOUGH or turn == ROUNDS:
            break
        near = np.flatnonzero(broken > -NEAR)
        R_back = after.basis(back.s, back.t)[0]
        R = sp.csr_array(sp.vstack([watch.R[near], R_back]) @ free)
        start = np.vstack([x[near], R_back @ P])
        planes = limits.only(near).planes_with(x[back.which], back.n, limits.high[back.which])
        matrices.project(
            indptr=R.indptr, indices=R.indices, data=R.data, x=start, D=D, planes=planes, sweeps=SWEEPS, enough=ENOUGH
        )

        level = P + free @ D
        there = y
        y = multiply(watch.R, level)
        far = np.where(lengths(y - there) > STILL, limits.high, np.inf)
        moved = np.flatnonzero(lengths(y - set_up) > MOVED)
        limits = limits.renew(moved, y, 1)
        set_up[moved] = y[moved]
        broken = limits.broken(y)
    broken[back.which] = np.maximum(broken[back.which], broken_back)
    worst = int(np.argmax(broken))
    # Whether the new level faces against the `normals` of the one before, at each watched sample
    _, along, across = after.derivatives(watch.s, np.clip(watch.t, *rings(after)), 1)
    infeasible = watch.near(np.asarray(dots(np.cross(along, across), limits.n) <= 0) | (broken > LARGEST_VIOLATION))
    return ExchangeStep(np.asarray(level - P), float(broken[worst]), y[worst], infeasible)
