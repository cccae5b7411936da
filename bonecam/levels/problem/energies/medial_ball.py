"""How much of their way samples of a level should go where others face them across a narrow hollow.

Its walls would come nearer to each other by two depths a level while its bottom rises by one: they would soon
leave a gap too narrow for control points to shape, and the level would fold in it. Walls that move as the
bottom does, along the line midway between them, keep the hollow's shape instead; of a depth along their own
normals that is the cosine to this line.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import dots

ROUNDS, TOUCHING, LEAST = 6, 1e-3, 0.02
TOGETHER = 3
"""Samples follow each other on rings: one answers for so many."""


def medial_ball_share(
    x: Float[ndarray, "k 3"], normals: Float[ndarray, "k 3"], narrow: float
) -> Float[ndarray, " k"]:
    """1 where a ball of radius `narrow` (mm) touches the sample from outside and holds no other, less the
    smaller the ball that does.

    With the cosine between the sample's normal and the line midway between it and what the ball touches
    beside it as the least, from half that radius on. The balls are found by shrinking them to what they hold
    (Ma, Bae & Choi 2012).
    """
    at = np.arange(0, len(x), TOGETHER)
    tree, radii, facing, shrinking = (
        cKDTree(x, leafsize=32),
        np.full(len(at), narrow),
        at.copy(),
        np.arange(len(at)),
    )
    for _ in range(ROUNDS):
        mine, within = at[shrinking], (1 - TOUCHING) * radii[shrinking]
        away, nearest = tree.query(
            x[mine] + radii[shrinking, None] * normals[mine], distance_upper_bound=within.max()
        )
        shrinks = (away < within) & (nearest != mine)
        shrinking, mine, held = shrinking[shrinks], mine[shrinks], np.asarray(nearest)[shrinks]
        if not len(shrinking):
            break
        across = x[held] - x[mine]
        radii[shrinking], facing[shrinking] = dots(across, across) / (2 * dots(across, normals[mine])), held
    midway = np.sqrt(np.maximum(1 + dots(normals[at], normals[facing]), 0) / 2)
    share = np.maximum(midway, LEAST) ** np.minimum(2 * (1 - radii / narrow), 1)
    return np.repeat(share, TOGETHER)[: len(x)]
