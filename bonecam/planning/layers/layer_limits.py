"""How deep a cut may be on the layers of a strategy."""

from bonecam.job import Job

FINISHING_LAYERS = {"iso-height": 2, "rotary": 1}
"""How many layers of each strategy, the last ones, are those of the finishing cutter."""
MOST_LAYERS = 2000
"""More layers than a strategy ever has: those of the thinnest roughing cuts of a bone."""


def layer_limits(job: Job) -> dict[int, float]:
    """The largest depth (mm) of the cut on each layer, counted from the last one as 0."""
    finishing = FINISHING_LAYERS[job.path.strategy]
    fine, rough = job.levels.finishing_depth, job.levels.layer_depth
    return {index: fine if index < finishing else rough for index in range(MOST_LAYERS)}
