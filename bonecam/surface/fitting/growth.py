"""Growing the T-mesh of a fit: a coarse start, knots where samples are missed, knots out again where they can
be spared."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.sections.rows import Rows
from bonecam.progress import Progress, report, silent
from bonecam.surface.basis.gauss import element_points
from bonecam.surface.basis.periodic import FEWEST
from bonecam.surface.fitting.adapt import Votes, miss_votes, refine
from bonecam.surface.fitting.prune import prune
from bonecam.surface.fitting.quadratic import Form, Term
from bonecam.surface.fitting.steps import LEAST_FACING, OFF, flattened, fold_grid, step
from bonecam.surface.fitting.target import Target
from bonecam.surface.tmesh.rows import RowTMesh
from bonecam.surface.tspline import TSpline

ROUGH_SHARE = 0.6  # of the control points may be spent on a first surface without folds
LOOSE_PLANE, PLANE = (
    0.3,
    1000.0,
)  # weight of the poles' planes, times the mean area of a control point: as it grows, and at last
ROUNDS, LAST_ROUNDS = 2, 4  # steps after each refinement, and at last, where the best is taken
GOAL = 0.95  # of the tolerance: no sample may be farther
GAIN = 0.93  # a round of taking knots out that leaves more of the control points (of the miss) halves the next one's share
LEAST_SHARE = {True: 0.3, False: 0.1}  # the last one, where the tolerance is reached (is not)
SPARE = {
    True: 0.95,
    False: 0.8,
}  # of the tolerance (of the miss where it is not reached): no sample may pass it for the lack of a knot
SPARED = {True: 0.4, False: 0.2}  # of the control points may go in one round
FIRST = (
    (150, 9, 10),
    (40, 5, 6),
)  # from so many control points allowed: spans and knots a row of the first T-mesh
PATIENCE = 3  # refinements of the first surface without clearly less that folds
LEAST_POINTS = FIRST[-1][0]
HELD = 1e-9  # weight of a control point's place between the rows' points, where these do not reach it
Refine = Callable[[RowTMesh, Votes, int], RowTMesh]
"""A finer T-mesh from the votes for it and the number of control points it may have more."""
Prune = Callable[[TSpline, Target, float, int], RowTMesh]
"""A T-mesh with fewer knots, at most so many fewer, for which no sample should pass the limit (mm)."""


@dataclass(frozen=True)
class Aim:
    """What is wanted, with how many control points, how the T-mesh changes, and how far rings round poles may
    be off ellipses."""

    tolerance: float
    most: int
    refine: Refine = refine
    prune: Prune = prune
    off: float = OFF


def grown(surface: TSpline, target: Target, aim: Aim, progress: Progress = silent) -> tuple[TSpline, Target]:
    """Refined where samples are missed until none is or the control points are spent, and settled with plane
    poles."""
    first = target.worst / (GOAL * aim.tolerance)
    while target.worst > GOAL * aim.tolerance and surface.tmesh.size < aim.most:
        size, worst = surface.tmesh.size, target.worst
        way = 1 - np.log(worst / (GOAL * aim.tolerance)) / np.log(first)
        report(
            progress,
            float(np.clip(max(way, size / aim.most), 0, 1)),
            f"{size} control points, {worst:.3f} mm",
        )
        samples = target.all
        votes = miss_votes(
            surface, samples.s, samples.t, samples.distances, samples.areas, GOAL * aim.tolerance
        )
        assert isinstance(surface.tmesh, RowTMesh)
        tmesh = aim.refine(surface.tmesh, votes, aim.most - size)
        if tmesh.size == size:
            break
        surface = moved(surface, tmesh)
        surface, target = settle(surface, target.on(surface, aim.tolerance).denser(surface), aim)
        if target.worst > worst:  # new knots are not settled yet: no vote on that
            surface, target = settle(surface, target, aim, 1)
    best = surface, target
    for number in range(LAST_ROUNDS):
        surface, target = settle(surface, target, aim, 1, PLANE)
        if number == 0 or target.worst < best[1].worst:
            best = surface, target
    surface = flattened(best[0])
    return surface, best[1].on(surface, aim.tolerance)


def thinned(surface: TSpline, target: Target, aim: Aim) -> tuple[TSpline, Target]:
    """Knots taken out where they can be spared and put in where they are missed, as long as that brings
    clearly fewer or closer."""
    share, folded = 1.0, target.folded(surface)
    while share > LEAST_SHARE[target.worst <= aim.tolerance]:
        reached, size, worst = target.worst <= aim.tolerance, surface.tmesh.size, target.worst
        tmesh = aim.prune(
            surface, target, SPARE[reached] * max(aim.tolerance, worst), round(share * SPARED[reached] * size)
        )
        fewer = moved(surface, tmesh)
        fewer, found = settle(fewer, target.on(fewer, aim.tolerance), aim)
        fewer, found = grown(fewer, found, replace(aim, most=size - 1 if reached else aim.most))
        better = found.worst <= (aim.tolerance if reached else worst) and (folded or not found.folded(fewer))
        gained = fewer.tmesh.size / size if reached else found.worst / worst
        if better:
            surface, target = fewer, found
        if not better or gained > GAIN:
            share /= 2
    return surface, target


def first_surface(rows: Rows, target: Target, aim: Aim) -> tuple[TSpline, Target]:
    """A coarse surface with the parameters of the rows, and the feet on it; its T-mesh grows as long as that
    folds less."""
    spans, knots = next(first[1:] for first in FIRST if first[0] <= aim.most)
    tmesh = first_tmesh(spans, knots)
    best, waited = through_loops(rows, tmesh), 0
    surface, fewest = best, folded_places(best, target)
    while fewest > 0 and waited < PATIENCE:
        samples = target.on(surface, aim.tolerance).all
        votes = miss_votes(surface, samples.s, samples.t, samples.distances, samples.areas, aim.tolerance)
        finer = aim.refine(tmesh, votes, round(ROUGH_SHARE * aim.most) - tmesh.size)
        if finer.size == tmesh.size:
            break
        tmesh, surface = finer, through_loops(rows, finer)
        folded = folded_places(surface, target)
        waited = 0 if folded < GAIN * fewest else waited + 1
        if folded < fewest:
            best, fewest = surface, folded
    return best, target.on(best, aim.tolerance)


def folded_places(surface: TSpline, target: Target) -> int:
    """How many places of the fold grid do not face as the mesh does; the tip of a cone never does."""
    return int((target.shape.facing(surface, *fold_grid(surface)) <= LEAST_FACING).sum())


def through_loops(rows: Rows, tmesh: RowTMesh) -> TSpline:
    """The surface that meets the rows' loops and poles best, each at its parameters; faintly held by them at
    its anchors."""
    loops, count = rows.guides.shape[:2]
    order = np.arange(1, loops + 1) * (len(rows.heights) + 1) / (loops + 1)
    heights = np.interp(order, np.arange(len(rows.heights) + 2), [0.0, *rows.heights, 1.0])
    s, t = np.tile(np.arange(count) / count, loops), np.repeat(heights, count)
    weights = np.repeat(np.gradient(heights), count)
    basis = tmesh.blending(np.append(s, [0.0, 0.0]), np.append(t, [0.0, 1.0]), 0)[0]
    weighted = sp.diags_array(np.append(weights, [1.0, 1.0])) @ basis
    points = np.vstack([rows.guides.reshape(-1, 3), rows.poles])
    nets = np.concatenate(
        [
            np.repeat(rows.poles[:1, None], count, axis=1),
            rows.guides,
            np.repeat(rows.poles[1:, None], count, axis=1),
        ]
    )
    anchor_s, anchor_t = anchors(tmesh)
    column, place = (
        np.rint(anchor_s * count).astype(int) % count,
        np.interp(anchor_t, [0.0, *heights, 1.0], np.arange(loops + 2)),
    )
    level = np.minimum(place.astype(int), loops)
    share = (place - level)[:, None]
    held = nets[level, column] * (1 - share) + nets[level + 1, column] * share
    normal = (basis.T @ weighted).toarray() + HELD * np.eye(tmesh.size)
    return TSpline(tmesh, np.linalg.solve(normal, weighted.T @ points + HELD * held), np.ones(tmesh.size))


def first_tmesh(spans: int, knots: int) -> RowTMesh:
    """Even spans in t, `knots` even knots a row, four in the rows next to the poles."""
    t_knots = np.concatenate([np.zeros(3), np.linspace(0, 1, spans + 1), np.ones(3)])
    rows = [np.arange(knots) / knots for _ in range(spans + 3)]
    rows[0] = rows[-1] = np.zeros(1)
    rows[1] = rows[-2] = np.arange(FEWEST) / FEWEST
    return RowTMesh.from_rows(t_knots, rows)


def moved(surface: TSpline, tmesh: RowTMesh) -> TSpline:
    """A surface on `tmesh` like `surface`: least squares in the Gauss points, faintly held at the anchors."""
    size = tmesh.size
    draft = TSpline(tmesh, surface.positions(*anchors(tmesh)), np.ones(size))
    s, t, share = element_points(draft.elements().boxes, 2)
    data = Term(draft.basis(s, t)[0], share[:, None, None] * np.eye(3), surface.positions(s, t))
    held = Term(
        sp.eye_array(size, format="csr"),
        np.broadcast_to(1e-6 / size * np.eye(3), (size, 3, 3)),
        draft.control_points,
    )
    return TSpline(tmesh, Form.of([data, held], size).least(), np.ones(size))


def anchors(tmesh: RowTMesh) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """(s, t) of each control point: its knot and its row's Greville point."""
    t = [tmesh.t_knots[j + 1 : j + 4].mean() for j in range(len(tmesh.s_knots))]
    return np.concatenate(tmesh.s_knots), np.repeat(t, [len(row) for row in tmesh.s_knots])


def settle(
    surface: TSpline, target: Target, aim: Aim, rounds: int = ROUNDS, plane: float = LOOSE_PLANE
) -> tuple[TSpline, Target]:
    """`rounds` steps with the feet followed after each."""
    for _ in range(rounds):
        surface = step(surface, target, aim.tolerance, plane, aim.off)
        target = target.on(surface, aim.tolerance)
    return surface, target
