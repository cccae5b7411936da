"""A plane in which the contacts of a surface, given by their parameters, lie nearly as they do on the surface.

An open surface is laid out by its mean lengths along s and t. One that is closed round is turned about a point of the
plane: with the length l along it and the mean radius rho (circumference / 2 pi) a place lies at

    r (cos 2 pi s, sin 2 pi s),    ln r = -int dl / rho

which keeps angles and circles on a surface of revolution: circles that hold no other point there hold none here. So
neither the seam nor the pole at the highest t, the free end, needs points of its own; at the lowest t is the post.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.integrate import cumulative_trapezoid

from bonecam.surface.tspline import TSpline

AROUND, ALONG = 32, 96
"""Places along s and t by which lengths are measured; those along t are denser at the ends, where poles may be."""
LEAST_RADIUS = 1e-3
"""Of a pole, as a share of the largest mean radius."""


def plane_points(surface: TSpline, parameters: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """The places of (s, t) in the plane; in mm where the surface is open round, of no unit where it is closed."""
    s, t = ((float(low), float(high)) for low, high in surface.domain)
    closed = surface.closed_in_s
    around = np.linspace(s[0], s[1], AROUND + 1)
    along = t[0] + np.ptp(t) * (1 - np.cos(np.linspace(0, np.pi, ALONG))) / 2
    grid = np.stack(np.meshgrid(along, around, indexing="ij"), axis=2).reshape(-1, 2)
    points = surface.positions(grid[:, 1], grid[:, 0]).reshape(ALONG, AROUND + 1, 3)
    rings = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1)
    way = np.r_[0.0, np.cumsum(steps)]
    share = (parameters[:, 0] - s[0]) / np.ptp(s)
    if not closed:
        return np.column_stack([share * rings.mean(), np.interp(parameters[:, 1], along, way)])
    radii = rings / (2 * np.pi)
    radii = np.maximum(radii, LEAST_RADIUS * radii.max())
    log = cumulative_trapezoid(1 / radii, way, initial=0)
    r = np.exp(np.interp(parameters[:, 1], along, -log))
    return np.column_stack([r * np.cos(2 * np.pi * share), r * np.sin(2 * np.pi * share)])
