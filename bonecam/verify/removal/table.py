"""How far the tool stays above the table, at the ends of all moves."""

from collections.abc import Mapping

import numpy as np

from bonecam.nc.reading.motions import Motions
from bonecam.toolpath.cutters.cutter import Cutter
from bonecam.verify.removal.result import Spot


def table_clearance(motions: Motions, tools: Mapping[int, Cutter]) -> Spot:
    """The lowest point of ball, shank and holder over the table (z = 0), mm.

    The lowest point of a disc of radius r whose unit normal has the height a is r sqrt(1 - a^2) below its
    middle.
    """
    lowest = np.full(len(motions.tips), np.inf)
    for number, cutter in tools.items():
        rows = motions.tools == number
        tips = motions.tips[rows, 2]
        up = motions.axes[rows, 2]
        drop = np.sqrt(np.maximum(1 - up**2, 0.0))
        found = tips + cutter.radius * up - cutter.radius
        for _, start, end, radius in cutter.sections:
            found = np.minimum(found, tips + np.minimum(start * up, end * up) - radius * drop)
        lowest[rows] = found
    move = int(np.argmin(lowest))
    x, y, z = (float(v) for v in motions.tips[move])
    return Spot(float(lowest[move]), int(motions.lines[move]), (x, y, z))
