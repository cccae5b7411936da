"""The tool paths of the parting pass (`planning/passes/parting.py`), and whether a cutter reaches its groove at all."""

from dataclasses import replace

from bonecam.errors import JobError, OrientationError
from bonecam.job import Job, field_error
from bonecam.machine.limits import MachineLimits
from bonecam.planning.collision.scene import Scene
from bonecam.planning.holding.post_length import parting_lift
from bonecam.planning.oriented_path import orient
from bonecam.planning.passes.parting import groove_below, groove_core, parting_contacts, parting_cutters
from bonecam.setup.placement import Setup
from bonecam.tool.path import ToolPath
from bonecam.workholding.clamping import clamping_of

REMEDY = "give a larger holding.parting_stand_off, a longer post or a longer overhang, or no parting"


def check_parting(setup: Setup, job: Job, limits: MachineLimits) -> None:
    """JobError where the parting groove of a job would come too near to what stands on the table, or no cutter
    reaches it with the part on its post."""
    if not job.holding.parting:
        return
    clamping = clamping_of(job.holding, limits.bodies.table).below
    kept = max((column.top for column in clamping.kept_columns("cutter")), default=clamping.clearance)
    lowest = float(setup.part.mesh.bounds[0, 2])
    grooves = [groove_below(lowest, setup.post, job.holding, cutter) for cutter in parting_cutters(job, limits.bodies)]
    bottom = max(groove.bottom for groove in grooves)
    if bottom < kept:
        bound = f"the groove ends at z {bottom:.2f}, all is kept off what is below z {kept:.2f}"
        raise _error(job, f"{bound}: give less, or a longer post (holding.length)")
    if not parting_lift(setup, job, limits) <= 0:
        raise _error(job, f"no cutter reaches the groove: {REMEDY}")


def parting_paths(scene: Scene, job: Job, limits: MachineLimits) -> list[ToolPath]:
    """The paths of the parting groove below the finished part, the level of `scene`, whose material is what stands
    then; none where the job wants none. OrientationError where no cutter gets all round."""
    if not job.holding.parting:
        return []
    for cutter in parting_cutters(job, limits.bodies):
        try:
            # The paths of one cutter
            lowest = float(scene.level.bounds[0, 2])
            groove = groove_below(lowest, scene.post, job.holding, cutter, scene.material)
            paths = [
                orient(step, replace(scene, core=groove_core(step, scene.post)), limits, job.path, job.nc)
                for step in parting_contacts(groove, cutter, job)
            ]
        except OrientationError:
            continue
        if not any(len(path.uncut) for path in paths):
            return paths
    raise OrientationError(f"parting: no cutter reaches the groove all round: {REMEDY}")


def _error(job: Job, what: str) -> JobError:
    """The error of a groove that cannot be."""
    return field_error("holding", "parting_stand_off", job.holding.parting_stand_off, what)
