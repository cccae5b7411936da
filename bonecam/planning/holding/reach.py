"""What would shorten a post: other parameters, and the post's length with each; and what a shorter post costs.

The lengths are those that `post_length.py` finds for the job with one parameter changed. Where the post is cut
shorter instead, the contacts that need more of it stay uncut: all of them lie round the post.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bonecam.job import Job
from bonecam.machine.limits import MachineLimits
from bonecam.planning.holding.post_length import sampled_lifts, sampled_lifts_of_part, shortest_post
from bonecam.setup.placement import Setup
from bonecam.workholding.clamping import clamping_of

STEEP_TILT = 80.0
"""A ball still cuts well with its axis tilted by this from the normal, degrees: its equator cuts, not its shank."""
SHORT_OVERHANG = 0.8
"""Share of the finishing cutter's overhang that is tried; it has to stay behind the flutes."""
SHARES = (0.75, 0.5)
"""Shares of the post's length for which is told what would stay uncut."""


@dataclass(frozen=True)
class Remedy:
    """A change of the job or the machine, and the length of the post with it, mm."""

    change: str
    length: float


@dataclass(frozen=True)
class ShorterPost:
    """Length of a shorter post, mm, and the area of the part that would stay uncut with it, mm^2."""

    length: float
    uncut: float


@dataclass(frozen=True)
class ReachAdvice:
    """What shortens the post, the most helpful first, and what it costs to cut it shorter as it is."""

    remedies: tuple[Remedy, ...]
    shorter: tuple[ShorterPost, ...]

    @property
    def report(self) -> dict[str, list[dict[str, float | str]]]:
        """The advice in the report's section `post`."""
        return {
            "remedies": [{"change": each.change, "length_mm": each.length} for each in self.remedies],
            "shorter": [{"length_mm": each.length, "uncut_mm2": round(each.uncut, 1)} for each in self.shorter],
        }


def post_advice(setup: Setup, job: Job, limits: MachineLimits) -> dict[str, Any]:
    """`remedies` and `shorter` of the report of a post that was found, where it is slender; nothing where it is not."""
    if job.holding.length - job.holding.support_height <= job.warnings.slender * job.holding.diameter:
        return {}
    return what_would_help(setup, job, limits).report


def what_would_help(setup: Setup, job: Job, limits: MachineLimits) -> ReachAdvice:
    """What would shorten the post of a job, on which the part stands already."""
    length = job.holding.length
    height = float(setup.stock.bounds[0, 2])
    clamping = clamping_of(job.holding, limits.bodies.table)
    remedies = [
        Remedy(change, shortest_post(sampled_lifts(setup, changed, other), height, clamping))
        for change, changed, other in _changes(job, limits)
    ]
    helpful = sorted((each for each in remedies if each.length < length), key=lambda each: each.length)

    lifts = sampled_lifts_of_part(setup, job, limits)
    each_area = setup.part.mesh.area / len(lifts)
    shorter = []
    for wanted in (float(np.ceil(share * length)) for share in SHARES):
        missed = np.isfinite(lifts) & (lifts > wanted - height)
        shorter.append(ShorterPost(wanted, float(missed.sum() * each_area)))
    return ReachAdvice(tuple(helpful), tuple(shorter))


def _changes(job: Job, limits: MachineLimits) -> Iterator[tuple[str, Job, MachineLimits]]:
    """Changes that are tried: what it is, and job and machine with it."""
    if job.path.max_tilt_deg < STEEP_TILT:
        steep = replace(job, path=replace(job.path, max_tilt_deg=STEEP_TILT))
        yield f"path.max_tilt_deg = {STEEP_TILT:g}", steep, limits
    overhang = round(SHORT_OVERHANG * job.finishing.overhang, 1)
    if overhang > max(job.finishing.flute_length, job.finishing.neck_length):
        short = replace(job, finishing=replace(job.finishing, overhang=overhang))
        yield f"finishing.overhang = {overhang:g}", short, limits
    if limits.bodies.nose:
        narrow = replace(limits.bodies, nose=())
        yield "a spindle no wider than the holder", job, replace(limits, bodies=narrow)
