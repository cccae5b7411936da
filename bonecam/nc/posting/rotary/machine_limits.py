"""What the planning of paths must know of a machine's rotary axes: how far the tool axis tilts, how fast the axes are,
and where they come to their limits within a path."""

from functools import lru_cache, partial

import numpy as np

from bonecam.errors import MachineError
from bonecam.machine.kinematics import inverse_rotary, within_limits
from bonecam.machine.limits import MachineLimits
from bonecam.machine.machine import Machine
from bonecam.nc.posting.rotary.lifts import lift_places

AXIS_MARGIN = np.radians(1.0)
"""Kept from the machine's tilt limit, radians: a turn of up to 30 degrees between two axes at the limit
bulges past it by less."""


def tilt_limit(machine: Machine) -> float:
    """The largest angle (rad) from +Z that the tool axis reaches in every direction round the part."""
    azimuths = np.linspace(0, 2 * np.pi, 73)[:-1]
    tilts = np.radians(np.arange(0.0, 180.01, 0.25))
    tilt, azimuth = (grid.ravel() for grid in np.meshgrid(tilts, azimuths, indexing="ij"))
    axes = np.column_stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    found, _ = inverse_rotary(machine, axes)
    reached = within_limits(machine, found).any(1).reshape(len(tilts), -1).all(1)
    return float(tilts[-1] if reached.all() else tilts[max(int(np.argmin(reached)) - 1, 0)])


@lru_cache(maxsize=8)
def machine_limits(machine: Machine) -> MachineLimits:
    """The polar angles that tool paths for the machine may use: up to AXIS_MARGIN below its tilt limit. The rotary
    axis nearer to Z changes the azimuth, the other one the polar angle."""
    turn, tilt = sorted(machine.rotary, key=lambda axis: -abs(axis.direction[2]))
    largest = tilt_limit(machine) - AXIS_MARGIN
    if largest <= 0:
        bounded = [axis for axis in machine.rotary if axis.bounded]
        ranges = ((axis.letter, *np.degrees(axis.limits)) for axis in bounded)
        bounds = ", ".join(f"{letter} {low:g} to {high:g} deg" for letter, low, high in ranges)
        raise MachineError(
            f"{machine.name}: with {bounds} the tool axis leans to some sides only: give wider limits, or take another "
            "machine (--machine)",
            machine=machine.name,
        )
    return MachineLimits(
        largest,
        tilt_speed=tilt.speed,
        turn_speed=turn.speed,
        lift_places=partial(lift_places, machine),
        bodies=machine.bodies,
    )
