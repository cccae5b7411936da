"""The T-mesh of a .tsm file on its index grid, and which control point belongs to which vertex.

A border vertex has further control points beside its own one, which lies outermost. `cg` says to which sides
(D0..D3 = 1: to its north, west, south and east in its own frame) and lists them counter-clockwise from the
north, corners between two such sides included (-1: not there). In index space each of these is a line of its
own with the same knot: the clamped border. A corner of the domain that turns inwards has them on all four
sides.
"""

from collections.abc import Callable

import numpy as np
from numpy import ndarray

from bonecam.surface.files.tsm.records import Records
from bonecam.surface.files.tsm.tmesh_chart import TMeshChart, chart_of
from bonecam.surface.tmesh.general import TMesh


def tmesh_of(records: Records) -> tuple[TMesh, list[int]]:
    """The T-mesh and, for each of its vertices, the number of its control point in the file."""
    chart = chart_of(records)
    nodes, grips = _nodes(records, chart)
    return _index_grid(records, chart, nodes), grips


def _nodes(records: Records, chart: TMeshChart) -> tuple[ndarray, list[int]]:
    """The control points in use, in the order of the file: the vertex of each and its offset (di, dj) in
    lines from the vertex' own control point, (n, 3); and their numbers in the file."""
    if not records.owners:
        return _one_a_vertex(records)
    nodes = []
    grips = []
    own = {vertex: grip for grip, (primary, vertex) in enumerate(records.owners) if primary}
    for v, vertex in enumerate(records.vertices):
        if vertex is None:
            continue
        if v not in own:
            raise records.error("v", v, "it has no control point: a '0m gvp' record is missing")
        nodes.append((v, 0, 0))
        grips.append(own[v])
        turn = chart.directions[vertex[0]] - vertex[1]
        for grip, offset in _further_points(records, v):
            if grip >= 0:
                for _ in range(turn % 4):
                    offset = (-offset[1], offset[0])
                nodes.append((v, *offset))
                grips.append(grip)
    if len(set(grips)) < len(grips) or max(grips) >= len(records.grips):
        grip = max(grips) if max(grips) >= len(records.grips) else next(g for g in grips if grips.count(g) > 1)
        raise records.error("0g", grip, "it is missing, or belongs to two places of the T-mesh")
    order = np.argsort(grips)
    return np.array(nodes)[order], [grips[k] for k in order]


def _one_a_vertex(records: Records) -> tuple[ndarray, list[int]]:
    """The control points of a file without `0m` records (Fusion): one a vertex, in order."""
    used = [v for v, vertex in enumerate(records.vertices) if vertex is not None]
    if len(used) != len(records.grips):
        raise records.error("0g", len(records.grips), f"{len(used)} vertices need as many control points")
    return np.array([(v, 0, 0) for v in used]), list(range(len(used)))


def _further_points(records: Records, v: int) -> list[tuple[int, tuple[int, int]]]:
    """The control points of a vertex beside its own one: number (-1: not there) and offset (di, dj) in the
    vertex' own frame."""
    if v not in records.corners:
        return []
    valence = records.corners[v][0]
    extents = records.corners[v][1:5]
    grips = records.corners[v][5:]
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


def _index_grid(records: Records, chart: TMeshChart, nodes: ndarray) -> TMesh:
    """The T-mesh on its index grid, which has one line for every knot and offset in use."""
    knots = []
    vertices = []
    principal = []
    for axis in (0, 1):
        line = chart.lines[nodes[:, 0], axis]
        keys = np.column_stack([line, nodes[:, 1 + axis]])
        distinct, number = np.unique(keys, axis=0, return_inverse=True)
        knots.append(chart.knots[axis][distinct[:, 0]])
        vertices.append(number.ravel())
        principal.append(np.flatnonzero(distinct[:, 1] == 0))
    own = np.column_stack([principal[axis][chart.lines[:, axis]] for axis in (0, 1)])
    index = np.column_stack(vertices)
    edges = [
        _edges(records, chart, nodes=nodes, index=index, axis=axis, counts=[len(k) for k in knots]) for axis in (0, 1)
    ]
    shape = tuple(len(k) - (not length) for k, length in zip(knots, chart.period))
    inside = np.zeros(shape, dtype=bool)
    for k, face in enumerate(records.faces):
        if face is not None:
            _mark_face(inside, records, chart=chart, own=own, k=k, start=face[0])
    return TMesh(
        s_lines=knots[0],
        t_lines=knots[1],
        vertices=index,
        along_s=edges[0],
        along_t=edges[1].T.copy(),
        inside=inside,
        period=chart.period,
    )


def _edges(
    records: Records, chart: TMeshChart, nodes: ndarray, index: ndarray, axis: int, counts: list[int]
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
            first = _facing(groups[link[3]], max)
            last = _facing(groups[following[3]], min)
            for across in first.keys() & last.keys():
                (start, row), (end, _) = first[across], last[across]
                edges[start : (end if end > start else None), row] = True
                edges[: (end if end <= start else 0), row] = True
    return edges


def _facing(group: dict[tuple[int, int], tuple[int, int]], extreme: Callable) -> dict[int, tuple[int, int]]:
    """The control points at one side of a vertex, by their offset across."""
    side = extreme(along for along, _ in group)
    return {across: place for (along, across), place in group.items() if along == side}


def _mark_face(inside: ndarray, records: Records, chart: TMeshChart, own: ndarray, k: int, start: int) -> None:
    """Mark the cells of face k; its sides are the lines of its corners' own control points."""
    corners = []
    n = start
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
