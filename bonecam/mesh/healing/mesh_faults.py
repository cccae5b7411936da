"""What keeps a mesh from being one closed genus-0 part, each with its place."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.mesh.healing.topology import edges_of, genus, half_edges, pieces_of
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class Fault:
    """One thing wrong: its kind (one word), a phrase with the count, and where it is seen first (mm)."""

    kind: str
    what: str
    place: Float[ndarray, "3"]

    def __str__(self) -> str:
        return f"{self.what} near ({', '.join(f'{x:.2f}' for x in self.place)})"


def faults_of(mesh: TriangleMesh) -> tuple[Fault, ...]:
    """All that is wrong: null, open, nonmanifold, mixed, parts, inward, genus, intersecting; nothing for a
    part that can be machined.

    Genus and orientation are looked at only where the mesh is closed and manifold: they mean nothing before.
    """
    edges = (*_null_faults(mesh), *_edge_faults(mesh))
    shape = () if edges else _shape_faults(mesh)
    return (*edges, *shape, *_intersection_faults(mesh))


def _null_faults(mesh: TriangleMesh) -> tuple[Fault, ...]:
    null = np.flatnonzero(~mesh.face_vectors.any(axis=1))
    return (Fault("null", f"{len(null)} faces without area", _place_of_face(mesh, int(null[0]))),) if len(null) else ()


def _edge_faults(mesh: TriangleMesh) -> tuple[Fault, ...]:
    edges, counts = edges_of(mesh)
    faults = []
    for kind, phrase, wrong in (
        ("open", "open edges", counts == 1),
        ("nonmanifold", "edges with more than two faces", counts > 2),
    ):
        if wrong.any():
            faults.append(Fault(kind, f"{wrong.sum()} {phrase}", mesh.vertices[edges[np.argmax(wrong)]].mean(0)))
    halves = half_edges(mesh).reshape(-1, 2)
    _, first, same = np.unique(halves, axis=0, return_index=True, return_counts=True)
    if not faults and (same > 1).any():
        place = mesh.vertices[halves[first[np.argmax(same)], 0]]
        faults.append(
            Fault("mixed", f"{(same > 1).sum()} edges between faces that are oriented against each other", place)
        )
    return tuple(faults)


def _shape_faults(mesh: TriangleMesh) -> tuple[Fault, ...]:
    import igl

    pieces = pieces_of(mesh)
    whole = igl.is_vertex_manifold(mesh.faces.astype(np.int64))
    pinched = np.setdiff1d(np.flatnonzero(~whole), np.setdiff1d(np.arange(len(whole)), mesh.faces))
    if len(pinched):
        return (Fault("pinched", f"{len(pinched)} vertices where two surfaces touch", mesh.vertices[pinched[0]]),)
    if pieces.max() > 0:
        return (Fault("parts", f"{pieces.max() + 1} separate parts", _place_of_face(mesh, int(np.argmax(pieces)))),)
    if not mesh.volume > 0:
        return (Fault("inward", f"an enclosed volume of {mesh.volume:.3g} mm^3", mesh.vertices[mesh.faces[0, 0]]),)
    handles = genus(mesh)
    centre = mesh.vertices[np.unique(mesh.faces)].mean(0)
    return (
        (Fault("genus", f"{handles} handle{'s' if handles > 1 else ''} (genus {handles})", centre),) if handles else ()
    )


def _intersection_faults(mesh: TriangleMesh) -> tuple[Fault, ...]:
    cut = self_intersections(mesh)
    return (
        (Fault("intersecting", f"{len(cut)} faces that cut others", _place_of_face(mesh, int(cut[0]))),)
        if len(cut)
        else ()
    )


def _place_of_face(mesh: TriangleMesh, face: int) -> Float[ndarray, "3"]:
    return np.asarray(mesh.vertices[mesh.faces[face]].mean(0))


def holes_of(mesh: TriangleMesh) -> list[Int[ndarray, " k"]]:
    """The vertices on the rim of each hole: open edges that hang together."""
    import scipy.sparse as sp

    edges, counts = edges_of(mesh)
    rim = edges[counts == 1]
    if not len(rim):
        return []
    names, compact = np.unique(rim, return_inverse=True)
    ends = compact.reshape(-1, 2)
    graph = sp.coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(names), len(names)))
    count, labels = sp.csgraph.connected_components(graph, directed=False)
    return [names[labels == k] for k in range(count)]
