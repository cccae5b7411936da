"""What a machine must have for a job: the speeds of its spindle and axes, and the travel for stock and
tool."""

from bonecam.errors import MachineError
from bonecam.job import Job, ToolJob, field_error
from bonecam.nc.machine import Machine
from bonecam.orientation.axes.lead import check_lead
from bonecam.setup.stock import Stock
from bonecam.toolpath.cutters.cutter import Cutter


def check_tools(job: Job, machine: Machine) -> None:
    """JobError where a cutter cannot be made, is driven faster than the machine can, or enters a flat
    part."""
    for section in ("roughing", "finishing"):
        tool = job.tool(section)
        cutter = Cutter.from_job(0, section, tool, machine.nose)
        _check_speeds(section, tool, machine)
        check_lead(cutter, job.path.lead_deg)


def _check_speeds(section: str, tool: ToolJob, machine: Machine) -> None:
    """JobError where spindle speed (1/min) or feed (mm/min) are more than the machine has."""
    if tool.spindle > machine.spindle_speed:
        bound = f"{machine.name} turns at {machine.spindle_speed:g} 1/min at most: give less"
        raise field_error(section, "spindle", tool.spindle, bound)

    slowest = min(axis.speed for axis in machine.linear)
    if tool.feed > slowest:
        bound = f"an axis of {machine.name} makes {slowest:g} mm/min at most: give less"
        raise field_error(section, "feed", tool.feed, bound)


def check_room(stock: Stock, job: Job, machine: Machine) -> None:
    """MachineError where an axis of the machine travels less than the post, the stock on it and a tool
    need."""
    height = job.holding.length + stock.length + max(job.roughing.overhang, job.finishing.overhang)
    for axis in machine.linear:
        needed = height if axis.letter == "Z" else stock.diameter
        if needed > axis.travel:
            bound = f"{needed:.0f} mm are needed along {axis.letter}, its travel is {axis.travel:.0f} mm"
            remedy = "take a larger machine (--machine), or a smaller stock, a shorter post or tool"
            evidence = {"axis": axis.letter, "needed": needed, "travel": axis.travel}
            raise MachineError(f"{machine.name}: {bound}: {remedy}", **evidence)
