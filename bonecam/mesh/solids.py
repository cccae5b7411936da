"""Meshes as solids: bodies of revolution, unions and differences, and where faces pass through each other.

Connectivity of a mesh: half-edges, edges, neighbours, pieces, genus.

The union of closed meshes as one closed mesh, and the difference of two, exact (Zhou et al. 2016).

Self-intersections, found exactly (CGAL's predicates through libigl; detection only).

The mesh of a body of revolution about the Z axis.
"""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int, Int64
from numpy import ndarray

from bonecam.errors import MeshError
from bonecam.mesh.triangle_mesh import TriangleMesh, side_by_side


def half_edges(mesh: TriangleMesh) -> Int[ndarray, "m 3 2"]:
    """The directed edges of each face: from its corner k to its corner k + 1."""
    return mesh.faces[:, [[0, 1], [1, 2], [2, 0]]]


def edges_of(mesh: TriangleMesh) -> tuple[Int[ndarray, "e 2"], Int[ndarray, " e"]]:
    """The distinct edges (lower vertex first) and how many faces meet at each."""
    names, counts = np.unique(edge_names(half_edges(mesh), len(mesh.vertices)), return_counts=True)
    return np.column_stack(np.divmod(names, len(mesh.vertices))).astype(mesh.faces.dtype), counts


def edge_names(edges: Int[ndarray, "*n 2"], count: int) -> Int64[ndarray, "*n"]:
    """A number for each edge between two of `count` vertices, the same both ways along it."""
    return np.asarray(np.sort(edges, axis=-1).astype(np.int64) @ [count, 1])


def neighbours_of(mesh: TriangleMesh) -> Int[ndarray, "m 3"]:
    """For each face and corner k the face across the edge from corner k to k+1; MeshError where the mesh is
    not closed and manifold."""
    count = len(mesh.vertices)
    start, end = half_edges(mesh).astype(np.int64).reshape(-1, 2).T
    forward = start * count + end
    backward = end * count + start
    order = np.argsort(forward, kind="stable")
    place = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    if len(np.unique(forward)) != len(forward) or (forward[order][place] != backward).any():
        raise MeshError("the mesh is not closed and consistently oriented: repair it first")
    return (order[place] // 3).reshape(-1, 3)


def neighbour_middles(mesh: TriangleMesh) -> Float[ndarray, "v 3"]:
    """The mean of the neighbours of each vertex of a closed mesh, whose faces run along each edge once each way; mm."""
    start, end = half_edges(mesh).reshape(-1, 2).T
    total = np.zeros_like(mesh.vertices)
    np.add.at(total, start, mesh.vertices[end])
    return np.asarray(total / np.maximum(np.bincount(start, minlength=len(total)), 1)[:, None])


def pieces_of(mesh: TriangleMesh) -> Int[ndarray, " m"]:
    """The number of the connected piece each face belongs to: faces that share a vertex are of one piece."""
    count = len(mesh.vertices)
    start, end = half_edges(mesh).reshape(-1, 2).T
    graph = sp.coo_array((np.ones(len(start)), (start, end)), shape=(count, count))
    _, labels = sp.csgraph.connected_components(graph, directed=False)
    return np.unique(labels[mesh.faces[:, 0]], return_inverse=True)[1]


def genus(mesh: TriangleMesh) -> int:
    """Number of handles of a closed, connected, manifold mesh (Euler: V - E + F = 2 - 2 g)."""
    edges, _ = edges_of(mesh)
    return int(2 - (len(np.unique(mesh.faces)) - len(edges) + len(mesh.faces))) // 2


def repeats_corner(faces: Int[ndarray, "m 3"]) -> Bool[ndarray, " m"]:
    """Which faces name a vertex twice."""
    a, b, c = faces.T
    return np.asarray((a == b) | (b == c) | (c == a))


def solid_union(meshes: Sequence[TriangleMesh], names: Sequence[str] = ()) -> TriangleMesh:
    """The boundary of everything that lies in one of the closed, outward meshes; it may have several pieces.

    MeshError, with the name of the mesh (`names`, or its number), where one is not closed or encloses no volume.
    """
    called = names or [f"solid {number}" for number in range(len(meshes))]
    for mesh, name in zip(meshes, called, strict=True):
        _require_solid(mesh, name)
    both = side_by_side(meshes)
    return _boolean("union", both.vertices, both.faces.astype(np.int64))


def solid_difference(one: TriangleMesh, other: TriangleMesh) -> TriangleMesh:
    """The boundary of what lies in the first closed mesh and not in the second; MeshError as in `solid_union`."""
    return _boolean("minus", *_arrays(one, "the first solid"), *_arrays(other, "the second solid"))


def solid_intersection(one: TriangleMesh, other: TriangleMesh) -> TriangleMesh:
    """The boundary of what lies in both closed meshes, without faces where there is nothing; MeshError as in
    `solid_union`."""
    return _boolean("intersect", *_arrays(one, "the first solid"), *_arrays(other, "the second solid"))


def _arrays(mesh: TriangleMesh, name: str) -> tuple[ndarray, ndarray]:
    """Vertices and faces of a closed mesh, as libigl takes them; MeshError as in `solid_union`."""
    _require_solid(mesh, name)
    return mesh.vertices, mesh.faces.astype(np.int64)


def _boolean(name: str, *arrays: ndarray) -> TriangleMesh:
    """The result of one of libigl's operations on meshes."""
    import igl.copyleft.cgal as cgal

    try:
        points, corners, _ = cgal.mesh_boolean(*arrays, type_str=name)
    except RuntimeError as error:
        raise MeshError(f"the solids cannot be combined ({error}): repair them first") from error
    return TriangleMesh(points, np.asarray(corners, dtype=np.int32))


def _require_solid(mesh: TriangleMesh, name: str) -> None:
    """MeshError where a mesh is open or faces inward."""
    edges, counts = edges_of(mesh)
    if not len(mesh.faces) or (counts % 2).any():
        open_at = mesh.vertices[edges[np.argmax(counts % 2)]].mean(axis=0) if len(mesh.faces) else np.zeros(3)
        place = ", ".join(f"{x:.2f}" for x in open_at)
        raise MeshError(
            f"{name} is not closed near ({place}): close it, as the filter meshing_close_holes does",
            name=name,
            place=open_at,
        )
    if not mesh.volume > 0:
        raise MeshError(f"{name} encloses {mesh.volume:.3g} mm^3: turn its faces outward", name=name)


def self_intersections(mesh: TriangleMesh) -> Int[ndarray, " k"]:
    """The faces that cut another face of the same mesh (touching along shared edges and corners is none), in
    rising order."""
    import igl.copyleft.cgal as cgal

    if not len(mesh.faces):
        return np.empty(0, dtype=np.int64)
    crossings = cgal.remesh_self_intersections(np.array(mesh.vertices), mesh.faces.astype(np.int64), detect_only=True)
    return np.unique(np.asarray(crossings[2], dtype=np.int64).ravel())


def segments_around(radius: float, chord_tolerance: float) -> int:
    """How many segments keep a circle's polygon within half the chord tolerance (mm) of it; 12 at least."""
    return max(12, int(np.ceil(np.pi / half_angle(radius, chord_tolerance))))


def half_angle(radius: float, chord_tolerance: float) -> float:
    """Half the angle (radians) of an arc whose chord is half the chord tolerance (mm) from it."""
    return float(np.arccos(max(1 - chord_tolerance / (2 * radius), 0.0)))


def revolve(
    radii: Float[ndarray, " r"], heights: Float[ndarray, " r"], ends: tuple[float, float], around: int
) -> TriangleMesh:
    """The closed outward mesh of rings of `around` vertices about the Z axis and a pole at either end.

    `radii` and `heights` (rising) are those of the rings, `ends` the heights of the poles; mm.
    """
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(around)])
    points = radii[:, None, None] * ring + heights[:, None, None] * np.array([0.0, 0.0, 1.0])
    poles = np.array([[0, 0, end] for end in ends])
    return TriangleMesh(np.vstack([points.reshape(-1, 3), poles]), ring_faces(len(radii), around))


