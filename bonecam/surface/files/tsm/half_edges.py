"""A general T-mesh as half edges: its vertices, the two links of every edge, and the loops they make."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.tmesh.general import TMesh


@dataclass(eq=False)
class Graph:
    """The vertices of a .tsm file, each of which joins the control points with its knots: `own` is the
    control point that stands for the vertex, `vertex_of` the vertex of each control point, `offsets` its
    place (lines in s and t) from the vertex' own one, `neighbours` the next vertex to the east, north, west
    and south (-1: none)."""

    own: list[int]
    vertex_of: Int64[ndarray, " n"]
    offsets: Int64[ndarray, "n 2"]
    neighbours: Int64[ndarray, "v 4"]


def graph_of(mesh: TMesh) -> Graph:
    """The vertices: control points that are joined by edges of no length are one.

    Raises SurfaceError where more than three lines with one knot meet."""
    label = np.arange(mesh.size)
    steps = [_neighbours(mesh, direction) for direction in range(4)]
    s, t = mesh.s_lines[mesh.vertices[:, 0]], mesh.t_lines[mesh.vertices[:, 1]]
    joined = [np.where((n >= 0) & (s == s[n]) & (t == t[n]), n, -1) for n in steps]
    for _ in range(8):
        for other in joined:
            label = np.where(other >= 0, np.minimum(label, label[other]), label)
    kinds, vertex_of = np.unique(label, return_inverse=True)
    own = []
    offsets = np.zeros((mesh.size, 2), dtype=np.int64)
    for v in range(len(kinds)):
        members = np.flatnonzero(vertex_of == v)
        own.append(_own_point(members, mesh, joined))
        offsets[members] = mesh.vertices[members] - mesh.vertices[own[-1]]
    if (np.abs(offsets) > 1).any():
        raise SurfaceError("more than three lines with one knot meet at a vertex: a .tsm file cannot hold it")
    neighbours = np.full((len(kinds), 4), -1)
    for direction, other in enumerate(steps):
        for v, node in enumerate(own):
            while other[node] >= 0 and vertex_of[other[node]] == v:
                node = int(other[node])
            neighbours[v, direction] = vertex_of[other[node]] if other[node] >= 0 else -1
    return Graph(own, vertex_of, offsets, neighbours)


def _neighbours(mesh: TMesh, direction: int) -> ndarray:
    """The next control point of each along the edges in a direction (0 east, 1 north, 2 west, 3 south), -1
    where no edge starts."""
    grid = mesh.crossings
    i, j = mesh.vertices.T
    axis = direction % 2
    sign = 1 if direction < 2 else -1
    edges = (mesh.along_s, mesh.along_t)[axis]
    count = grid.shape[axis]
    closed = bool(mesh.period[axis])
    place = [i.copy(), j.copy()]
    neighbours = np.full(mesh.size, -1)
    walking = np.ones(mesh.size, dtype=bool)
    for _ in range(count):
        piece = place[axis] if sign > 0 else place[axis] - 1
        possible = walking & (closed | ((piece >= 0) & (piece < edges.shape[axis])))
        at = [place[0], place[1]]
        at[axis] = np.where(possible, piece, 0) % edges.shape[axis]
        walking = possible & edges[at[0], at[1]]
        place[axis] = np.where(walking, (place[axis] + sign) % count if closed else place[axis] + sign, place[axis])
        here = grid[place[0], place[1]]
        neighbours = np.where(walking & (here >= 0), here, neighbours)
        walking &= here < 0
    return neighbours


def _own_point(members: ndarray, mesh: TMesh, joined: list[ndarray]) -> int:
    """The control point of a vertex that lies outermost; the middle one where three lines meet."""
    place = mesh.vertices[members]
    wanted = []
    for axis in (0, 1):
        lines = np.unique(place[:, axis])
        if len(lines) < 3:
            low, high = (members[place[:, axis] == line] for line in (lines[0], lines[-1]))
            wanted.append(
                lines[0] if _at_border(low, mesh, axis, -1) and not _at_border(high, mesh, axis, 1) else lines[-1]
            )
        else:
            wanted.append(lines[1])
    outermost = members[(place == wanted).all(axis=1)]
    if not len(outermost):
        raise SurfaceError(f"control point {members[0]} belongs to a corner that .tsm files have no form for")
    return int(outermost[0])


def _at_border(nodes: ndarray, mesh: TMesh, axis: int, sign: int) -> bool:
    """Whether the domain ends beside these control points, on the side `sign` along `axis`."""
    place = mesh.vertices[nodes]
    shape = mesh.inside.shape
    cells = []
    for across in (0, -1):
        cell = place.copy()
        cell[:, axis] += 0 if sign > 0 else -1
        cell[:, 1 - axis] += across
        for d in (0, 1):
            if mesh.period[d]:
                cell[:, d] %= shape[d]
        valid = ((cell >= 0) & (cell < shape)).all(axis=1)
        cells.append(valid & mesh.inside[tuple(np.where(valid[:, None], cell, 0).T)])
    return not np.logical_or(*cells).all()


def links_of(graph: Graph) -> tuple[list[tuple[int, int]], dict[tuple[int, int], int]]:
    """The half edges (vertex, direction), the two of an edge one after the other, and the number of each."""
    links = []
    for v, row in enumerate(graph.neighbours):
        for direction, w in enumerate(row.tolist()):
            if w >= 0 and graph.neighbours[w, (direction + 2) % 4] != v:
                message = (
                    f"lines with one knot part between control points {graph.own[v]} and "
                    f"{graph.own[w]}: a .tsm file cannot hold it"
                )
                raise SurfaceError(message, control_points=(graph.own[v], graph.own[w]))
            if direction < 2 and w >= 0:
                links += [(v, direction), (w, direction + 2)]
    return links, {link: n for n, link in enumerate(links)}


def next_links(graph: Graph, links: list[tuple[int, int]], ids: dict[tuple[int, int], int]) -> list[int]:
    """The next half edge of each round its face: the one that turns left most."""
    following = []
    for v, direction in links:
        end = int(graph.neighbours[v, direction])
        turns = [
            (end, (direction + turn) % 4) for turn in (1, 0, -1) if graph.neighbours[end, (direction + turn) % 4] >= 0
        ]
        if not turns:
            raise SurfaceError(
                f"an edge ends at control point {graph.own[end]} inside a face: a .tsm file cannot hold it"
            )
        following.append(ids[turns[0]])
    return following
