"""The force of one edge of a ball at the middle of a strip, in closed form: what clamping is chosen by, before any path
is planned."""

import math

import numpy as np

from bonecam.job.materials.mechanical import CuttingForce


def strip_force(force: CuttingForce, radius: float, depth: float, scallop: float, chip: float) -> float:
    """Force (N) on an edge of a ball of `radius` mm that takes `chip` mm off the middle of a strip `depth` mm deep,
    beside one that was left with scallops of `scallop` mm.

    The edge is engaged from where the strip before it ends, a = acos(1 - depth / R) from the middle of the ball's
    groove, to half of the way w = sqrt(8 R scallop) between two passes on the other side: over R (a + asin(w / 2R))
    along the ball, with chips of h sin(kappa) (Altintas 2012, 2.8). Depth and scallop beyond the radius count as it.
    """
    whole = math.acos(1 - min(depth / radius, 1.0))
    half = math.asin(min(math.sqrt(2 * scallop / radius), 1.0))
    edge = radius * (whole + half)
    area = chip * radius * (2 - math.cos(whole) - math.cos(half))
    cutting, rubbing = force.array[:3], force.array[3:]
    return float(np.linalg.norm(cutting * area + rubbing * edge))
