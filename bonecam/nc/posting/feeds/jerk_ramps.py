"""Ramps of speed whose acceleration is bounded, and its jerk where that is known.

A ramp from speed v to v + D at acceleration a and jerk j begins and ends without acceleration (S-shaped). It takes

    T = 2 sqrt(D / j)   where D <= a^2 / j,   else   T = D / a + a / j,

and, being point-symmetric, the way (v + D / 2) T. With an infinite jerk T = D / a. Units are those of the caller.
"""

import math

import numpy as np
from jaxtyping import Float
from numpy import ndarray

HALVINGS = 50
"""Times that the interval of the speed which a move reaches is halved."""


def reached(speed: float, way: float, a: float, j: float) -> float:
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


def ramp_times(
    rises: Float[ndarray, " m"], a: Float[ndarray, " m"], j: Float[ndarray, " m"]
) -> Float[ndarray, " m"]:
    """Times of ramps by these changes of the speed, at their accelerations and jerks."""
    with np.errstate(invalid="ignore", over="ignore"):
        short = rises * j <= a**2
        return np.where(short, 2 * np.sqrt(rises / j), rises / a + np.where(np.isinf(j), 0.0, a / j))


def move_times(
    start: Float[ndarray, " m"],
    end: Float[ndarray, " m"],
    a: Float[ndarray, " m"],
    j: Float[ndarray, " m"],
    way: Float[ndarray, " m"],
) -> Float[ndarray, " m"]:
    """Times of moves of these ways from one speed to another, as fast as speed 1 allows. One that is all part of a
    longer ramp takes its way at the mean of both speeds."""
    low = np.maximum(start, end)
    high = np.maximum(low, 1.0)

    def ramps(peak: Float[ndarray, " m"]) -> tuple[Float[ndarray, " m"], Float[ndarray, " m"]]:
        up, down = ramp_times(peak - start, a, j), ramp_times(peak - end, a, j)
        return up + down, up * (start + peak) / 2 + down * (peak + end) / 2

    part = ramps(low)[1] >= way
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        fits = ramps(middle)[1] <= way
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    time, used = ramps(low)
    whole = time + np.maximum(way - used, 0.0) / np.maximum(low, np.finfo(float).tiny)
    mean = (start + end) / 2
    return np.asarray(np.where(part & (mean > 0), way / np.where(mean > 0, mean, 1.0), whole))
