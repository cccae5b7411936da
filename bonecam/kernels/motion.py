"""The motion of a machine's axes along a path: rotary angles, ramps of the speed.

The cheapest sequence of states along a chain (Viterbi 1967), compiled; rotary angles along a tool path are
chosen by it.

The speed along a polyline whose corners are rounded, and ramps whose jerk is bounded too; compiled.

With b = v^2 the path acceleration is (db/ds) / 2. Where an axis has the rate q' along the path and changes it by q'' it
accelerates by q' (db/ds) / 2 + q'' b, which bounds db/ds at each b. A line has no q''; a corner, rounded over h before
and behind it by a parabola, has the change of the rate over 2 h (`planning/motion_time.py`).

A ramp from speed v to v + D at acceleration a and jerk j begins and ends without acceleration (S-shaped). It takes

    T = 2 sqrt(D / j)   where D <= a^2 / j,   else   T = D / a + a / j,

and, being point-symmetric, the way (v + D / 2) T. Units are those of the caller.
"""

import math

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit

FULL_TURN = 2 * np.pi


@inner_njit()
def _least(costs: ndarray) -> float:
    """The least of the costs."""
    least = np.inf
    for cost in costs:
        least = min(least, cost)
    return least


@njit(cache=True)
def cheapest_chain(
    start: ndarray,
    travel: ndarray,
    wraps: ndarray,
    size: tuple[int, int],
    values: ndarray,
    allowed: ndarray,
    bounded: ndarray,
    jumps: ndarray,
) -> tuple[ndarray, ndarray]:
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


HALVINGS = 50
"""Times that the interval of the speed which a move reaches is halved."""


@inner_njit()
def _reached(speed: float, way: float, a: float, j: float) -> float:
    """The speed at the end of a ramp of this way that begins with a `speed`."""
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


@inner_njit()
def _ramp_time(rise: float, a: float, j: float) -> float:
    """The time of a ramp by this change of the speed."""
    return 2 * math.sqrt(rise / j) if rise * j <= a**2 else rise / a + a / j


@inner_njit()
def _ramps(start: float, peak: float, end: float, a: float, j: float) -> tuple[float, float]:
    """Time and way of the ramps from a speed to its peak and to the speed at the end."""
    up, down = _ramp_time(peak - start, a, j), _ramp_time(peak - end, a, j)
    return up + down, up * (start + peak) / 2 + down * (peak + end) / 2


@inner_njit()
def _move_time(start: float, end: float, a: float, j: float, way: float) -> float:
    """The time of a move of this way from one speed to another, as fast as speed 1 allows. One that is all part of a
    longer ramp takes its way at the mean of both speeds."""
    low = max(start, end)
    if start + end > 0.0 and _ramps(start, low, end, a, j)[1] >= way:
        return 2 * way / (start + end)
    high = max(low, 1.0)
    if _ramps(start, high, end, a, j)[1] <= way:
        low = high
    for _ in range(HALVINGS if low < high else 0):
        middle = (low + high) / 2
        if _ramps(start, middle, end, a, j)[1] <= way:
            low = middle
        else:
            high = middle
    time, used = _ramps(start, low, end, a, j)
    return time + max(way - used, 0.0) / low


@inner_njit()
def _ramp_up(speeds: ndarray, times: ndarray, ways: ndarray, a: ndarray, j: ndarray) -> None:
    """Lower the speeds at the ends of moves until no ramp exceeds them forwards, and set the times of the moves that
    lie within a ramp, NaN of the others. A ramp begins where the speed is as high as may be; over many short moves it
    builds up one acceleration, with the least acceleration and jerk that it has met."""
    begin = speeds[0]
    way = since = 0.0
    least_a = least_j = math.inf
    for k in range(len(ways)):
        way += ways[k]
        least_a = min(least_a, a[k])
        least_j = min(least_j, j[k])
        far = _reached(begin, way, least_a, least_j)
        times[k] = math.nan
        if far >= speeds[k + 1]:
            begin = speeds[k + 1]
            way = since = 0.0
            least_a = least_j = math.inf
            continue
        # a ramp takes its way at the mean of its ends
        until = 2 * way / (begin + far)
        times[k] = until - since
        speeds[k + 1], since = far, until


