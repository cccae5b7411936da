"""Triangles within a measured chord tolerance of a surface, closed or open.

A coarse conforming mesh of the parameter domain (surface.rings, patch_mesh) is refined by splitting edges: an
edge is split where the surface at its quarter points is farther from the chord than the tolerance, and all
edges of a triangle where the surface at its centroid is, or where the triangle faces against the surface.
What is split depends on the edge alone, so the mesh stays watertight across elements, T-junctions, seam and
poles. The distances are measured on the final mesh, not estimated.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.kernels import triangles
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tessellation.elements import MOST_VERTICES, element_mesh
from bonecam.surface.tessellation.patches import patch_mesh
from bonecam.surface.tessellation.rings import ring_mesh
from bonecam.surface.tmesh.extracted import ExtractedTMesh
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tmesh.surface import Surface

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
    if isinstance(surface.tmesh, ExtractedTMesh):
        parameters, points, faces, worst = element_mesh(
            surface, MARGIN * chord_tolerance, angle_tolerance, most_vertices
        )
        return Tessellation(_check_mesh(surface, parameters, points, faces), parameters, worst)
    rows = isinstance(surface.tmesh, RowTMesh)
    parameters, poles, faces = ring_mesh(surface, chord_tolerance) if rows else patch_mesh(surface)
    points = surface.positions(*parameters.T)
    draft = _Draft(surface, parameters, poles=poles, points=points, faces=faces, fresh=np.ones(len(faces), dtype=bool))
    for _ in range(ROUNDS):
        edges, edge_of_face = _edges(draft.faces)
        marked = _edges_to_split(draft, edges, edge_of_face, MARGIN * chord_tolerance, angle_tolerance)
        if not marked.any():
            mesh = _check_mesh(surface, draft.parameters, draft.points, draft.faces)
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
        marked[fresh] |= _too_bent(draft, edges[fresh], chord_tolerance, angle_tolerance)
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


def _too_bent(draft: _Draft, edges: ndarray, chord_tolerance: float, angle_tolerance: float) -> ndarray:
    a, b = (draft.surface.normals(*draft.parameters[edges[:, k]].T) for k in (0, 1))
    length = _lengths(draft.points, edges)
    return (np.einsum("ni,ni->n", a, b) < np.cos(angle_tolerance)) & (length > chord_tolerance)


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


def _check_mesh(surface: Surface, parameters: ndarray, points: ndarray, faces: ndarray) -> TriangleMesh:
    """The mesh. Raises SurfaceError where a face has no area."""
    mesh = TriangleMesh(points, faces.astype(np.int32))
    area = np.linalg.norm(mesh.face_vectors, axis=1)
    if not area.min() > 0:
        place = parameters[mesh.faces[int(np.argmin(area))][0]]
        raise SurfaceError(
            f"control points coincide near (s, t) = ({place[0]:.4f}, {place[1]:.4f}): move them apart", place=place
        )
    inward = not isinstance(surface.tmesh, RowTMesh) and _closed(mesh.faces) and mesh.volume < 0
    return TriangleMesh(mesh.vertices, mesh.faces[:, ::-1]) if inward else mesh


def _closed(faces: ndarray) -> bool:
    """Whether every edge has a face on both sides."""
    following = faces[:, [1, 2, 0]].astype(np.int64)
    there = faces.astype(np.int64) << 32 | following
    back = following << 32 | faces
    return np.array_equal(np.sort(there, axis=None), np.sort(back, axis=None))
