"""How the faces hang together: edges, neighbours, pieces, genus."""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Int
from numpy import ndarray

from bonecam.errors import MeshError
from bonecam.mesh.triangle_mesh import TriangleMesh


def edges_of(mesh: TriangleMesh) -> tuple[Int[ndarray, "e 2"], Int[ndarray, " e"]]:
    """The distinct edges (lower vertex first) and how many faces meet at each."""
    halves = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    return np.unique(np.sort(halves, axis=1), axis=0, return_counts=True)


def neighbours_of(mesh: TriangleMesh) -> Int[ndarray, "m 3"]:
    """For each face and corner k the face across the edge from corner k to k+1; MeshError where the mesh is
    not closed and manifold."""
    count = len(mesh.vertices)
    start, end = mesh.faces.astype(np.int64), np.roll(mesh.faces, -1, axis=1).astype(np.int64)
    there, back = (start * count + end).ravel(), (end * count + start).ravel()
    order = np.argsort(there, kind="stable")
    place = np.minimum(np.searchsorted(there[order], back), len(order) - 1)
    if len(np.unique(there)) != len(there) or (there[order][place] != back).any():
        raise MeshError("the mesh is not closed and consistently oriented: repair it first")
    return (order[place] // 3).reshape(-1, 3)


def pieces_of(mesh: TriangleMesh) -> Int[ndarray, " m"]:
    """The number of the connected piece each face belongs to: faces that share a vertex hang together."""
    count = len(mesh.vertices)
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    graph = sp.coo_array((np.ones(len(start)), (start, end)), shape=(count, count))
    _, labels = sp.csgraph.connected_components(graph, directed=False)
    return np.unique(labels[mesh.faces[:, 0]], return_inverse=True)[1]


def genus(mesh: TriangleMesh) -> int:
    """Number of handles of a closed, connected, manifold mesh (Euler: V - E + F = 2 - 2 g)."""
    edges, _ = edges_of(mesh)
    return int(2 - (len(np.unique(mesh.faces)) - len(edges) + len(mesh.faces))) // 2
