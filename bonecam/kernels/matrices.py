"""Products of sparse matrices (CSR) and points (n, 3), compiled: they take a third of the time of scipy's,
which are for any number of columns.

Indices are read as unsigned: with signed ones each access would test whether it counts from the end.

Normal equations of sparse rows, compiled: H += D_i^T M_i D_i with a 3 x 3 or 2 x 2 metric for each row,
or H += w_i D_i^T D_i, into a lower band.

The loops of one morph level's program, compiled: an iteration of ADMM, a sweep of projections.

Both hold samples x_l + sum_i R_li D_i between two planes (low <= n . (y - c) <= high, from the footpoint c on
the level before) and behind a third (m . y <= h, the stock's wall). R is in CSR form.

Align the moves read back from a program with the rows of the tool paths: which move reaches which row, and
which lie between two rows; compiled.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import CONTRACT, inner_njit, njit
from bonecam.kernels.vectors import Three, cross, distance, dot, length


@njit(cache=True, fastmath=CONTRACT)
def times(indptr: ndarray, indices: ndarray, data: ndarray, D: ndarray, y: ndarray) -> None:
    """Write R D into y."""
    for l in range(np.uint32(len(y))):
        y0 = y1 = y2 = 0.0
        for k in range(np.uint32(indptr[l]), np.uint32(indptr[l + 1])):
            j, r = np.uint32(indices[k]), data[k]
            y0 += r * D[j, 0]
            y1 += r * D[j, 1]
            y2 += r * D[j, 2]
        y[l, 0], y[l, 1], y[l, 2] = y0, y1, y2


@njit(cache=True, fastmath=CONTRACT)
def transposed_times(indptr: ndarray, indices: ndarray, data: ndarray, y: ndarray, D: ndarray) -> None:
    """Write R'y into D."""
    D[:] = 0.0
    for l in range(np.uint32(len(y))):
        y0, y1, y2 = y[l, 0], y[l, 1], y[l, 2]
        for k in range(np.uint32(indptr[l]), np.uint32(indptr[l + 1])):
            j, r = np.uint32(indices[k]), data[k]
            D[j, 0] += r * y0
            D[j, 1] += r * y1
            D[j, 2] += r * y2


def csr_parts(matrix: Any) -> tuple[ndarray, ndarray, ndarray]:
    """Starts, columns and values of a CSR matrix as the loops here take them: of one kind, for which they are compiled
    once."""
    starts, columns = (part.astype(np.int64, copy=False) for part in (matrix.indptr, matrix.indices))
    return starts, columns, matrix.data


@njit(cache=True)
def add_rows(
    band: ndarray,
    gradient: ndarray,
    starts: ndarray,
    columns: ndarray,
    values: ndarray,
    metric: ndarray,
    targets: ndarray,
) -> None:
    """Add v_ij v_ik M_i to the band and v_ij M_i X_i to the gradient (n, 3), for the rows i of a CSR matrix
    v.

    Unknown 3 j + a is axis a of control point j; band[p, q - p] holds H[q, p] for q >= p. metric (m, 3, 3)
    symmetric, targets (m, 3).
    """
    pull = np.zeros(3)
    for i in range(len(starts) - 1):
        for a in range(3):
            pull[a] = (
                metric[i, a, 0] * targets[i, 0] + metric[i, a, 1] * targets[i, 1] + metric[i, a, 2] * targets[i, 2]
            )
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            for a in range(3):
                gradient[j, a] += values[p] * pull[a]
            for q in range(starts[i], starts[i + 1]):
                k = columns[q]
                if k > j:
                    product = values[p] * values[q]
                    for a in range(3):
                        for b in range(3):
                            band[3 * j + a, 3 * (k - j) + b - a] += product * metric[i, a, b]
                elif k == j:
                    product = values[p] * values[q]
                    for a in range(3):
                        for b in range(a, 3):
                            band[3 * j + a, b - a] += product * metric[i, a, b]


@njit(cache=True)
def width(starts: ndarray, columns: ndarray) -> int:
    """How many diagonals the lower band of the normal equations of a CSR matrix's rows has."""
    most = 0
    for i in range(len(starts) - 1):
        if starts[i] < starts[i + 1]:
            low = high = columns[starts[i]]
            for p in range(starts[i] + 1, starts[i + 1]):
                low, high = min(low, columns[p]), max(high, columns[p])
            most = max(most, high - low)
    return most + 1


@njit(cache=True, fastmath=CONTRACT)
def add_weighted(band: ndarray, starts: ndarray, columns: ndarray, values: ndarray, weights: ndarray) -> None:
    """Add w_i v_ij v_ik to the band, for the rows i of a CSR matrix v; band[p, q - p] holds H[q, p] for q >=
    p."""
    for i in range(len(starts) - 1):
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            share = weights[i] * values[p]
            for q in range(starts[i], p + 1):
                k = columns[q]
                band[min(j, k), abs(j - k)] += share * values[q]


