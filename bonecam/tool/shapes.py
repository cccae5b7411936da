"""Where a cutter must be a ball: a bull nose or a flat end roughs the levels of a morph, and nothing else."""

from bonecam.errors import JobError
from bonecam.job import Job, field_error
from bonecam.machine.machine import Machine


def check_shapes(job: Job, machine: Machine) -> None:
    """JobError where a bull nose or a flat end is asked to do what is planned for balls alone."""
    for name in ("finishing", "fine"):
        if getattr(job, name).shape != "ball":
            raise _refused(job, name, "only a ball finishes")
    if job.roughing.shape == "ball":
        return
    if job.path.strategy != "morph" or job.path.pattern == "published":
        why = "other ends than balls rough the levels of a morph, in other patterns than the published one"
        raise _refused(job, "roughing", why)
    if job.holding.second:
        raise _refused(job, "roughing", "the second clamping roughs with a ball")
    if job.holding.parting:
        raise _refused(job, "roughing", "the groove that parts is turned by a ball")
    if machine.programmed_point == "centre":
        raise _refused(job, "roughing", f"{machine.name} programs the centre of a ball")


def only_balls(job: Job, what: str) -> None:
    """JobError where `what` is planned for balls alone and the roughing cutter is none."""
    if job.roughing.shape != "ball":
        raise _refused(job, "roughing", f"{what} is roughed with a ball")


def _refused(job: Job, name: str, why: str) -> JobError:
    return field_error(name, "shape", getattr(job, name).shape, f"{why}: give shape = 'ball'")
