"""Side step and scallop of a ball on a circular section, exact both ways.

A section of curvature kappa (1/mm, > 0 where the part bulges towards the cutter) is a circle of radius 1/kappa; ball centres
lie on the circle 1/kappa + R, the cusp on 1/kappa + h. The triangle centre - cutter - cusp gives, with theta the angle between
neighbouring contacts,

    sin(theta/4) = (kappa/2) sqrt( h (2R - h) / ((1 + kappa R)(1 + kappa h)) ),      side step L = theta / kappa

and L = 2 sqrt(h (2R - h)) on a plane. Suresh & Yang (1994) as used by Gan et al. (2014), section 4.3; the textbook
sqrt(8 h R / (1 + kappa R)) exceeds h.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import ToolPathError

FLAT = 1e-6
"""Sections with |sin(theta/4)| below this take the limit kappa -> 0: its relative error is FLAT^2 / 6."""


def side_step(radius: float, scallop: float, curvature: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Distance along the section between contacts (mm) that leaves cusps of exactly `scallop`.

    A section so sharp that one pass leaves less anywhere answers its whole circumference. Raises ToolPathError where
    kappa <= -1/R: the ball cannot touch there; ValueError unless 0 < scallop < radius.
    """
    _refuse(radius, curvature)
    if not 0 < scallop < radius:
        raise ValueError(f"scallop {scallop} must lie between 0 and the radius {radius}")
    half = np.sqrt(scallop * (2 * radius - scallop) / ((1 + curvature * radius) * (1 + curvature * scallop))) / 2
    sine = np.clip(curvature * half, -1, 1)
    flat = np.abs(sine) < FLAT
    return np.where(flat, 4 * half, 4 * np.arcsin(sine) / np.where(flat, 1, curvature))


def scallop_of_step(radius: float, step: Float[ndarray, " n"], curvature: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Height of the cusp (mm) that contacts `step` apart along the section leave.

    The cusp lies on both balls: with a = theta/2 and rho = 1/kappa, rho + h = (rho + R) cos a - sqrt(R^2 - (rho + R)^2 sin^2 a).
    NaN where neighbouring balls do not meet. Raises ToolPathError where kappa <= -1/R.
    """
    _refuse(radius, curvature)
    angle = curvature * step / 2
    across = np.where(np.abs(angle) < FLAT, step / 2, np.sin(angle) / np.where(curvature == 0, 1, curvature))
    fall = np.where(np.abs(angle) < FLAT, curvature * step**2 / 8, 2 * np.sin(angle / 2) ** 2 / np.where(curvature == 0, 1, curvature))
    with np.errstate(invalid="ignore"):
        depth = radius - np.sqrt(radius**2 - (across * (1 + curvature * radius)) ** 2)
    return depth - fall * (1 + curvature * radius)


def _refuse(radius: float, curvature: ndarray) -> None:
    if (1 + curvature * radius <= 0).any():
        worst = int(np.argmin(curvature))
        raise ToolPathError(
            f"section {worst} bends in with curvature {curvature[worst]:.4g} 1/mm: a ball of radius {radius:g} mm gouges; "
            f"take one below {-1 / curvature[worst]:.3g} mm",
            index=worst,
            curvature=float(curvature[worst]),
        )
