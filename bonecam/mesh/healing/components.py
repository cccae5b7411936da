"""Components of a mesh, face by face across edges of two faces: the part, and what lies beside and inside it.

Where components touch at a vertex or an edge only, each is taken by itself: the rest keeps its vertices to the
bit. What touches along faces is told apart by `healing.junctions`.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import MeshError, counted, place_name
from bonecam.mesh.healing.repair_state import RepairState
from bonecam.mesh.healing.surface_moves import winding_numbers
from bonecam.mesh.healing.topology import edge_names, edges_of, half_edges
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces

DEBRIS = 0.05
"""Loose pieces up to this share of the part's area are dropped."""


def components_of(mesh: TriangleMesh) -> Int[ndarray, " m"]:
    """The component each face belongs to, from 0.

    Faces that share an edge of two faces are of one patch. A patch is a component, but patches that end at an edge of
    more faces are one with the others that end there.
    """
    import igl

    patches = np.asarray(igl.extract_manifold_patches(mesh.faces.astype(np.int64))[1]).ravel()
    sides = edge_names(half_edges(mesh), len(mesh.vertices)).ravel()
    _, edge_of, counts = np.unique(sides, return_inverse=True, return_counts=True)
    shared = counts[edge_of] > 2
    own, faces = np.unique(np.column_stack([edge_of, np.repeat(patches, 3)])[shared], axis=0, return_counts=True)
    ends = own[faces == 1]
    met = np.flatnonzero(ends[1:, 0] == ends[:-1, 0])
    count = int(patches.max(initial=-1)) + 1
    graph = sp.coo_array((np.ones(len(met)), (ends[met, 1], ends[met + 1, 1])), shape=(count, count))
    return np.asarray(sp.csgraph.connected_components(graph, directed=False)[1][patches], dtype=np.int64)


def keep_part(state: RepairState) -> RepairState:
    """The largest component, where the others are debris or inner shells; MeshError where they are parts."""
    mesh = state.mesh
    component_of = components_of(mesh)
    areas = np.bincount(component_of, np.linalg.norm(mesh.face_vectors, axis=1) / 2)
    if len(areas) == 1:
        return state
    part = _outermost(mesh, component_of, int(np.argmax(areas)))
    volumes = _volumes(mesh, component_of)
    closed = _closed(mesh, component_of)
    inside = _shares_inside(mesh, component_of, part)
    inner = (inside == 1) | (closed & (inside > 0.5) & (volumes * volumes[part] < 0))
    loose = ~inner
    loose[part] = False
    if areas[loose].max(initial=0.0) > DEBRIS * areas[part]:
        raise _refusal(mesh, component_of, np.where(inner, 0.0, areas))
    if loose.any():
        share = areas[loose].max() / areas[part]
        place = _middle(mesh, component_of == np.argmax(np.where(loose, areas, 0.0)))
        largest = "the largest " if loose.sum() > 1 else ""
        pieces = f"dropped {counted(int(loose.sum()), 'loose piece')} of at most {share:.2%} of the part's area"
        state = state.keep(~loose[component_of], f"{pieces}, {largest}near {place_name(place)}", outside=True)
    if inner.any():
        enclosed = np.where(inner, closed * np.abs(volumes), -1.0)
        shells = _inner_shells(mesh, component_of, enclosed, inside)
        state = state.keep(~inner[component_of[~loose[component_of]]], shells)
    return state


def _outermost(mesh: TriangleMesh, component_of: Int[ndarray, " m"], largest: int) -> int:
    """The component that the largest lies inside of, else itself: a folded inner shell may have more area."""
    low, high = (_extremes(mesh, component_of, extreme) for extreme in (np.minimum, np.maximum))
    round_it = np.flatnonzero(((low < low[largest]) & (high > high[largest])).all(axis=1))
    holding = [k for k in round_it if _shares_inside(mesh, component_of, int(k))[largest] == 1]
    return int(max(holding, key=lambda k: np.prod(high[k] - low[k]), default=largest))


