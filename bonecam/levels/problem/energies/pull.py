"""The pull on the level itself: its samples along a smoothed field of directions (`attraction.py`), as far as
they should go.

A sample should go as far as it may, and is pulled beyond; with a `least_share` below 1 one with less way to the
stock than the farthest goes less, so that all come to the stock together: where some come early, levels crowd into
what is left between them and fold. Nothing is pulled farther than the stock's wall: what lies at it already would
be drawn along it, and waves of one level would no longer fit into those of the next.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths, unit
from bonecam.levels.problem.energies.energy import Given, Pulled
from bonecam.levels.problem.factorisation import factorise
from bonecam.levels.problem.limits.planes import heights
from bonecam.levels.problem.limits.wall import inside
from bonecam.surface.query.closest_point import closest_points_near

SMOOTHING = 1e-4
"""Weight of the thin plate, parameters over [0, 1], that smooths the field of directions."""
OVERSHOOT = 2.0
"""How far a sample that may go all the depth is pulled, in depths."""
ALL_OUT = 8
"""How sharply the pull beyond the depth sets in."""
LONGEST, LEAST_COSINE = 2.0, 0.3
"""A sample that is pulled obliquely goes a longer way to its height: so many heights at most; and cosines between its
way and the normal count as no less than this."""


def pull(given: Given) -> Pulled:
    """The samples of the energy, weighed by area and uniformly."""
    discretisation = given.discretisation
    P = given.before.control_points
    samples = discretisation.samples
    x = samples.R @ P
    area_vectors = samples.area_vectors(P)
    area = np.linalg.norm(area_vectors, axis=1)
    weights = area * samples.weights
    weights = weights / weights.sum() + given.parameters.uniform / len(x)
    normals = area_vectors / np.maximum(area, np.finfo(float).tiny)[:, None]
    field = samples.R.T @ (weights[:, None] * discretisation.attraction(x, normals, discretisation.stock))
    field = unit(samples.R @ factorise(SMOOTHING * discretisation.M, samples.R, weights).solve(field))
    gap = -discretisation.stock.signed_distance(x)
    share = np.clip(gap / given.rest.left, given.parameters.least_share, 1.0)
    target = targets(given, x, s=samples.s, t=samples.t, normals=normals, towards=field, share=share)
    return Pulled(
        samples.s,
        samples.t,
        R=samples.R,
        x=x,
        weights=weights,
        target=target,
        beyond=1 + (OVERSHOOT - 1) * share**ALL_OUT,
    )


def targets(
    given: Given,
    x: Float[ndarray, "k 3"],
    s: Float[ndarray, " k"],
    t: Float[ndarray, " k"],
    normals: Float[ndarray, "k 3"],
    towards: Float[ndarray, "k 3"],
    share: Float[ndarray, " k"],
) -> Float[ndarray, "k 3"]:
    """Where samples at x should be: so far along `towards` that their distance to the level before is a
    `share` of what they may go."""
    stock = given.discretisation.stock
    cut = given.cut
    distance, out = stock.distances_and_normals(x)
    gap = -distance
    height = share * heights(cut, gap)[1]
    cosine = np.maximum(dots(normals, towards), LEAST_COSINE)
    reach = longest = np.minimum(height / cosine, LONGEST * height)
    for _ in range(2):
        y = x + reach[:, None] * towards
        s, t, c, _ = closest_points_near(given.before, y, s, t, 1)
        away = lengths(y - c)
        slope = dots(y - c, towards) / np.maximum(away, np.finfo(float).tiny)
        reach = np.clip(reach + (height - away) / np.maximum(slope, LEAST_COSINE), 0, longest)
    reach = np.minimum(reach, gap / np.maximum(dots(towards, out), LEAST_COSINE))
    return inside(stock, x + reach[:, None] * towards, np.minimum(gap, cut.landing))
