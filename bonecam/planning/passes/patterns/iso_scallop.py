"""Curves along a closed part that are not iso-parametric: each lies at the exact local step from the one
before, so that cusps are full everywhere.

Passes are counted from some meridians, the seeds, to both sides: psi = 0 on the seed and |grad psi| L = 1 beside it
(`step_metric.py`), which is solved for psi_s by iteration, psi_t being that of the round before. Where slopes are steep
this does not settle: the later rounds count more passes where the round before fell short. The curves psi = 1/2,
3/2, ... end where those of the neighbouring seed begin: where the part is slender there are fewer. So each of
them is a function s(t) over one or several ranges of t.

Two curves that meet at the border between two seeds lie at most one step apart.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.planning.passes.patterns.curves import Curves, curves_of, ranges
from bonecam.planning.passes.patterns.step_metric import StepMetric

ROUNDS = 12
"""Rounds of the iteration: cusps then exceed a scallop of 0.01 mm by 4 % at most on five bones."""
FREE_ROUNDS = 3
"""The first rounds, in which slopes of the curves are still found, are not mended."""
SHORT_GAP = 3.0
"""A gap of a curve that is shorter is cut through, in side steps: turning about costs more."""


@dataclass(frozen=True, eq=False)
class SeedSide:
    """One side of a seed: the passes counted from it at the places `s` (h,) x t; `s` runs away from the seed
    and ends at the border to the next one."""

    s: Float[ndarray, " h"]
    passes: Float[ndarray, "h b"]


def iso_scallop_curves(metric: StepMetric, seeds: int) -> Curves:
    """The curves counted from `seeds` meridians, which must divide the places of the grid in s by an even number.

    Between two seeds, the group of curves runs from the one to the other.
    """
    sides = _sides(metric, seeds)
    pieces: list[ndarray] = []
    group: list[int] = []
    for k in range(seeds):
        beyond = [_pieces(metric, side) for side in (sides[2 * k], sides[(2 * k + 3) % len(sides)])]
        turn = np.array([1.0 if k == seeds - 1 else 0.0, 0.0])
        seed_pieces = beyond[0] + [turn + piece for piece in beyond[1][::-1]]
        pieces += seed_pieces
        group += [k] * len(seed_pieces)
    return curves_of(pieces, np.array(group))


def _sides(metric: StepMetric, seeds: int) -> list[SeedSide]:
    """The two sides of each seed meridian, that of growing s first."""
    cell = metric.s[1] - metric.s[0]
    count = len(metric.s)
    half = count // (2 * seeds)
    a, b = np.ones_like(metric.E), np.zeros_like(metric.E)
    closer = np.ones_like(metric.E)
    for number in range(ROUNDS):
        coverage = metric.coverage(a, b)
        if number > FREE_ROUNDS:
            closer = closer * metric.shortfall(coverage)
        rate = closer * metric.rate(a, coverage)
        between = (rate + np.roll(rate, -1, axis=0)) / 2 * cell
        sides: list[SeedSide] = []
        b = np.empty_like(rate)
        for seed in np.arange(seeds) * 2 * half:
            for sign in (1, -1):
                index = seed + sign * np.arange(half + 1)
                steps = between[(index[:-1] if sign > 0 else index[1:]) % count]
                passes = np.vstack([np.zeros(len(metric.t)), np.cumsum(steps, axis=0)])
                sides.append(SeedSide(index * cell, passes))
                b[index % count] = sign * np.gradient(passes, metric.t, axis=1)
        a = rate
    return sides


def _pieces(metric: StepMetric, side: SeedSide) -> list[Float[ndarray, "_ 2"]]:
    """The curves of one side from the seed on, from low to high t."""
    width = side.passes[-1]
    cell = float(np.sqrt(metric.G.mean())) * (metric.t[1] - metric.t[0])
    short = SHORT_GAP * metric.flat_step / cell
    curves: list[ndarray] = []
    numbers = np.arange(int(width.max()) + 1)
    s_of_curves = np.array([np.interp(numbers + 0.5, column, side.s) for column in side.passes.T])
    for number in numbers:
        knots = np.column_stack([s_of_curves[:, number], metric.t])
        curves += [knots[a:b] for a, b in ranges(width >= number, short)]
    return curves
