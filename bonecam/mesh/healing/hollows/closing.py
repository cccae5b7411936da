"""Where the centre of a ball that stays outside a mesh can be, nearest to given points.

The closing of a part by a ball of radius r is what no such ball reaches from outside (Serra 1982). A point lies as deep
in it as the nearest centre c with dist(c, part) >= r is farther than r. That centre is found by successive half-spaces:
each foot q of a centre on the part allows only centres x with n . (x - q) >= r, n = (c - q) / |c - q|; the point is
projected onto the intersection of those of all feet so far, the foot of the new centre is added, and all n are taken
anew.
"""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.kernels.closest.half_spaces import project_on_half_spaces
from bonecam.mesh.distance import MeshDistance, exact_closest

ROUNDS = 40
"""Feet that are looked for at a point, at most; ten are usual."""
MOST_FEET = 12
"""Feet that are kept of a point."""
SAME = 0.02
"""Feet closer to each other than this share of the radius are one: the ball between them is wrong by r SAME^2 / 8."""
ACCURACY = 1e-5
"""A centre that moves by less, mm, has been found; it may enter the part by as much."""
BEYOND = 10.0
"""A projection farther away than so many radii comes from half-spaces that exclude one another."""


def nearest_centres(
    distance: MeshDistance, points: Float[ndarray, "n 3"], starts: Float[ndarray, "n 3"], radius: float
) -> Float[ndarray, "n 3"]:
    """For each point the nearest place (mm) outside a closed mesh that is `radius` or more away from it.

    `starts` are such places, near the points. What comes back is a local minimum, never farther than the start: so
    the depth of a point in the closing is exact, or told too large by what a nearer centre elsewhere would allow.
    """
    mesh = distance.mesh
    normals = mesh.face_vectors / np.maximum(lengths(mesh.face_vectors), np.finfo(float).tiny)[:, None]
    nearest = starts.copy()
    tried = starts.copy()
    feet = np.full((len(points), MOST_FEET, 3), np.inf)
    outward = np.zeros((len(points), MOST_FEET, 3))
    going = np.arange(len(points))
    for _ in range(ROUNDS):
        foot, face = exact_closest(mesh, tried[going])
        away = tried[going] - foot
        nearer = lengths(tried[going] - points[going]) < lengths(nearest[going] - points[going])
        nearer &= lengths(away) >= radius - ACCURACY
        nearer[nearer] = ~distance.inside(tried[going[nearer]])
        nearest[going[nearer]] = tried[going[nearer]]
        slot = _slots(foot, feet[going], tried[going], SAME * radius)
        feet[going, slot] = foot
        outward[going, slot] = normals[face]
        centres = _allowed(points[going], tried[going], feet[going], outward[going], radius)
        on = lengths(centres - tried[going]) > ACCURACY  # false where there is none
        tried[going[on]] = centres[on]
        going = going[on]
        if not len(going):
            break
    return nearest


def _slots(
    foot: Float[ndarray, "n 3"], feet: Float[ndarray, "n k 3"], centres: Float[ndarray, "n 3"], same: float
) -> Int[ndarray, " n"]:
    """Where to keep a new foot: in place of one that it is the `same` as (within so many mm), in an empty place, or in
    that of the foot farthest from the centre."""
    apart = np.linalg.norm(feet - foot[:, None], axis=2)
    away = np.linalg.norm(feet - centres[:, None], axis=2)
    again = apart.min(axis=1) < same
    return np.where(again, np.argmin(apart, axis=1), np.argmax(away, axis=1))


def _allowed(
    points: Float[ndarray, "n 3"],
    centres: Float[ndarray, "n 3"],
    feet: Float[ndarray, "n k 3"],
    outward: Float[ndarray, "n k 3"],
    radius: float,
) -> Float[ndarray, "n 3"]:
    """The place nearest to each point in the half-spaces that the `feet` of its centre allow (an infinite one none);
    NaN where they exclude one another. `outward` are the normals of the part there: a centre inside it is led out."""
    known = np.isfinite(feet[:, :, :1])
    foot = np.where(known, feet, 0.0)
    away = centres[:, None] - foot
    distance = np.linalg.norm(away, axis=2, keepdims=True)
    side = np.where((away * outward).sum(axis=2, keepdims=True) < 0, -1.0, 1.0)
    normals = np.where(distance > ACCURACY, side * away / np.maximum(distance, ACCURACY), outward)
    offsets = np.where(known[:, :, 0], (normals * foot).sum(axis=2) + radius, -np.inf)
    return np.asarray(project_on_half_spaces(points, normals, offsets, BEYOND * radius))
