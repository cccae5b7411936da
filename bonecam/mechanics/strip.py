"""The force of one edge of a ball at the middle of a strip, in closed form: what clamping is chosen by, before any path
is planned."""

import math
from collections.abc import Iterator

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import JobError
from bonecam.job import Job
from bonecam.job.materials.mechanical import CuttingForce

SHALLOWER = (2.0, 3.0, 5.0)
"""How many times as shallow finishing cuts are asked, with scallops as much lower."""


def strip_force(force: CuttingForce, radius: float, depth: float, scallop: float, chip: float) -> Float[ndarray, "3"]:
    """Forces (N: tangential, radial, that is along the normal of the ball, axial) on an edge of a ball of `radius` mm
    that takes `chip` mm off the middle of a strip `depth` mm deep, beside one that was left with scallops of `scallop`
    mm.

    The edge is engaged from where the strip before it ends, a = acos(1 - depth / R) from the middle of the ball's
    groove, to half of the way w = sqrt(8 R scallop) between two passes on the other side: over R (a + asin(w / 2R))
    along the ball, with chips of h sin(kappa) (Altintas 2012, 2.8). Depth and scallop beyond the radius count as it.
    """
    whole = math.acos(1 - min(depth / radius, 1.0))
    half = math.asin(min(math.sqrt(2 * scallop / radius), 1.0))
    edge = radius * (whole + half)
    area = chip * radius * (2 - math.cos(whole) - math.cos(half))
    return force.array[:3] * area + force.array[3:] * edge


def job_strip_forces(force: CuttingForce, job: Job, name: str) -> Float[ndarray, "3"]:
    """The forces (N) of the deepest strip of the cutter "roughing" or "finishing" of a job, as `strip_force`."""
    tool = job.tool(name)
    depth = job.deepest(name)
    chip = tool.feed / (tool.spindle * tool.flutes)
    scallop = max(tool.scallop, job.levels.scallop_share * depth) if name == "roughing" else tool.scallop
    return strip_force(force, tool.radius, depth, scallop, chip)


def job_strip_force(force: CuttingForce, job: Job, name: str) -> float:
    """The size (N) of the force of the deepest strip of the cutter "roughing" or "finishing" of a job."""
    return float(np.linalg.norm(job_strip_forces(force, job, name)))


def lighter_jobs(job: Job) -> Iterator[tuple[str, Job]]:
    """Jobs with ever shallower finishing cuts than those of a job, and these cuts in words; at the feed that the
    material gives them."""
    levels = job.levels
    fields = "levels.finishing_depth, finishing.scallop"
    by_number = not levels.listed and bool(levels.cuts[0])
    if not by_number:
        fields = "levels.finishing_depth, the first of levels.depths where they are stated, finishing.scallop"
    for times in SHALLOWER:
        depth, scallop = (float(f"{value / times:.2g}") for value in (job.deepest("finishing"), job.finishing.scallop))
        changed: dict[str, float | str] = {"finishing_depth": depth}
        if not by_number:
            outer = levels.listed[1:] or (levels.cuts[1],)
            changed |= {"schedule": "numbers", "depths": " ".join(f"{each:g}" for each in (depth, *outer))}
        try:
            lighter = job.with_values(levels=changed, finishing={"scallop": scallop})
        except JobError:  # a job takes none that are so small
            continue
        yield f"finishing cuts of {depth:g} mm with scallops of {scallop:g} ({fields})", lighter


def lighter_cuts(force: CuttingForce, job: Job) -> tuple[tuple[str, float], ...]:
    """Finishing cuts of `lighter_jobs`, in words, and the share of its force that each takes."""
    whole = job_strip_force(force, job, "finishing")
    return tuple((what, job_strip_force(force, lighter, "finishing") / whole) for what, lighter in lighter_jobs(job))
