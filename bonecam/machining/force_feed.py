"""Feeds by the force: the paths of a program whose removal was simulated, with feeds for an even peak
(`mechanics/feed_schedule.py`) where cutter and machine allow them.

No tooth takes more than the largest chip of the material's cutting data or leaves feed marks over the scallop, nor less
than half of what it takes at the cutter's feed: it would rub. No feed is raised beyond what the accelerations of the
machine's axes let a move reach, where they are known; `drivable_paths` keeps it within their speeds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import Job, field_error
from bonecam.machine.machine import Machine
from bonecam.mechanics.feed_schedule import LEAST, FeedSchedule, feed_schedule, peaks
from bonecam.mechanics.loads import PathLoads
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.feeds.drivable_feeds import fastest_cut
from bonecam.nc.posting.path_words import Posted, post_path
from bonecam.nc.reading.read import read_program
from bonecam.report.page.move_sources import rows_of_moves
from bonecam.tool.path import PARTING, MoveKind, ToolPath
from bonecam.verify.removal.result import Removal

STEP = 1.25
"""Ratio of one feed to the next: few words of F."""


@dataclass(frozen=True, eq=False)
class PathsByForce:
    """Paths with feeds by a `schedule`."""

    paths: tuple[ToolPath, ...]
    schedule: FeedSchedule


@dataclass(frozen=True, eq=False)
class BeforeForce:
    """What a program with constant feeds had: its removal, its time, and the schedule that was made of these."""

    schedule: FeedSchedule
    removal: Removal
    minutes: float

    def report(self, after: Removal, minutes: float) -> dict[str, Any]:
        """`feed` of the report: times and peaks before and after."""
        cutters = [
            {"tool": tool, "target_n": round(target, 2), **_peaks(self.removal, after, tool)}
            for tool, target in self.schedule.targets.items()
        ]
        return {"by": "force", "time_min": [round(self.minutes, 3), round(minutes, 3)], "cutters": cutters}


def check_force_asked(job: Job, *, asked: bool) -> None:
    """JobError where feeds are to follow a force that is not `asked` for."""
    if job.path.feed == "force" and not asked:
        why = "the force is found by the simulation of the text: leave out --no-simulation and --no-mechanics"
        raise field_error("path", "feed", job.path.feed, why)


def check_one_feed(job: Job, why: str) -> None:
    """JobError where a job wants its feeds by the force, which what it is for does not give, as `why` says."""
    if job.path.feed == "force":
        raise field_error("path", "feed", job.path.feed, f"{why}: leave it out, or use `convert`")


def with_constant_feed(job: Job) -> Job:
    """The job with one feed for each cutter."""
    return replace(job, path=replace(job.path, feed="constant"))


def paths_by_force(
    paths: Sequence[ToolPath], text: str, removal: Removal, machine: Machine, dialect: Dialect, job: Job
) -> PathsByForce:
    """The `paths` that the `text` was posted from, with feeds by the force that its removal tells; ValueError where
    that was not asked."""
    if removal.mechanics is None:
        raise ValueError("the removal knows no force: simulate it with a workpiece")
    motions = read_program(text, machine, dialect)
    tools = [level.tool for level in removal.levels]
    schedule = feed_schedule(removal.mechanics.paths, tools, len(motions.tips))
    leads = rows_of_moves(motions, paths, dialect)
    ratios = np.full(sum(len(path.tips) for path in paths), np.inf)
    np.minimum.at(ratios, leads.rows[~leads.away], schedule.ratios[~leads.away])
    ratios[~np.isfinite(ratios)] = 1.0
    around = np.vstack([path.tips for path in paths])
    before = None
    by_force = []
    first = 0
    for path in paths:
        wanted = _wanted(path, ratios[first : first + len(path.tips)], job)
        posted = post_path(wanted, machine, dialect=dialect, job=job, around=around, before=before)
        before = posted.moves.angles[-1]
        by_force.append(_reachable(path, posted))
        first += len(path.tips)
    return PathsByForce(tuple(by_force), schedule)


def _wanted(path: ToolPath, ratios: Float[ndarray, " n"], job: Job) -> ToolPath:
    """A path whose cuts have the feeds of the ratios, each no more than those of the rows beside it in its pass."""
    cuts = path.kinds == MoveKind.CUT
    goes_on = np.r_[False, cuts[1:] & cuts[:-1] & (np.diff(path.pass_index) == 0)]
    least = ratios.copy()
    least[1:] = np.where(goes_on[1:], np.minimum(least[1:], ratios[:-1]), least[1:])
    least[:-1] = np.where(goes_on[1:], np.minimum(least[:-1], ratios[1:]), least[:-1])
    feeds = path.feed_rates
    feed = path.cutter.feed
    low = np.minimum(feeds, LEAST * feed)
    high = np.maximum(feeds, fastest_cut(path.cutter, job))
    steps = _stepped(np.clip(feeds * least, low, high), feed)
    # what an axis or evenness has lowered to between two steps stays
    stepped = np.where(least < 1, np.minimum(steps, feeds), np.maximum(steps, feeds))
    changed = goes_on & (path.level != PARTING)
    return replace(path, feed_rates=np.where(changed, np.clip(stepped, low, high), feeds))


def _stepped(feeds: Float[ndarray, "n"], feed: float) -> Float[ndarray, "n"]:
    """The feeds rounded down to whole STEPs from the cutter's `feed`."""
    return np.asarray(feed * STEP ** np.floor(np.log(np.maximum(feeds, 1e-6) / feed) / np.log(STEP) + 1e-6))


def _reachable(path: ToolPath, posted: Posted) -> ToolPath:
    """The path with the feeds of its posted form, those that are raised no higher than the axes get to."""
    feeds = posted.path.feed_rates
    if posted.control.machine.knows_accelerations:
        rows = posted.moves.rows
        count = len(path.tips)
        way = np.bincount(rows, posted.lengths, count)
        minutes = np.bincount(rows, posted.driven_minutes, count)
        reached = np.where(minutes > 0, way / np.where(minutes > 0, minutes, 1.0), feeds)
        reached = _stepped(reached, path.cutter.feed)
        raised = feeds > path.feed_rates
        feeds = np.where(raised, np.clip(reached, path.feed_rates, np.maximum(feeds, path.feed_rates)), feeds)
    return replace(path, feed_rates=feeds)


def _peaks(before: Removal, after: Removal, tool: int) -> dict[str, list[float]]:
    """The peaks (N) of a cutter at 95 % of its time and at most, before and after."""
    pairs = [peaks(_loads(removal, tool), (0.95, 1.0)) for removal in (before, after)]
    return {name: [round(pair[k], 2) for pair in pairs] for k, name in enumerate(("peak_p95_n", "peak_max_n"))}


def _loads(removal: Removal, tool: int) -> list[PathLoads]:
    """The loads of the paths of a cutter, but of those that part."""
    assert removal.mechanics is not None
    both = zip(removal.mechanics.paths, removal.levels, strict=True)
    return [path for path, level in both if level.tool == tool and path.index != PARTING]