def cylinder(radius: float, bottom: float, top: float, chord_tolerance: float) -> TriangleMesh:
    """A closed outward cylinder about the Z axis, its vertices on the surface, its faces within `chord_tolerance` of it
    and of nearly one size; mm."""
    around = segments_around(radius, chord_tolerance)
    step = 2 * np.pi * radius / around
    disc = np.linspace(0, radius, max(2, int(np.ceil(radius / step))) + 1)[1:]
    rises = np.linspace(bottom, top, max(2, int(np.ceil((top - bottom) / step))) + 1)
    radii = np.concatenate([disc, np.full(len(rises) - 2, radius), disc[::-1]])
    heights = np.concatenate([np.full(len(disc), bottom), rises[1:-1], np.full(len(disc), top)])
    return revolve(radii, heights, (bottom, top), around)


def prism(outline: Float[ndarray, "n 2"], bottom: float, top: float) -> TriangleMesh:
    """The closed outward upright prism over a convex `outline`, counter-clockwise seen from above, mm."""
    count = len(outline)
    points = np.vstack([np.column_stack([outline, np.full(count, height)]) for height in (bottom, top)])
    index = np.arange(count)
    fan = np.column_stack([np.zeros(count - 2, dtype=np.int64), index[1:-1], index[2:]])
    sides = band_faces(index[None], index[None] + count)
    return TriangleMesh(points, np.vstack([fan[:, ::-1], fan + count, sides]).astype(np.int32))


def band_faces(lower: ndarray, upper: ndarray) -> ndarray:
    """Triangles (m, 3) between rings of vertices (r, around) and the rings above them."""
    a, b = lower.ravel(), np.roll(lower, -1, axis=1).ravel()
    c, d = np.roll(upper, -1, axis=1).ravel(), upper.ravel()
    return np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def ring_faces(rings: int, around: int) -> ndarray:
    """Triangles (m, 3) between neighbouring rings and to the poles, whose vertices follow those of the rings."""
    index = np.arange(rings * around).reshape(rings, around)
    turned = np.roll(index, -1, axis=1)
    lower_pole = np.full(around, rings * around)
    upper_pole = lower_pole + 1
    bottom = np.column_stack([lower_pole, turned[0], index[0]])
    top = np.column_stack([upper_pole, index[-1], turned[-1]])
    faces = np.vstack([band_faces(index[:-1], index[1:]), bottom, top])
    return faces.astype(np.int32)
