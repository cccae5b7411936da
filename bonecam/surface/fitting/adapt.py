"""Where a row-structured T-mesh gets knots: only where the mesh is missed.

Each sample of the mesh that is missed votes with (its area) x (its distance)^4 for the longer side of the
cell it lies in: for an s-knot in the middle of the interval in each row that acts there, or for a t-knot in
the middle of the span. Votes are divided by the control points the knot costs (an s-knot one, a t-knot a
whole row), and the best are taken. Low cells are not cut: a cubic with even knots follows a rim of a right
angle within a tenth of their distance, and rows of lower cells only fold.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.surface.basis.knots import span_functions
from bonecam.surface.basis.periodic import FEWEST
from bonecam.surface.fitting.target import MeshSamples
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

POWER = 4
"""Power of the distance, in goals, in a vote."""

MIN_GROWTH = 0.04
"""Control points added in one round where little of the area is missed, share of the present ones."""

GROWTH_BY_MISS = 0.3
"""Further control points, share of the present ones where the whole area is missed."""

FEWEST_ADDED = 6
"""Control points added in one round at least, where the limit leaves room."""

LEAST_WORTH = 0.02
"""Share of the best cut's votes for each control point: cuts with less wait for the next round."""

NARROWEST = 1 / 256
"""Turns: no s-interval is cut to less than half of this."""

LOWEST = 4.0
"""Goals: no cell that is lower is cut along t."""


@dataclass(frozen=True, eq=False)
class Votes:
    """Samples at (s, t), each with the weight of its miss, and |S_s| and |S_t| there, mm; their share of the
    area; the goal, mm."""

    s: Float[ndarray, " n"]
    t: Float[ndarray, " n"]
    weight: Float[ndarray, " n"]
    around: Float[ndarray, " n"]
    along: Float[ndarray, " n"]
    missed: float
    goal: float


@dataclass(frozen=True)
class KnotCandidate:
    """One possible knot: in row `row` (-1: a t-knot) at `place`, with its votes for each control point it
    costs."""

    row: int
    place: float
    worth: float


def miss_votes(surface: TSpline, samples: MeshSamples, goal: float) -> Votes:
    """The votes of the samples that are farther than `goal` (mm) from the surface."""
    missed = samples.distances > goal
    s, t, areas = samples.s[missed], samples.t[missed], samples.areas[missed]
    _, Ss, St = surface.evaluate(s, t, 1)
    return Votes(
        s=s,
        t=t,
        weight=areas * (samples.distances[missed] / goal) ** POWER,
        around=np.linalg.norm(Ss, axis=1),
        along=np.linalg.norm(St, axis=1),
        missed=float(areas.sum() / samples.areas.sum()),
        goal=goal,
    )


def refine(tmesh: RowTMesh, votes: Votes, room: int) -> RowTMesh:
    """The T-mesh with the best cuts made, at most `room` control points more; the same T-mesh where none is
    left."""
    cuts = sorted(_cuts(tmesh, votes), key=lambda cut: (-cut.worth, cut.row, cut.place))
    wanted = min(room, max(FEWEST_ADDED, round((MIN_GROWTH + GROWTH_BY_MISS * votes.missed) * tmesh.size)))
    refined = tmesh
    rows = [list(row) for row in tmesh.s_knots]
    t_cuts: list[float] = []
    for cut in cuts:
        if refined.size - tmesh.size >= wanted or cut.worth < LEAST_WORTH * cuts[0].worth:
            break
        tried = [[*row, cut.place] if j == cut.row else row for j, row in enumerate(rows)]
        tried_t = [*t_cuts, cut.place] if cut.row < 0 else t_cuts
        finer = with_t_knots(tmesh.t_knots, [np.sort(np.array(row)) for row in tried], np.array(tried_t))
        if finer.size - tmesh.size <= (room if refined is tmesh else min(room, 2 * wanted)):
            refined = finer
            rows = tried
            t_cuts = tried_t
    return refined


def with_t_knots(t_knots: Float[ndarray, " k"], rows: list[ndarray], new: Float[ndarray, " c"]) -> RowTMesh:
    """The T-mesh with the t-knots `new`; each new row takes the s-knots of the old row nearest to it in t
    (by Greville points).
    """
    refined = np.sort(np.concatenate([t_knots, new]))
    old, fresh = (np.array([k[j + 1 : j + 4].mean() for j in range(len(k) - 4)]) for k in (t_knots, refined))
    nearest = np.abs(fresh[:, None] - old[None, 1:-1]).argmin(axis=1) + 1
    chosen = [rows[j] for j in nearest]
    chosen[0], chosen[-1] = rows[0], rows[-1]
    chosen[1], chosen[-2] = rows[1], rows[-2]
    return RowTMesh.from_rows(refined, chosen)


def _cuts(tmesh: RowTMesh, votes: Votes) -> list[KnotCandidate]:
    """All cuts that got votes."""
    span = np.clip(np.searchsorted(tmesh.t_knots, votes.t, side="right") - 1, 3, len(tmesh.t_knots) - 5)
    functions = span_functions(tmesh.t_knots[span[:, None] + np.arange(-3, 5)], votes.t, 0)[0]
    acting = span[:, None] + np.arange(-3, 1)
    widths = np.stack([_interval(tmesh.s_knots[j], votes.s)[1] for j in range(len(tmesh.s_knots))], axis=1)
    side = (functions * np.take_along_axis(widths, acting, axis=1)).sum(axis=1) * votes.around
    height = (tmesh.t_knots[span + 1] - tmesh.t_knots[span]) * votes.along
    tall = height > side

    voting = tall & (height > LOWEST * votes.goal)
    worth = np.bincount(span[voting], votes.weight[voting], minlength=len(tmesh.t_knots))
    cuts = []
    for k in np.flatnonzero(worth):
        cost = max(len(tmesh.s_knots[j]) for j in (k - 2, k - 1))
        cuts.append(KnotCandidate(-1, float(tmesh.t_knots[k : k + 2].mean()), float(worth[k]) / cost))
    return [*_row_cuts(tmesh, votes, ~tall, acting, functions), *cuts]


def _row_cuts(
    tmesh: RowTMesh, votes: Votes, voting: Bool[ndarray, " n"], acting: ndarray, functions: ndarray
) -> list[KnotCandidate]:
    cuts = []
    for j, knots in enumerate(tmesh.s_knots):
        if len(knots) < FEWEST:
            continue
        share = np.where(acting == j, functions, 0).sum(axis=1) * votes.weight * voting
        here = share > 0
        index = _interval(knots, votes.s[here])[0]
        worth = np.bincount(index, share[here], minlength=len(knots))
        gaps = np.diff(np.append(knots, knots[0] + 1))
        for k in np.flatnonzero((worth > 0) & (gaps > NARROWEST)):
            cuts.append(KnotCandidate(j, float(np.mod(knots[k] + gaps[k] / 2, 1.0)), float(worth[k])))
    return cuts


def _interval(knots: ndarray, s: ndarray) -> tuple[ndarray, ndarray]:
    """Which interval of the row holds s, and its width; a pole row has one of width 1."""
    index = np.mod(np.searchsorted(knots, s, side="right") - 1, len(knots))
    return index, np.diff(np.append(knots, knots[0] + 1))[index]
