"""Fitting a row-structured T-spline to a mesh: few control points, put only where the mesh would be missed.

The start is a coarse surface through the loops of the mesh's harmonic field, which give every mesh sample its
first foot. It is drawn to the samples (`steps`); round by round knots are added where samples are missed
(`adapt`) and taken out where they can be spared (`prune`) until all samples are within the tolerance or the
control points are spent. A dense measurement, both ways, decides; what it finds missed joins the samples.
"""

from dataclasses import dataclass, replace
from itertools import islice

from bonecam.mesh.pose import upright
from bonecam.mesh.sections.harmonic_rows import Rows
from bonecam.mesh.sections.row_choices import row_choices
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, part, report, rising, silent
from bonecam.surface.fitting.adapt import refine
from bonecam.surface.fitting.deviation import Deviation, measure
from bonecam.surface.fitting.growth import GAIN, LEAST_POINTS, Aim, Prune, Refine, first_surface, grow, settle, thin
from bonecam.surface.fitting.prune import prune
from bonecam.surface.fitting.steps import OFF
from bonecam.surface.fitting.target import FitTarget
from bonecam.surface.tspline import TSpline

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

ROW_POINTS = 100
"""Points of each of these rows."""

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
    for rows in islice(row_choices(posed, ROWS, ROW_POINTS, progress=part(progress, 0.0, 0.1)), CHOICES):
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
    surface, target = first_surface(rows, FitTarget.of(mesh, rows, SAMPLES), aim)
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
