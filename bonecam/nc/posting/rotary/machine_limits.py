"""What the planning of paths must know of a machine's rotary axes: which tool axes it has, how fast the axes are, and
where they come to their limits within a path."""

from functools import lru_cache, partial

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.machine.kinematics import inverse_linear
from bonecam.machine.limits import MachineLimits, polar_angles
from bonecam.machine.machine import Machine
from bonecam.machine.reach import EVEN, planned_band, reached_axes
from bonecam.nc.posting.path_words import axis_minutes
from bonecam.nc.posting.rotary.choice import choose_angles
from bonecam.nc.posting.rotary.lifts import lift_places
from bonecam.planning.motion_time import motion_minutes
from bonecam.tool.path import MoveKind

HOLD_CONE = np.radians(0.0005)
"""A tilt by less is none: the last decimal of words."""


@lru_cache(maxsize=8)
def machine_limits(machine: Machine) -> MachineLimits:
    """The tool axes that paths for the machine may use: polar angles within the band that it has all round, or else
    those that its joints reach. The rotary axis nearer to the part's Z changes the azimuth, the other one the polar
    angle. MachineError where the tool has a single direction."""
    turn, tilt = sorted(
        machine.rotary, key=lambda axis: -abs(machine.in_part(np.array([axis.direction]))[0, 2])
    )
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
        path_minutes=partial(path_minutes, machine),
        bodies=machine.bodies,
        reached=reached,
    )


def path_minutes(
    machine: Machine,
    tips: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    feeds: Float[ndarray, "n"],
    tool_length: float,
) -> Float[ndarray, "m"]:
    """How long a machine takes for a path (`PathMinutes`), its rotary axes turning as they would be posted;
    MachineError where they do not reach it."""
    kinds, liftable = np.full(len(tips), MoveKind.CUT), np.ones(len(tips), dtype=bool)
    angles = choose_angles(machine, axes, kinds, HOLD_CONE, liftable=liftable).angles
    joints = inverse_linear(machine, tips, angles, tool_length)
    at_feed = np.maximum(lengths(np.diff(tips, axis=0)) / feeds[1:], axis_minutes(machine, joints)[1:])
    return motion_minutes(machine, joints, at_feed)
