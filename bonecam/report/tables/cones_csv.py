"""Cones of free tool axes as a table of comma-separated values."""

import csv
import io
from collections.abc import Sequence

import numpy as np

from bonecam.tool.path import ToolPath

COLUMNS = (
    *("level", "rest"),
    *("apex_x", "apex_y", "apex_z"),
    *("axis_x", "axis_y", "axis_z"),
    *("side_x", "side_y", "side_z"),
    *("half_angle_deg", "second_half_angle_deg", "contacts"),
)


def cones_csv(paths: Sequence[ToolPath]) -> str:
    """One line for each cone that contacts keep to, in machining order: the node that stands for them among the ball's
    centres (mm), unit axis, unit direction of the largest opening, both semi-angles, and how many contacts they are."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for path in paths:
        if path.cones is None:
            continue
        cones = path.cones
        used, contacts = np.unique(cones.cone_of[cones.cone_of >= 0], return_counts=True)
        for k, count in zip(used, contacts):
            apex = [f"{value:.4f}" for value in cones.apexes[k]]
            frame = [f"{value:.6f}" for value in (*cones.shapes.axes[k], *cones.shapes.sides[k])]
            angles = [f"{value:.3f}" for value in np.degrees(cones.shapes.angles[k])]
            writer.writerow([path.level, path.rest, *apex, *frame, *angles, count])
    return text.getvalue()
