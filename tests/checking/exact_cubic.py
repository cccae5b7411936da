"""Exact values of blending functions for the comparisons with published ones."""

from fractions import Fraction
from itertools import pairwise


def exact_cubic(knots: list[float], x: Fraction) -> Fraction:
    """Evaluates the cubic B-spline on five knots by the recursion of Cox (1972) and de Boor (1972) in exact
    fractions."""
    k = [Fraction(value) for value in knots]
    values = [Fraction(int(a <= x < b)) for a, b in pairwise(k)]
    for p in (1, 2, 3):
        values = [
            (values[i] * (x - k[i]) / (k[i + p] - k[i]) if k[i + p] > k[i] else 0)
            + (values[i + 1] * (k[i + p + 1] - x) / (k[i + p + 1] - k[i + 1]) if k[i + p + 1] > k[i + 1] else 0)
            for i in range(len(values) - 1)
        ]
    return values[0]
