"""The side step between neighbouring passes of a ball that leaves a given scallop height, exact on a circular
section.

A section across the feed of curvature kappa (1/mm, > 0 where the part bulges towards the cutter) is a circle
of radius 1/kappa. The ball centres lie on the circle 1/kappa + R, the cusp between them on 1/kappa + h. The
triangle of circle centre, ball centre and cusp gives, with theta the angle between neighbouring contacts,

    sin(theta/4) = (kappa/2) sqrt( h (2R - h) / ((1 + kappa R)(1 + kappa h)) ),    side step L = theta /
    kappa,

and L = 2 sqrt(h (2R - h)) on a plane. Source: Suresh & Yang (1994) as used by Gan et al. (2014), section 4.3.
The approximation of textbooks, L = sqrt(8 h R / (1 + kappa R)), leaves more than h.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import ToolPathError

FLAT = 1e-6
"""Sections with |sin(theta/4)| below this take the limit kappa -> 0: its relative error is FLAT^2 / 6."""


def side_step(radius: float, scallop: float, curvature: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Distance along the section between contacts (mm) that leaves cusps of exactly `scallop`.

    Where the section is so sharp that one pass leaves no cusp as high, it is the whole circumference. Raises
    ToolPathError where kappa <= -1/R: the ball cannot touch there; ValueError unless 0 < scallop < radius.
    """
    # ToolPathError where a section is hollow and sharper than the ball
    if (1 + curvature * radius <= 0).any():
        worst = int(np.argmin(curvature))
        raise ToolPathError(
            f"section {worst} bends in with curvature {curvature[worst]:.4g} 1/mm: "
            f"a ball of radius {radius:g} mm gouges; "
            f"take one below {-1 / curvature[worst]:.3g} mm",
            index=worst,
            curvature=float(curvature[worst]),
        )

    if not 0 < scallop < radius:
        raise ValueError(f"scallop {scallop} must lie between 0 and the radius {radius}")
    quotient = scallop * (2 * radius - scallop) / ((1 + curvature * radius) * (1 + curvature * scallop))
    half = np.sqrt(quotient) / 2
    sine = np.clip(curvature * half, -1, 1)
    flat = np.abs(sine) < FLAT
    return np.where(flat, 4 * half, 4 * np.arcsin(sine) / np.where(flat, 1, curvature))