@njit(cache=True, nogil=True, fastmath=CONTRACT)
def add_pairs(band: ndarray, starts: ndarray, columns: ndarray, values: ndarray, metric: ndarray) -> None:
    """Add v_ij v_ik M_i to the band, for the rows i of a CSR matrix v and symmetric 2 x 2 metrics M (m, 2, 2).

    Unknown 2 j + a is value a of control point j; band[p, q - p] holds H[q, p] for q >= p.
    """
    for i in range(len(starts) - 1):
        first, both, second = metric[i, 0, 0], metric[i, 0, 1], metric[i, 1, 1]
        if first == 0 and second == 0:
            continue
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            for q in range(starts[i], starts[i + 1]):
                apart = 2 * (columns[q] - j)
                if apart < 0:
                    continue
                product = values[p] * values[q]
                band[2 * j, apart] += product * first
                band[2 * j, apart + 1] += product * both
                band[2 * j + 1, apart] += product * second
                if apart:
                    band[2 * j + 1, apart - 1] += product * both


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


AXIS_WEIGHT = 80.0
"""mm a radian: between two rows the fraction of a move is found from its tool axis where that turns by more
than a radian in this length, else from its ball centre. Words of 0.001 mm and 0.001 degrees are about as
exact there."""

SMALL_ANGLE = 1e-9
"""Angles below this (rad) are interpolated on the straight line."""

FRACTION_ROUNDING = 1e-3
"""A move between two rows may fall behind the one before by this fraction: the rounding of the words."""


@inner_njit()
def _angle(a: ndarray, b: ndarray) -> float:
    """Angle between two vectors, radians."""
    return np.arctan2(length(cross(a, b)), dot(a, b))


@inner_njit()
def _slerp(a: ndarray, b: ndarray, fraction: float) -> ndarray:
    """Spherical linear interpolation between two unit vectors."""
    angle = _angle(a, b)
    vector = np.empty(3)
    first = 1 - fraction
    second = fraction
    size = 1.0
    if not angle < SMALL_ANGLE:
        first = np.sin(first * angle)
        second = np.sin(fraction * angle)
        size = np.sin(angle)
    for d in range(3):
        vector[d] = (first * a[d] + second * b[d]) / size
    return vector


@inner_njit()
def _between(tip: ndarray, axis: ndarray, tips: ndarray, axes: ndarray, radius: float) -> Three:
    """Fraction, tip error (mm) and axis error (rad) of a move against the path from one row to the next: the
    ball centre on the straight line, the axis on the great circle."""
    start, chord, off = np.empty(3), np.empty(3), np.empty(3)
    for d in range(3):
        start[d] = tips[0, d] + radius * axes[0, d]
        chord[d] = tips[1, d] + radius * axes[1, d] - start[d]
        off[d] = tip[d] + radius * axis[d] - start[d]
    turn = _angle(axes[0], axes[1])
    square = dot(chord, chord)
    if turn * AXIS_WEIGHT > np.sqrt(square):
        fraction = _angle(axes[0], axis) / turn
    else:
        fraction = dot(chord, off) / square if square > 0 else 0.0
    fraction = min(max(fraction, 0.0), 1.0)
    meant = _slerp(axes[0], axes[1], fraction)
    for d in range(3):
        end = tips[1, d] + radius * axes[1, d]
        off[d] = (1 - fraction) * start[d] + fraction * end - radius * meant[d] - tip[d]
    return fraction, length(off), _angle(meant, axis)


@njit(cache=True)
def align_moves(
    tips: ndarray,
    axes: ndarray,
    may_be_extra: ndarray,
    path_tips: ndarray,
    path_axes: ndarray,
    from_anywhere: ndarray,
    radius: ndarray,
    tip_tolerance: float,
    axis_tolerance: float,
) -> tuple[ndarray, ndarray, ndarray, int, int]:
    """The row of the path that each move reaches, its tip error (mm) and axis error (rad), and where the
    search stopped.

    A move is given its row (>= 0); -1 where it is extra; or -2 - row where it lies between `row` - 1 and
    `row`. Moves that `may_be_extra` may come before a row that is reached `from_anywhere`, and after the last
    row. The search stops at the first move that fits nowhere: the last two answers are that move and the row
    waited for; both are the counts where every move has its place.
    """
    n, m = len(tips), len(path_tips)
    source = np.full(n, -1, dtype=np.int64)
    tip_error = np.zeros(n)
    axis_error = np.zeros(n)
    row, fraction_before = 0, 0.0
    for move in range(n):
        if row < m:
            off = distance(path_tips[row], tips[move])
            angle = _angle(path_axes[row], axes[move])
            if off <= tip_tolerance and angle <= axis_tolerance:
                source[move], tip_error[move], axis_error[move] = row, off, angle
                row = row + 1
                fraction_before = 0.0
                continue
            if row > 0:
                fraction, off, angle = _between(
                    tips[move], axes[move], path_tips[row - 1 : row + 1], path_axes[row - 1 : row + 1], radius[row]
                )
                in_order = fraction >= fraction_before - FRACTION_ROUNDING
                if off <= tip_tolerance and angle <= axis_tolerance and in_order:
                    source[move] = -2 - row
                    tip_error[move] = off
                    axis_error[move] = angle
                    fraction_before = fraction
                    continue
            if from_anywhere[row] and may_be_extra[move]:
                continue
        elif may_be_extra[move]:
            continue
        return source, tip_error, axis_error, move, row
    return source, tip_error, axis_error, n, row
