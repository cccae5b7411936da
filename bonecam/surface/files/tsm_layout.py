"""From half edges to index space: where the vertices and control points of a .tsm file lie.

Link flags give every link its direction (a turn to the left at each corner of a face), edges their knot
intervals: walking them lays the T-mesh out in one chart. A walk that comes home one period further on closes
that direction; any other contradiction is an extraordinary point or a broken interval, and an error that
names the record.

A border vertex has further control points beside its own one, which lies outermost. `cg` says to which sides
(D0..D3 = 1: to its north, west, south and east in its own frame) and lists them counter-clockwise from the
north, corners between two such sides included (-1: not there). In index space each of these is a line of its
own with the same knot: the clamped border. A corner of the domain that turns inwards has them on all four
sides.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.surface.files.tsm_records import Records
from bonecam.surface.tmesh.general import TMesh

STEPS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])  # east, north, west, south
SLACK = 1e-9  # of the widest knot range: knots nearer to each other are one


@dataclass(eq=False)
class Chart:
    """Direction of every link, position and line number of every vertex, knots of the lines, period."""

    directions: list[int]
    places: Float[ndarray, "n 2"]
    lines: Int64[ndarray, "n 2"]
    knots: tuple[Float[ndarray, " a"], Float[ndarray, " b"]]
    period: tuple[float, float]


def tmesh_of(records: Records) -> tuple[TMesh, list[int]]:
    """The T-mesh and, for each of its vertices, the number of its control point in the file."""
    chart = _chart(records)
    nodes, grips = _nodes(records, chart)
    return _grid(records, chart, nodes), grips


def _chart(records: Records) -> Chart:
    directions = _directions(records)
    places, period = _places(records, directions)
    used = np.flatnonzero([vertex is not None for vertex in records.vertices])
    lines, knots = np.zeros((len(places), 2), dtype=np.int64), []
    for axis in (0, 1):
        values, number = _lines(places[used, axis], SLACK * np.ptp(places[used]), period[axis])
        lines[used, axis] = number
        knots.append(_stated(records, "st"[axis], values))
    stated = [records.knots.get(f"{letter}-period", [length])[0] for letter, length in zip("st", period)]
    return Chart(directions, places, lines, (knots[0], knots[1]), (stated[0], stated[1]))


def _directions(records: Records) -> list[int]:
    """0 east, 1 north, 2 west, 3 south, for every link; the first face's own link runs east (the vertices'
    frames need not agree)."""
    found = [-1] * len(records.links)
    start = next((face[0] for face in records.faces if face is not None), -1)
    if start < 0:
        raise records.error("f", 0, "the file has no face")
    found[start] = 0
    queue = deque([start])
    while queue:
        n = queue.popleft()
        link = records.links[n]
        assert link is not None
        following = records.links[link[1]]
        assert following is not None
        for other, direction in ((link[2], found[n] + 2), (link[1], found[n] + 1 - following[6])):
            if found[other] < 0:
                found[other] = direction % 4
                queue.append(other)
            elif found[other] != direction % 4:
                message = f"its direction contradicts link {n} (a wrong flag, or an extraordinary point, which only .iga files can hold)"
                raise records.error("l", other, message)
    for n, link in enumerate(records.links):
        if link is not None and found[n] < 0:
            raise records.error("l", n, "it is not connected to the first face")
    return found


def _places(records: Records, directions: list[int]) -> tuple[ndarray, tuple[float, float]]:
    """Positions from knot intervals, and the periods. The least position is 0, in a closed direction the
    first vertex'."""
    out: dict[int, list[tuple[int, int, ndarray]]] = {}
    for n, link in enumerate(records.links):
        if link is not None:
            edge, following = records.edges[link[5]], records.links[link[1]]
            assert edge is not None
            assert following is not None
            out.setdefault(link[3], []).append((n, following[3], STEPS[directions[n]] * edge[1]))
    places = np.zeros((len(records.vertices), 2))
    start = min(out)
    seen, queue, misses = {start}, deque([start]), []
    while queue:
        v = queue.popleft()
        for n, w, step in out[v]:
            if w not in seen:
                seen.add(w)
                places[w] = places[v] + step
                queue.append(w)
            else:
                misses.append((n, places[v] + step - places[w]))
    used = sorted(out)
    places[used] -= places[used].min(axis=0)
    slack = SLACK * float(np.ptp(places[used]))
    _check_faces({n: step for links in out.values() for n, _, step in links}, records, slack)
    period = _period(records, misses, slack)
    for axis in (0, 1):
        if period[axis]:
            places[used, axis] -= places[start, axis]
    return places, period