def _extremes(mesh: TriangleMesh, component_of: Int[ndarray, " m"], extreme: np.ufunc) -> Float[ndarray, "c 3"]:
    """The lowest or highest coordinates of each component."""
    order = np.argsort(component_of, kind="stable")
    starts = np.searchsorted(component_of[order], np.arange(component_of.max() + 1))
    corners = extreme.reduce(mesh.vertices[mesh.faces], axis=1)
    return np.asarray(extreme.reduceat(corners[order], starts))


def _volumes(mesh: TriangleMesh, component_of: Int[ndarray, " m"]) -> Float[ndarray, " c"]:
    """The volume that each component encloses, mm^3, negative where its faces point inwards; of an open one as if the
    middle of the mesh closed it."""
    corners = mesh.vertices - mesh.vertices.mean(axis=0)
    return np.asarray(np.bincount(component_of, np.linalg.det(corners[mesh.faces]) / 6))


def _closed(mesh: TriangleMesh, component_of: Int[ndarray, " m"]) -> Bool[ndarray, " c"]:
    """Which components have no open edge."""
    edges, counts = edges_of(mesh)
    sides, rim = (edge_names(each, len(mesh.vertices)) for each in (half_edges(mesh), edges[counts == 1]))
    closed = np.ones(component_of.max() + 1, dtype=bool)
    closed[component_of[np.isin(sides, rim).any(axis=1)]] = False
    return closed


def _shares_inside(mesh: TriangleMesh, component_of: Int[ndarray, " m"], outer: int) -> Float[ndarray, " c"]:
    """The share of the faces of each component whose middles lie inside the component `outer`; 0 for itself."""
    others = component_of != outer
    middles = mesh.vertices[mesh.faces[others]].mean(axis=1)
    inside = np.abs(winding_numbers(keep_faces(mesh, ~others), middles)) > 0.5
    count = int(component_of.max()) + 1
    return np.bincount(component_of[others], inside, count) / np.bincount(component_of, minlength=count)


def _inner_shells(
    mesh: TriangleMesh, component_of: Int[ndarray, " m"], volumes: Float[ndarray, " c"], inside: Float[ndarray, " c"]
) -> str:
    """The sentence on the inner shells, whose `volumes` are not negative: how many were left out, their volume and
    place, and where one comes out of the part."""
    inner = volumes >= 0
    largest = int(np.argmax(volumes))
    near = f"near {place_name(_middle(mesh, component_of == largest))}"
    count = int(inner.sum())
    if not volumes[largest]:
        message = f"dropped {counted(count, 'open sheet')} inside the part, {'the largest ' if count > 1 else ''}{near}"
    elif count == 1:
        message = f"filled an inner shell (cavity) of {volumes[largest]:.3g} mm3 {near}"
    else:
        each = f"{volumes[inner].sum():.3g} mm3 in all, the largest of {volumes[largest]:.3g} mm3"
        message = f"filled {count} inner shells (cavities), {each} {near}"
    through = int((inner & (inside < 1)).sum())
    if through:
        what = "it comes" if count == 1 else f"{through} of them {'comes' if through == 1 else 'come'}"
        message += f"; {what} out through the surface"
    return message


def _middle(mesh: TriangleMesh, faces: Bool[ndarray, " m"]) -> Float[ndarray, "3"]:
    return np.asarray(mesh.vertices[mesh.faces[faces]].mean(axis=(0, 1)))


def _refusal(mesh: TriangleMesh, component_of: Int[ndarray, " m"], areas: Float[ndarray, " c"]) -> MeshError:
    """The error of several parts, of which those inside another have no `areas`."""
    parts = int((areas > 0).sum())
    place = _middle(mesh, component_of == np.argsort(-areas, kind="stable")[1])
    what = f"the mesh has {parts} separate parts, the second largest near {place_name(place)} mm"
    remedy = "save the one to machine by itself"
    if (edges_of(mesh)[1] == 1).any():
        remedy += ", or merge close vertices in a mesh editor where the two are one"
    return MeshError(f"{what}: {remedy}", parts=parts, areas=areas, place=place)
