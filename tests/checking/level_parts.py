"""A small part with a waist or a groove, its stock, and the program of its first level."""

import numpy as np

from bonecam.levels.problem import Cut, StepParameters
from bonecam.setup import Capsule, Schedule
from bonecam.surface import RowTMesh, TSpline

CAPSULE = Capsule(np.array([0.0, 0.0, 4.5]), np.array([0.0, 0.0, 15.5]), 4.5)
"""A stock that holds the parts."""


SCHEDULE = Schedule((0.1, 0.1), 0.5)
"""Cuts of 0.1, 0.1 and then 0.5 mm."""


def waisted(waist: float = 0.35, rows: int = 12, around: int = 10) -> TSpline:
    """Makes a bone with two heads and a waist, 18 mm long between z = 1 and z = 19."""
    knots = np.concatenate([np.zeros(4), np.linspace(0, 1, rows - 2)[1:-1], np.ones(4)])
    counts = [1] + [around + j % 2 for j in range(1, rows - 1)] + [1]
    tmesh = RowTMesh.from_rows(knots, [np.arange(n) / n for n in counts])
    points = []
    for j, n in enumerate(counts):
        t = knots[j + 1 : j + 4].mean()
        z = 1.0 + 18.0 * t
        reach = 3.2 * np.sqrt(max(0.0, 1 - (2 * t - 1) ** 4)) * (1 - waist * np.exp(-(((t - 0.5) / 0.2) ** 2)))
        angle = 2 * np.pi * np.arange(n) / n
        points.append(np.column_stack([reach * np.cos(angle), 0.8 * reach * np.sin(angle), np.full(n, z)]))
    return TSpline(tmesh, np.vstack(points), np.ones(tmesh.size))


def grooved(share: float) -> TSpline:
    """Makes a bone with a groove along it, where some of its control points keep only this share of their
    distance from the axis."""
    part = waisted(0.0, around=16)
    P = np.array(part.control_points)
    P[(np.abs(np.arctan2(P[:, 1], P[:, 0])) < 0.1) & (np.abs(P[:, 2] - 10) < 7), :2] *= share
    return part.with_control_points(P)


STEP_PARAMETERS = StepParameters(stiffness=1e-7, bending=1e-7, uniform=0.05)


HALF_MILLIMETRE = Cut(depth=0.5, landing=0.05)
"""A cut of 0.5 mm."""
