"""Which element of a surface holds (s, t): search in strips of t, compiled."""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit


@njit(inline="always")
def _strip(strip_knots: ndarray, strip_table: ndarray, t: float) -> int:
    """The last strip that starts at or below t. The table holds, for even slices of the t-range, the strip at
    which the search starts."""
    count = len(strip_knots) - 1
    slices = len(strip_table)
    k = strip_table[
        min(slices - 1, max(0, int((t - strip_knots[0]) * (slices / (strip_knots[count] - strip_knots[0])))))
    ]
    while k + 1 < count and strip_knots[k + 1] <= t:
        k += 1
    return k


@njit(inline="always")
def _slot(strip_starts: ndarray, lows: ndarray, highs: ndarray, tables: ndarray, k: int, s: float) -> int:
    """The last element of strip k that starts at or below s, its first one where there is none."""
    a = strip_starts[k]
    b = strip_starts[k + 1] - 1
    slots = tables.shape[1]
    i = tables[k, min(slots - 1, max(0, int((s - lows[a]) * (slots / (highs[b] - lows[a])))))]
    while i < b and lows[i + 1] <= s:
        i += 1
    return i


@inner_njit()
def locate_one(
    strip_knots: ndarray, strip_table: ndarray, strip_starts: ndarray, lows: ndarray, highs: ndarray,
    ids: ndarray, tables: ndarray,
    s: float, t: float,
) -> int:  # fmt: skip
    """The element that holds (s, t), its borders included; -1 where there is none.

    Strip k covers t in [strip_knots[k], strip_knots[k+1]]; its elements are sorted by their lower s.
    """
    k = _strip(strip_knots, strip_table, t)
    while k >= 0:
        i = _slot(strip_starts, lows, highs, tables, k, s)
        if lows[i] <= s <= highs[i]:
            return ids[i]
        if i > strip_starts[k] and highs[i - 1] == s:
            return ids[i - 1]
        if t > strip_knots[k]:
            return -1
        k -= 1
    return -1


@njit(cache=True)
def locate(
    strip_knots: ndarray, strip_table: ndarray, strip_starts: ndarray, lows: ndarray, highs: ndarray,
    ids: ndarray, tables: ndarray,
    s: ndarray, t: ndarray,
) -> ndarray:  # fmt: skip
    """The element of each sample, as `locate_one` finds it, without a call where the first guess is right."""
    elements = np.empty(len(s), dtype=np.int32)
    for n in range(len(s)):
        x = s[n]
        i = _slot(strip_starts, lows, highs, tables, _strip(strip_knots, strip_table, t[n]), x)
        if lows[i] <= x <= highs[i]:
            elements[n] = ids[i]
        else:
            elements[n] = locate_one(strip_knots, strip_table, strip_starts, lows, highs, ids, tables, x, t[n])
    return elements
