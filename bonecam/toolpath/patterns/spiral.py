"""One spiral round a closed part, from its free end to its held one, without links.

Passes are counted from the upper pole down: psi = 0 there and |grad psi| L = 1 below (`step_metric.py`), a
Hamilton-Jacobi equation that is followed row by row down t. The curves psi = const are rings, each at the exact local
step from the one before; the spiral psi = s, with s counted on from turn to turn, joins them. Where psi ends sooner at
the lower pole on some sides than on others, the spiral ends in arcs.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.toolpath.patterns.curves import Curves, curves_of, ranges
from bonecam.toolpath.patterns.step_metric import StepMetric

ROUNDS = 3
"""Rounds in which the steps follow the directions of the rings."""
SMOOTHING = 0.1
"""Waves of a ring are damped as by a Gaussian of this standard deviation, mm, at each row: they cannot grow."""
STEEPEST = 0.9
"""Largest sine of the angle between a ring and the line t = const."""
SHORT_GAP = 3.0
"""A gap of the spiral that is shorter is cut through, in side steps."""


def spiral_curves(metric: StepMetric) -> Curves:
    """The turns of the spiral as one curve, and its last arcs as further ones."""
    places = len(metric.s)
    a, b = np.zeros_like(metric.E), -np.ones_like(metric.E)
    for _ in range(ROUNDS):
        passes, a, b = _count_down(metric, metric.slowness(a, b))

    width = passes[:, 0]
    s = np.arange(int(np.ceil((width.max() + 1) * places))) / places
    side = np.arange(len(s)) % places
    t = np.array([np.interp(turn, passes[k, ::-1], metric.t[::-1]) for turn, k in zip(s, side)])
    knots = np.column_stack([s, t])
    short = SHORT_GAP * metric.flat_step / (np.sqrt(metric.E[:, 1].mean()) / places)
    return curves_of([knots[first:end] for first, end in ranges(s - 0.5 <= width[side], short)])


def _count_down(
    metric: StepMetric, slowness: Float[ndarray, "a b"]
) -> tuple[Float[ndarray, "a b"], Float[ndarray, "a b"], Float[ndarray, "a b"]]:
    """The passes from the upper pole down to each place for |grad psi| = slowness, psi_s and psi_t."""
    places, rows = metric.E.shape
    waves = 2 * np.pi * np.arange(places // 2 + 1)
    cell = metric.t[1] - metric.t[0]
    passes, a, b = (np.zeros((places, rows)) for _ in range(3))
    for row in range(rows - 1, -1, -1):
        E, F, area = metric.E[:, row], metric.F[:, row], metric.area[:, row]
        spectrum = np.fft.rfft(passes[:, row])
        spectrum *= np.exp(-((SMOOTHING * waves / np.sqrt(E).mean()) ** 2) / 2)
        passes[:, row] = np.fft.irfft(spectrum, places)
        steepest = STEEPEST * np.sqrt(E) * slowness[:, row]
        a[:, row] = np.clip(np.fft.irfft(1j * waves * spectrum, places), -steepest, steepest)
        rest = E * slowness[:, row] ** 2 - a[:, row] ** 2
        b[:, row] = (F * a[:, row] - area * np.sqrt(rest)) / E
        if row:
            passes[:, row - 1] = passes[:, row] - cell * np.minimum(b[:, row], 0.0)
    return passes, a, b
