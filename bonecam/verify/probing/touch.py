"""A ball that comes down on a surface along given normals, and stops where it first touches (sphere tracing)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.mesh.distance import MeshDistance
from bonecam.surface.tspline import TSpline

TOUCHES = 1e-6
"""A ball touches what it is nearer to, mm."""
MOST_STEPS = 500
"""A ball that slides past something so often without touching it is where it is."""


def touching_centres(
    surface: MeshDistance,
    places: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    radius: float,
    start: Float[ndarray, " n"],
    end: float,
) -> Float[ndarray, "n 3"]:
    """Centres of the ball where it first touches the `surface` on its way along each normal, from the height `start`
    (mm, of the centre, clear of everything) down to the height `end`; NaN where it touches nothing."""
    heights = np.array(start)
    coming = np.arange(len(places))
    for _ in range(MOST_STEPS):
        gap = surface.unsigned(places[coming] + heights[coming, None] * normals[coming]) - radius
        heights[coming] -= np.maximum(gap, 0.0)
        coming = coming[(gap > TOUCHES) & (heights[coming] > end)]
        if not len(coming):
            break
    found = places + heights[:, None] * normals
    found[heights <= end] = np.nan
    return found


def deviations(part: TSpline, centres: Float[ndarray, "n 3"], radius: float) -> Float[ndarray, " n"]:
    """Signed distance of each centre from the nominal surface less the ball's radius, mm; NaN where there is none."""
    found = np.full(len(centres), np.nan)
    known = np.isfinite(centres[:, 0])
    near = part.project(centres[known])
    outside = dots(part.normals(near.s, near.t), centres[known] - near.points) >= 0
    found[known] = np.where(outside, near.distances, -near.distances) - radius
    return found
