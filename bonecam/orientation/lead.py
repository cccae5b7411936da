"""The wished-for axis: the normal leaning forward along the feed (Gan et al. 2014, section 5.2: 10 degrees
keep the ball's tip, which does not cut, off the surface), turned up where the machine's limits or the table
forbid it."""

import math

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import wrong
from bonecam.orientation.limits import AxisLimits, polar, unit, with_polar
from bonecam.orientation.scene import TABLE_CLEARANCE
from bonecam.toolpath.cutter import Cutter

OUTWARD = 0.3


def lead_axes(
    normals: Float[ndarray, "n 3"], feeds: Float[ndarray, "n 3"], lead: float
) -> Float[ndarray, "n 3"]:
    """cos(lead) n + sin(lead) f, unit; `lead` in radians, positive leans forward."""
    return unit(np.cos(lead) * normals + np.sin(lead) * feeds)


def check_lead(cutter: Cutter, lead_deg: float) -> None:
    """JobError where shank or holder would enter a flat part while the axis leans by the lead angle (degrees).

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
            raise wrong(cutter.name, f"{name}_diameter", 2 * radius, remedy)


def turned_up(
    axes: Float[ndarray, "n 3"], centres: Float[ndarray, "n 3"], cutter: Cutter, limits: AxisLimits
) -> Float[ndarray, "n 3"]:
    """The axes with polar angles brought within the limits and above the table.

    An axis that points almost straight down takes its azimuth from where its ball stands about the Z axis:
    outward.
    """
    away = centres[:, :2] / np.maximum(
        np.linalg.norm(centres[:, :2], axis=1, keepdims=True), np.finfo(float).tiny
    )
    level = np.linalg.norm(axes[:, :2], axis=1, keepdims=True)
    down = axes[:, 2:] < 0
    leaning = np.where(down, axes[:, :2] + OUTWARD * (1 - level) * away, axes[:, :2])
    aimed = np.column_stack([leaning, axes[:, 2]])
    angle = polar(axes)
    top = np.minimum(limits.largest, table_limit(centres, cutter))
    wanted = np.clip(angle, limits.smallest, np.maximum(top, limits.smallest))
    return np.where((wanted == angle)[:, None], axes, with_polar(aimed, wanted))


def table_limit(centres: Float[ndarray, "n 3"], cutter: Cutter) -> Float[ndarray, " n"]:
    """Largest polar angle at which the holder's and shank's rims stay above the table, at least a right
    angle; radians.

    A rim at height c above the ball's centre with radius r stands at z + c cos(a) - r sin(a) = z + h cos(a +
    f).
    """
    largest = np.full(len(centres), np.pi)
    for _, start, end, radius in cutter.sections:
        for height in (start - cutter.radius, end - cutter.radius):
            reach, phase = np.hypot(height, radius), np.arctan2(radius, height)
            ratio = np.clip((2 * TABLE_CLEARANCE - centres[:, 2]) / reach, -1, 1)
            largest = np.minimum(largest, np.where(ratio > -1, np.arccos(ratio) - phase, np.pi))
    return np.maximum(largest, np.pi / 2)
