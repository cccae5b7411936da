"""Cheapest way through a chain of states (Viterbi): used to choose rotary angles along a tool path."""

import numpy as np
from numba import njit


@njit(cache=True)
def cheapest_chain(start: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """States (n,) of the cheapest chain: start (k,) costs, steps (n - 1, k, k) costs from state to state.

    Ties go to the lowest state. A chain of infinite cost answers -1 from the first row that cannot be
    reached.
    """
    n, k = steps.shape[0] + 1, len(start)
    came = np.zeros((n, k), dtype=np.int16)
    cost = start.copy()
    following = np.empty(k)
    for row in range(n - 1):
        for to in range(k):
            best, place = np.inf, 0
            for state in range(k):
                value = cost[state] + steps[row, state, to]
                if value < best:
                    best, place = value, state
            following[to] = best
            came[row + 1, to] = place
        if np.min(following) == np.inf:
            states = np.full(n, -1, dtype=np.int64)
            states[: row + 1] = 0
            return states
        cost[:] = following
    states = np.empty(n, dtype=np.int64)
    states[n - 1] = np.argmin(cost)
    for row in range(n - 1, 0, -1):
        states[row - 1] = came[row, states[row]]
    return states
