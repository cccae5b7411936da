"""The cheapest sequence of states along a chain (Viterbi 1967), compiled; rotary angles along a tool path are
chosen by it."""

import numpy as np

from bonecam.kernels import inner_njit, njit

FULL_TURN = 2 * np.pi


@inner_njit()
def _least(costs: np.ndarray) -> float:
    """The least of the costs."""
    least = np.inf
    for cost in costs:
        least = min(least, cost)
    return least


@njit(cache=True)
def cheapest_chain(
    start: np.ndarray,
    travel: np.ndarray,
    wraps: np.ndarray,
    size: tuple[int, int],
    values: np.ndarray,
    allowed: np.ndarray,
    bounded: np.ndarray,
    jumps: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The state (n,) of each row in the cheapest chain, by dynamic programming, and which rows a jump leads to.

    State (s T1 + i) T2 + j of a row is its solution s with turns i and j of the two joints, `size` = (T1, T2); `values`
    (n, k, 2) are its angles (rad), which only those `allowed` (n, k) may take. `start` (k,) are the costs of the first
    row's states. A step from solution a to b costs `travel` (n - 1, 2, 2), and turns the joints down by `wraps`
    (n - 1, 2, 2, 2). A jump leads to any state: it costs `jumps` (n - 1,), which may be infinite, and its own travel,
    by the shorter way of a joint that is not `bounded` (2,). Ties go to the step, then to the lowest state. Where every
    chain costs infinity, the rows from the first on that cannot be reached are -1.
    """
    n, k = allowed.shape
    per_solution = size[0] * size[1]
    previous = np.zeros((n, k), dtype=np.int16)
    jumped = np.zeros((n, k), dtype=np.bool_)
    cost = start.copy()
    next_cost = np.empty(k)
    for row in range(n - 1):
        next_cost[:] = np.inf
        for state in range(k):
            if cost[state] == np.inf:
                continue
            a = state // per_solution
            i = state % per_solution // size[1]
            j = state % size[1]
            for b in range(2):
                i_to = i - wraps[row, a, b, 0]
                j_to = j - wraps[row, a, b, 1]
                if i_to < 0 or i_to >= size[0] or j_to < 0 or j_to >= size[1]:
                    continue
                to = (b * size[0] + i_to) * size[1] + j_to
                value = cost[state] + travel[row, a, b]
                if allowed[row + 1, to] and value < next_cost[to]:
                    next_cost[to] = value
                    previous[row + 1, to] = state
        least = _least(cost) + jumps[row]
        for to in range(k):
            if not allowed[row + 1, to] or least >= next_cost[to]:
                continue
            for state in range(k):
                value = cost[state] + jumps[row]
                if value >= next_cost[to]:
                    continue
                for joint in range(2):
                    change = values[row + 1, to, joint] - values[row, state, joint]
                    if not bounded[joint]:
                        change -= FULL_TURN * np.round(change / FULL_TURN)
                    value += abs(change)
                if value < next_cost[to]:
                    next_cost[to] = value
                    previous[row + 1, to] = state
                    jumped[row + 1, to] = True
        if _least(next_cost) == np.inf:
            states = np.full(n, -1, dtype=np.int64)
            states[: row + 1] = 0
            return states, np.zeros(n, dtype=np.bool_)
        cost, next_cost = next_cost, cost
    states = np.empty(n, dtype=np.int64)
    reached = np.zeros(n, dtype=np.bool_)
    states[n - 1] = np.argmin(cost)
    for row in range(n - 1, 0, -1):
        reached[row] = jumped[row, states[row]]
        states[row - 1] = previous[row, states[row]]
    return states, reached
