"""A general T-mesh as half edges: the `#TS0200` text that `read_tsm` and other programs read (record forms:
surface.tsm).

Control points with the same knots that touch are one vertex; the outermost is its own, the others become its
`cg` record. Walking the edges, always turning left, gives the loops: faces, and the outside. Comments keep
what half edges lose: all digits of the knots.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.files.tsm_records import DIRECTIONS, TSM_HEADER
from bonecam.surface.tmesh.general import TMesh
from bonecam.surface.tspline import TSpline

AROUND = (
    (0, 1),
    (-1, 1),
    (-1, 0),
    (-1, -1),
    (0, -1),
    (1, -1),
    (1, 0),
    (1, 1),
)  # from the north, counter-clockwise


@dataclass(eq=False)
class Graph:
    """Vertices of the file: own control point of each, members with offsets, and the vertex next to each in
    the four directions (-1)."""

    own: list[int]
    vertex_of: Int64[ndarray, " n"]
    offsets: Int64[ndarray, "n 2"]
    neighbours: Int64[ndarray, "v 4"]


def tsm_text(surface: TSpline[TMesh], homogeneous: bool = False) -> str:
    """The file's text. Raises SurfaceError for a T-mesh that half edges cannot hold (rows without edges
    across them)."""
    mesh = surface.tmesh
    graph = _graph(mesh)
    links, ids = _links(graph)
    loops = _loops(graph, links, ids)
    lines = [
        TSM_HEADER,
        "",
        "degree 3",
        "cap-type 1",
        "star-smoothness 0",
        "units 0.001 millimeters",
        "force-bezier-end-conditions 1",
    ]
    lines += [*_knot_comments(mesh), *_topology(mesh, graph, links, ids, loops), *_grips(graph)]
    points = surface.control_points
    if homogeneous:
        points = _products(points, surface.weights[:, None])
    lines += ["0g " + " ".join(repr(float(x)) for x in (*p, w)) for p, w in zip(points, surface.weights)]
    return "\n".join([*lines, "", "tol 1e-05", ""])


def _products(points: Float[ndarray, "n 3"], weights: Float[ndarray, "n 1"]) -> ndarray:
    """Numbers that give `points` when they are divided by `weights`, to the last bit."""
    found = points * weights
    for other in (np.nextafter(points * weights, -np.inf), np.nextafter(points * weights, np.inf)):
        found = np.where(found / weights == points, found, other)
    if not (found / weights == points).all():
        raise SurfaceError(
            f"control point {int(np.argmin((found / weights == points).all(axis=1)))} has no homogeneous form to the last bit"
        )
    return found


def _knot_comments(mesh: TMesh) -> list[str]:
    found = []
    for letter, lines, period in (("s", mesh.s_lines, mesh.period[0]), ("t", mesh.t_lines, mesh.period[1])):
        knots = lines[np.concatenate([[True], np.diff(lines) > 0])]
        found.append(f"#{letter}-knots " + " ".join(repr(float(k)) for k in knots))
        if period:
            found.append(f"#{letter}-period {period!r}")
    return found


def _graph(mesh: TMesh) -> Graph:
    """Control points that are joined by edges of no length, as vertices."""
    label = np.arange(mesh.size)
    steps = [_neighbours(mesh, direction) for direction in range(4)]
    s, t = mesh.s_lines[mesh.vertices[:, 0]], mesh.t_lines[mesh.vertices[:, 1]]
    joined = [np.where((n >= 0) & (s == s[n]) & (t == t[n]), n, -1) for n in steps]
    for _ in range(8):
        for other in joined:
            label = np.where(other >= 0, np.minimum(label, label[other]), label)
    kinds, vertex_of = np.unique(label, return_inverse=True)
    own, offsets = [], np.zeros((mesh.size, 2), dtype=np.int64)
    for v in range(len(kinds)):
        members = np.flatnonzero(vertex_of == v)
        own.append(_own(members, mesh, joined))
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
    """The control point next to each one along the edges of a direction, -1 where no edge starts."""
    grid, (i, j) = mesh.crossings, mesh.vertices.T
    axis, sign = direction % 2, 1 if direction < 2 else -1
    edges, count, closed = (mesh.along_s, mesh.along_t)[axis], grid.shape[axis], bool(mesh.period[axis])
    place, found, walking = [i.copy(), j.copy()], np.full(mesh.size, -1), np.ones(mesh.size, dtype=bool)
    for _ in range(count):
        piece = place[axis] if sign > 0 else place[axis] - 1
        possible = walking & (closed | ((piece >= 0) & (piece < edges.shape[axis])))
        at = [place[0], place[1]]
        at[axis] = np.where(possible, piece, 0) % edges.shape[axis]
        walking = possible & edges[at[0], at[1]]
        place[axis] = np.where(
            walking, (place[axis] + sign) % count if closed else place[axis] + sign, place[axis]
        )
        here = grid[place[0], place[1]]
        found = np.where(walking & (here >= 0), here, found)
        walking &= here < 0
    return found


def _own(members: ndarray, mesh: TMesh, joined: list[ndarray]) -> int:
    """The control point of a vertex that lies outermost; the middle one where three lines meet."""
    place = mesh.vertices[members]
    wanted = []
    for axis in (0, 1):
        lines = np.unique(place[:, axis])
        if len(lines) < 3:
            low, high = (members[place[:, axis] == line] for line in (lines[0], lines[-1]))
            wanted.append(
                lines[0] if _leaves(low, mesh, axis, -1) and not _leaves(high, mesh, axis, 1) else lines[-1]
            )
        else:
            wanted.append(lines[1])
    found = members[(place == wanted).all(axis=1)]
    if not len(found):
        raise SurfaceError(f"control point {members[0]} belongs to a corner that .tsm files have no form for")
    return int(found[0])


def _leaves(nodes: ndarray, mesh: TMesh, axis: int, sign: int) -> bool:
    """Whether the domain ends beside these control points."""
    place, shape = mesh.vertices[nodes], mesh.inside.shape
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


def _links(graph: Graph) -> tuple[list[tuple[int, int]], dict[tuple[int, int], int]]:
    """Half edges (vertex, direction), the two of an edge one after the other, and their numbers."""
    links = []
    for v, row in enumerate(graph.neighbours):
        for direction, w in enumerate(row.tolist()):
            if w >= 0 and graph.neighbours[w, (direction + 2) % 4] != v:
                message = f"lines with one knot part between control points {graph.own[v]} and {graph.own[w]}: a .tsm file cannot hold it"
                raise SurfaceError(message, control_points=(graph.own[v], graph.own[w]))
            if direction < 2 and w >= 0:
                links += [(v, direction), (w, direction + 2)]
    return links, {link: n for n, link in enumerate(links)}


def _loops(graph: Graph, links: list[tuple[int, int]], ids: dict[tuple[int, int], int]) -> list[int]:
    """The next link of each: the one that turns left most."""
    following = []
    for v, direction in links:
        end = int(graph.neighbours[v, direction])
        turns = [
            (end, (direction + turn) % 4)
            for turn in (1, 0, -1)
            if graph.neighbours[end, (direction + turn) % 4] >= 0
        ]
        if not turns:
            raise SurfaceError(
                f"an edge ends at control point {graph.own[end]} inside a face: a .tsm file cannot hold it"
            )
        following.append(ids[turns[0]])
    return following


def _topology(mesh: TMesh, graph: Graph, links: list, ids: dict, following: list[int]) -> list[str]:
    """The records f, e, v, l and ec."""
    previous = {n: k for k, n in enumerate(following)}
    flags = [1 - (links[n][1] - links[previous[n]][1] + 1) % 4 + 1 for n in range(len(links))]
    face = [-2] * len(links)
    faces: list[int] = []
    for n in sorted(range(len(links)), key=lambda n: (links[n][1] != 0, n)):
        if face[n] == -2:
            loop = [n]
            while following[loop[-1]] != n:
                loop.append(following[loop[-1]])
            number = len(faces) if _is_face(mesh, graph, links[n]) else -1
            if number >= 0 and sum(flags[k] == 0 for k in loop) != 4:
                raise SurfaceError(
                    "a face has no four corners (rows without edges across them): a .tsm file cannot hold it"
                )
            faces += [n] if number >= 0 else []
            for k in loop:
                face[k] = number
    knots = (mesh.s_lines, mesh.t_lines)
    records = [f"f {n} 0" for n in faces]
    for n in range(0, len(links), 2):
        (v, direction), w = links[n], links[n + 1][0]
        low, high = (knots[direction][mesh.vertices[graph.own[k], direction]] for k in (v, w))
        records.append(f"e {n} {float(high - low if high > low else high + mesh.period[direction] - low)!r}")
    for v, row in enumerate(graph.neighbours):
        direction = int(np.flatnonzero(row >= 0)[0])
        records.append(f"v {ids[v, direction]} {DIRECTIONS[direction]}")
    for n, (v, _) in enumerate(links):
        records.append(f"l {previous[n]} {following[n]} {n ^ 1} {v} {face[n]} {n // 2} {flags[n]}")
    return records + [f"ec {n // 2} 0" for n in range(0, len(links), 2) if -1 in (face[n], face[n + 1])]


def _is_face(mesh: TMesh, graph: Graph, link: tuple[int, int]) -> bool:
    """Whether the cell to the left of a link belongs to the domain."""
    i, j = mesh.vertices[graph.own[link[0]]]
    di, dj = ((0, 0), (-1, 0), (-1, -1), (0, -1))[link[1]]
    cell = (int(i + di), int(j + dj))
    for axis in (0, 1):
        if not mesh.period[axis] and not 0 <= cell[axis] < mesh.inside.shape[axis]:
            return False
    return bool(mesh.inside[cell[0] % mesh.inside.shape[0], cell[1] % mesh.inside.shape[1]])


def _grips(graph: Graph) -> list[str]:
    """The records 0m: which control point belongs to which vertex, and where."""
    own = set(graph.own)
    records = ["0m odd-grip-map"] + [
        f"0m {'gvp' if n in own else 'gv'} {v}" for n, v in enumerate(graph.vertex_of)
    ]
    for v in range(len(graph.own)):
        members = np.flatnonzero(graph.vertex_of == v)
        if len(members) > 1:
            places = {tuple(graph.offsets[n].tolist()): int(n) for n in members}
            sides = [
                any(o[axis] == sign for o in places) for axis, sign in ((1, 1), (0, -1), (1, -1), (0, 1))
            ]
            wanted = [
                a
                for k, a in enumerate(AROUND)
                if (sides[k // 2] if k % 2 == 0 else sides[k // 2] and sides[(k // 2 + 1) % 4])
            ]
            extents = " ".join(str(int(side)) for side in sides)
            records.append(f"0m cg {v} 4 {extents} " + " ".join(str(places.get(a, -1)) for a in wanted))
    return records
