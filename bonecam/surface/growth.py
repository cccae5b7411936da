"""Where a row-structured T-mesh gets knots: only where the mesh is missed.

Each sample of the mesh that is missed votes with (its area) x (its distance)^4 for the longer side of the
cell it lies in: for an s-knot in the middle of the interval in each row that acts there, or for a t-knot in
the middle of the span. Votes are divided by the control points the knot costs (an s-knot one, a t-knot a
whole row), and the best are taken. Low cells are not cut: a cubic with even knots follows a rim of a right
angle within a tenth of their distance, and rows of lower cells only fold.

Taking knots out of a row-structured T-mesh again where the fit can spare them.

For each s-knot of each row the curve Q_j is fitted without it; the change, blended with N_j, moves the
surface at the samples. A knot is spared where no sample's distance along the normal would pass the limit;
those that raise it least go first, and of neighbouring knots only one.

Growing the T-mesh of a fit: a coarse start, knots where samples are missed, knots out again where they can
be spared.

Fitting a row-structured T-spline to a mesh: few control points, put only where the mesh would be missed.

The start is a coarse surface through the loops of the mesh's harmonic field, which give every mesh sample its
first foot. It is drawn to the samples (`steps`); round by round knots are added where samples are missed
(`adapt`) and taken out where they can be spared (`prune`) until all samples are within the tolerance or the
control points are spent. A dense measurement, both ways, decides; what it finds missed joins the samples.

A fitted surface smoothed where it bends more sharply than levels can follow, within what it may miss its mesh by.

Creases of the mesh, and cells that the fit squeezed or sheared, leave places with radii of microns, over which levels
fold. Steps of the fit (`steps`) are taken again, in which the shape itself resists the thin-plate energy round such
places, not only its change; a place once sharp is held so until the end. Of the surfaces on the way the one counts
whose least radius is largest and which a dense measurement finds near enough.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.pose import upright
from bonecam.mesh.rows import Rows, row_choices
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, part, report, rising, silent
from bonecam.surface.basis import FEWEST, clamped_spans, element_points, periodic_collocation, span_functions
from bonecam.surface.fitting import (
    FINAL_PLANE_WEIGHT,
    LEAST_FACING,
    OFF,
    Deviation,
    FitTarget,
    MeshSamples,
    fair_step,
    first_tmesh,
    flatten_poles,
    fold_grid,
    measure,
    step,
    through_loops,
    transfer,
)
from bonecam.surface.query import rings
from bonecam.surface.tmesh import RowTMesh
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
    # All cuts that got votes.
    span, window = clamped_spans(tmesh.t_knots, votes.t)
    functions = span_functions(window, votes.t, 0)[0]
    acting = span[:, None] + np.arange(-3, 1)
    widths = np.stack([_interval(tmesh.s_knots[j], votes.s)[1] for j in range(len(tmesh.s_knots))], axis=1)
    side = (functions * np.take_along_axis(widths, acting, axis=1)).sum(axis=1) * votes.around
    height = (tmesh.t_knots[span + 1] - tmesh.t_knots[span]) * votes.along
    tall = height > side

    cuts = []
    for j, knots in enumerate(tmesh.s_knots):
        if len(knots) < FEWEST:
            continue
        share = np.where(acting == j, functions, 0).sum(axis=1) * votes.weight * ~tall
        here = share > 0
        index = _interval(knots, votes.s[here])[0]
        worth = np.bincount(index, share[here], minlength=len(knots))
        gaps = np.diff(np.append(knots, knots[0] + 1))
        for k in np.flatnonzero((worth > 0) & (gaps > NARROWEST)):
            cuts.append(KnotCandidate(j, float(np.mod(knots[k] + gaps[k] / 2, 1.0)), float(worth[k])))

    voting = tall & (height > LOWEST * votes.goal)
    worth = np.bincount(span[voting], votes.weight[voting], minlength=len(tmesh.t_knots))
    for k in np.flatnonzero(worth):
        cost = max(len(tmesh.s_knots[j]) for j in (k - 2, k - 1))
        cuts.append(KnotCandidate(-1, float(tmesh.t_knots[k : k + 2].mean()), float(worth[k]) / cost))
    cuts = sorted(cuts, key=lambda cut: (-cut.worth, cut.row, cut.place))
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


def _interval(knots: ndarray, s: ndarray) -> tuple[ndarray, ndarray]:
    """Which interval of the row holds s, and its width; a pole row has one of width 1."""
    index = np.mod(np.searchsorted(knots, s, side="right") - 1, len(knots))
    return index, np.diff(np.append(knots, knots[0] + 1))[index]


WIDEST = 0.25
"""The widest gap between knots, in turns, of a row next to a pole: round a wider one the surface folds at the
pole."""


@dataclass(frozen=True, eq=False)
class Spared:
    """A knot of a row, the samples its lack moves, how far along their normals, and the distance that
    makes."""

    row: int
    knot: int
    samples: Int[ndarray, " k"]
    moves: Float[ndarray, " k"]
    worst: float


def prune(surface: TSpline, target: FitTarget, limit: float, most: int) -> RowTMesh:
    """The T-mesh without at most `most` knots, no sample's distance being expected to pass `limit` (mm) for
    their lack."""
    tmesh = surface.tmesh
    assert isinstance(tmesh, RowTMesh)
    now, spared = spare_knots(surface, target)
    removable = [one for one in spared if one.worst < limit]
    gone: list[set[int]] = [set() for _ in tmesh.s_knots]
    for one in sorted(removable, key=lambda one: (one.worst, one.row, one.knot)):
        count = len(tmesh.s_knots[one.row])
        near = {(one.knot + d) % count for d in (-2, -1, 0, 1, 2)}
        if sum(map(len, gone)) >= most or near & gone[one.row] or count - len(gone[one.row]) <= FEWEST:
            continue
        left = np.delete(tmesh.s_knots[one.row], [*gone[one.row], one.knot])
        if one.row in (1, len(gone) - 2) and np.diff(left, append=left[0] + 1).max() > WIDEST:
            continue
        then = now[one.samples] + one.moves
        if len(then) == 0 or np.abs(then).max() < limit:
            gone[one.row].add(one.knot)
            now[one.samples] = then
    return RowTMesh.from_rows(tmesh.t_knots, [np.delete(knots, sorted(g)) for knots, g in zip(tmesh.s_knots, gone)])


def spare_knots(surface: TSpline, target: FitTarget) -> tuple[Float[ndarray, " n"], list[Spared]]:
    """The signed distances of the samples now, and what the lack of each knot would do; rows with the fewest
    knots have none to spare."""
    samples = target.inward
    normals = surface.normals(samples.s, samples.t)
    now = dots(surface.positions(samples.s, samples.t) - samples.points, normals)
    basis = sp.csc_array(surface.basis(samples.s, samples.t)[0])
    return now, [
        one for row in range(len(surface.tmesh.row_starts) - 1) for one in _row(surface, basis, normals, now, row)
    ]


def _row(surface: TSpline, basis: sp.csc_array, normals: ndarray, now: ndarray, row: int) -> list[Spared]:
    """All knots of one row."""
    tmesh = surface.tmesh
    assert isinstance(tmesh, RowTMesh)
    knots = tmesh.s_knots[row]
    start = int(tmesh.row_starts[row])
    if len(knots) <= FEWEST:
        return []
    points = surface.control_points[start : start + len(knots)]
    part = sp.csr_array(basis[:, start : start + len(knots)])
    moved = np.flatnonzero(np.diff(part.indptr))
    part = part[moved]
    whole = la.inv(periodic_collocation(knots, knots))
    spared = []
    for k in range(len(knots)):
        matrix = whole @ periodic_collocation(np.delete(knots, k), knots)
        change = matrix @ la.lstsq(matrix, points)[0] - points
        moves = dots(part @ change, normals[moved])
        felt = np.abs(moves) > 1e-3 * np.abs(moves).max(initial=0.0)
        worst = np.abs(now[moved[felt]] + moves[felt]).max(initial=0.0)
        spared.append(Spared(row, k, moved[felt], moves[felt], float(worst)))
    return spared


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


SAMPLES = 6000
"""Samples inside the faces of the mesh; its vertices are samples too."""

MEASUREMENTS = 16
"""Dense measurements, each followed by more samples where the mesh is missed."""

THIN_AGAIN = 1.05
"""Factor on the control points that the last thinning left: from so many on knots are taken out again."""

AFTER = 0.6
"""Share of the work that is expected to be left after each measurement, for the progress."""

MOST = 20000
"""Control points where no limit is given."""

ROWS = 48
"""Rows of the harmonic field where none are given."""

CHOICES = 2
"""Sets of rows that are tried where none are given."""

SPENT = "all control points are spent: raise surface.max_control_points"
STUCK = "more control points would bring it no nearer: round the edge or fill the hollow there"
FOLDED = "it meets itself: smooth the mesh, or raise surface.tolerance"
OFTEN = f"{MEASUREMENTS} measurements each found new places missed: raise surface.tolerance"


@dataclass(frozen=True, eq=False)
class Fit:
    """The fitted surface and how far it is from the mesh; `reached` says whether that is within the tolerance
    asked for.

    Where it is not, `deviation.place` is the spot that is missed the most, and `shortfall` says why it came
    no nearer, and what helps.
    """

    surface: TSpline
    deviation: Deviation
    tolerance: float
    reached: bool
    shortfall: str = ""

    @property
    def control_points(self) -> int:
        """Number of control points."""
        return self.surface.tmesh.size


def fit(
    target: TriangleMesh,
    tolerance: float,
    max_control_points: int = MOST,
    *,
    rows: Rows | None = None,
    progress: Progress = silent,
    refine: Refine = refine,
    prune: Prune = prune,
    round_poles: bool = False,
) -> Fit:
    """The T-spline within `tolerance` (mm, both ways) of the mesh, or as near as `max_control_points` allow:
    see `Fit.reached`.

    `rows` are sections of the mesh from the lower to the upper pole; without them the mesh is stood upright
    and cut. Where that does not reach the tolerance, other rows are tried (`row_choices`) and round poles; the
    nearer surface counts. `round_poles` draws the control points next to each pole to an ellipse round it: for
    levels, which fold sooner at other poles. It takes some more control points, and the largest bones may fold.
    Raises ValueError on a tolerance of 0 or fewer than 40 control points, MeshError where the mesh is not
    closed and of genus 0.
    """
    if not tolerance > 0 or max_control_points < LEAST_POINTS:
        raise ValueError(
            f"tolerance {tolerance}, {max_control_points} control points: give a length above 0 and "
            f"{LEAST_POINTS} or more"
        )
    aim = Aim(tolerance, max_control_points, refine, prune, 0.0 if round_poles else OFF)
    if rows is not None:
        return _fit_rows(target, rows, aim, progress)
    posed, motion = upright(target)
    progress = rising(progress)
    tried: list[Fit] = []
    for rows in islice(row_choices(posed, ROWS, progress=part(progress, 0.0, 0.1)), CHOICES):
        tried.append(_fit_rows(posed, rows, aim, part(progress, 0.1, 1.0)))
        if tried[-1].reached:
            break
        aim = replace(aim, off=0.0)
    best = min(tried, key=lambda one: (one.shortfall == FOLDED, one.deviation.max))
    back = best.surface.with_control_points((best.surface.control_points - motion[:3, 3]) @ motion[:3, :3])
    d = best.deviation
    place = (d.place - motion[:3, 3]) @ motion[:3, :3]
    return replace(best, surface=back, deviation=replace(d, place=place))


def _fit_rows(mesh: TriangleMesh, rows: Rows, aim: Aim, progress: Progress) -> Fit:
    """The best surface of rounds of growing, thinning and measuring; of several one without folds.

    Rounds end where the dense measurement finds nothing missed, or more control points would not help.
    """
    # A coarse surface with the parameters of the rows, and the closest points on it. Its T-mesh grows as long as the
    # surface folds less.
    target = FitTarget.of(mesh, rows, SAMPLES)
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
    surface = best
    target = target.on(best, aim.tolerance)
    surface, target = settle(surface, target, aim)
    rounds: list[tuple[bool, float, int, TSpline, Deviation]] = []
    size = 0
    why = OFTEN
    progress = rising(progress)
    for number in range(MEASUREMENTS):
        done, then = (1 - AFTER**k for k in (number, number + 1))
        surface, target = grow(surface, target, aim, part(progress, done, then))
        if surface.tmesh.size > THIN_AGAIN * size or surface.tmesh.size >= aim.most:
            surface, target = thin(surface, target, aim)
            size = surface.tmesh.size
        measured = measure(surface, mesh, target.shape.distance)
        now = measured.deviation
        report(progress, then, f"{surface.tmesh.size} control points, {now.max:.3f} mm measured")
        rounds.append((target.folded(surface), max(now.max, aim.tolerance), number, surface, now))
        missed, parameters = measured.missed(max(aim.tolerance, target.worst))
        spent = surface.tmesh.size >= aim.most
        why = SPENT if spent else STUCK if target.worst > aim.tolerance else OFTEN
        if not len(missed) or (why != OFTEN and number > 0 and now.max > GAIN * min(one[1] for one in rounds[:-1])):
            break
        target = target.with_points(missed, parameters, surface)
    folded, _, _, surface, now = min(rounds, key=lambda one: one[:3])
    reached = now.max <= aim.tolerance and not folded
    return Fit(surface, now, aim.tolerance, reached, "" if reached else FOLDED if folded else why)


WEIGHTS = (3e-3, 1e-3)
"""Weights of the energy round sharp places, times (mean cell side)^4: the first leaves larger radii, the second is
nearer to the mesh."""
ROUNDS = 6
"""Steps with each weight."""
CREASE_SAMPLES = 20000
"""Samples of the mesh: as many as the dense measurement has, which finds the creases of a mesh between fewer."""
RADIUS_POINTS = 3
"""Gauss points each way an element at which radii are taken."""
CREASE_GAIN = 1.5
"""Factor on the least radius below which a surface is no smoother."""


def without_creases(found: Fit, mesh: TriangleMesh, radius: float, limit: float) -> Fit | None:
    """The fit with bends of `radius` (mm) and less made wider, `limit` (mm) from the mesh at most; None where it has
    none, or that does not widen them."""
    sharpest = least_radius(found.surface)
    if sharpest >= radius:
        return None
    distance = MeshDistance(mesh)
    tried = [(least_radius(surface), surface) for surface in _fairer(found, mesh, radius, limit)]
    for bend, surface in sorted(tried, key=lambda one: -one[0]):
        if bend < CREASE_GAIN * sharpest:
            break
        deviation = measure(surface, mesh, distance).deviation
        if deviation.max <= limit:
            reached = deviation.max <= found.tolerance
            return replace(found, surface=surface, deviation=deviation, reached=reached)
    return None


def least_radius(surface: TSpline) -> float:
    """The least radius of curvature (mm) at the Gauss points."""
    return float(_radii(surface).min())


def _fairer(fitted: Fit, mesh: TriangleMesh, radius: float, limit: float) -> Iterator[TSpline]:
    """The surfaces after each step that its samples find within the limit."""
    start = FitTarget.at_feet(mesh, fitted.surface, CREASE_SAMPLES, fitted.tolerance)
    for weight in WEIGHTS:
        surface = fitted.surface
        target = start
        sharp = np.zeros(len(surface.elements().boxes), dtype=bool)
        for _ in range(ROUNDS):
            sharp |= _radii(surface) < radius
            surface = fair_step(surface, target, fitted.tolerance, sharp, weight)
            target = target.on(surface, fitted.tolerance)
            if target.worst <= limit:
                yield flatten_poles(surface)


def _radii(surface: TSpline) -> Float[ndarray, " e"]:
    """The least radius of curvature (mm) at POINTS Gauss points each way of each element."""
    s, t, _ = element_points(surface.elements().boxes, RADIUS_POINTS)
    bends = surface.curvature(s, np.clip(t, *rings(surface)))
    most = np.maximum(np.abs(bends.k1), np.abs(bends.k2))
    return np.asarray(1 / np.maximum(most, np.finfo(float).tiny)).reshape(-1, RADIUS_POINTS**2).min(axis=1)
