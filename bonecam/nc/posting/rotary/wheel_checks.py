"""Whether a wheel can be cut at all: on the machine, and by the cutters between its blades."""

from bonecam.errors import MachineError, place_name
from bonecam.job import Job, field_error
from bonecam.machine.machine import Machine
from bonecam.nc.posting.rotary.machine_limits import machine_limits
from bonecam.planning.links.link_space import UP
from bonecam.surface.blades.wheel import Wheel


def require_upright(machine: Machine) -> None:
    """MachineError where the tool cannot stand upright over the wheel's axis, from where it goes to the next blade."""
    if (machine_limits(machine).nearest(UP[None])[0] != UP).any():
        what = "its tool cannot stand along the wheel's axis, over which it goes from blade to blade"
        raise MachineError(f"{machine.name}: {what}: take a mill of five axes", machine=machine.name)


def require_room(wheel: Wheel, job: Job) -> None:
    """JobError where a cutter does not pass between two blades."""
    gap, place = wheel.gap()
    for name in ("roughing", "finishing"):
        width = 2 * job.tool(name).radius
        kept = 2 * job.levels.finishing_depth if name == "roughing" else 0.0
        if gap < width + kept:
            need = f"{width:g} mm" + (f" and the allowance of {kept:g} mm on both blades" if kept else "")
            what = f"the blades are {gap:.2f} mm apart at {place_name(place)}, the ball needs {need}"
            raise field_error(name, "radius", job.tool(name).radius, f"{what}: give a smaller ball")
