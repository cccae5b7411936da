"""The loops of one morph level's program, compiled: an iteration of ADMM, a sweep of projections.

Both hold samples x_l + sum_i R_li D_i between two planes (low <= n . (y - c) <= high, from the footpoint c on
the level before) and behind a third (m . y <= h, the stock's wall). R is in CSR form.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.fastmath import CONTRACT

BROKEN_SWEEPS = 15
"""Most sweeps over the samples with broken limits alone after each sweep over all samples."""

PARALLEL = 1e-3
"""Least squared sine of the angle between slab and wall: below it the two count as parallel."""


class Planes(NamedTuple):
    """The planes of samples, one row each: low <= n . (y - c) <= high and m . y <= h, mm."""

    c: ndarray
    n: ndarray
    low: ndarray
    high: ndarray
    m: ndarray
    h: ndarray


@njit(inline="always")
def correction(d: float, low: float, high: float, e: float, g: float) -> tuple[float, float]:
    """How far to go along n and along m to the nearest point of the slab behind the wall, mm.

    d is the height over the footpoint, e the distance outside the wall, g = n . m.
    """
    p = min(max(d, low), high) - d
    if e + p * g <= 0.0:
        return p, 0.0
    d -= e * g
    if e > 0.0 and low <= d <= high:
        return 0.0, -e
    t = min(max(d, low), high) - (d + e * g)
    across = 1.0 - g * g
    if across > PARALLEL:
        return (t + e * g) / across, (-e - t * g) / across
    return 0.5 * (t - e), 0.0


@njit(cache=True, fastmath=CONTRACT)
def sweep(
    x: ndarray, y: ndarray, H: ndarray, planes: Planes, weights: ndarray,
    rho: float, relaxation: float, z: ndarray, u: ndarray,
) -> float:  # fmt: skip
    """One iteration for samples that y has moved: z = the point of the limits nearest to (H + rho (x + y +
    u)) / (1 + rho), u += x + y - z, and y = W (z - u - x), whose moments the control points are fitted to.

    Returns the residual: the weighted sum of squares of how far z moved and how far it is from x + y.
    """
    c, n, low, high, m, h = planes
    keep = 1.0 - relaxation
    share = 1.0 / (1.0 + rho)
    residual = 0.0
    for l in range(len(x)):
        e0 = x[l, 0] + y[l, 0]
        e1 = x[l, 1] + y[l, 1]
        e2 = x[l, 2] + y[l, 2]
        w = weights[l]
        y0 = relaxation * e0 + keep * z[l, 0] + u[l, 0]
        y1 = relaxation * e1 + keep * z[l, 1] + u[l, 1]
        y2 = relaxation * e2 + keep * z[l, 2] + u[l, 2]
        a0, a1, a2 = share * (H[l, 0] + rho * y0), share * (H[l, 1] + rho * y1), share * (H[l, 2] + rho * y2)
        n0, n1, n2, m0, m1, m2 = n[l, 0], n[l, 1], n[l, 2], m[l, 0], m[l, 1], m[l, 2]
        d = n0 * (a0 - c[l, 0]) + n1 * (a1 - c[l, 1]) + n2 * (a2 - c[l, 2])
        p, q = correction(d, low[l], high[l], m0 * a0 + m1 * a1 + m2 * a2 - h[l], n0 * m0 + n1 * m1 + n2 * m2)
        a0, a1, a2 = a0 + p * n0 + q * m0, a1 + p * n1 + q * m1, a2 + p * n2 + q * m2
        residual += w * ((e0 - a0) ** 2 + (e1 - a1) ** 2 + (e2 - a2) ** 2)
        residual += w * ((z[l, 0] - a0) ** 2 + (z[l, 1] - a1) ** 2 + (z[l, 2] - a2) ** 2)
        y0, y1, y2 = y0 - a0, y1 - a1, y2 - a2
        z[l, 0], z[l, 1], z[l, 2], u[l, 0], u[l, 1], u[l, 2] = a0, a1, a2, y0, y1, y2
        y[l, 0], y[l, 1], y[l, 2] = w * (a0 - y0 - x[l, 0]), w * (a1 - y1 - x[l, 1]), w * (a2 - y2 - x[l, 2])
    return residual


@inner_njit(fastmath=CONTRACT)
def _sweep_onto(
    indptr: ndarray, indices: ndarray, data: ndarray, x: ndarray, D: ndarray, planes: Planes,
    rows: ndarray, broken: ndarray, least: float,
) -> tuple[float, int]:  # fmt: skip
    """Move D onto the limits of the samples `rows`, one after the other (Kaczmarz). Returns how far the worst
    broke them, mm, and how many did by more than `least`; those are listed in `broken` (may be `rows`
    itself)."""
    c, n, low, high, m, h = planes
    worst, count = 0.0, 0
    for l in rows:
        y0 = x[l, 0]
        y1 = x[l, 1]
        y2 = x[l, 2]
        square = 0.0
        for k in range(indptr[l], indptr[l + 1]):
            j, r = indices[k], data[k]
            square += r * r
            y0 += r * D[j, 0]
            y1 += r * D[j, 1]
            y2 += r * D[j, 2]
        n0, n1, n2, m0, m1, m2 = n[l, 0], n[l, 1], n[l, 2], m[l, 0], m[l, 1], m[l, 2]
        d = n0 * (y0 - c[l, 0]) + n1 * (y1 - c[l, 1]) + n2 * (y2 - c[l, 2])
        p, q = correction(d, low[l], high[l], m0 * y0 + m1 * y1 + m2 * y2 - h[l], n0 * m0 + n1 * m1 + n2 * m2)
        far = abs(p) + abs(q)
        if far > least:
            worst = max(worst, far)
            broken[count] = l
            count += 1
            p, q = p / square, q / square
            for k in range(indptr[l], indptr[l + 1]):
                j, r = indices[k], data[k]
                D[j, 0] += r * (p * n0 + q * m0)
                D[j, 1] += r * (p * n1 + q * m1)
                D[j, 2] += r * (p * n2 + q * m2)
    return worst, count


@njit(cache=True, fastmath=CONTRACT)
def project(
    indptr: ndarray, indices: ndarray, data: ndarray, x: ndarray, D: ndarray, planes: Planes,
    sweeps: int, enough: float,
) -> None:  # fmt: skip
    """Move D onto the limits of one sample after the other (Kaczmarz), until all hold to `enough` mm or for
    `sweeps` sweeps over all samples.

    After each sweep the samples that broke their limits, which are few, are swept alone, until they hold or
    BROKEN_SWEEPS times.
    """
    every = np.arange(len(x))
    broken = np.empty(len(x), np.int64)
    for _ in range(sweeps):
        worst, count = _sweep_onto(indptr, indices, data, x, D, planes, every, broken, 0.01 * enough)
        if worst < enough:
            break
        for _ in range(BROKEN_SWEEPS):
            worst, count = _sweep_onto(indptr, indices, data, x, D, planes, broken[:count], broken, 0.01 * enough)
            if worst < enough:
                break