@njit(cache=True)
def ramped_times(highest: ndarray, ways: ndarray, a: ndarray, j: ndarray) -> ndarray:
    """The times (m,) of successive moves of these `ways`, with speeds up to 1, and at their ends (m + 1,) up to the
    `highest`, at the accelerations and jerks (m,) of the moves."""
    m = len(ways)
    forwards, up = highest.copy(), np.empty(m)
    _ramp_up(forwards, up, ways, a, j)
    speeds, down = forwards.copy(), np.empty(m)
    _ramp_up(speeds[::-1], down[::-1], ways[::-1], a[::-1], j[::-1])
    times = np.empty(m)
    for k in range(m):
        kept = speeds[k] == forwards[k] and speeds[k + 1] == forwards[k + 1]
        times[k] = up[k] if kept and not math.isnan(up[k]) else down[k]
        if math.isnan(times[k]):
            times[k] = _move_time(speeds[k], speeds[k + 1], a[k], j[k], ways[k])
    return times


@inner_njit()
def _gain(rate: ndarray, bend: ndarray, b: float, most: ndarray) -> float:
    """The most that half of db/ds can be, where axes with these bounds have these q' and q''."""
    gain = math.inf
    for k in range(len(most)):
        if rate[k] != 0.0:
            used = bend[k] * b if rate[k] > 0.0 else -bend[k] * b
            gain = min(gain, (most[k] - used) / abs(rate[k]))
    return max(gain, 0.0)


@inner_njit()
def _speed_up(
    squares: ndarray, a: ndarray, lines: ndarray, half: ndarray, rates: ndarray, bends: ndarray, most: ndarray
) -> None:
    """Lower the squares of speeds at the ends of lines and corners until none speeds up faster, in two steps a
    corner."""
    for i in range(len(lines)):
        b = squares[2 * i] + 2 * a[i] * lines[i]
        squares[2 * i + 1] = min(squares[2 * i + 1], b)
        if i + 1 < len(lines):
            b = squares[2 * i + 1]
            b += 2 * half[i] * _gain(rates[i], bends[i], b, most)
            b = min(b, squares[2 * i + 2])
            b += 2 * half[i] * _gain((rates[i] + rates[i + 1]) / 2, bends[i], b, most)
            squares[2 * i + 2] = min(squares[2 * i + 2], b)


@njit(cache=True)
def rounded_times(
    highest: ndarray, ways: ndarray, a: ndarray, half: ndarray, rates: ndarray, bends: ndarray, most: ndarray
) -> tuple[ndarray, ndarray]:
    """The times (m,) of successive moves of these `ways`, each with half of the corners at its ends, and the speeds
    (m + 1,) at these, up to 1 and up to the `highest`, at the accelerations `a` (m,) along the moves. Corners are
    rounded over `half` (m - 1,) on both sides, with q'' = `bends` (m - 1, d) there; `rates` (m, d) are the q' of moves,
    `most` (d,) the accelerations of axes."""
    m = len(ways)
    squares = np.empty(2 * m)
    lines = ways.copy()
    for i in range(m):
        squares[2 * i], squares[2 * i + 1] = highest[i] ** 2, highest[i + 1] ** 2
        if i + 1 < m:
            lines[i] -= half[i]
            lines[i + 1] -= half[i]
    _speed_up(squares, a, lines, half, rates, bends, most)
    _speed_up(squares[::-1], a[::-1], lines[::-1], half[::-1], -rates[::-1], bends[::-1], most)
    speeds, times = np.sqrt(squares), np.zeros(m)
    for i in range(m):
        start, end = speeds[2 * i], speeds[2 * i + 1]
        if lines[i] > 0.0:
            peak = min(math.sqrt((squares[2 * i] + squares[2 * i + 1]) / 2 + a[i] * lines[i]), 1.0)
            peak = max(peak, start, end)
            ramps = (2 * peak**2 - start**2 - end**2) / (2 * a[i])
            times[i] += (2 * peak - start - end) / a[i] + max(lines[i] - ramps, 0.0) / peak
        if i + 1 < m and half[i] > 0.0:
            corner = 2 * half[i] / (end + speeds[2 * i + 2])
            times[i] += corner
            times[i + 1] += corner
    return times, np.append(np.minimum(speeds[::2], np.append(0.0, speeds[1:-1:2])), 0.0)
