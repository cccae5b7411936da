"""What a tailstock keeps the tool from: its bracket stands beside the part, in the way of holder and spindle."""

from dataclasses import replace

import numpy as np

from bonecam.job import Job, field_error
from bonecam.job.holding.tailstock_section import NO_TAILSTOCK
from bonecam.machine.limits import MachineLimits
from bonecam.planning.holding.post_length import sampled_lifts_of_part
from bonecam.setup.placement import Setup

CONTACTS = 400
"""So many contacts are sampled on the part."""


def blocked_share(setup: Setup, job: Job, limits: MachineLimits) -> float:
    """The share of the sampled contacts of the part that are reached without the tailstock of a job, whose bracket is
    settled, and not with it; 0 where it has none. JobError where it leaves none of them."""
    if not job.holding.has_tailstock:
        return 0.0
    bare = replace(job, holding=replace(job.holding, tailstock=NO_TAILSTOCK))
    without = np.isfinite(sampled_lifts_of_part(replace(setup, post=setup.post.alone), bare, limits, CONTACTS))
    with_it = np.isfinite(sampled_lifts_of_part(setup, job, limits, CONTACTS))
    if not without.any():
        return 0.0  # whatever is in the way, the tailstock is not what keeps the tool off
    if not with_it.any():
        reach = job.holding.tailstock_reach
        bound = "arm and column stand in the way of holder and spindle everywhere: give more, a longer pin "
        raise field_error(
            "holding", "tailstock_reach", reach, f"{bound}(tailstock_length), a longer overhang, or no tailstock"
        )
    return max(1.0 - with_it.sum() / without.sum(), 0.0)
