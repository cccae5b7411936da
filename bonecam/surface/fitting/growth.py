"""Growing the T-mesh of a fit: a coarse start, knots where samples are missed, knots out again where they can
be spared."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bonecam.mesh.sections.harmonic_rows import Rows
from bonecam.progress import Progress, report, silent
from bonecam.surface.fitting.adapt import Votes, miss_votes, refine
from bonecam.surface.fitting.initial_surface import first_tmesh, through_loops, transfer
from bonecam.surface.fitting.prune import prune
from bonecam.surface.fitting.steps import FINAL_PLANE_WEIGHT, LEAST_FACING, OFF, flatten_poles, fold_grid, step
from bonecam.surface.fitting.target import FitTarget
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

FIRST_SHARE = 0.6
"""Share of the control points that may be spent on a first surface without folds."""

GROWING_PLANE_WEIGHT = 0.3
"""Weight of the planes through the poles while the T-mesh grows, times the mean area of a control point."""

STEPS = 2
"""Steps after each refinement."""

FINAL_STEPS = 4
"""Last steps with plane poles, of which the best is taken."""

GOAL = 0.95
"""Share of the tolerance: no sample may be farther, so that the dense measurement finds less above it."""

GAIN = 0.93
"""A round of taking knots out that leaves a larger share of the control points, or of the largest distance,
halves the share of the next round."""


@dataclass(frozen=True)
class Pruning:
    """How boldly knots are taken out.

    `spare` is a share of the tolerance where that is reached, of the largest distance where it is not: no sample may
    pass it for the lack of a knot. `removable` is the share of the control points that may go in one round, and
    `least_share` the last share of it that is tried.
    """

    spare: float
    removable: float
    least_share: float


REACHED = Pruning(spare=0.95, removable=0.4, least_share=0.3)
"""Where the surface meets the tolerance."""

MISSED = Pruning(spare=0.8, removable=0.2, least_share=0.1)
"""Where it does not."""

FIRST = ((150, 9, 10), (40, 5, 6))
"""From so many control points allowed: spans in t, and knots in a row, of the first T-mesh."""

MAX_STALLED = 3
"""Refinements of the first surface without a clearly smaller number of folded places."""

LEAST_POINTS = FIRST[-1][0]
"""Fewest control points that a fit can be limited to."""

Refine = Callable[[RowTMesh, Votes, int], RowTMesh]
"""A finer T-mesh from the votes for it and the number of control points it may have more."""
Prune = Callable[[TSpline, FitTarget, float, int], RowTMesh]
"""A T-mesh with fewer knots, at most so many fewer, for which no sample should pass the limit (mm)."""


@dataclass(frozen=True)
class Aim:
    """The tolerance (mm) and the most control points of a fit, how its T-mesh changes, and the share of
    their size that rings round poles may be off ellipses.
    """

    tolerance: float
    most: int
    refine: Refine = refine
    prune: Prune = prune
    off: float = OFF


def grow(surface: TSpline, target: FitTarget, aim: Aim, progress: Progress = silent) -> tuple[TSpline, FitTarget]:
    """The surface refined where samples are missed, until none is or the control points are spent.

    The last steps make the poles' surroundings plane. Also the target with the closest points on it.
    """
    first = target.worst / (GOAL * aim.tolerance)
    while target.worst > GOAL * aim.tolerance and surface.tmesh.size < aim.most:
        size = surface.tmesh.size
        worst = target.worst
        way = 1 - np.log(worst / (GOAL * aim.tolerance)) / np.log(first)
        report(progress, float(np.clip(max(way, size / aim.most), 0, 1)), f"{size} control points, {worst:.3f} mm")
        votes = miss_votes(surface, target.all, GOAL * aim.tolerance)
        assert isinstance(surface.tmesh, RowTMesh)
        tmesh = aim.refine(surface.tmesh, votes, aim.most - size)
        if tmesh.size == size:
            break
        surface = transfer(surface, tmesh)
        surface, target = settle(surface, target.on(surface, aim.tolerance).denser(surface), aim)
        if target.worst > worst:  # new knots are not settled yet: no vote on that
            surface, target = settle(surface, target, aim, 1)
    best = surface, target
    for number in range(FINAL_STEPS):
        surface, target = settle(surface, target, aim, 1, FINAL_PLANE_WEIGHT)
        if number == 0 or target.worst < best[1].worst:
            best = surface, target
    surface = flatten_poles(best[0])
    return surface, best[1].on(surface, aim.tolerance)


def thin(surface: TSpline, target: FitTarget, aim: Aim) -> tuple[TSpline, FitTarget]:
    """The surface without the knots that can be spared, and grown again where it is missed.

    Rounds go on as long as they leave clearly fewer control points, or a clearly smaller distance.
    """
    share = 1.0
    folded = target.folded(surface)
    while True:
        reached = target.worst <= aim.tolerance
        pruning = REACHED if reached else MISSED
        if share <= pruning.least_share:
            break
        size = surface.tmesh.size
        worst = target.worst
        tmesh = aim.prune(
            surface, target, pruning.spare * max(aim.tolerance, worst), round(share * pruning.removable * size)
        )
        fewer = transfer(surface, tmesh)
        fewer, new_target = settle(fewer, target.on(fewer, aim.tolerance), aim)
        fewer, new_target = grow(fewer, new_target, replace(aim, most=size - 1 if reached else aim.most))
        better = new_target.worst <= (aim.tolerance if reached else worst) and (folded or not new_target.folded(fewer))
        gained = fewer.tmesh.size / size if reached else new_target.worst / worst
        if better:
            surface = fewer
            target = new_target
        if not better or gained > GAIN:
            share /= 2
    return surface, target


def first_surface(rows: Rows, target: FitTarget, aim: Aim) -> tuple[TSpline, FitTarget]:
    """A coarse surface with the parameters of the rows, and the closest points on it.

    Its T-mesh grows as long as the surface folds less.
    """
    spans, knots = next(first[1:] for first in FIRST if first[0] <= aim.most)
    tmesh = first_tmesh(spans, knots)
    best = through_loops(rows, tmesh)
    surface = best
    fewest = folded_places(best, target)
    stalled = 0
    while fewest > 0 and stalled < MAX_STALLED:
        votes = miss_votes(surface, target.on(surface, aim.tolerance).all, aim.tolerance)
        finer = aim.refine(tmesh, votes, round(FIRST_SHARE * aim.most) - tmesh.size)
        if finer.size == tmesh.size:
            break
        tmesh = finer
        surface = through_loops(rows, finer)
        folded = folded_places(surface, target)
        stalled = 0 if folded < GAIN * fewest else stalled + 1
        if folded < fewest:
            best = surface
            fewest = folded
    return best, target.on(best, aim.tolerance)


def folded_places(surface: TSpline, target: FitTarget) -> int:
    """How many places of the fold grid do not face as the mesh does; the tip of a cone never does."""
    return int((target.shape.facing(surface, *fold_grid(surface)) <= LEAST_FACING).sum())


def settle(
    surface: TSpline, target: FitTarget, aim: Aim, steps: int = STEPS, plane: float = GROWING_PLANE_WEIGHT
) -> tuple[TSpline, FitTarget]:
    """`steps` steps of the fit, each followed by the search for the closest points."""
    for _ in range(steps):
        surface = step(surface, target, aim.tolerance, plane, aim.off)
        target = target.on(surface, aim.tolerance)
    return surface, target
