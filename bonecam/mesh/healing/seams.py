"""Seams: corners of neighbouring faces that are not one vertex, as in STL files, are merged where they are.

Only vertices on open edges are merged, within the smallest tolerance that leaves the fewest open edges, so that
what is closed stays apart however near it is.
"""

import numpy as np
from jaxtyping import Float, Int32, Int64
from numpy import ndarray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from bonecam.errors import counted
from bonecam.mesh.healing.repair_state import RepairState
from bonecam.mesh.healing.topology import edges_of
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces

TOLERANCES = (0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4)
"""Distances within which corners are merged, tried in this order, shares of the diagonal; the last is 3 um on a
phalanx, less than decimation may move."""
SHORTEST_EDGE_SHARE = 0.5
"""Largest tolerance as a share of the shortest edge."""
NO_EDGE = 1e-6
"""Edges up to this share of the diagonal are those of faces without area."""


def weld_seams(state: RepairState) -> RepairState:
    """The mesh with corners along open edges merged, where that leaves fewer of them; faces may then name a vertex
    twice. The sentence tells the largest distance."""
    mesh = state.mesh
    fewest = best = len(_open_edges(mesh))
    welded = mesh
    for tolerance in _tolerances(mesh) if fewest else ():
        candidate = _weld(mesh, tolerance)
        left = len(_open_edges(candidate))
        if left < best:
            best, welded = left, candidate
        if not left:
            break
    if best == fewest:
        return state
    merged = len(np.unique(mesh.faces)) - len(np.unique(welded.faces))
    distance = _largest_distance(mesh, welded)
    message = f"merged {counted(merged, 'duplicate vertex')} along open edges"
    after = keep_faces(welded)
    return state.moved(after, f"{message}, at most {distance:.2g} mm apart") if distance else state.then(after, message)


def _tolerances(mesh: TriangleMesh) -> list[float]:
    """The tolerances to try, mm, below the shortest edge."""
    edges, _ = edges_of(mesh)
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    limit = SHORTEST_EDGE_SHARE * lengths[lengths > NO_EDGE * mesh.diagonal].min(initial=np.inf)
    return [share * mesh.diagonal for share in TOLERANCES if share * mesh.diagonal <= limit]


def _weld(mesh: TriangleMesh, tolerance: float) -> TriangleMesh:
    """The mesh whose faces name, for each vertex on an open edge, the first that is near it."""
    rim = np.unique(_open_edges(mesh))
    first = np.arange(len(mesh.vertices))
    first[rim] = rim[nearest_groups(mesh.vertices[rim], tolerance)]
    return TriangleMesh(mesh.vertices, first[mesh.faces].astype(np.int32))


def _open_edges(mesh: TriangleMesh) -> Int32[ndarray, "e 2"]:
    edges, counts = edges_of(mesh)
    return edges[(counts == 1) & (edges[:, 0] != edges[:, 1])]


def _largest_distance(mesh: TriangleMesh, welded: TriangleMesh) -> float:
    moved: Float[ndarray, "m 3 3"] = mesh.vertices[mesh.faces] - mesh.vertices[welded.faces]
    return float(np.linalg.norm(moved, axis=2).max())


def nearest_groups(points: Float[ndarray, "n 3"], tolerance: float) -> Int64[ndarray, " n"]:
    """For each point the first point of its group; points within `tolerance` of each other are of one group."""
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    groups = connected_components(graph, directed=False)[1]
    _, first, index = np.unique(groups, return_index=True, return_inverse=True)
    return np.asarray(first[index], dtype=np.int64)
