"""How deep balls enter the surface of what stands, and whether they do where none has been."""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.mesh.distance import MeshDistance


def ball_depths(
    surface: MeshDistance, centres: Float[ndarray, "n 3"], radius: float
) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
    """How deep a ball of this radius at each centre enters a closed surface (mm; negative: it is off), and the unit
    direction out of it at the nearest place."""
    points, _ = surface.closest(centres)
    outward = np.where(surface.inside(centres), -1.0, 1.0)
    distance = outward * np.linalg.norm(centres - points, axis=1)
    return radius - distance, (centres - points) / np.where(distance, distance, np.inf)[:, None]


def enters_beside(
    places: KDTree,
    deep: Float[ndarray, " n"],
    outward: Float[ndarray, "n 3"],
    centres: Float[ndarray, "n 3"],
    contacts: Float[ndarray, "n 3"],
    radius: float,
    depth: float,
) -> Bool[ndarray, " n"]:
    """Whether balls that are `deep` in material with these `places`, which is left along `outward`, enter it by more
    than `depth` (mm) where a ball at their contact has not been."""
    entered = deep > depth
    which = np.flatnonzero(entered)
    nearest = centres - (radius - deep)[:, None] * outward
    for i, near in zip(which, places.query_ball_point(centres[which], radius - depth), strict=True):
        here = np.vstack([nearest[i], places.data[near]])
        entered[i] = bool((np.linalg.norm(here - contacts[i], axis=1) > radius).any())
    return np.asarray(entered)
