"""Where the vertices of a .tsm file lie: its half edges laid out in one chart.

Link flags give every link its direction (a turn to the left at each corner of a face), edges their knot
intervals: walking them lays the T-mesh out in one chart. A walk that comes home one period further on closes
that direction; any other contradiction is an extraordinary point or a broken interval, and an error that
names the record.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.surface.files.tsm.records import Records

STEPS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
"""Steps in s and t of the directions 0 east, 1 north, 2 west, 3 south."""

SLACK = 1e-9
"""Share of the widest knot range: knots nearer to each other are one."""


@dataclass(eq=False)
class TMeshChart:
    """The T-mesh of a file in one chart: `directions` of all links (0 east, 1 north, 2 west, 3 south),
    `places` (s, t) and numbers of the `lines` of all vertices, `knots` of the lines in s and t, and the
    `period` in s and t (0: open)."""

    directions: list[int]
    places: Float[ndarray, "n 2"]
    lines: Int64[ndarray, "n 2"]
    knots: tuple[Float[ndarray, " a"], Float[ndarray, " b"]]
    period: tuple[float, float]


def chart_of(records: Records) -> TMeshChart:
    """The T-mesh of the records laid out in one chart."""
    directions = _directions(records)
    positions, period = _places(records, directions)
    used = np.flatnonzero([vertex is not None for vertex in records.vertices])
    lines = np.zeros((len(positions), 2), dtype=np.int64)
    knots = []
    for axis in (0, 1):
        values, number = _lines(positions[used, axis], SLACK * np.ptp(positions[used]), period[axis])
        lines[used, axis] = number
        knots.append(_exact_knots(records, "st"[axis], values))
    stated = [records.knots.get(f"{letter}-period", [length])[0] for letter, length in zip("st", period)]
    return TMeshChart(directions, positions, lines, (knots[0], knots[1]), (stated[0], stated[1]))


def _directions(records: Records) -> list[int]:
    """The direction of every link: 0 east, 1 north, 2 west, 3 south. The link that the first face names runs
    east; the directions that `v` records state need not agree with it."""
    directions = [-1] * len(records.links)
    start = next((face[0] for face in records.faces if face is not None), -1)
    if start < 0:
        raise records.error("f", 0, "the file has no face")
    directions[start] = 0
    queue = deque([start])
    while queue:
        n = queue.popleft()
        link = records.links[n]
        assert link is not None
        following = records.links[link[1]]
        assert following is not None
        for other, direction in ((link[2], directions[n] + 2), (link[1], directions[n] + 1 - following[6])):
            if directions[other] < 0:
                directions[other] = direction % 4
                queue.append(other)
            elif directions[other] != direction % 4:
                message = (
                    f"its direction contradicts link {n} (a wrong flag, or an extraordinary point, "
                    "which only .iga files can hold)"
                )
                raise records.error("l", other, message)
    for n, link in enumerate(records.links):
        if link is not None and directions[n] < 0:
            raise records.error("l", n, "it is not connected to the first face")
    return directions


def _places(records: Records, directions: list[int]) -> tuple[ndarray, tuple[float, float]]:
    """Positions (s, t) of the vertices, summed from knot intervals, and the periods in s and t (0: open). In
    an open direction the least position is 0, in a closed one that of the first vertex."""
    out: dict[int, list[tuple[int, int, ndarray]]] = {}
    for n, link in enumerate(records.links):
        if link is not None:
            edge, following = records.edges[link[5]], records.links[link[1]]
            assert edge is not None
            assert following is not None
            out.setdefault(link[3], []).append((n, following[3], STEPS[directions[n]] * edge[1]))
    positions = np.zeros((len(records.vertices), 2))
    start = min(out)
    seen = {start}
    queue = deque([start])
    misses = []
    while queue:
        v = queue.popleft()
        for n, w, step in out[v]:
            if w not in seen:
                seen.add(w)
                positions[w] = positions[v] + step
                queue.append(w)
            else:
                misses.append((n, positions[v] + step - positions[w]))
    used = sorted(out)
    positions[used] -= positions[used].min(axis=0)
    slack = SLACK * float(np.ptp(positions[used]))
    _check_faces({n: step for links in out.values() for n, _, step in links}, records, slack)
    period = _period(records, misses, slack)
    for axis in (0, 1):
        if period[axis]:
            positions[used, axis] -= positions[start, axis]
    return positions, period


def _check_faces(steps: dict[int, ndarray], records: Records, slack: float) -> None:
    """FileError where the knot intervals round a face do not add up to zero."""
    total = np.zeros((len(records.faces), 2))
    for n, step in steps.items():
        link = records.links[n]
        if link is not None and link[4] >= 0:
            total[link[4]] += step
    wrong = np.flatnonzero(np.abs(total).max(axis=1) > slack)
    if len(wrong):
        s, t = total[wrong[0]]
        raise records.error(
            "f", int(wrong[0]), f"the knot intervals round it do not add up: they miss by {s:.6g} in s and {t:.6g} in t"
        )


def _period(records: Records, misses: list[tuple[int, ndarray]], slack: float) -> tuple[float, float]:
    """The periods in s and t: by how much walks round the surface miss their start. FileError where two walks
    miss it by different lengths, or in s and t at once."""
    period = [0.0, 0.0]
    for n, miss in misses:
        for axis in (0, 1):
            length = abs(float(miss[axis]))
            if length <= slack:
                continue
            if abs(miss[1 - axis]) > slack or (period[axis] and abs(length - period[axis]) > slack):
                raise records.error(
                    "l",
                    n,
                    f"knot intervals do not add up round a loop: they miss by {miss[0]:.6g} in s and "
                    f"{miss[1]:.6g} in t",
                )
            period[axis] = period[axis] or length
    return period[0], period[1]


def _lines(values: ndarray, slack: float, period: float) -> tuple[ndarray, ndarray]:
    """The knots of the lines in ascending order, and the number of the line that each value lies on. A line
    has the value of its first vertex; values nearer than `slack` are one."""
    values = np.mod(values + slack, period) - slack if period else values
    order = np.argsort(values, kind="stable")
    new = np.concatenate([[True], np.diff(values[order]) > slack])
    number = np.empty(len(values), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    first = np.full(int(number.max()) + 1, len(values))
    np.minimum.at(first, number, np.arange(len(values)))
    return np.maximum(values[first], 0.0), number


def _exact_knots(records: Records, letter: str, knots: ndarray) -> ndarray:
    """The knots with all digits, from the file's comment #s-knots or #t-knots; `knots`, summed from
    intervals, where it has none. FileError where the two differ."""
    stated = np.array(records.knots.get(f"{letter}-knots", knots))
    if len(stated) != len(knots) or (np.abs(stated - stated[0] - knots) > 1e-6 * np.ptp(knots)).any():
        raise records.error(f"#{letter}-knots", 0, "its knots are not those that the edges' intervals add up to")
    return stated
