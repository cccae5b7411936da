"""Whether a surface that is machined alone lies on the solids that are given with it."""

import numpy as np

from bonecam.errors import SurfaceError
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tspline import TSpline

SAMPLED = 20
"""Places along s and along t at which a surface is looked at from outside."""
ABOVE = 0.1
"""From so far, mm: ten times the gouge allowed by default."""
FLOATING = 1.0
"""A surface that lies farther from the solids, mm, is none of theirs: an allowance on a part is less."""


def check_on_solids(surface: TSpline, solid: TriangleMesh, file: str) -> None:
    """SurfaceError where most of a surface lies in the solid that it belongs to, faces into it, or lies off it: links
    would go through what it bounds."""
    shares = (np.arange(SAMPLED) + 0.5) / SAMPLED
    along = (low + shares * (high - low) for low, high in surface.domain)
    s, t = (places.ravel() for places in np.meshgrid(*along))
    places = surface.positions(s, t)
    distance = MeshDistance(solid)
    covered = float(distance.inside(places + ABOVE * surface.normals(s, t)).mean())
    if covered > 0.5:
        what = f"{covered:.0%} of it lies in the solids that must not be gouged, or faces into them"
        raise SurfaceError(f"{file}: {what}: reverse every row, or leave the solid out that covers it", file=file)
    away = distance.unsigned(places)
    if np.median(away) > FLOATING:
        what = f"half of it lies {np.median(away):.1f} to {away.max():.1f} mm off part and obstacles"
        raise SurfaceError(f"{file}: {what}: give the solid that it bounds (--part) beside them", file=file)
