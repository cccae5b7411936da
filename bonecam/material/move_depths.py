"""How deep balls enter material on straight moves between places."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import numbered

DENSE = 0.25
"""Depths on a move are measured no farther apart, mm, as the places of the material are."""


def move_depths(
    depths: Callable[[ndarray, float], tuple[ndarray, ndarray]],
    starts: Float[ndarray, "m 3"],
    ends: Float[ndarray, "m 3"],
    radius: float,
) -> Float[ndarray, " m"]:
    """The largest depth (mm) of a ball between start and end of each move of its centre, both left out; 0 where it
    enters nothing there. `depths` are those of a material at given centres."""
    counts = np.ceil(np.linalg.norm(ends - starts, axis=1) / DENSE).astype(np.int64) - 1
    counts = np.maximum(counts, 0)
    move, place = numbered(counts)
    share = ((place + 1) / (counts[move] + 1))[:, None]
    deepest = np.zeros(len(starts))
    np.maximum.at(deepest, move, depths((1 - share) * starts[move] + share * ends[move], radius)[0])
    return deepest
