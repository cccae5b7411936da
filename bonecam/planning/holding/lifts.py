"""How much higher a part must stand for a tool to keep clear of the table and of what holds it, in closed form."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.planning.axes.lead import LEAVING, ROOM
from bonecam.tool.cutter import Cutter
from bonecam.workholding.clamping import Clamping

SLICE = 4.0
"""Length of the slices in which a tool is held over a chuck, mm."""
HAIR = 1e-6
"""mm: far above the rounding of lifts."""


def needed_lifts(
    centres: Float[ndarray, "n 3"],
    directions: Float[ndarray, "d 3"],
    cutter: Cutter,
    clamping: Clamping,
) -> Float[ndarray, "n d"]:
    """How much higher (mm) each ball centre must be for a tool in each direction to keep the clearance above the
    table's plane, and above columns (chuck, what stands on the table) where it is over them, while it leaves the
    contact along its axis too (LEAVING).

    The tool is taken in slices no longer than SLICE: each is over a column if its widest disc is. A slice is left out
    in directions along which it reaches over the column from no contact, or where the table asks for more at each.
    """
    across = np.hypot(directions[:, 0], directions[:, 1])
    farthest = np.hypot(centres[:, 0], centres[:, 1]).max(initial=0.0)
    room = clamping.clearance + ROOM
    sunk = LEAVING * np.maximum(-directions[:, 2], 0.0)
    discs = _discs(cutter)
    rims = [radius * across - height * directions[:, 2] for height, radius, _ in discs]
    above_table = room + (sunk + np.max(rims, axis=0))
    lift = above_table - centres[:, 2:]
    for column in clamping.solids:
        for height, radius, section in discs:
            room = clamping.room(column, section) + ROOM
            reach = column.radius + room + radius
            above = room + column.top + radius * across + sunk - height * directions[:, 2]
            counts = (above > above_table - HAIR) & (np.abs(height) * across - farthest < reach + HAIR)
            some = np.flatnonzero(counts)
            x, y = (centres[:, None, k] + height * directions[some, k] for k in (0, 1))
            over = x * x + y * y < reach**2
            lift[:, some] = np.where(
                over, np.maximum(lift[:, some], above[some] - centres[:, 2:]), lift[:, some]
            )
    return lift


def _discs(cutter: Cutter) -> list[tuple[float, float, str]]:
    """Heights above the ball's centre and radii (mm) of discs across the tool, no more than SLICE apart, each as
    wide as the tool is near it; and the names of their sections."""
    discs = []
    for section in cutter.profile:
        count = int(np.ceil((section.end - section.start) / SLICE)) + 1
        for u in np.linspace(section.start, section.end, count):
            discs.append((float(u) - cutter.radius, section.widest, section.name))
    return discs
