"""Whether a machine leans its tool as paths of others want it, told before anything is posted."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from bonecam.errors import MachineError
from bonecam.machine.check import reach_text
from bonecam.machine.kinematics import inverse_rotary, within_limits
from bonecam.machine.limits import polar_angles
from bonecam.machine.machine import Machine
from bonecam.tool.path import ToolPath

SHOWN = 6
"""Paths that are named."""


def check_axes(paths: Sequence[ToolPath], machine: Machine) -> None:
    """MachineError where moves want tool axes that no rotary angles of the machine within its limits give: of which
    paths, how many, how they lean, and what the machine has."""
    beyond = [_beyond(path, machine) for path in paths]
    if not any(mask.any() for mask in beyond):
        return
    axes = np.vstack([path.axes[mask] for path, mask in zip(paths, beyond, strict=True)])
    moves = sum(len(path.axes) for path in paths)
    low, high = np.degrees([polar_angles(axes).min(), polar_angles(axes).max()])
    named = list(dict.fromkeys(path.title for path, mask in zip(paths, beyond, strict=True) if mask.any()))
    more = f" and {len(named) - SHOWN} more" if len(named) > SHOWN else ""
    lean = f"{low:.0f} to {high:.0f} deg" if high - low > 1 else f"{low:.1f} deg"
    raise MachineError(
        f"{machine.name}: {len(axes)} of {moves} moves lean the tool by {lean} as its axes cannot, in "
        f"{', '.join(named[:SHOWN])}{more}; on it {reach_text(machine)}: plan the part for this machine "
        f"(bonecam convert PART --machine {machine.name}), or post the paths for one that leans so",
        machine=machine.name,
        moves=len(axes),
    )


def _beyond(path: ToolPath, machine: Machine) -> Bool[ndarray, " n"]:
    """The moves of a path whose axes the machine does not reach."""
    solutions, _ = inverse_rotary(machine, path.axes)
    return np.asarray(~within_limits(machine, solutions).any(axis=1))
