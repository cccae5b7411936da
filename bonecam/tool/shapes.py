"""Where a cutter must be a ball: a bull nose roughs the levels of a morph, and nothing else."""

from bonecam.errors import JobError
from bonecam.job import Job, field_error
from bonecam.machine.machine import Machine


def check_shapes(job: Job, machine: Machine) -> None:
    """JobError where a bull nose is asked to do what is planned for balls alone."""
    bulls = [name for name in ("roughing", "finishing", "fine") if getattr(job, name).shape == "bull"]
    for name in bulls:
        if name != "roughing":
            raise _refused(name, "a bull nose only roughs")
    if not bulls:
        return
    if job.path.strategy != "morph" or job.path.pattern == "published":
        raise _refused(
            "roughing", "a bull nose roughs the levels of a morph, in other patterns than the published one"
        )
    if job.holding.second:
        raise _refused("roughing", "the second clamping roughs with a ball")
    if job.holding.parting:
        raise _refused("roughing", "the groove that parts is turned by a ball")
    if machine.programmed_point == "centre":
        raise _refused("roughing", f"{machine.name} programs the centre of a ball")


def only_balls(job: Job, what: str) -> None:
    """JobError where `what` is planned for balls alone and the roughing cutter is a bull nose."""
    if job.roughing.shape == "bull":
        raise _refused("roughing", f"{what} is roughed with a ball")


def _refused(name: str, why: str) -> JobError:
    return field_error(name, "shape", "bull", f"{why}: give shape = 'ball'")
