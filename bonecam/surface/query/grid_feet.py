"""Feet: the parameters of the surface point nearest to given points, from a start near by.

Gauss-Newton on |S(s, t) - X|^2 with the step limited to a part of the domain. A step over a pole goes on
along the opposite meridian (t -> -t, s -> s + 1/2), so the poles need no care by the caller.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import dots
from bonecam.surface.tmesh.surface import Surface

LONGEST_STEP = 0.1  # part of the domain in one step, both directions


def grid_parameters(
    surface: Surface, around: int, along: int
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """s and t of a regular grid over the whole domain, poles included: n = around * (along + 1)."""
    low, high = surface.domain[1]
    s, t = np.meshgrid(np.arange(around) / around, np.linspace(low, high, along + 1))
    return s.ravel(), t.ravel()


def nearest_on_grid(
    surface: Surface, points: Float[ndarray, "n 3"], around: int = 96, along: int = 128
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """s and t of the nearest of a regular grid of surface points: the start where nothing better is known."""
    s, t = grid_parameters(surface, around, along)
    _, nearest = cKDTree(surface.positions(s, t)).query(points)
    return s[nearest], t[nearest]


def follow(
    surface: Surface,
    points: Float[ndarray, "n 3"],
    s: Float[ndarray, " n"],
    t: Float[ndarray, " n"],
    rounds: int = 4,
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
    """s, t and distances of the feet of `points`, walking from s, t; no result is further away than its
    start."""
    best_s, best_t, best = s, t, np.full(len(s), np.inf)
    for _ in range(rounds):
        S, Ss, St = surface.derivatives(s, t, 1)
        away = points - S
        distance = np.linalg.norm(away, axis=1)
        better = distance < best
        best_s, best_t, best = (
            np.where(better, s, best_s),
            np.where(better, t, best_t),
            np.where(better, distance, best),
        )
        s, t = _within(surface, *_step(away, Ss, St, s, t))
    distance = np.linalg.norm(points - surface.positions(s, t), axis=1)
    better = distance < best
    return np.where(better, s, best_s), np.where(better, t, best_t), np.where(better, distance, best)


def _step(away: ndarray, Ss: ndarray, St: ndarray, s: ndarray, t: ndarray) -> tuple[ndarray, ndarray]:
    """One Gauss-Newton step; the metric is raised where S_s vanishes."""
    E, F, G = (dots(a, b) for a, b in ((Ss, Ss), (Ss, St), (St, St)))
    E = E + 1e-6 * G
    a, b = dots(away, Ss), dots(away, St)
    scale = 1 / np.maximum(np.maximum(E * G - F * F, 1e-9 * E * G), np.finfo(float).tiny)
    ds, dt = (G * a - F * b) * scale, (E * b - F * a) * scale
    limit = np.minimum(1.0, LONGEST_STEP / np.maximum(np.maximum(np.abs(ds), np.abs(dt)), LONGEST_STEP))
    return s + limit * ds, t + limit * dt


def _within(surface: Surface, s: ndarray, t: ndarray) -> tuple[ndarray, ndarray]:
    """Back into the domain, over a pole where the step left it."""
    low, high = surface.domain[1]
    over = (t < low) | (t > high)
    t = np.where(t < low, 2 * low - t, np.where(t > high, 2 * high - t, t))
    return np.mod(np.where(over, s + 0.5, s), 1.0), t
