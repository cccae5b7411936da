"""The tool axis of every contact of a path: the preferred one where it is admissible, else the nearest one
that is.

The preferred axis leans forward by the lead angle (`lead.py`), within the machine's limits, and runs round
the singularity (`lead.py`).

Axes eased where the machine's rotary axes would hold up the cut.

Where the tip hardly moves while the tool turns, a rotary axis at its speed limit holds the tip below the feed, and the
ball rubs. A move is slow where its turn lets less than SHARE of the cutter's feed. Round slow moves the axes become
their means over a stretch of the pass, which spreads the turn over the neighbours; stretches grow as long as slow moves
are left. An axis is changed only where the machine reaches the new one, it leans from the normal by no more than is
allowed and by no less than before or than the least lead, it stays in its cone if it was in one, and tool and moves are
proven free. Rings round the post stay slow: there the table must turn once.

FCL's word on the axes that no certified cone holds: the exact tool of each pose against level, material, post and
clamping. What it does not find free is left out.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, lengths, unit
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
    admissible[open_] = checker.free_by_distance(centres[open_], preferred[open_])

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


SHARE = 0.55
"""A move whose turn lets less of the cutter's feed is slow: half of it, and what the rounding of words and feeds may
take."""
STRETCHES = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Half lengths of the stretches that are tried, mm."""


def eased_axes(
    path: ContactPath,
    chosen: ToolAxes,
    wanted: WantedAxes,
    checker: CollisionChecker,
    limits: MachineLimits,
    job: PathJob,
) -> ToolAxes:
    """The axes that were chosen from those `wanted`, eased on each pass where the speeds of the machine's rotary axes
    are known."""
    easing = _Easing(path, chosen, wanted=wanted, checker=checker, limits=limits, job=job)
    axes = chosen.axes
    for half in STRETCHES:
        slow = easing.slow(axes)
        if not slow.any():
            break
        axes = easing.eased(axes, slow, half)
    changed = (axes != chosen.axes).any(axis=1)
    beside = changed | np.r_[False, changed[:-1]] | np.r_[changed[1:], False]
    return replace(chosen, axes=axes, free_in_motion=chosen.free_in_motion & ~beside)


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
        self.leads = np.minimum(angles_between(chosen.axes, path.normals), least)
        has_axis = chosen.found
        same = path.pass_index[1:] == path.pass_index[:-1]
        self.joined: Bool[ndarray, " n"] = np.r_[same & has_axis[1:] & has_axis[:-1], False]
        self.piece = np.r_[0, np.cumsum(~self.joined[:-1])]
        steps = np.where(self.joined[:-1], lengths(np.diff(path.centres, axis=0)), 0.0)
        self.along = np.r_[0.0, np.cumsum(steps)]
        self.rows: list[Int[ndarray, " r"]] = np.split(
            np.arange(len(has_axis)), np.flatnonzero(np.diff(self.piece)) + 1
        )

    def slow(self, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether the move from each contact to the next is slow."""
        limits = self.limits
        ways = lengths(np.diff(self.path.cutter.tips_of(self.path.centres, axes), axis=0))
        return self.joined & np.r_[limits.turning_minutes(axes) * SHARE * self.path.cutter.feed > ways, False]

    def eased(self, axes: Float[ndarray, "n 3"], slow: Bool[ndarray, " n"], half: float) -> Float[ndarray, "n 3"]:
        """The axes, eased over stretches of this half length (mm) round the slow moves where that leaves fewer."""
        tried = axes.copy()
        part = np.full(len(axes), -1)
        parts = 0
        for rows in self.rows:
            if not slow[rows].any():
                continue
            # How much each contact of a pass takes of the mean: all of it at slow moves, none `half` (mm) beside them
            ends = np.flatnonzero(slow[rows])
            along = self.along[rows]
            marked = along[np.unique(np.r_[ends, np.minimum(ends + 1, len(rows) - 1)])]
            away = np.abs(along[:, None] - marked[None]).min(axis=1)
            share = np.clip(1 - away / half, 0.0, 1.0)

            # The mean axis from `half` (mm) before each contact to as much behind it
            weights = np.gradient(along) + 1e-6 if len(rows) > 1 else np.ones(1)
            sums = np.vstack([np.zeros(3), np.cumsum(weights[:, None] * axes[rows], axis=0)])
            first, last = np.searchsorted(along, along - half), np.searchsorted(along, along + half, "right")
            means = unit(sums[last] - sums[first])
            tried[rows] = unit((1 - share)[:, None] * axes[rows] + share[:, None] * means)
            inside = share > 0
            part[rows] = np.where(inside, parts + np.cumsum(np.diff(inside, prepend=False)), -1)
            parts += len(rows) + 1
        tried = avoid_singularity(tried, self.path.centres, self.piece)
        return self._taken(axes, self.limits.nearest(tried) if self.limits.narrow else tried, part, slow)

    def _in_cones(self, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether each axis is in its contact's cone."""
        return np.zeros(len(axes), dtype=bool) if self.cones is None else self.cones.hold(axes)

    def _taken(
        self,
        axes: Float[ndarray, "n 3"],
        tried: Float[ndarray, "n 3"],
        part: Int[ndarray, " n"],
        slow: Bool[ndarray, " n"],
    ) -> Float[ndarray, "n 3"]:
        """The axes, those of each part that may be changed as `tried`."""
        asked = np.flatnonzero(part >= 0)
        if not len(asked):
            return axes
        path = self.path
        may = within_limits(tried[asked], path.normals[asked], self.limits, self.max_tilt)
        may &= angles_between(tried[asked], path.normals[asked]) >= self.leads[asked] - 1e-9
        may &= (~self.in_cone | self._in_cones(tried))[asked]
        before, after = (np.bincount(part[asked], s[asked]) for s in (slow, self.slow(tried)))
        bad = after >= before
        bad[part[asked[~may]]] = True
        open_ = asked[~bad[part[asked]]]
        free = self.checker.free(path.centres[open_], tried[open_])
        bad[part[open_[~free]]] = True
        kept = (part >= 0) & ~bad[part]
        new = np.where(kept[:, None], tried, axes)
        moves = self.joined & (kept | np.r_[kept[1:], False])
        free = self.checker.moves_free(path.cutter.tips_of(path.centres, new), new, moves)
        for ends in (part, np.r_[part[1:], -1]):
            blocked = ends[moves & ~free]
            bad[blocked[blocked >= 0]] = True
        kept &= ~bad[part]
        return np.where(kept[:, None], tried, axes)


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
