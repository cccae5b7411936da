"""The text of a .tsm file (`#TS0200`) for a general T-spline; `surface.files.tsm.records` has the forms of
the records.

Control points with the same knots that touch are one vertex; the outermost is its own, the others become its
`cg` record. Walking the edges, always turning left, gives the loops: faces, and the outside. Comments keep
what half edges lose: all digits of the knots.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.files.rows_file import number_words
from bonecam.surface.files.tsm.half_edges import Graph, graph_of, links_of, next_links
from bonecam.surface.files.tsm.records import DIRECTIONS, TSM_HEADER
from bonecam.surface.tmesh.general import TMesh
from bonecam.surface.tspline import TSpline

AROUND = ((0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1))
"""Offsets (lines in s and t) of the control points round a vertex' own one, from the north,
counter-clockwise."""


def tsm_text(surface: TSpline[TMesh], homogeneous: bool = False) -> str:
    """The file's text. Raises SurfaceError for a T-mesh that half edges cannot hold (rows without edges
    across them)."""
    mesh = surface.tmesh
    graph = graph_of(mesh)
    links, ids = links_of(graph)
    loops = next_links(graph, links, ids)
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
        points = _homogeneous(points, surface.weights[:, None])
    lines += [f"0g {number_words((*p, w))}" for p, w in zip(points, surface.weights)]
    return "\n".join([*lines, "", "tol 1e-05", ""])


def _homogeneous(points: Float[ndarray, "n 3"], weights: Float[ndarray, "n 1"]) -> ndarray:
    """Homogeneous coordinates (n, 3): numbers that give `points` to the last bit when divided by `weights`.

    Raises SurfaceError where there are none."""
    homogeneous = points * weights
    for other in (np.nextafter(points * weights, -np.inf), np.nextafter(points * weights, np.inf)):
        homogeneous = np.where(homogeneous / weights == points, homogeneous, other)
    if not (homogeneous / weights == points).all():
        raise SurfaceError(
            f"control point {int(np.argmin((homogeneous / weights == points).all(axis=1)))} has no "
            "homogeneous form to the last bit"
        )
    return homogeneous


def _knot_comments(mesh: TMesh) -> list[str]:
    """The comments with the knots and the periods to all digits."""
    comments = []
    for letter, lines, period in (("s", mesh.s_lines, mesh.period[0]), ("t", mesh.t_lines, mesh.period[1])):
        knots = lines[np.concatenate([[True], np.diff(lines) > 0])]
        comments.append(f"#{letter}-knots {number_words(knots)}")
        if period:
            comments.append(f"#{letter}-period {period!r}")
    return comments


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
        v, direction = links[n]
        w = links[n + 1][0]
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
    records = ["0m odd-grip-map"] + [f"0m {'gvp' if n in own else 'gv'} {v}" for n, v in enumerate(graph.vertex_of)]
    for v in range(len(graph.own)):
        members = np.flatnonzero(graph.vertex_of == v)
        if len(members) > 1:
            member_at = {tuple(graph.offsets[n].tolist()): int(n) for n in members}
            sides = [any(o[axis] == sign for o in member_at) for axis, sign in ((1, 1), (0, -1), (1, -1), (0, 1))]
            wanted = [
                a
                for k, a in enumerate(AROUND)
                if (sides[k // 2] if k % 2 == 0 else sides[k // 2] and sides[(k // 2 + 1) % 4])
            ]
            extents = " ".join(str(int(side)) for side in sides)
            records.append(f"0m cg {v} 4 {extents} " + " ".join(str(member_at.get(a, -1)) for a in wanted))
    return records