def _check_faces(steps: dict[int, ndarray], records: Records, slack: float) -> None:
    """Knot intervals must add up to nothing round every face."""
    total = np.zeros((len(records.faces), 2))
    for n, step in steps.items():
        link = records.links[n]
        if link is not None and link[4] >= 0:
            total[link[4]] += step
    wrong = np.flatnonzero(np.abs(total).max(axis=1) > slack)
    if len(wrong):
        s, t = total[wrong[0]]
        raise records.error(
            "f",
            int(wrong[0]),
            f"the knot intervals round it do not add up: they miss by {s:.6g} in s and {t:.6g} in t",
        )


def _period(records: Records, misses: list[tuple[int, ndarray]], slack: float) -> tuple[float, float]:
    """By how much walks round the surface miss their start."""
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
                    f"knot intervals do not add up round a loop: they miss by {miss[0]:.6g} in s and {miss[1]:.6g} in t",
                )
            period[axis] = period[axis] or length
    return period[0], period[1]


def _lines(values: ndarray, slack: float, period: float) -> tuple[ndarray, ndarray]:
    """Distinct knots, the first vertex' value standing for all of a line, and the line of each value."""
    values = np.mod(values + slack, period) - slack if period else values
    order = np.argsort(values, kind="stable")
    new = np.concatenate([[True], np.diff(values[order]) > slack])
    number = np.empty(len(values), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    first = np.full(int(number.max()) + 1, len(values))
    np.minimum.at(first, number, np.arange(len(values)))
    return np.maximum(values[first], 0.0), number


def _stated(records: Records, letter: str, knots: ndarray) -> ndarray:
    """The knots as the file's #s-knots or #t-knots comment has them, all digits; the walked ones where there
    is none."""
    stated = np.array(records.knots.get(f"{letter}-knots", knots))
    if len(stated) != len(knots) or (np.abs(stated - stated[0] - knots) > 1e-6 * np.ptp(knots)).any():
        raise records.error(
            f"#{letter}-knots", 0, "its knots are not those that the edges' intervals add up to"
        )
    return stated


def _nodes(records: Records, chart: Chart) -> tuple[ndarray, list[int]]:
    """Per control point in use: vertex and offset (di, dj) from the vertex' own control point; and its number
    in the file."""
    if not records.owners:
        return _plain(records)
    nodes, grips = [], []
    own = {vertex: grip for grip, (primary, vertex) in enumerate(records.owners) if primary}
    for v, vertex in enumerate(records.vertices):
        if vertex is None:
            continue
        if v not in own:
            raise records.error("v", v, "it has no control point: a '0m gvp' record is missing")
        nodes.append((v, 0, 0))
        grips.append(own[v])
        turn = chart.directions[vertex[0]] - vertex[1]
        for grip, offset in _corner(records, v):
            if grip >= 0:
                for _ in range(turn % 4):
                    offset = (-offset[1], offset[0])
                nodes.append((v, *offset))
                grips.append(grip)
    if len(set(grips)) < len(grips) or max(grips) >= len(records.grips):
        grip = (
            max(grips) if max(grips) >= len(records.grips) else next(g for g in grips if grips.count(g) > 1)
        )
        raise records.error("0g", grip, "it is missing, or belongs to two places of the T-mesh")
    order = np.argsort(grips)
    return np.array(nodes)[order], [grips[k] for k in order]


def _plain(records: Records) -> tuple[ndarray, list[int]]:
    """Files without `0m` (Fusion): one control point a vertex, in order."""
    used = [v for v, vertex in enumerate(records.vertices) if vertex is not None]
    if len(used) != len(records.grips):
        raise records.error("0g", len(records.grips), f"{len(used)} vertices need as many control points")
    return np.array([(v, 0, 0) for v in used]), list(range(len(used)))


def _corner(records: Records, v: int) -> list[tuple[int, tuple[int, int]]]:
    """The further control points of a vertex: number and offset in the vertex' own frame."""
    if v not in records.corners:
        return []
    valence, extents, grips = records.corners[v][0], records.corners[v][1:5], records.corners[v][5:]
    around = ((0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1))
    sides = [k // 2 if k % 2 == 0 else -1 for k in range(8)]
    offsets = [
        o
        for k, o in enumerate(around)
        if (extents[sides[k]] if k % 2 == 0 else extents[k // 2] and extents[(k // 2 + 1) % 4])
    ]
    if valence != 4 or not set(extents) <= {0, 1} or len(grips) != len(offsets):
        raise records.error("cg", v, f"extents {extents} need valence 4 and {len(offsets)} control points")
    for grip in grips:
        if grip != -1 and (not 0 <= grip < len(records.owners) or records.owners[grip] != (False, v)):
            raise records.error("cg", v, f"control point {grip} is not one of vertex {v} ('0m gv {v}')")
    return list(zip(grips, offsets))


def _grid(records: Records, chart: Chart, nodes: ndarray) -> TMesh:
    """The index grid: one line for every knot and offset in use."""
    knots, vertices, principal = [], [], []
    for axis in (0, 1):
        line = chart.lines[nodes[:, 0], axis]
        keys = np.column_stack([line, nodes[:, 1 + axis]])
        distinct, number = np.unique(keys, axis=0, return_inverse=True)
        knots.append(chart.knots[axis][distinct[:, 0]])
        vertices.append(number.ravel())
        principal.append(np.flatnonzero(distinct[:, 1] == 0))
    own = np.column_stack([principal[axis][chart.lines[:, axis]] for axis in (0, 1)])
    index = np.column_stack(vertices)
    edges = [_edges(records, chart, nodes, index, axis, [len(k) for k in knots]) for axis in (0, 1)]
    shape = tuple(len(k) - (not length) for k, length in zip(knots, chart.period))
    inside = np.zeros(shape, dtype=bool)
    for k, face in enumerate(records.faces):
        if face is not None:
            _fill(inside, records, chart, own, k, face[0])
    return TMesh(knots[0], knots[1], index, edges[0], edges[1].T.copy(), inside, chart.period)


def _edges(
    records: Records, chart: Chart, nodes: ndarray, index: ndarray, axis: int, counts: list[int]
) -> ndarray:
    """Edges along one axis, [line along, line across]: between control points of one vertex and, row by row,
    of neighbours.

    Two neighbours share those rows that reach the side at which they face each other.
    """
    edges = np.zeros((counts[axis] if chart.period[axis] else counts[axis] - 1, counts[1 - axis]), dtype=bool)
    groups: dict[
        int, dict[tuple[int, int], tuple[int, int]]
    ] = {}  # vertex -> (offset along, across) -> (line along, across)
    for node, place in zip(nodes, index):
        offset = (int(node[1 + axis]), int(node[2 - axis]))
        groups.setdefault(int(node[0]), {})[offset] = (int(place[axis]), int(place[1 - axis]))
    for group in groups.values():
        for (along, across), (line, row) in group.items():
            if (along + 1, across) in group:
                edges[line, row] = True
    for n, link in enumerate(records.links):
        if link is not None and chart.directions[n] == axis:
            following = records.links[link[1]]
            assert following is not None
            first, last = _facing(groups[link[3]], max), _facing(groups[following[3]], min)
            for across in first.keys() & last.keys():
                (start, row), (end, _) = first[across], last[across]
                edges[start : (end if end > start else None), row] = True
                edges[: (end if end <= start else 0), row] = True
    return edges


def _facing(group: dict[tuple[int, int], tuple[int, int]], extreme: Callable) -> dict[int, tuple[int, int]]:
    """The control points at one side of a vertex, by their offset across."""
    side = extreme(along for along, _ in group)
    return {across: place for (along, across), place in group.items() if along == side}


def _fill(inside: ndarray, records: Records, chart: Chart, own: ndarray, k: int, start: int) -> None:
    """Mark the cells of face k; its sides are the lines of its corners' own control points."""
    corners, n = [], start
    for _ in range(len(records.links)):
        link = records.links[n]
        assert link is not None
        if link[4] != k:
            raise records.error("f", k, f"link {n} of its loop belongs to face {link[4]}")
        if link[6] == 0:
            corners.append((chart.directions[n], own[link[3]]))
        n = link[1]
        if n == start:
            break
    sides = dict(corners)
    if len(corners) != 4 or len(sides) != 4:
        raise records.error("f", k, f"it has {len(corners)} corners (links with flag 0): a face needs four")
    # a link that starts at a corner and runs east starts at the lower left one
    (low_i, low_j), (high_i, high_j) = sides[0], sides[2]
    i = np.arange(low_i, high_i if high_i > low_i else high_i + inside.shape[0]) % inside.shape[0]
    j = np.arange(low_j, high_j if high_j > low_j else high_j + inside.shape[1]) % inside.shape[1]
    inside[np.ix_(i, j)] = True
