"""How much higher a part must stand for a tool to keep clear of the table and of what holds it, in closed form."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.closest.highest_over import highest_over
from bonecam.planning.axes.lead import LEAVING, ROOM
from bonecam.tool.cutter import Cutter
from bonecam.workholding.clamping import Clamping

SLICE = 4.0
"""Length of the slices in which a tool is held over a chuck, mm."""


def needed_lifts(
    centres: Float[ndarray, "n 3"],
    directions: Float[ndarray, "d 3"],
    cutter: Cutter,
    clamping: Clamping,
) -> Float[ndarray, "n d"]:
    """How much higher (mm) each ball centre must be for a tool in each direction to keep the clearance above the
    table's plane, and above columns (chuck, what stands on the table) where it is over them, while it leaves the
    contact along its axis too (LEAVING).

    The tool is taken in slices no longer than SLICE: each is over a column if its widest disc is.
    """
    across = np.hypot(directions[:, 0], directions[:, 1])
    sunk = LEAVING * np.maximum(-directions[:, 2], 0.0)
    discs = _discs(cutter)
    rims = [radius * across - height * directions[:, 2] for height, radius, _ in discs]
    above_table = clamping.clearance + ROOM + (sunk + np.max(rims, axis=0))
    offsets, squares, above = [], [], []
    for column in clamping.solids:
        for height, radius, section in discs:
            room = clamping.room(column, section) + ROOM
            offsets.append(height)
            squares.append((column.radius + room + radius) ** 2)
            above.append(room + column.top + radius * across + sunk - height * directions[:, 2])
    if not above:
        return above_table - centres[:, 2:]
    heights = np.array(above).T
    order = np.argsort(-heights, axis=1)
    falling = np.take_along_axis(heights, order, axis=1)
    discs_over = np.array(offsets)[order], np.array(squares)[order], falling
    return highest_over(centres, directions, *discs_over, above_table) - centres[:, 2:]


def _discs(cutter: Cutter) -> list[tuple[float, float, str]]:
    """Heights above the ball's centre and radii (mm) of discs across the tool, no more than SLICE apart, each as
    wide as the tool is near it; and the names of their sections."""
    discs = []
    for section in cutter.profile:
        count = int(np.ceil((section.end - section.start) / SLICE)) + 1
        for u in np.linspace(section.start, section.end, count):
            discs.append((float(u) - cutter.centre_height, section.widest, section.name))
    return discs
