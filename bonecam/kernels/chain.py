"""The cheapest sequence of states along a chain (Viterbi 1967), compiled; rotary angles along a tool path are
chosen by it."""

import numpy as np
from numba import njit


@njit(cache=True)
def cheapest_chain(start: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """The state (n,) of each row in the cheapest chain, by dynamic programming.

    `start` (k,) are the costs of the first row's states, `steps` (n - 1, k, k) those from a state to a state
    of the next row. Ties go to the lowest state. Where every chain costs infinity, the rows from the first on
    that cannot be reached are -1.
    """
    n, k = steps.shape[0] + 1, len(start)
    previous = np.zeros((n, k), dtype=np.int16)
    cost = start.copy()
    next_cost = np.empty(k)
    for row in range(n - 1):
        for to in range(k):
            least, best = np.inf, 0
            for state in range(k):
                value = cost[state] + steps[row, state, to]
                if value < least:
                    least, best = value, state
            next_cost[to] = least
            previous[row + 1, to] = best
        if np.min(next_cost) == np.inf:
            states = np.full(n, -1, dtype=np.int64)
            states[: row + 1] = 0
            return states
        cost[:] = next_cost
    states = np.empty(n, dtype=np.int64)
    states[n - 1] = np.argmin(cost)
    for row in range(n - 1, 0, -1):
        states[row - 1] = previous[row, states[row]]
    return states
