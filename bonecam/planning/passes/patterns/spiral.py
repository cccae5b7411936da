"""One spiral round a closed part, from its free end to its held one, without links.

Passes are counted from the upper pole down: psi = 0 there and |grad psi| L = 1 below (`step_metric.py`), a
Hamilton-Jacobi equation that is followed row by row down t. The curves psi = const are rings, each at the exact local
step from the one before; the spiral psi = s, with s counted on from turn to turn, joins them. Where psi ends sooner at
the lower pole on some sides than on others, the spiral ends in arcs.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.planning.passes.patterns.curves import Curves, curves_of, ranges
from bonecam.planning.passes.patterns.step_metric import StepMetric

ROUNDS = 6
"""Rounds in which the steps follow the directions of the rings, and gaps that smoothing left are closed."""
MOST_CLOSER = 2.0
"""Where smoothing leaves gaps, passes are at most so many times closer than asked."""
SMOOTHING = 0.1
"""Waves of a ring are damped as by a Gaussian of this standard deviation, mm, at each row: they cannot grow."""
STEEPEST = 0.9
"""Largest sine of the angle between a ring and the line t = const."""
SHORT_GAP = 3.0
"""A gap of the spiral that is shorter is cut through, in side steps."""


def spiral_curves(metric: StepMetric) -> Curves:
    """The turns of the spiral as one curve, and its last arcs as further ones."""
    count = len(metric.s)
    a, b = np.zeros_like(metric.E), -np.ones_like(metric.E)
    closer = np.ones_like(metric.E)
    for _ in range(ROUNDS):
        passes = _count_down(metric, closer * metric.slowness(a, b))
        around = np.pad(passes, ((1, 1), (0, 0)), mode="wrap")
        a, b = (around[2:] - around[:-2]) * count / 2, np.gradient(passes, metric.t, axis=1)
        closer = np.minimum(closer * metric.shortfall(metric.coverage(a, b)), MOST_CLOSER)

    width = passes[:, 0]
    turns = np.arange(int(np.ceil(width.max() + 1)))[:, None] + np.arange(count) / count
    t = [np.interp(turns[:, k], passes[k, ::-1], metric.t[::-1]) for k in range(count)]
    s = turns.ravel()
    side = np.arange(turns.size) % count
    knots = np.column_stack([s, np.array(t).T.ravel()])
    short = SHORT_GAP * metric.flat_step / (np.sqrt(metric.E[:, 1].mean()) / count)
    return curves_of([knots[first:end] for first, end in ranges(s - 0.5 <= width[side], short)])


def _count_down(metric: StepMetric, slowness: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
    """The passes from the upper pole down to each place for |grad psi| = slowness."""
    count, rows = metric.E.shape
    waves = 2 * np.pi * np.arange(count // 2 + 1)
    cell = metric.t[1] - metric.t[0]
    passes = np.zeros((count, rows))
    for row in range(rows - 1, 0, -1):
        E, F, area = metric.E[:, row], metric.F[:, row], metric.area[:, row]
        spectrum = np.fft.rfft(passes[:, row])
        spectrum *= np.exp(-((SMOOTHING * waves / np.sqrt(E).mean()) ** 2) / 2)
        steepest = STEEPEST * np.sqrt(E) * slowness[:, row]
        a = np.clip(np.fft.irfft(1j * waves * spectrum, count), -steepest, steepest)
        b = (F * a - area * np.sqrt(E * slowness[:, row] ** 2 - a**2)) / E
        passes[:, row - 1] = np.fft.irfft(spectrum, count) - cell * np.minimum(b, 0.0)
    return passes
