"""What a job has to meet before any work is done for it: sizes, cutters and machine that go together, a post
that meets the part.

Every refusal names the field with its value, the bound and the remedy.
"""

from bonecam.errors import MachineError
from bonecam.job import Job, LevelsJob, wrong
from bonecam.levels.solvers.clarabel import require_clarabel
from bonecam.nc.machine import Machine
from bonecam.nc.tool_requirements import check_tools
from bonecam.setup.placement import check_sizes
from bonecam.setup.stock import Stock
from bonecam.toolpath.zigzag import MAX_DEPTH_RADII


def check_job(job: Job, machine: Machine) -> None:
    """JobError where fields of the job do not go together, ask more of the machine than it has, or of a
    solver that is not installed."""
    check_sizes(job.stock)
    check_tools(job, machine)
    check_depths(job)
    check_method(job.levels)
    if abs(job.path.lead_deg) > job.path.max_tilt_deg:
        raise wrong(
            "path",
            "lead_deg",
            job.path.lead_deg,
            f"keep it within path.max_tilt_deg ({job.path.max_tilt_deg:g})",
        )


def check_method(levels: LevelsJob) -> None:
    """JobError where the solver of the levels is not installed."""
    if levels.method == "qcqp":
        require_clarabel()


def check_depths(job: Job) -> None:
    """JobError where a cut is deeper than its ball may sink: nothing of the level would be cut."""
    first, beyond = job.levels.cuts
    listed = bool(job.levels.depths.strip())
    for level, depth in enumerate((*first, beyond)):
        section = "finishing" if job.is_finishing(level) else "roughing"
        radius = getattr(job, section).radius
        if depth > MAX_DEPTH_RADII * radius:
            name = "depths" if listed else "finishing_depth" if level < len(first) else "roughing_depth"
            bound = f"a ball of {section}.radius = {radius:g} mm sinks {MAX_DEPTH_RADII * radius:g} mm at most ({MAX_DEPTH_RADII:g} of it)"
            raise wrong(
                "levels", name, getattr(job.levels, name), f"{bound}: give shallower cuts or a larger ball"
            )


def check_room(stock: Stock, job: Job, machine: Machine) -> None:
    """MachineError where the stock on its post with a tool above it cannot be within the machine's travel."""
    needed = job.holding.length + stock.length + max(job.roughing.overhang, job.finishing.overhang)
    for axis in machine.linear:
        extent = needed if axis.letter == "Z" else stock.diameter
        if extent > axis.travel:
            raise MachineError(
                f"{machine.name}: {extent:.0f} mm are needed along {axis.letter}, its travel is {axis.travel:.0f} mm: "
                "take a larger machine (--machine), or a smaller stock, a shorter post or tool",
                axis=axis.letter,
                needed=extent,
                travel=axis.travel,
            )
