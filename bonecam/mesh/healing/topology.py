"""Connectivity of a mesh: half-edges, edges, neighbours, pieces, genus."""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int, Int64
from numpy import ndarray

from bonecam.errors import MeshError
from bonecam.mesh.triangle_mesh import TriangleMesh


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
