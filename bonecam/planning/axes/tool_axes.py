"""The tool axis of every contact of a path: the preferred one where it is admissible, else the nearest one
that is.

The preferred axis leans forward by the lead angle (`lead.py`), within the machine's limits, and runs round
the singularity (`lead.py`).

Axes eased along the passes where the machine's rotary axes would hold up the cut.

A rotary axis that turns unevenly holds the tip up, whether at its speed or by its acceleration: at 5 m/min a move of
0.2 mm takes 2 ms, in which an axis of 500 deg/s^2 changes its rate by 1 deg/s. So along a pass that takes more than
SLOW times as long as at the feed the axes become their smoothing spline: of all curves y over the way of the ball's
centre, x, through the axes a that must stay, the one of least

    int |y - a|^2 dx + L^4 int |y''|^2 dx

(Reinsch 1967). An axis stays as it is where the machine does not reach the new one, where that leans from the normal by
more than is allowed, or by less than before and than the least lead, where it leaves the cone that it was in, or where
tool or moves are not free. The new axes of a pass are taken where it is driven sooner with them.

FCL's word on the axes that no certified cone holds: the exact tool of each pose against level, material, post and
clamping. What it does not find free is left out.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.linalg import solveh_banded

from bonecam.arrays import angles_between, lengths, settled, unit
from bonecam.errors import JobError
from bonecam.job import PathJob
from bonecam.machine.limits import MachineLimits
from bonecam.planning.axes.lead import (
    Free,
    avoid_singularity,
    avoid_singularity_where,
    bound_polar_angles,
    has_room,
    lead_axes,
    nearest_free_axes,
    smooth_axes,
    within_limits,
)
from bonecam.planning.collision import CollisionChecker, build_fcl_model
from bonecam.planning.motion_time import rotary_minutes
from bonecam.planning.scene import Scene
from bonecam.plugins import added, run_added
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import ContactPath, FreeCones, PoseCheck


@dataclass(frozen=True, eq=False)
class WantedAxes:
    """The axes to start from, and for which contacts they are `certified` free with their halves of the moves to their
    neighbours; the `cones` of the contacts, if the axes were chosen in cones."""

    axes: Float[ndarray, "n 3"]
    certified: Bool[ndarray, " n"]
    cones: FreeCones | None = None


@dataclass(frozen=True, eq=False)
class ToolAxes:
    """An axis for every contact, and an empty string or why it has none (`limits`, `collision`).

    `free_in_motion`: the pose and its halves of the moves to its neighbours on the pass are proven free
    already.
    """

    axes: Float[ndarray, "n 3"]
    reasons: tuple[str, ...]
    free_in_motion: Bool[ndarray, " n"]

    @property
    def found(self) -> Bool[ndarray, " n"]:
        """Which contacts have an axis."""
        return np.array([not reason for reason in self.reasons], dtype=bool)


def choose_axes(
    path: ContactPath, checker: CollisionChecker, limits: MachineLimits, job: PathJob, wanted: WantedAxes | None = None
) -> ToolAxes:
    """An axis for every contact that is within limits and free of collision; `wanted` are the axes to start from,
    by default those that lean forward by the lead angle."""
    cutter, centres, passes = path.cutter, path.centres, path.pass_index
    max_tilt = np.radians(job.max_tilt_deg)
    if wanted is None:
        leaning = lead_axes(path.normals, path.feeds, np.radians(job.lead_deg))
        wanted = WantedAxes(leaning, np.zeros(len(leaning), dtype=bool))
    bounded = bound_polar_angles(wanted.axes, centres, cutter, checker.scene.clamping, limits)
    preferred = avoid_singularity(bounded, centres, passes)

    same_pass = np.r_[passes[1:] == passes[:-1], False]
    known = wanted.certified & _with_neighbours((preferred == wanted.axes).all(axis=1))
    in_motion = checker.free_in_motion(cutter.tips_of(centres, preferred), preferred, same_pass, known)
    admissible = within_limits(preferred, path.normals, limits, max_tilt)
    open_ = np.flatnonzero(admissible & ~in_motion)
    admissible[open_] = checker.free(centres[open_], preferred[open_])

    axes, reasons = _replace(path, preferred, admissible=admissible, checker=checker, limits=limits, max_tilt=max_tilt)
    kept = (axes == preferred).all(axis=1) & np.array([not reason for reason in reasons])
    return ToolAxes(axes, tuple(reasons), in_motion & _with_neighbours(kept))


def _with_neighbours(kept: Bool[ndarray, " n"]) -> Bool[ndarray, " n"]:
    """Which contacts are kept with those before and behind them."""
    with_ends = np.r_[True, kept, True]
    return with_ends[:-2] & kept & with_ends[2:]


def added_axes(
    path: ContactPath, surface: TSpline, scene: Scene, limits: MachineLimits, job: PathJob
) -> Float[ndarray, "n 3"] | None:
    """The axes of a path on a surface that an orientation that was added fixes: unit vectors, one a contact. None for
    an orientation of our own. JobError where it gives none."""
    if job.orientation in ("cones", "lead"):
        return None
    axes_of = added("orientations", job.orientation)
    with run_added("orientations", job.orientation):
        axes = np.asarray(axes_of(path, surface, scene, limits, job), dtype=float)
    if axes.shape != path.normals.shape or not np.allclose(np.linalg.norm(axes, axis=1), 1.0):
        what = f"the orientation {job.orientation!r} that was added gives no axes"
        raise JobError(f"{what}: give an array ({len(path.normals)}, 3) of unit vectors", orientation=job.orientation)
    return axes


def fixed_axes(
    path: ContactPath, checker: CollisionChecker, axes: Float[ndarray, "n 3"], limits: MachineLimits
) -> ToolAxes:
    """These axes where the machine can take them and the tool is free of collision; the other contacts have none
    (`limits`, `collision`)."""
    free = checker.free(path.centres, axes)
    reasons = np.where(limits.allow(axes), np.where(free, "", "collision"), "limits")
    return ToolAxes(axes, tuple(reasons.tolist()), np.zeros(len(axes), dtype=bool))


def _replace(
    path: ContactPath,
    preferred: Float[ndarray, "n 3"],
    admissible: Bool[ndarray, " n"],
    checker: CollisionChecker,
    limits: MachineLimits,
    max_tilt: float,
) -> tuple[Float[ndarray, "n 3"], list[str]]:
    """The axes, those that are not admissible replaced by the nearest free ones and smoothed; for each an
    empty string or why there is none.

    Axes with room to leave the contact come first. FCL is asked only where no axis is proven free by distances: it
    takes a hundred times as long.
    """
    axes = preferred.copy()
    centres = path.centres
    reasons = np.where(admissible, "", "collision").astype(object)
    if admissible.all():
        return axes, reasons.tolist()

    def roomy(balls: Float[ndarray, "k 3"], tried: Float[ndarray, "k 3"]) -> Bool[ndarray, " k"]:
        free = has_room(tried, balls, path.cutter, checker.scene.clamping)
        free[free] = checker.free_by_distance(balls[free], tried[free])
        return free

    for proof in (roomy, checker.free_by_distance, checker.free):
        which = np.flatnonzero(reasons == "collision")
        free = _by_contact(proof, centres)
        axes[which], reasons[which] = nearest_free_axes(
            which, axes[which], normals=path.normals[which], limits=limits, max_tilt=max_tilt, free=free
        )

    with_axis = np.flatnonzero(reasons == "")
    free = _by_contact(roomy, centres[with_axis])
    normals, passes = path.normals[with_axis], path.pass_index[with_axis]
    smooth = smooth_axes(
        axes[with_axis],
        normals,
        passes=passes,
        replaced=~admissible[with_axis],
        limits=limits,
        max_tilt=max_tilt,
        free=free,
    )

    def still_admissible(i: Int[ndarray, " k"], tried: Float[ndarray, "k 3"]) -> Bool[ndarray, " k"]:
        return within_limits(tried, normals[i], limits, max_tilt) & free(i, tried)

    axes[with_axis] = avoid_singularity_where(smooth, centres[with_axis], passes, still_admissible)
    return axes, reasons.tolist()


def _by_contact(proof: Callable[[ndarray, ndarray], ndarray], centres: Float[ndarray, "n 3"]) -> Free:
    """A proof of poses (ball centres, axes) as one of contacts by index."""
    return lambda contacts, tried: proof(centres[contacts], tried)


SLOW = 1.05
"""A pass that takes so many times what it takes at the feed is eased."""
LENGTHS = (1.0, 4.0)
"""Over which axes are eased, one after the other, mm. The first halves what rotary axes cost on a bone whose contacts
lie unevenly (hamate), the second spreads a sudden turn; 0.5 and 2 beside them bring 1 % more."""
LEAD_SLACK = np.radians(0.25)
"""By which an axis may come nearer to the normal than the least lead."""
PINNED = 1e6
"""How much more an axis weighs that must stay."""
TRIES = 12
"""Times that some axes of a pass are kept before all are."""
CLOSEST = 0.02
"""Contacts count as so far apart at least, mm: with less the spline's equations are badly conditioned."""
LEAST_WAY = 1e-3
"""Moves of the tip count as so long at least, mm."""
EASED_QUANTUM = 2.0**-20
"""Components of eased axes are multiples of this: they differ by up to 3e-10 from processor to processor."""


