"""Depths of the cuts that a job leaves open: the fewest that ball, neck and part bear.

The cut onto the part takes `levels.finishing_depth`. Each one outside it takes as much as these allow:

    the ball sinks in by half of its radius at most, where its edge meets material over 60 degrees;
    the peak of the force at the middle of the part keeps the neck below a third of its yield strength;
    the peak bends part and cutter by no more than what the cuts inside it still take off: so none cuts into the part.

So cuts are deep where much stands under them, and thin at the end. Before a roughing cut the roughing cutter leaves
scallops of `levels.scallop_share` (0: SCALLOP_SHARE) of its depth, or `roughing.scallop` where that is more. A
neck is found with its depths (`neck.py`): a weak one has shallower cuts.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bonecam.job import Job
from bonecam.machine.limits import MachineLimits
from bonecam.mechanics.cutter import cutter_compliance
from bonecam.mechanics.strip import job_strip_force
from bonecam.mechanics.workpiece import mechanics_of_job
from bonecam.planning.holding.finished_beam import finished_beam, normal_compliance
from bonecam.setup.placement import Setup
from bonecam.tool.cutter import Cutter

PEAK_SHARE = 0.9
"""Peak force of a roughing pass, as a share of `strip_force`: 60 N at a depth of 0.5 mm, 120 and 126 N at 1 mm."""
YIELD_SHARE = 1 / 3
"""Of the yield strength, which the stress at that peak may reach."""
BALL_SHARE = 0.5
"""A roughing ball sinks in by this share of its radius at most."""
SCALLOP_SHARE = 0.1
"""`levels.scallop_share` of depths that are found where a job states none: with 0.2 a program is 10 % shorter, and
its cuts are 0.06 to 0.09 mm deeper than their levels allow, beyond what is warned of."""
R10 = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)
"""The preferred numbers of a decade (ISO 3): depths that are tried, mm, and their decimal multiples."""


def leaves_depths_open(job: Job, *, neck_found: bool) -> bool:
    """Whether depths are to be found: where the job asks for it, or, on levels that are not as published, states none
    and it is known how its neck holds, found or stated (`neck_found`)."""
    morphs = job.path.strategy == "morph" and "published" not in (job.levels.method, job.path.pattern)
    return job.levels.found or (neck_found and morphs and job.levels.automatic)


def with_found_depths(setup: Setup, job: Job, limits: MachineLimits) -> Job:
    """The job with the depths of its cuts that its holding bears; JobError where nothing is known of the stiffness of
    its material."""
    stiffness, force = mechanics_of_job(job)
    part = setup.part.mesh
    beam = finished_beam(part, setup.post, job.holding, stiffness)
    stress = float(beam.moment_stress(np.array([[1.0, 0.0, 0.0]]), part.bounds.mean(axis=0)[None])[0])
    cutter = Cutter.from_job(1, "roughing", job.tool("roughing"), limits.bodies.nose)
    give = normal_compliance(beam, part) + cutter_compliance(cutter)
    strongest = YIELD_SHARE * stiffness.yield_strength

    finishing = job.levels.finishing_depth
    tried = preferred_depths(finishing, BALL_SHARE * cutter.radius)
    peaks = {depth: PEAK_SHARE * job_strip_force(force, _with_depths(job, [depth]), "roughing") for depth in tried}

    def bears(depth: float, under: float) -> bool:
        """Whether a roughing cut may take a depth (mm) where `under` mm more stand on the part."""
        return peaks[depth] * give <= under and peaks[depth] * stress <= strongest

    return _with_depths(job, found_depths(finishing, tried, setup.stock.diameter, bears))


def depths_report(job: Job) -> dict[str, Any]:
    """`depths_found` in the report's section `post`: the depths (mm) of the cuts of a job that were found."""
    return {"depths_found": list(job.levels.listed)}


def _with_depths(job: Job, depths: Sequence[float]) -> Job:
    """The job with these depths (mm) of its cuts, and the scallops that go with them."""
    stated = " ".join(f"{depth:g}" for depth in depths)
    share = job.levels.scallop_share or SCALLOP_SHARE
    return job.with_values(levels={"depths": stated, "scallop_share": share})


def preferred_depths(above: float, most: float) -> list[float]:
    """The depths (mm) that are tried, rising: beyond `above`, `most` at most, itself included."""
    decades = range(math.floor(math.log10(above)), math.ceil(math.log10(most)) + 1)
    depths = [round(10.0**decade * step, 6) for decade in decades for step in R10]
    return [depth for depth in depths if above < depth < most] + [most] * (most > above)


def found_depths(
    finishing: float, tried: Sequence[float], enough: float, bears: Callable[[float, float], bool]
) -> tuple[float, ...]:
    """The depths (mm) from the part outwards, the last for all others: `finishing`, then each time the largest of those
    `tried`, which rise, that is no shallower than the one before and that the holding `bears` (depth, what stands
    under it), or as much as before; until the largest of all is reached, or `enough`."""
    depths = [finishing]
    while sum(depths) < enough and tried and depths[-1] < tried[-1]:
        borne = [depth for depth in tried if depth > depths[-1] and bears(depth, sum(depths))]
        depths.append(max(borne, default=depths[-1]))
    while len(depths) > 1 and depths[-2] == depths[-1]:
        depths.pop()
    return tuple(depths)
