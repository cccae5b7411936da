"""The tool axis of every contact of a path: the preferred one where it is admissible, else the nearest one
that is.

The preferred axis leans forward by the lead angle (`lead.py`), within the machine's limits, and runs round
the singularity (`singularity.py`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.job import PathJob
from bonecam.machine.limits import MachineLimits
from bonecam.planning.axes.admissible import Free, nearest_free_axes, smooth_axes, within_limits
from bonecam.planning.axes.lead import bound_polar_angles, has_room, lead_axes
from bonecam.planning.axes.singularity import avoid_singularity, avoid_singularity_where
from bonecam.planning.collision.checker import CollisionChecker
from bonecam.tool.path import ContactPath, FreeCones


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
        lead = cutter.lead if cutter.is_bull else np.radians(job.lead_deg)
        leaning = lead_axes(path.normals, path.feeds, lead)
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
