"""What each level of a morph is cut with: the cutter, and how deep the cut may be."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from bonecam.job import Job
from bonecam.levels.measure.level import Level
from bonecam.machine.bodies import MachineBodies
from bonecam.planning.passes.engaged_segments import DepthLimits
from bonecam.tool.cutter import Cutter


def cutter_of(level: int, job: Job, bodies: MachineBodies) -> Cutter:
    """The cutter of a level, with the scallop that it may leave there and the feed of that cut."""
    number, name = (2, "finishing") if job.is_finishing(level) else (1, "roughing")
    cutter = Cutter.from_job(number, name, job.tool(name, level), bodies.nose)
    return replace(cutter, scallop=job.scallop(level))


def depth_limits(levels: Sequence[Level], level: int, cutters: Mapping[int, Cutter], job: Job) -> DepthLimits:
    """The depths of the cut that leaves a level."""
    before = cutters.get(level + 1)
    limit, outer = levels[level + 1].limit, levels[min(level + 2, len(levels) - 1)].limit
    return DepthLimits(
        limit, before.scallop if before else 0.0, least_depth(level, job), cutters[level].rest_depth(limit, outer)
    )


def least_depth(level: int, job: Job) -> float:
    """The depth (mm) below which a cut that leaves the level is left to the next one, if that is a roughing one too:
    `path.least_depth`, or half of the scallop that the next one takes off there in any case. The published pattern
    leaves none out, nor do jobs whose least depth is 0."""
    if job.path.pattern == "published":
        return -math.inf
    to_roughing = level > 0 and not job.is_finishing(level) and not job.is_finishing(level - 1)
    if not (to_roughing and job.path.least_depth):
        return 0.0
    return max(job.path.least_depth, job.scallop(level) / 2)
