"""Triangles within a chord tolerance of a surface.

The coarse mesh a tessellation starts from: rings round a closed surface, each with its own number of
vertices, zipped.

Counts come from the normal curvature: an arc of parameter length d sags by |n.S_ss| d^2 / 8.

The coarse mesh the tessellation of an open surface starts from: its Bezier elements, conforming across T-junctions.

The corners of all elements are vertices; an element takes those that lie on its sides. A side t = const on which the
surface is one point (a pole) is one vertex.

Triangles within a measured chord tolerance of a surface, closed or open.

A coarse conforming mesh of the parameter domain (surface.rings, patch_mesh) is refined by splitting edges: an
edge is split where the surface at its quarter points is farther from the chord than the tolerance, and all
edges of a triangle where the surface at its centroid is, or where the triangle faces against the surface.
What is split depends on the edge alone, so the mesh stays watertight across elements, T-junctions, seam and
poles. The distances are measured on the final mesh, not estimated.

One parameter mesh for several surfaces over the same T-mesh, fine enough for each of them.

The mesh of `surface.tessellate` for the first surface is refined where the second one needs it, and so on:
every edge and face is measured on every surface, so that all their tessellations lie within the chord
tolerance and correspond vertex by vertex.

Whether a closed surface bounds a body: levels can be made round no other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, Int32
from numpy import ndarray

from bonecam.errors import SurfaceError, place_name
from bonecam.kernels import triangles
from bonecam.mesh.solids import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tmesh import RowTMesh, Surface

SAG = 4.0
"""Share of the 8 in |n.S_ss| d^2 / 8: the diagonal of a cell sags by the sum of both directions."""

AROUND = 48
"""Samples of a ring from which its count is estimated."""

FEWEST = 16
"""Vertices of a ring: between fewer, what is straight in (s, t) bends so far round a pole that small faces
turn over."""

ASPECT = 3.0
"""Longest edges along a ring against the distance of the rings."""

TYPICAL = 0.75
"""This quantile of the sag sets the counts; sharper spots are split later."""


def ring_mesh(
    surface: Surface, chord_tolerance: float
) -> tuple[Float[ndarray, "n 2"], Bool[ndarray, " n"], Int[ndarray, "m 3"]]:
    """Parameters of the vertices, which of them are poles, and faces counter-clockwise from outside."""
    # t of each ring, poles included, and its number of vertices (a pole: 1).
    breaks = np.unique(surface.elements().boxes[:, 2:])
    middle = (breaks[:-1] + breaks[1:]) / 2
    sag = _sag(surface, middle, 5)
    counts = np.maximum(1, np.ceil(np.diff(breaks) * np.sqrt(sag / (SAG * chord_tolerance)))).astype(int)
    t = np.concatenate(
        [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(breaks[:-1], breaks[1:], counts)] + [breaks[-1:]]
    )
    around = np.ceil(np.sqrt(_sag(surface, t, 3) / (SAG * chord_tolerance)))
    s = np.arange(AROUND) / AROUND
    points = surface.positions(np.tile(s, len(t)), np.repeat(t, AROUND)).reshape(len(t), AROUND, 3)
    length = np.linalg.norm(points - np.roll(points, -1, axis=1), axis=2).sum(axis=1)
    gap = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1)
    if not gap.min() > 0:
        place = t[np.argmin(gap)]
        raise SurfaceError(
            f"the rows near t = {place:.4f} lie on one point: move their control points apart", place=place
        )
    gap = np.maximum(np.concatenate([gap[:1], gap]), np.concatenate([gap, gap[-1:]]))
    ring = np.maximum(FEWEST, np.maximum(around, np.ceil(length / (ASPECT * gap)))).astype(int)
    for end, pole in zip((0, -1), surface.tmesh.poles):
        if pole:
            ring[end] = 1
    counts = ring.tolist()
    starts = np.concatenate([[0], np.cumsum(counts)]).tolist()
    parameters = np.vstack([np.column_stack([np.arange(n) / n, np.full(n, x)]) for n, x in zip(counts, t)])
    faces = [_zip(starts[k], counts[k], starts[k + 1], counts[k + 1]) for k in range(len(t) - 1)]
    poles = np.concatenate([np.full(n, n == 1) for n in counts])
    return parameters, poles, np.vstack(faces)


def _sag(surface: Surface, t: ndarray, which: int) -> ndarray:
    """A typical |n.S_ss| (which = 3) or |n.S_tt| (5) on each line t = const."""
    inside = np.clip(t, *(surface.domain[1] + np.array([1e-6, -1e-6]) * np.ptp(surface.domain[1])))
    s = np.tile(np.arange(AROUND) / AROUND, len(t))
    along = np.repeat(inside, AROUND)
    derivatives = surface.derivatives(s, along, 2)
    normals = np.cross(derivatives[1], derivatives[2])
    length = np.linalg.norm(normals, axis=1)
    second = np.abs(np.einsum("ni,ni->n", normals, derivatives[which])) / np.where(length > 0, length, 1.0)
    return np.quantile(second.reshape(len(t), AROUND), TYPICAL, axis=1)


def _zip(lower: int, m: int, upper: int, n: int) -> ndarray:
    """Triangles between two rings of m and n even vertices that start at ids lower and upper; 1 is a pole."""
    if m == 1:
        return np.column_stack([np.full(n, lower), upper + (np.arange(n) + 1) % n, upper + np.arange(n)])
    if n == 1:
        return np.column_stack([lower + np.arange(m), lower + (np.arange(m) + 1) % m, np.full(m, upper)])
    step = np.concatenate([(np.arange(m) + 0.5) / m, (np.arange(n) + 0.5) / n])
    is_lower = np.concatenate([np.ones(m, dtype=bool), np.zeros(n, dtype=bool)])[np.argsort(step, kind="stable")]
    i, j = np.cumsum(is_lower) - is_lower, np.cumsum(~is_lower) - ~is_lower
    third = np.where(is_lower, lower + (i + 1) % m, upper + (j + 1) % n)
    return np.column_stack([lower + i % m, third, upper + j % n])


ONE_POINT = 1e-12
"""Share of the size: points nearer to each other are one."""


def corners_of(boxes: Float[ndarray, "e 4"]) -> Float[ndarray, "k 2"]:
    """The four corners (s, t) of each box, counter-clockwise."""
    return boxes[:, [0, 2, 1, 2, 1, 3, 0, 3]].reshape(-1, 2)


def patch_mesh(
    surface: Surface, boxes: Float[ndarray, "e 4"], corners: Float[ndarray, "k 2"]
) -> tuple[Float[ndarray, "n 2"], Bool[ndarray, " n"], Int[ndarray, "m 3"]]:
    """Parameters of the vertices, which of them are poles, and faces counter-clockwise in (s, t), of boxes that fill
    the domain; their corners have the parameters that the vertices get."""
    parameters, vertex = np.unique(corners, axis=0, return_inverse=True)
    faces, centres = _triangles(boxes, parameters, vertex.reshape(-1, 4))
    parameters = np.vstack([parameters, centres])
    # The vertices of a side t = const on which the surface is one point made one, faces that vanish with it left out.
    poles = np.zeros(len(parameters), dtype=bool)
    target = np.arange(len(parameters))
    size = float(np.ptp(surface.control_points, axis=0).max())
    for level in surface.domain[1] if not surface.elements().period[1] else ():
        here = np.flatnonzero(parameters[:, 1] == level)
        points = surface.positions(*parameters[here].T)
        if len(here) > 1 and np.ptp(points, axis=0).max() <= ONE_POINT * size:
            target[here] = here[0]
            poles[here[0]] = True
    faces = target[faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, index = np.unique(faces, return_inverse=True)
    return parameters[used], poles[used], index.reshape(-1, 3)


def _triangles(boxes: ndarray, parameters: ndarray, vertex: ndarray) -> tuple[ndarray, ndarray]:
    """Two triangles for an element without further vertices on its sides, else a fan round its centre."""
    on_line: list[dict[float, ndarray]] = []
    for axis in (0, 1):
        order = np.lexsort((parameters[:, 1 - axis], parameters[:, axis]))
        values, starts = np.unique(parameters[order, axis], return_index=True)
        on_line.append(dict(zip(values.tolist(), np.split(order, starts[1:]))))
    faces: list[tuple[int, int, int]] = []
    centres: list[tuple[float, float]] = []
    for box, corner in zip(boxes, vertex.tolist()):
        loop: list[int] = []
        for side, axis in enumerate((1, 0, 1, 0)):  # bottom, right, top, left
            start = box[2 * (1 - axis)]
            end = box[2 * (1 - axis) + 1]
            level = float(parameters[corner[(0, 1, 2, 0)[side]], axis])
            here = on_line[axis][level]
            along = parameters[here, 1 - axis]
            between = here[(along > start) & (along < end)].tolist()
            loop += [corner[side], *(between if side < 2 else between[::-1])]
        if len(loop) == 4:
            faces += [(loop[0], loop[1], loop[2]), (loop[0], loop[2], loop[3])]
        else:
            centre = len(parameters) + len(centres)
            centres.append(((box[0] + box[1]) / 2, (box[2] + box[3]) / 2))
            faces += [(loop[k], loop[(k + 1) % len(loop)], centre) for k in range(len(loop))]
    return np.array(faces, dtype=np.int64), np.array(centres, dtype=np.float64).reshape(-1, 2)


MOST_VERTICES = 4_000_000
"""A surface is never given more: 120 s of computing."""

ROUNDS = 100
"""Rounds of splitting at most: where the split of a face asks for that of the next one, splits wander along a row, a
face a round (41 rounds within 0.002 mm of a talus)."""

MARGIN = 0.9
"""Share of the tolerance is kept at the measured places: between them the surface may lie a little farther
off."""

QUARTERS = np.array([[0.75, 0.25], [0.5, 0.5], [0.25, 0.75]])
CENTRE = np.full((1, 3), 1 / 3)


@dataclass(frozen=True, eq=False)
class Tessellation:
    """A mesh, the (s, t) of each vertex (s of a pole is 0) and the largest measured chord error in mm."""

    mesh: TriangleMesh
    parameters: Float[ndarray, "n 2"]
    deviation: float


@dataclass(eq=False)
class _Draft:
    """The mesh in the making; `fresh` faces are still to be measured."""

    surface: Surface
    parameters: Float[ndarray, "n 2"]
    poles: Bool[ndarray, " n"]
    points: Float[ndarray, "n 3"]
    faces: Int[ndarray, "m 3"]
    fresh: Bool[ndarray, " m"]
    deviation: float = 0.0

    def between(self, corners: Int[ndarray, "n c"], shares: Float[ndarray, "k c"]) -> tuple[ndarray, ndarray]:
        """s and t at barycentric shares of vertices, round a closed direction the short way."""
        (s_low, _), (t_low, _) = self.surface.domain
        parameters = triangles.interpolate_parameters(
            self.parameters,
            self.poles,
            corners=corners,
            shares=shares,
            origin=(s_low, t_low),
            period=self.surface.elements().period,
        )
        return parameters[0], parameters[1]


def tessellate(
    surface: Surface, chord_tolerance: float, angle_tolerance: float | None = None, most_vertices: int = MOST_VERTICES
) -> Tessellation:
    """Triangles within `chord_tolerance` (mm) of the surface; with `angle_tolerance` (rad) the normals along
    an edge, too.

    The mesh is outward where the surface is closed, else on the side of S_s x S_t; it is closed where the
    surface is. Edges shorter than the chord tolerance are not split for their angle. Raises SurfaceError
    where the tolerance cannot be reached with `most_vertices` or a triangle has no area.
    """
    if not chord_tolerance > 0 or (angle_tolerance is not None and not angle_tolerance > 0):
        raise ValueError(f"tolerances must be positive, not {chord_tolerance} and {angle_tolerance}")
    own = getattr(surface.tmesh, "tessellate", None)
    if own is not None:
        return own(surface, chord_tolerance, angle_tolerance, most_vertices)
    if isinstance(surface.tmesh, RowTMesh):
        start = ring_mesh(surface, chord_tolerance)
    else:
        boxes = surface.elements().boxes
        start = patch_mesh(surface, boxes, corners_of(boxes))
    return split_to_tolerance(surface, start, chord_tolerance, angle_tolerance, most_vertices)


def split_to_tolerance(
    surface: Surface,
    start: tuple[Float[ndarray, "n 2"], Bool[ndarray, " n"], Int[ndarray, "m 3"]],
    chord_tolerance: float,
    angle_tolerance: float | None,
    most_vertices: int,
) -> Tessellation:
    """The mesh of parameters, poles and faces that `start` has, its edges split until it is as `tessellate` says."""
    parameters, poles, faces = start
    points = surface.positions(*parameters.T)
    draft = _Draft(surface, parameters, poles=poles, points=points, faces=faces, fresh=np.ones(len(faces), dtype=bool))
    for _ in range(ROUNDS):
        edges, edge_of_face = _edges(draft.faces)
        marked = _edges_to_split(draft, edges, edge_of_face, MARGIN * chord_tolerance, angle_tolerance)
        if not marked.any():
            mesh = checked_mesh(draft.parameters, draft.points, draft.faces)
            return Tessellation(mesh, draft.parameters, draft.deviation)
        if len(draft.points) + int(marked.sum()) > most_vertices:
            break
        _split_edges(draft, edges, edge_of_face, marked)
    place = draft.parameters[edges[np.argmax(marked), 0]]
    raise SurfaceError(
        f"the surface cannot be tessellated to {chord_tolerance} mm with {most_vertices:,} vertices, "
        f"in {ROUNDS} rounds, near (s, t) = ({place[0]:.4f}, {place[1]:.4f}): raise the tolerance",
        place=place,
    )


def _edges(faces: ndarray) -> tuple[ndarray, ndarray]:
    """Edges (e, 2), lower vertex first, and those of the sides 01, 12, 20 of each face (m, 3)."""
    following = faces[:, [1, 2, 0]]
    sides = np.minimum(faces, following).astype(np.int64) << 32 | np.maximum(faces, following)
    keys, edge_of_face = np.unique(sides, return_inverse=True)
    return np.column_stack([keys >> 32, keys & 0xFFFFFFFF]), edge_of_face.reshape(-1, 3)


def _edges_to_split(
    draft: _Draft, edges: ndarray, edge_of_face: ndarray, chord_tolerance: float, angle_tolerance: float | None
) -> ndarray:
    """Which edges must be split, by the fresh faces and their edges. What passes is measured into
    draft.deviation."""
    marked = np.zeros(len(edges), dtype=bool)
    marked[edge_of_face[draft.fresh].ravel()] = True
    fresh = np.flatnonzero(marked)
    points = draft.surface.positions(*draft.between(edges[fresh], QUARTERS)).reshape(-1, 3, 3)
    along = triangles.segment_distances(points, draft.points, edges[fresh])
    marked[fresh] = along > chord_tolerance
    if angle_tolerance is not None:
        a, b = (draft.surface.normals(*draft.parameters[edges[fresh, k]].T) for k in (0, 1))
        bent = np.einsum("ni,ni->n", a, b) < np.cos(angle_tolerance)
        marked[fresh] |= bent & (_lengths(draft.points, edges[fresh]) > chord_tolerance)
    faces = draft.faces[draft.fresh]
    sides = edge_of_face[draft.fresh]
    s, t = draft.between(faces, CENTRE)
    centre, S_s, S_t = draft.surface.derivatives(s, t, 1)
    inside = triangles.triangle_distances(centre, draft.points, faces)
    normals = np.cross(S_s, S_t)
    height = np.einsum("ni,ni->n", normals, draft.points[faces].mean(axis=1) - centre)
    inside = np.maximum(inside, np.abs(height) / np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny))
    length = _lengths(draft.points, edges)[sides]
    a, b, c = (draft.points[faces[:, k]] for k in range(3))
    against = np.einsum("ni,ni->n", np.cross(b - a, c - a), normals) <= 0
    wrong = (inside > chord_tolerance) | (against & (length.max(axis=1) > 4 * chord_tolerance))
    marked[sides[np.arange(len(sides)), np.argmax(length, axis=1)][wrong]] = True
    passed = np.concatenate([along[along <= chord_tolerance], inside[inside <= chord_tolerance]])
    draft.deviation = max(draft.deviation, float(passed.max(initial=0.0)))
    return marked


def _split_edges(draft: _Draft, edges: ndarray, edge_of_face: ndarray, marked: ndarray) -> None:
    """Put a vertex on each of the edges, and on the longest edge of every face they cut (Rivara 1984), and
    cut the faces.

    So no face gets thinner and thinner: where one edge of a face is split, its longest one is.
    """
    longest = np.argmax(_lengths(draft.points, edges)[edge_of_face], axis=1)
    triangles.mark_longest(marked, edge_of_face, edge_of_face[np.arange(len(longest)), longest])
    middle = np.full(len(edges), -1)
    middle[marked] = len(draft.points) + np.arange(int(marked.sum()))
    s, t = draft.between(edges[marked], QUARTERS[1:2])
    draft.parameters = np.vstack([draft.parameters, np.column_stack([s, t])])
    draft.poles = np.concatenate([draft.poles, np.zeros(len(s), dtype=bool)])
    draft.points = np.vstack([draft.points, draft.surface.positions(s, t)])
    middle = middle[edge_of_face]
    touched = (middle >= 0).any(axis=1)
    new = _cut_faces(draft.points, draft.faces[touched], middle[touched])
    draft.faces = np.vstack([draft.faces[~touched], new])
    draft.fresh = np.concatenate([np.zeros(int((~touched).sum()), dtype=bool), np.ones(len(new), dtype=bool)])


def _lengths(points: ndarray, edges: ndarray) -> ndarray:
    return np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)


def _cut_faces(points: ndarray, faces: ndarray, middle: ndarray) -> ndarray:
    """Faces with a vertex in the middle of one, two or three sides (-1: none) into two, three or four.

    Two cuts start from the middle of the longer side.
    """
    marked = middle >= 0
    count = marked.sum(axis=1)
    turn = np.where(count == 1, np.argmax(marked, axis=1), np.where(count == 2, (np.argmin(marked, axis=1) + 1) % 3, 0))
    order = (turn[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, order, axis=1).T
    m, n, o = np.take_along_axis(middle, order, axis=1).T
    shorter = np.linalg.norm(points[a] - points[b], axis=1) <= np.linalg.norm(points[b] - points[c], axis=1)
    two = count == 2
    pieces = [
        (count == 1, (a, m, c)), (count == 1, (m, b, c)),
        (two, (m, b, n)), (two & shorter, (a, m, n)), (two & shorter, (a, n, c)),
        (two & ~shorter, (a, m, c)), (two & ~shorter, (m, n, c)),
        (count == 3, (a, m, o)), (count == 3, (m, b, n)), (count == 3, (o, n, c)), (count == 3, (m, n, o)),
    ]  # fmt: skip
    return np.vstack([np.column_stack(corners)[which] for which, corners in pieces])


def checked_mesh(
    parameters: Float[ndarray, "n 2"], points: Float[ndarray, "n 3"], faces: Int[ndarray, "m 3"]
) -> TriangleMesh:
    """The mesh. Raises SurfaceError where a face has no area."""
    mesh = TriangleMesh(points, faces.astype(np.int32))
    area = np.linalg.norm(mesh.face_vectors, axis=1)
    if not area.min() > 0:
        place = parameters[mesh.faces[int(np.argmin(area))][0]]
        raise SurfaceError(
            f"control points coincide near (s, t) = ({place[0]:.4f}, {place[1]:.4f}): move them apart", place=place
        )
    return mesh


def shared_parameters(
    surfaces: Sequence[Surface], chord_tolerance: float
) -> tuple[Float[ndarray, "n 2"], Int32[ndarray, "m 3"]]:
    """(s, t) of the vertices (a pole's s is 0) and the faces; raises SurfaceError where the tolerance cannot
    be reached."""
    parameters, poles, faces = ring_mesh(surfaces[0], chord_tolerance)
    for surface in surfaces:
        points = surface.positions(*parameters.T)
        draft = _Draft(surface, parameters, poles, points=points, faces=faces, fresh=np.ones(len(faces), dtype=bool))
        for _ in range(ROUNDS):
            edges, edge_of_face = _edges(draft.faces)
            marked = _edges_to_split(draft, edges, edge_of_face, MARGIN * chord_tolerance, None)
            if not marked.any():
                break
            _split_edges(draft, edges, edge_of_face, marked)
        else:
            raise SurfaceError(
                f"the surfaces cannot be tessellated together to {chord_tolerance} mm: raise the tolerance"
            )
        parameters, poles, faces = draft.parameters, draft.poles, draft.faces
    return parameters, faces.astype(np.int32)


def require_valid(surface: Surface, chord_tolerance: float, name: str) -> TriangleMesh:
    """The tessellation within `chord_tolerance` mm; SurfaceError where the closed surface cuts itself or its
    normals point inwards."""
    mesh = tessellate(surface, chord_tolerance).mesh
    what = f"{name}: the surface of {surface.tmesh.size} control points"
    cut = self_intersections(mesh)
    if len(cut):
        place = mesh.vertices[mesh.faces[cut]].mean(axis=1)[0]
        remedy = "raise surface.max_control_points, or smooth the mesh or fill the cleft there"
        raise SurfaceError(
            f"{what} cuts itself in {len(cut)} faces, first near {place_name(place)}: {remedy}", faces=cut, place=place
        )
    if mesh.volume <= 0:
        raise SurfaceError(
            f"{what} is turned inside out, its normals point inwards: reverse its s parameter or do not mirror it"
        )
    return mesh
