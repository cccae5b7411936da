"""The door to pymeshlab: MeshLab's module, and triangle meshes into and out of its mesh sets.

Remeshing by MeshLab: even triangles of one edge length (Hoppe et al.'s split, collapse, flip, smooth,
reproject), or shorter edges.

And by Rivara's bisection, where only chosen faces are too large.
"""

from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import angles_between, unit
from bonecam.errors import FileError
from bonecam.mesh.solids import half_edges
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.runtime.loading import loaded_once


@loaded_once
def meshlab() -> Any:
    """The pymeshlab module; FileError names the system packages to install where its plugins are missing."""
    try:
        import pymeshlab
    except ImportError as error:
        raise FileError(
            f"pymeshlab cannot be loaded ({error}): install the system packages libgl1 and libopengl0"
        ) from error
    if "meshing_isotropic_explicit_remeshing" not in pymeshlab.filter_list():
        count = pymeshlab.plugin_number()
        raise FileError(
            f"pymeshlab loaded only {count} plugins: install the system packages libgl1 and libopengl0", plugins=count
        )
    return pymeshlab


def to_meshset(mesh: TriangleMesh) -> Any:
    """A pymeshlab.MeshSet with `mesh` as its one layer."""
    meshset = meshlab().MeshSet()
    meshset.add_mesh(meshlab().Mesh(mesh.vertices, mesh.faces))
    return meshset


def from_meshset(meshset: Any) -> TriangleMesh:
    """The current layer of a pymeshlab.MeshSet; ValueError where a face names a vertex that is not there."""
    layer = meshset.current_mesh()
    return TriangleMesh(layer.vertex_matrix(), layer.face_matrix())


def quality_colours(largest: float) -> dict[str, Any]:
    """Parameters of MeshLab's filter that colours vertices by quality: from dark at 0 to light at `largest`."""
    return {"minval": 0.0, "maxval": largest, "colormap": "Viridis"}


TIP = float(np.pi)
"""Radians: a vertex whose faces' angles sum to less is the tip of a spike, as of a cone narrower than 60 degrees."""


def remesh(mesh: TriangleMesh, edge: float, *, iterations: int = 8) -> TriangleMesh:
    """A mesh of the same surface with edges near `edge` (mm); its vertices lie on the old surface, some of them at the
    tips of its spikes. ValueError: edge <= 0."""
    if not edge > 0:
        raise ValueError(f"edge {edge} mm: give a positive length")
    meshset = to_meshset(mesh)
    pure = meshlab().PureValue
    meshset.meshing_isotropic_explicit_remeshing(
        iterations=iterations, targetlen=pure(edge), checksurfdist=True, maxsurfdist=pure(edge / 4), featuredeg=60.0
    )
    even = from_meshset(meshset)

    # Collapses cut tips off, as they measure only how far new faces lie off the old ones: the vertex nearest to each,
    # where one lies within two edges, is moved there
    tips = mesh.vertices[angle_sums(mesh) < TIP]
    away, nearest = cKDTree(even.vertices).query(tips)
    near = away < 2 * edge
    vertices = even.vertices.copy()
    vertices[np.asarray(nearest)[near]] = tips[near]
    return TriangleMesh(vertices, even.faces)


def angle_sums(mesh: TriangleMesh) -> Float[ndarray, " v"]:
    """The sum of the faces' angles at each vertex, radians: 2 pi where the surface is flat."""
    corners = mesh.vertices[mesh.faces]
    sides = [unit(corners[:, (k + 1) % 3] - corners[:, k]) for k in range(3)]
    angles = np.stack([angles_between(sides[k], -sides[k - 1]) for k in range(3)], axis=1)
    return np.bincount(mesh.faces.ravel(), angles.ravel(), minlength=len(mesh.vertices))


def split_edges(mesh: TriangleMesh, edge: float) -> TriangleMesh:
    """The mesh with every edge that is longer than `edge` (mm) split in the middle until none is; its surface
    stays where it was. ValueError: edge <= 0."""
    if not edge > 0:
        raise ValueError(f"edge {edge} mm: give a positive length")
    corners = mesh.vertices[mesh.faces]
    longest = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
    if longest <= edge:
        return mesh
    meshset = to_meshset(mesh)
    halvings = 2 * int(np.ceil(np.log2(longest / edge)))
    meshset.meshing_surface_subdivision_midpoint(iterations=halvings, threshold=meshlab().PureValue(edge))
    return from_meshset(meshset)


def bisect_faces(mesh: TriangleMesh, chosen: Bool[ndarray, " f"]) -> TriangleMesh:
    """The mesh with the longest edge of every chosen face cut in the middle, and that of every face an edge of
    which is cut; its surface stays where it was.

    Angles stay at least half as wide (Rivara 1984). New vertices come last.
    """
    ends = np.sort(half_edges(mesh).reshape(-1, 2), axis=1)
    edges, index = np.unique(ends, axis=0, return_inverse=True)
    edge_of = index.reshape(-1, 3)
    length = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    first = np.argmax(length[edge_of], axis=1)
    longest = edge_of[np.arange(len(edge_of)), first]
    cut = np.zeros(len(edges), dtype=bool)
    hit = chosen
    while not cut[longest[hit]].all():
        cut[longest[hit]] = True
        hit = np.any(cut[edge_of], axis=1)
    middle = len(mesh.vertices) - 1 + np.cumsum(cut)
    turn = (first[:, None] + np.arange(3)) % 3
    (a, b, c), (ab, bc, ca) = (np.take_along_axis(v, turn, axis=1)[hit].T for v in (mesh.faces, edge_of))
    faces = [mesh.faces[~hit]]
    for start, end, side in ((b, c, bc), (c, a, ca)):
        halved, m, q = cut[side], middle[ab], middle[side]
        faces.append(np.column_stack([start, end, m])[~halved])
        faces.extend(np.column_stack(three)[halved] for three in ((start, q, m), (q, end, m)))
    vertices = np.vstack([mesh.vertices, mesh.vertices[edges[cut]].mean(axis=1)])
    return TriangleMesh(vertices, np.vstack(faces).astype(np.int32))
