"""Cleaning a mesh: duplicates, fins, non-manifold places, orientation, holes, in the order that works."""

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.errors import MeshError, counted, place_name
from bonecam.mesh.healing.components import keep_part
from bonecam.mesh.healing.junctions import resolve_junctions
from bonecam.mesh.healing.mesh_faults import holes_of
from bonecam.mesh.healing.repair_state import RepairState, apply_filter, apply_filters
from bonecam.mesh.healing.topology import edge_names, edges_of, half_edges, repeats_corner
from bonecam.mesh.meshlab import from_meshset, to_meshset
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces

WIDEST_HOLE = 0.5
"""Widest hole that is closed, as a share of the diagonal."""
CUTTING = (
    ("meshing_repair_non_manifold_edges", "faces", "removed {} at edges with more than two faces", "face"),
    ("meshing_repair_non_manifold_vertices", "vertices", "split {} where surfaces touch", "vertex"),
)


INSIDE_OUT = (
    "turned the whole surface outward: it faced inward, as mirror images do; check the scanner's axes "
    "(mesh.mirror turns one back)"
)
"""What is told of a mesh that is inside out."""


def tidy(state: RepairState) -> RepairState:
    """Faces without area removed, the fins that are left where they were, and what meets at edges of more than two
    faces and is not the part."""
    areal = apply_filter(state, "meshing_remove_null_faces", "faces", "removed {} without area", "face")
    return resolve_junctions(drop_fins(areal))


def clean(state: RepairState) -> RepairState:
    """Non-manifold places cut apart, then faces oriented alike, then holes closed, then all turned outwards."""
    cut = keep_part(apply_filters(state, CUTTING))
    return orient_outwards(close_holes(orient_coherently(cut)))


def drop_unused(state: RepairState) -> RepairState:
    """The mesh without vertices of no face, which would widen its bounds, faces that name a vertex twice, and faces
    that stand there already: with the same vertices, or with others at the same places, the same way round."""
    mesh = state.mesh
    strays = len(mesh.vertices) - len(np.unique(mesh.faces))
    null = repeats_corner(mesh.faces)
    duplicate = ~null & _stand_there(mesh)
    if not (strays or null.any() or duplicate.any()):
        return state
    counts = {
        "removed {} of no face": (strays, "vertex"),
        "removed {} without area": (int(null.sum()), "face"),
        "removed {}": (int(duplicate.sum()), "duplicate face"),
    }
    reported = (text.format(counted(number, noun)) for text, (number, noun) in counts.items() if number)
    return state.then(keep_faces(mesh, ~(null | duplicate)), *reported)


def _stand_there(mesh: TriangleMesh) -> Bool[ndarray, " m"]:
    """Which faces repeat an earlier one."""
    place_of = np.unique(mesh.vertices + 0.0, axis=0, return_inverse=True)[1].ravel()
    at = place_of[mesh.faces]
    from_lowest = (np.argmin(at, axis=1)[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(at, from_lowest, axis=1)
    return _repeated(np.sort(mesh.faces, axis=1)) | _repeated(turned)


def _repeated(trios: Int[ndarray, "m 3"]) -> Bool[ndarray, " m"]:
    """Which rows repeat an earlier one."""
    order = np.lexsort(trios.T)
    repeats = np.zeros(len(trios), dtype=bool)
    repeats[order[1:]] = (trios[order[1:]] == trios[order[:-1]]).all(axis=1)
    return repeats


def drop_fins(state: RepairState) -> RepairState:
    """The mesh without faces that stick out from an edge of three faces and end in the open.

    (MeshLab would remove the smallest face of the edge instead.)
    """
    edges, counts = edges_of(state.mesh)
    names, sides = (edge_names(each, len(state.mesh.vertices)) for each in (edges, half_edges(state.mesh)))
    face_counts = counts[np.searchsorted(names, sides)]
    fins = (face_counts == 1).any(1) & (face_counts > 2).any(1)
    count = int(fins.sum())
    if not count:
        return state
    return state.keep(
        ~fins, f"removed {counted(count, 'face')} that {'stick' if count > 1 else 'sticks'} out", outside=True
    )


def orient_coherently(state: RepairState) -> RepairState:
    """All faces of a piece oriented alike."""
    after = apply_filter(state, "meshing_re_orient_faces_coherently").mesh
    turned = int((dots(after.face_vectors, state.mesh.face_vectors) < 0).sum())
    turned = min(turned, len(after.faces) - turned)
    return state.then(after, *((f"turned {counted(turned, 'face')} round",) if turned else ()))


def orient_outwards(state: RepairState) -> RepairState:
    """The whole surface turned outwards where it encloses a negative volume."""
    if state.mesh.volume >= 0:
        return state
    turned = TriangleMesh(state.mesh.vertices, state.mesh.faces[:, ::-1])
    return state.then(turned, INSIDE_OUT)


def close_holes(state: RepairState) -> RepairState:
    """Holes closed; MeshError where one is wider than WIDEST_HOLE of the diagonal.

    One of three edges gets back the only face that it can have: the state tells neither width nor area of such a hole.
    """
    holes = holes_of(state.mesh)
    if not holes:
        return state
    widths = [float(np.linalg.norm(np.ptp(state.mesh.vertices[rim], axis=0))) for rim in holes]
    widest = int(np.argmax(widths))
    if widths[widest] > WIDEST_HOLE * state.mesh.diagonal:
        place = state.mesh.vertices[holes[widest]].mean(0)
        what = f"the mesh is an open sheet: a hole {widths[widest]:.1f} mm wide near {place_name(place)}"
        remedy = "give a closed solid, or its surface (rows of points, STEP, IGES, .tspline) to `bonecam finish`"
        raise MeshError(f"{what}: {remedy}", place=place, width=widths[widest], tried=state.done)
    meshset = to_meshset(state.mesh)
    meshset.meshing_close_holes(maxholesize=len(state.mesh.faces) + 3, selfintersection=False)
    after = from_meshset(meshset)
    closed = len(holes) - len(holes_of(after))
    added = len(after.faces) - len(state.mesh.faces)
    which = f"{closed} of {counted(len(holes), 'hole')}" if closed < len(holes) else counted(closed, "hole")
    widest_text = f"{'the widest ' if len(holes) > 1 else ''}{widths[widest]:.2f} mm across"
    near = f"near {place_name(state.mesh.vertices[holes[widest]].mean(0))}"
    message = f"closed {which} with {counted(added, 'face')}, {widest_text} {near}"
    guessed = max((width for width, rim in zip(widths, holes) if len(rim) > 3), default=0.0)
    alone = np.array([rim for rim in holes if len(rim) == 3], dtype=np.int32).reshape(-1, 3)
    area = after.area - state.mesh.area - TriangleMesh(state.mesh.vertices, alone).area
    return state.closed(after, message, guessed, max(area, 0.0))
