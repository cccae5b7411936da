"""Axes eased where the machine's rotary axes would hold up the cut.

Where the tip hardly moves while the tool turns, a rotary axis at its speed limit holds the tip below the feed, and the
ball rubs. A move is slow where its turn lets less than SHARE of the cutter's feed. Round slow moves the axes become
their means over a stretch of the pass, which spreads the turn over the neighbours; stretches grow as long as slow moves
are left. A pass that is slow then and has no cones, as those of rest paths, is held in one axis near the mean of all,
if one is admissible. An axis is changed only where the machine reaches the new one, it leans from the normal by no more
than is allowed and by no less than before or than the least lead, it stays in its cone if it was in one, and tool and
moves are proven free. Rings round the post stay slow: there the table must turn once.
"""

from dataclasses import replace
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, lengths, perpendicular, unit
from bonecam.job import PathJob
from bonecam.machine.limits import MachineLimits
from bonecam.planning.axes.admissible import within_limits
from bonecam.planning.axes.singularity import avoid_singularity
from bonecam.planning.axes.tool_axes import ToolAxes, WantedAxes
from bonecam.planning.collision.checker import CollisionChecker
from bonecam.tool.path import ContactPath

SHARE = 0.55
"""A move whose turn lets less of the cutter's feed is slow: half of it, and what the rounding of words and feeds may
take."""
STRETCHES = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Half lengths of the stretches that are tried, mm."""
LEANS = np.radians([10.0, 20.0, 30.0])
"""Angles (radians) from the mean of a pass of the axes that it is held in, so many of them round it at each:"""
AROUND = 8


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
    for lean, turn in product(LEANS, range(AROUND)):
        slow = easing.slow(axes)
        if not (slow & ~easing.in_cone).any():
            break
        axes = easing.held(axes, slow, lean, 2 * np.pi * turn / AROUND)
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
            share = self._shares(rows, slow, half)
            means = self._means(rows, axes, half)
            tried[rows] = unit((1 - share)[:, None] * axes[rows] + share[:, None] * means)
            inside = share > 0
            part[rows] = np.where(inside, parts + np.cumsum(np.diff(inside, prepend=False)), -1)
            parts += len(rows) + 1
        return self._taken(axes, self._within(tried), part, slow)

    def held(
        self, axes: Float[ndarray, "n 3"], slow: Bool[ndarray, " n"], lean: float, turn: float
    ) -> Float[ndarray, "n 3"]:
        """The axes; passes with slow moves and without cones are held in one that leans from their mean to some side
        (radians)."""
        tried = axes.copy()
        part = np.full(len(axes), -1)
        for number, rows in enumerate(self.rows):
            if slow[rows].any() and not self.in_cone[rows].any():
                mean = unit(axes[rows].sum(axis=0)[None])
                side = perpendicular(mean)
                to = np.cos(turn) * side + np.sin(turn) * np.cross(mean, side)
                tried[rows] = np.cos(lean) * mean + np.sin(lean) * to
                part[rows] = number
        return self._taken(axes, self._within(tried), part, slow)

    def _within(self, tried: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """The axes led round the pole and, where the machine has few, brought to those that it has."""
        tried = avoid_singularity(tried, self.path.centres, self.piece)
        return self.limits.nearest(tried) if self.limits.narrow else tried

    def _in_cones(self, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether each axis is in its contact's cone."""
        return np.zeros(len(axes), dtype=bool) if self.cones is None else self.cones.hold(axes)

    def _shares(self, rows: Int[ndarray, " r"], slow: Bool[ndarray, " n"], half: float) -> Float[ndarray, " r"]:
        """How much each contact of a pass takes of the mean: all of it at slow moves, none `half` (mm) beside them."""
        ends = np.flatnonzero(slow[rows])
        along = self.along[rows]
        marked = along[np.unique(np.r_[ends, np.minimum(ends + 1, len(rows) - 1)])]
        away = np.abs(along[:, None] - marked[None]).min(axis=1)
        return np.clip(1 - away / half, 0.0, 1.0)

    def _means(self, rows: Int[ndarray, " r"], axes: Float[ndarray, "n 3"], half: float) -> Float[ndarray, "r 3"]:
        """The mean axis of a pass from `half` (mm) before each contact to as much behind it."""
        along = self.along[rows]
        weights = np.gradient(along) + 1e-6 if len(rows) > 1 else np.ones(1)
        sums = np.vstack([np.zeros(3), np.cumsum(weights[:, None] * axes[rows], axis=0)])
        first, last = np.searchsorted(along, along - half), np.searchsorted(along, along + half, "right")
        return unit(sums[last] - sums[first])

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
