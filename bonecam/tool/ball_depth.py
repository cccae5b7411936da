"""How deep the ball of a cutter may sink into the material."""

from bonecam.job import Job, field_error

MAX_DEPTH_RADII = 0.75
"""A ball is never sunk deeper than this many radii into the material."""


def check_depths(job: Job) -> None:
    """JobError where the depth of a cut is more than the ball of its cutter may sink into the material."""
    first, beyond = job.levels.cuts
    for level, depth in enumerate((*first, beyond)):
        section = "finishing" if job.is_finishing(level) else "roughing"
        radius = getattr(job, section).radius
        deepest = MAX_DEPTH_RADII * radius
        if depth > deepest:
            name = _depth_field(job, level, len(first))
            bound = (
                f"a ball of {section}.radius = {radius:g} mm sinks {deepest:g} mm at most ({MAX_DEPTH_RADII:g} of it)"
            )
            remedy = "give shallower cuts or a larger ball"
            raise field_error("levels", name, getattr(job.levels, name), f"{bound}: {remedy}")


def _depth_field(job: Job, level: int, first: int) -> str:
    """The field of the levels' job that gives the depth of a level's cut, where `first` depths are listed
    apart."""
    if job.levels.listed:
        return "depths"
    return "finishing_depth" if level < first else "roughing_depth"