def eased_axes(
    path: ContactPath,
    chosen: ToolAxes,
    wanted: WantedAxes,
    checker: CollisionChecker,
    limits: MachineLimits,
    job: PathJob,
) -> ToolAxes:
    """The axes that were chosen from those `wanted`, eased on each pass that the machine's rotary axes hold up, as far
    as their speeds and accelerations are known."""
    if len(chosen.axes) < 3:
        return chosen
    easing = _Easing(path, chosen, wanted=wanted, checker=checker, limits=limits, job=job)
    axes = chosen.axes
    for length in LENGTHS:
        axes = easing.eased(axes, length)
    kept = (axes == chosen.axes).all(axis=1)
    return replace(chosen, axes=axes, free_in_motion=chosen.free_in_motion & _with_neighbours(kept))


class _Easing:
    """What a path's axes are eased in."""

    def __init__(
        self,
        path: ContactPath,
        chosen: ToolAxes,
        wanted: WantedAxes,
        checker: CollisionChecker,
        limits: MachineLimits,
        job: PathJob,
    ) -> None:
        self.path, self.checker, self.limits = path, checker, limits
        self.cones = wanted.cones
        self.in_cone = self._in_cones(chosen.axes)
        self.max_tilt, least = np.radians(job.max_tilt_deg), np.radians(job.least_lead_deg)
        self.leads = np.minimum(angles_between(chosen.axes, path.normals), least) - LEAD_SLACK
        has_axis = chosen.found
        same = path.pass_index[1:] == path.pass_index[:-1]
        self.joined: Bool[ndarray, " m"] = same & has_axis[1:] & has_axis[:-1]
        self.piece = np.r_[0, np.cumsum(~self.joined)]
        self.inner = np.r_[False, self.joined] & np.r_[self.joined, False]
        self.steps = np.maximum(lengths(np.diff(path.centres, axis=0)), CLOSEST)

    def eased(self, axes: Float[ndarray, "n 3"], length: float) -> Float[ndarray, "n 3"]:
        """The axes, eased over this length (mm) on the slow passes that are driven sooner with them."""
        at_feed, driven = self._minutes(axes)
        stay = ~self.inner | (driven <= SLOW * at_feed)[self.piece]
        for tries in range(TRIES + 1):
            tried = self._smooth(axes, stay, length)
            bad = self._not_allowed(axes, tried)
            if not bad.any():
                break
            stay |= bad if tries < TRIES else np.isin(self.piece, self.piece[bad])
        else:
            return axes
        sooner = self._minutes(tried)[1] < driven
        return np.where(sooner[self.piece][:, None], tried, axes)

    def _minutes(self, axes: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " p"], Float[ndarray, " p"]]:
        """Of each piece of a pass at the feed, and as the rotary axes drive it."""
        ways = lengths(np.diff(self.path.cutter.tips_of(self.path.centres, axes), axis=0))
        at_feed = np.maximum(ways, LEAST_WAY) / self.path.cutter.feed
        driven = rotary_minutes(self.limits, axes, at_feed, self.joined)

        def of_pieces(minutes: Float[ndarray, " m"]) -> Float[ndarray, " p"]:
            return np.bincount(self.piece[1:], np.where(self.joined, minutes, 0.0), self.piece[-1] + 1)

        return of_pieces(at_feed), of_pieces(driven)

    def _smooth(self, axes: Float[ndarray, "n 3"], stay: Bool[ndarray, " n"], length: float) -> Float[ndarray, "n 3"]:
        """The smoothing splines of the pieces, through the axes that `stay`."""
        before, behind = self.steps[:-1], self.steps[1:]
        both = (before + behind) / 2
        second = np.array([1 / before, -1 / before - 1 / behind, 1 / behind]) / both
        bend = np.where(self.inner[1:-1], both * length**4, 0.0)
        share = np.r_[self.steps[0], both, self.steps[-1]] * np.where(stay, PINNED, 1.0)
        band = np.vstack([share, np.zeros((2, len(axes)))])
        for i in range(3):
            for j in range(i + 1):
                band[i - j, j : len(axes) - 2 + j] += bend * second[i] * second[j]
        found = unit(settled(solveh_banded(band, share[:, None] * axes, lower=True), EASED_QUANTUM))
        tried = avoid_singularity(np.where(stay[:, None], axes, found), self.path.centres, self.piece)
        return self.limits.nearest(tried) if self.limits.narrow else tried

    def _in_cones(self, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether each axis is in its contact's cone."""
        return np.zeros(len(axes), dtype=bool) if self.cones is None else self.cones.hold(axes)

    def _not_allowed(self, axes: Float[ndarray, "n 3"], tried: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Which of the axes must stay instead of those that are `tried`."""
        path = self.path
        changed = (tried != axes).any(axis=1)
        asked = np.flatnonzero(changed)
        may = within_limits(tried[asked], path.normals[asked], self.limits, self.max_tilt)
        may &= angles_between(tried[asked], path.normals[asked]) >= self.leads[asked]
        may &= (~self.in_cone | self._in_cones(tried))[asked]
        if may.all():
            may = self.checker.free(path.centres[asked], tried[asked])
        bad = np.zeros(len(axes), dtype=bool)
        bad[asked[~may]] = True
        if may.all():
            moves = np.r_[self.joined, False] & (changed | np.r_[changed[1:], False])
            blocked = moves & ~self.checker.moves_free(path.cutter.tips_of(path.centres, tried), tried, moves)
            bad = changed & (blocked | np.r_[False, blocked[:-1]])
        return bad


def judged_axes(
    path: ContactPath, chosen: ToolAxes, wanted: WantedAxes, checker: CollisionChecker
) -> tuple[ToolAxes, PoseCheck]:
    """The axes, without those outside of FCL's cones with which the tool at rest collides (`collision`), and how many
    were asked and refused."""
    cones, unsure = wanted.cones, chosen.found
    if cones is not None and cones.check is not None:
        unsure = unsure & ~cones.hold(chosen.axes)
    asked = np.flatnonzero(unsure)
    if not len(asked):
        return chosen, PoseCheck(0, 0)
    axes = chosen.axes[asked]
    tips = path.cutter.tips_of(path.centres[asked], axes)
    model = build_fcl_model(checker.scene, path.cutter)
    refused = asked[[bool(name) for name in model.colliding_sections(tips, axes)]]
    reasons = np.array(chosen.reasons, dtype=object)
    reasons[refused] = "collision"
    judged = replace(chosen, reasons=tuple(reasons.tolist()))
    return judged, PoseCheck(len(asked), len(refused))
