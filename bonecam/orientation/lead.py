"""The preferred tool axis: the contact normal leaning forward along the feed by the lead angle.

A lead of 10 degrees keeps the ball's tip, which does not cut, off the surface (Gan et al. 2014, section 5.2).
Where the machine's limits or the table forbid that axis, its polar angle is brought within bounds.
"""

import math

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.job import field_error
from bonecam.orientation.collision.scene import TABLE_CLEARANCE
from bonecam.orientation.limits import AxisLimits, polar_angles, with_polar_angles
from bonecam.toolpath.cutter import Cutter

OUTWARD = 0.3
"""How far an axis that points straight down is leant away from the Z axis before its azimuth is taken (a
share of its length)."""


def check_lead(cutter: Cutter, lead_deg: float) -> None:
    """JobError where shank or holder would enter a flat part while the axis leans by the lead angle
    (degrees).

    The rim of a cylinder with radius r that begins c above the ball's centre stands R + c cos(lead) - r
    sin(lead) above the part, R being the ball's radius.
    """
    lead = math.radians(abs(lead_deg))
    for name, start, _, radius in cutter.sections[1:]:
        above_centre = start - cutter.radius
        if cutter.radius + above_centre * math.cos(lead) <= radius * math.sin(lead):
            remedy = (
                f"at the lead of {lead_deg:g} degrees the {name} would cut into a flat part: "
                f"give a slimmer {name}, less path.lead_deg, or a longer overhang or flute_length"
            )
            raise field_error(cutter.name, f"{name}_diameter", 2 * radius, remedy)


def lead_axes(
    normals: Float[ndarray, "n 3"], feeds: Float[ndarray, "n 3"], lead: float
) -> Float[ndarray, "n 3"]:
    """cos(lead) n + sin(lead) f, unit; `lead` in radians, positive leans forward."""
    return unit(np.cos(lead) * normals + np.sin(lead) * feeds)


def bound_polar_angles(
    axes: Float[ndarray, "n 3"], centres: Float[ndarray, "n 3"], cutter: Cutter, limits: AxisLimits
) -> Float[ndarray, "n 3"]:
    """The axes with polar angles brought within the limits and above the table.

    An axis that points almost straight down takes its azimuth from where its ball stands about the Z axis:
    outward.
    """
    distance = np.linalg.norm(centres[:, :2], axis=1, keepdims=True)
    outward = centres[:, :2] / np.maximum(distance, np.finfo(float).tiny)
    horizontal = np.linalg.norm(axes[:, :2], axis=1, keepdims=True)
    down = axes[:, 2:] < 0
    leaning = np.where(down, axes[:, :2] + OUTWARD * (1 - horizontal) * outward, axes[:, :2])
    aimed = np.column_stack([leaning, axes[:, 2]])

    angle = polar_angles(axes)
    largest = np.minimum(limits.largest, table_limits(centres, cutter))
    bounded = np.clip(angle, limits.smallest, np.maximum(largest, limits.smallest))
    return np.where((bounded == angle)[:, None], axes, with_polar_angles(aimed, bounded))


def table_limits(centres: Float[ndarray, "n 3"], cutter: Cutter) -> Float[ndarray, " n"]:
    """Largest polar angle (radians) at which the rims of shank and holder stay above the table z = 0; at
    least a right angle.

    With a ball centre at height z, a rim of radius r at height c above it stands at z + c cos(a) - r sin(a) =
    z + h cos(a + f), h = |(c, r)|, tan(f) = r / c.
    """
    largest = np.full(len(centres), np.pi)
    for _, start, end, radius in cutter.sections:
        for height in (start - cutter.radius, end - cutter.radius):
            reach = np.hypot(height, radius)
            phase = np.arctan2(radius, height)
            cosine = np.clip((2 * TABLE_CLEARANCE - centres[:, 2]) / reach, -1, 1)
            largest = np.minimum(largest, np.where(cosine > -1, np.arccos(cosine) - phase, np.pi))
    return np.maximum(largest, np.pi / 2)
