"""What the planning of paths must know of a machine's rotary axes: which tool axes it has, how fast the axes are, and
where they come to their limits within a path."""

from functools import lru_cache, partial

import numpy as np

from bonecam.machine.limits import MachineLimits, polar_angles
from bonecam.machine.machine import Machine
from bonecam.machine.reach import EVEN, planned_band, reached_axes
from bonecam.nc.posting.rotary.lifts import lift_places


@lru_cache(maxsize=8)
def machine_limits(machine: Machine) -> MachineLimits:
    """The tool axes that paths for the machine may use: polar angles within the band that it has all round, or else
    those that its joints reach. The rotary axis nearer to the part's Z changes the azimuth, the other one the polar
    angle. MachineError where the tool has a single direction."""
    turn, tilt = sorted(machine.rotary, key=lambda axis: -abs(machine.in_part(np.array([axis.direction]))[0, 2]))
    band = planned_band(machine)
    reached = None
    if band is None:
        reached = reached_axes(machine)
        angles = polar_angles(reached.samples)
        band = max(float(angles.min()) - EVEN, 0.0), min(float(angles.max()) + EVEN, np.pi)
    return MachineLimits(
        band[1],
        band[0],
        tilt_speed=tilt.speed,
        turn_speed=turn.speed,
        lift_places=partial(lift_places, machine),
        bodies=machine.bodies,
        reached=reached,
    )
