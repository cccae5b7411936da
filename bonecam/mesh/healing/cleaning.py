"""Cleaning a mesh: debris, duplicates, fins, non-manifold places, orientation, holes, in the order that
works."""

import numpy as np

from bonecam.arrays import dots
from bonecam.errors import MeshError, counted, place_name
from bonecam.mesh.healing.faults import holes_of
from bonecam.mesh.healing.repair_state import RepairState, apply_filter, apply_filters
from bonecam.mesh.healing.topology import edges_of, half_edges, pieces_of
from bonecam.mesh.meshlab import from_meshset, to_meshset
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces

WIDEST_HOLE = 0.5
"""Widest hole that is closed, as a share of the diagonal."""
DEBRIS = 0.05
"""Loose pieces up to this share of the largest piece's area are dropped."""
TIDYING = (
    ("meshing_remove_null_faces", "faces", "removed {} without area", "face"),
    ("meshing_remove_duplicate_vertices", "vertices", "merged {}", "duplicate vertex"),
    ("meshing_remove_duplicate_faces", "faces", "removed {}", "duplicate face"),
)
CUTTING = (
    ("meshing_repair_non_manifold_edges", "faces", "removed {} at edges with more than two faces", "face"),
    ("meshing_repair_non_manifold_vertices", "vertices", "split {} where surfaces touch", "vertex"),
)


def tidy(state: RepairState) -> RepairState:
    """Faces without area, duplicates and fins removed."""
    return drop_fins(apply_filters(state, TIDYING))


def clean(state: RepairState) -> RepairState:
    """Non-manifold places cut apart, then faces oriented alike, then holes closed, then all turned
    outwards."""
    cut = keep_largest_piece(apply_filters(state, CUTTING))
    return orient_outwards(close_holes(orient_coherently(cut)))


def drop_unused_vertices(state: RepairState) -> RepairState:
    """The mesh without vertices of no face, which would widen its bounds."""
    strays = len(state.mesh.vertices) - len(np.unique(state.mesh.faces))
    if not strays:
        return state
    return state.then(
        keep_faces(state.mesh),
        f"removed {counted(strays, 'vertex')} of no face",
    )


def keep_largest_piece(state: RepairState) -> RepairState:
    """The largest piece, where the others are debris; MeshError where they are parts."""
    welded = apply_filter(state, "meshing_remove_duplicate_vertices").mesh
    pieces = pieces_of(welded)
    areas = np.bincount(pieces, np.linalg.norm(welded.face_vectors, axis=1) / 2)
    if len(areas) == 1:
        return state
    largest = int(np.argmax(areas))
    others = np.delete(areas, largest)
    if others.max() > DEBRIS * areas[largest]:
        second = int(np.argsort(-areas, kind="stable")[1])
        place = welded.vertices[welded.faces[pieces == second]].mean((0, 1))
        what = f"the mesh has {len(areas)} separate parts, the second largest near {place_name(place)} mm"
        raise MeshError(
            f"{what}: save the one to machine by itself", parts=len(areas), areas=areas, place=place
        )
    told = (
        f"dropped {counted(len(others), 'loose piece')} of at most {others.max() / areas[largest]:.2%} of "
        "the part's area"
    )
    return state.then(keep_faces(welded, pieces == largest), told)


def drop_fins(state: RepairState) -> RepairState:
    """The mesh without faces that stick out from an edge of three faces and end in the open.

    (MeshLab would remove the smallest face of the edge instead.)
    """
    edges, counts = edges_of(state.mesh)
    sides = np.sort(half_edges(state.mesh), axis=2).astype(np.int64)
    names = edges.astype(np.int64) @ [len(state.mesh.vertices), 1]
    found = counts[np.searchsorted(names, sides @ [len(state.mesh.vertices), 1])]
    fins = (found == 1).any(1) & (found > 2).any(1)
    if not (count := int(fins.sum())):
        return state
    return state.then(
        keep_faces(state.mesh, ~fins),
        f"removed {counted(count, 'face')} that {'stick' if count > 1 else 'sticks'} out",
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
    return state.then(
        TriangleMesh(state.mesh.vertices, state.mesh.faces[:, ::-1]), "turned the whole surface outward"
    )


def close_holes(state: RepairState) -> RepairState:
    """Holes closed; MeshError where one is wider than WIDEST_HOLE of the diagonal."""
    holes = holes_of(state.mesh)
    if not holes:
        return state
    widths = [float(np.linalg.norm(np.ptp(state.mesh.vertices[rim], axis=0))) for rim in holes]
    widest = int(np.argmax(widths))
    if widths[widest] > WIDEST_HOLE * state.mesh.diagonal:
        place = state.mesh.vertices[holes[widest]].mean(0)
        what = f"the mesh is an open sheet: a hole {widths[widest]:.1f} mm wide near {place_name(place)}"
        remedy = (
            "give a closed solid, or its surface (rows of points, STEP, IGES, .tspline) to `bonecam finish`"
        )
        raise MeshError(f"{what}: {remedy}", place=place, width=widths[widest], tried=state.done)
    meshset = to_meshset(state.mesh)
    meshset.meshing_close_holes(maxholesize=len(state.mesh.faces) + 3, selfintersection=False)
    after = from_meshset(meshset)
    closed = len(holes) - len(holes_of(after))
    added = len(after.faces) - len(state.mesh.faces)
    which = f"{closed} of {counted(len(holes), 'hole')}" if closed < len(holes) else counted(closed, "hole")
    widest_told = f"{'the widest ' if len(holes) > 1 else ''}{widths[widest]:.2f} mm across"
    return state.then(after, f"closed {which} with {counted(added, 'face')}, {widest_told}")
