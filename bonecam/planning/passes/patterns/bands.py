"""Bands round a closed part, from its free end to its held one, each cut by its own number of lines along the part.

A section t = const needs M(t) lines, counted by |grad psi| L = 1 (`step_metric.py`). The n lines of a band, the
largest M in it, share each of its sections in equal parts of M. The bands are those that are cut in the least time, by
dynamic programming over their borders.
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.planning.passes.patterns.curves import Curves, curves_of
from bonecam.planning.passes.patterns.step_metric import StepMetric

ROUNDS = 4
"""Rounds of the iteration for the slopes of the lines."""
BORDERS = 80
"""Ranges of t between which borders may lie."""


def band_curves(metric: StepMetric, feed: float, step_over: float, turn: float) -> Curves:
    """The lines of those bands that take the least time at `feed` (mm/min), with `step_over` minutes from line to line
    and `turn` minutes from band to band."""
    share, count, lengths = _shares(metric)
    s = np.r_[metric.s, 1.0]
    knots: list[ndarray] = []
    for start, end in list(pairwise(_borders(count, lengths / feed, step_over, turn)))[::-1]:
        lines = int(np.ceil(count[start : end + 1].max()))
        wanted = (np.arange(lines) + 0.5) / lines
        s_of_lines = np.array([np.interp(wanted, column, s) for column in share[:, start : end + 1].T])
        knots += [np.column_stack([line, metric.t[start : end + 1]]) for line in s_of_lines.T]
    return curves_of(knots)


def _shares(metric: StepMetric) -> tuple[Float[ndarray, "c b"], Float[ndarray, " b"], Float[ndarray, " b"]]:
    """The share of the lines of each section that lie before each s (the seam again at its end), the number of lines
    that the section needs, and the mean length (mm) of a line at it."""
    count = len(metric.s)
    a, b = np.ones_like(metric.E), np.zeros_like(metric.E)
    for _ in range(ROUNDS):
        a = metric.rate(a, metric.coverage(a, b))
        steps = (a + np.roll(a, -1, axis=0)) / 2 / count
        passes = np.vstack([np.zeros(len(metric.t)), np.cumsum(steps, axis=0)])
        share = passes / passes[-1]
        b = passes[-1] * np.gradient(share[:-1], metric.t, axis=1)
    length = (metric.area * metric.gradient(a, b)).mean(axis=0) / passes[-1] * (metric.t[1] - metric.t[0])
    return share, passes[-1], length


def _borders(count: Float[ndarray, " b"], minutes: Float[ndarray, " b"], step_over: float, turn: float) -> list[int]:
    """The sections at which bands of least time begin and end, from the first to the last; `minutes` takes a
    line at each section."""
    at = np.linspace(0, len(count) - 1, BORDERS + 1).astype(np.int64)
    way = np.r_[0.0, np.cumsum(minutes)]
    least = np.r_[0.0, np.full(BORDERS, np.inf)]
    before = np.zeros(BORDERS + 1, dtype=np.int64)
    for end in range(1, BORDERS + 1):
        # the number of lines of the bands that begin at each border before this one
        lines = [np.ceil(count[at[start] : at[end] + 1].max()) for start in range(end)]
        times = least[:end] + np.array(lines) * (way[at[end]] - way[at[:end]] + step_over) + turn
        before[end] = np.argmin(times)
        least[end] = times[before[end]]
    borders = [BORDERS]
    while borders[-1]:
        borders.append(int(before[borders[-1]]))
    return [int(at[k]) for k in borders[::-1]]
