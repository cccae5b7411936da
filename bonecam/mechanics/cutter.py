"""How far a cutter's ball gives way across its axis: the cutter as a stepped beam that the holder holds rigidly.

A force across the axis at the ball's centre bends a piece of the second moment I at the distance x above it by the
moment x F; Castigliano gives c = sum int x^2 / (E I) dx over flutes, neck and shank up to the holder. Pull along
the axis is left out: the displacement is c (I - a a^T) F.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.tool.cutter import Cutter

CARBIDE = 580_000.0
"""Modulus of cemented carbide with 10 % of cobalt, N/mm^2 (ISO 513 K grades: 570,000 to 630,000)."""
CORE = 0.8
"""Diameter of the round bar that bends as the fluted part does, as a share of the cutter's (Kops & Vo 1990, CIRP Annals
39, 93)."""


def cutter_compliance(cutter: Cutter) -> float:
    """Displacement of the ball's centre across the axis for a unit force there, mm/N."""
    total = 0.0
    for piece in cutter.profile:
        if piece.name in ("holder", "spindle"):
            break
        share = CORE if piece.name == "cutter" else 1.0
        low, high = piece.start - cutter.centre_height, piece.end - cutter.centre_height
        total += _bending(low, high, share * piece.radius, share * piece.end_radius)
    return total / CARBIDE


def across(compliance: float, axes: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
    """c (I - a a^T) for unit axes, mm/N."""
    return compliance * (np.eye(3) - axes[:, :, None] * axes[:, None, :])


def _bending(low: float, high: float, radius: float, end_radius: float) -> float:
    """int x^2 / I dx over a cylinder or cone from `low` to `high`, 1/mm, by Gauss's rule with 8 points: exact for a
    cylinder, to 1e-6 for a cone that doubles its radius."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    share = (nodes + 1) / 2
    x = low + share * (high - low)
    r = radius + share * (end_radius - radius)
    return float((weights * x**2 * 4 / (np.pi * r**4)).sum() * (high - low) / 2)
