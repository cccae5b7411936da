"""Ramps of speed whose acceleration is bounded, and its jerk where that is known; compiled.

A ramp from speed v to v + D at acceleration a and jerk j begins and ends without acceleration (S-shaped). It takes

    T = 2 sqrt(D / j)   where D <= a^2 / j,   else   T = D / a + a / j,

and, being point-symmetric, the way (v + D / 2) T. With an infinite jerk T = D / a. Units are those of the caller.
"""

import math

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit

HALVINGS = 50
"""Times that the interval of the speed which a move reaches is halved."""


@inner_njit()
def _reached(speed: float, way: float, a: float, j: float) -> float:
    """The speed at the end of a ramp of this way that begins with a `speed`; infinite where nothing bounds it."""
    if math.isinf(a):
        return math.inf
    if math.isinf(j):
        return math.sqrt(speed**2 + 2 * a * way)
    # x^2 = D: x^3 + 2 v x = way sqrt(j), whose one real root is a hyperbolic sine
    p, q = 2 * speed, way * math.sqrt(j)
    if p**1.5 > 1e-9 * q:
        x = 2 * math.sqrt(p / 3) * math.sinh(math.asinh(1.5 * q / p * math.sqrt(3 / p)) / 3)
    else:
        x = q ** (1 / 3)
    if x * x <= a * a / j:
        return speed + x * x
    b = 2 * speed + a * a / j
    rise = 2 * speed * a * a / j - 2 * a * way
    return speed + (math.sqrt(b * b - 4 * rise) - b) / 2


@inner_njit()
def _ramp_time(rise: float, a: float, j: float) -> float:
    """The time of a ramp by this change of the speed."""
    if math.isinf(j):
        return rise / a
    return 2 * math.sqrt(rise / j) if rise * j <= a**2 else rise / a + a / j


@inner_njit()
def _ramps(start: float, peak: float, end: float, a: float, j: float) -> tuple[float, float]:
    """Time and way of the ramps from a speed to its peak and to the speed at the end."""
    up, down = _ramp_time(peak - start, a, j), _ramp_time(peak - end, a, j)
    return up + down, up * (start + peak) / 2 + down * (peak + end) / 2


@inner_njit()
def _move_time(start: float, end: float, a: float, j: float, way: float) -> float:
    """The time of a move of this way from one speed to another, as fast as speed 1 allows. One that is all part of a
    longer ramp takes its way at the mean of both speeds."""
    low = max(start, end)
    if start + end > 0.0 and _ramps(start, low, end, a, j)[1] >= way:
        return 2 * way / (start + end)
    high = max(low, 1.0)
    if _ramps(start, high, end, a, j)[1] <= way:
        low = high
    for _ in range(HALVINGS if low < high else 0):
        middle = (low + high) / 2
        if _ramps(start, middle, end, a, j)[1] <= way:
            low = middle
        else:
            high = middle
    time, used = _ramps(start, low, end, a, j)
    return time + max(way - used, 0.0) / low


@inner_njit()
def _ramp_up(speeds: ndarray, times: ndarray, ways: ndarray, a: ndarray, j: ndarray) -> None:
    """Lower the speeds at the ends of moves until no ramp exceeds them forwards, and set the times of the moves that
    lie within a ramp, NaN of the others. A ramp begins where the speed is as high as may be; over many short moves it
    builds up one acceleration, with the least acceleration and jerk that it has met."""
    begin = speeds[0]
    way = since = 0.0
    least_a = least_j = math.inf
    for k in range(len(ways)):
        way += ways[k]
        least_a = min(least_a, a[k])
        least_j = min(least_j, j[k])
        jerked = math.isfinite(least_j)
        far = (
            _reached(begin, way, least_a, least_j) if jerked else _reached(speeds[k], ways[k], a[k], math.inf)
        )
        times[k] = math.nan
        if far >= speeds[k + 1]:
            begin = speeds[k + 1]
            way = since = 0.0
            least_a = least_j = math.inf
            continue
        # a ramp takes its way at the mean of its ends
        until = 2 * way / (begin + far)
        if jerked:
            times[k] = until - since
        speeds[k + 1], since = far, until


@njit(cache=True)
def ramped_times(highest: ndarray, ways: ndarray, a: ndarray, j: ndarray) -> ndarray:
    """The times (m,) of successive moves of these `ways`, with speeds up to 1, and at their ends (m + 1,) up to the
    `highest`, at the accelerations and jerks (m,) of the moves."""
    m = len(ways)
    forwards, up = highest.copy(), np.empty(m)
    _ramp_up(forwards, up, ways, a, j)
    speeds, down = forwards.copy(), np.empty(m)
    _ramp_up(speeds[::-1], down[::-1], ways[::-1], a[::-1], j[::-1])
    times = np.empty(m)
    for k in range(m):
        kept = speeds[k] == forwards[k] and speeds[k + 1] == forwards[k + 1]
        times[k] = up[k] if kept and not math.isnan(up[k]) else down[k]
        if math.isnan(times[k]):
            times[k] = _move_time(speeds[k], speeds[k + 1], a[k], j[k], ways[k])
    return times
