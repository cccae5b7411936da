"""The preferred tool axis: the contact normal leaning forward along the feed by the lead angle.

A lead of 10 degrees keeps the ball's tip, which does not cut, off the surface (Gan et al. 2014, section 5.2).
Where the machine's limits or the table forbid that axis, its polar angle is brought within bounds.
"""

import math

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.errors import JobError
from bonecam.job import field_error
from bonecam.machine.limits import MachineLimits, polar_angles, with_polar_angles
from bonecam.tool.cutter import Cutter, ToolSection
from bonecam.workholding.clamping import Clamping

OUTWARD = 0.3
"""How far an axis that points straight down is leant away from the Z axis before its azimuth is taken (a
share of its length)."""

ROOM = 0.5
"""Axes that would sink to the table are bounded so far above it, mm: the moves between them bulge."""
LEAVING = 5.0
"""Length (mm) along a drooping axis that there is room for above the table: the tool has to leave the contact."""


def check_lead(cutter: Cutter, lead_deg: float) -> None:
    """JobError where shank, holder or spindle would enter a flat part while the axis leans by the lead angle
    (degrees).

    A rim of radius r that stands c above the ball's centre along the axis is R + c cos(lead) - r sin(lead) above
    the part, R being the ball's radius.
    """
    lead = cutter.lead if cutter.is_bull else math.radians(abs(lead_deg))
    for section in cutter.profile[1:]:
        for height, radius in ((section.start, section.radius), (section.end, section.end_radius)):
            if cutter.envelope_radius + (height - cutter.centre_height) * math.cos(lead) <= radius * math.sin(lead):
                raise _lead_error(cutter, section, lead_deg)


def _lead_error(cutter: Cutter, section: ToolSection, lead_deg: float) -> JobError:
    name = section.name
    enters = f"at the lead of {lead_deg:g} degrees the {name} would cut into a flat part"
    if name == "spindle":
        remedy = "give a longer overhang or holder, or less path.lead_deg"
        return field_error(cutter.name, "overhang", cutter.overhang, f"{enters}: {remedy}")
    remedy = f"give a slimmer {name}, less path.lead_deg, or a longer overhang or flute_length"
    return field_error(cutter.name, f"{name}_diameter", 2 * section.radius, f"{enters}: {remedy}")


def lead_axes(normals: Float[ndarray, "n 3"], feeds: Float[ndarray, "n 3"], lead: float) -> Float[ndarray, "n 3"]:
    """cos(lead) n + sin(lead) f, unit; `lead` in radians, positive leans forward."""
    return unit(np.cos(lead) * normals + np.sin(lead) * feeds)


def bound_polar_angles(
    axes: Float[ndarray, "n 3"],
    centres: Float[ndarray, "n 3"],
    cutter: Cutter,
    clamping: Clamping,
    limits: MachineLimits,
) -> Float[ndarray, "n 3"]:
    """The axes with polar angles brought within the limits and above the table's plane.

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
    largest = np.minimum(limits.largest, table_limits(centres, cutter, clamping.clearance))
    bounded = np.clip(angle, limits.smallest, np.maximum(largest, limits.smallest))
    kept = np.where((bounded == angle)[:, None], axes, with_polar_angles(aimed, bounded))
    return limits.nearest(kept) if limits.narrow else kept


def has_room(
    axes: Float[ndarray, "n 3"], centres: Float[ndarray, "n 3"], cutter: Cutter, clamping: Clamping
) -> Bool[ndarray, " n"]:
    """Whether a tool that leaves its contact along its axis keeps above the table."""
    if not clamping.closed:
        return np.ones(len(axes), dtype=bool)
    return polar_angles(axes) <= table_limits(centres, cutter, clamping.clearance)


def table_limits(centres: Float[ndarray, "n 3"], cutter: Cutter, clearance: float) -> Float[ndarray, " n"]:
    """Largest polar angle (radians) at which the rims of the tool keep the clearance (mm) above the table z = 0, and
    ROOM more for the moves, at the contact and LEAVING from it; 0 where none does.

    With a ball centre at height z, a rim of radius r at height c above it stands at z + c cos(a) - r sin(a) =
    z + h cos(a + f), h = |(c, r)|, tan(f) = r / c.
    """
    largest = np.full(len(centres), np.pi)
    rims = [
        (height - cutter.centre_height + leaving, radius)
        for section in cutter.profile
        for height, radius in ((section.start, section.radius), (section.end, section.end_radius))
        for leaving in (0.0, LEAVING)
    ]
    for height, radius in rims:
        reach = np.hypot(height, radius)
        phase = np.arctan2(radius, height)
        cosine = np.clip((clearance + ROOM - centres[:, 2]) / reach, -1, 1)
        largest = np.minimum(largest, np.where(cosine > -1, np.arccos(cosine) - phase, np.pi))
    return np.maximum(largest, 0.0)
