"""The flat end and the bull nose of 2 mm, by closed forms."""

import numpy as np
from numpy import ndarray

CORNERS = {"bull": 0.5, "flat": 0.0}
"""Corner radii, mm."""
RADIUS = 2.0


def distances(shape: str, height: float, points: ndarray, tip: ndarray, axis: ndarray) -> ndarray:
    """Signed distances (mm) of points from the cutting part of this height: that of a quadrant rounded by the corner,
    in the half plane of the axis, cut off at the height."""
    corner, away = CORNERS[shape], points - tip
    h = away @ axis
    out = np.stack([np.linalg.norm(away - h[:, None] * axis, axis=1) - (RADIUS - corner), corner - h])
    end = np.linalg.norm(np.maximum(out, 0), axis=0) + np.minimum(out.max(0), 0) - corner
    both = np.maximum(np.stack([end, h - height]), 0)
    return np.where(both.all(axis=0), np.linalg.norm(both, axis=0), np.maximum(end, h - height))
