"""Junctions: edges at which more than two faces meet, resolved by the cells into which the faces part space.

The part is the largest bounded cell, what it encloses, and cells behind a wall in it; its surface is where faces lie
between it and the rest. Debris that shares faces with it, walls and faces that stick out go; the other faces keep
their vertices to the bit. The cells are exact (Zhou et al. 2016), but mean nothing on a surface that is open elsewhere
or cuts itself.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots, unit
from bonecam.errors import counted, place_name
from bonecam.mesh.healing.components import DEBRIS
from bonecam.mesh.healing.repair_state import RepairState
from bonecam.mesh.healing.topology import edge_names, edges_of, half_edges
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces

SMOOTH = float(np.cos(np.radians(25.0)))
"""A surface that goes on below a cell, with a turn of less than this at its rim, has no wall there: neighbouring faces
of the 558 of a coarse talus turn less."""


def resolve_junctions(state: RepairState) -> RepairState:
    """The surface of the part among faces that meet at edges of more than two; the mesh as it is where there are none,
    or the cells of its faces bound no closed surface."""
    mesh = state.mesh
    if not (edges_of(mesh)[1] > 2).any() or len(self_intersections(mesh)):
        return state
    cells = _cells(mesh)
    part = _part_cells(mesh, cells)
    on_front, on_back = part[cells].T
    surface = on_front != on_back
    inward = (on_front & surface).sum() > surface.sum() / 2  # a mesh that is inside out stays so here
    turned = (on_back if inward else on_front) & surface
    faces = np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces)
    after = keep_faces(TriangleMesh(mesh.vertices, faces), surface)
    if not surface.any() or (edges_of(after)[1] == 1).any() or _other_parts(mesh, cells, part):
        return state
    if not surface.all():
        outside = ~part[cells].all(axis=1)
        state = state.keep(surface, _left_out(mesh, cells, part, surface), outside=outside)
    return state.then(after, *([f"turned {counted(int(turned.sum()), 'face')} round"] if turned.any() else []))


def _other_parts(mesh: TriangleMesh, cells: Int[ndarray, "m 2"], part: Bool[ndarray, " c"]) -> bool:
    """Whether a cell that is not of the part is no debris."""
    areas = np.linalg.norm(mesh.face_vectors, axis=1) / 2
    front, back = (np.bincount(side, areas, len(part)) for side in cells.T)
    others = (front + back)[1:][~part[1:]]
    return bool(others.max(initial=0.0) > DEBRIS * areas[part[cells].any(axis=1)].sum())


def _left_out(
    mesh: TriangleMesh, cells: Int[ndarray, "m 2"], part: Bool[ndarray, " c"], surface: Bool[ndarray, " m"]
) -> str:
    """What the faces are that are not of the surface of the part: those of debris, walls, faces that stick out."""
    in_debris = ~part[cells] & (cells > 0)
    of_debris = in_debris.any(axis=1) & ~surface
    inside = part[cells].all(axis=1)
    sticking_out = (cells == 0).all(axis=1)
    kinds = {
        f"dropped {counted(len(np.unique(cells[in_debris])), 'piece')} on faces of the part": of_debris,
        f"removed {counted(int(inside.sum()), 'face')} inside the part": inside,
        f"removed {counted(int(sticking_out.sum()), 'face')} that stuck out": sticking_out,
    }
    return ", ".join(
        f"{reported} near {place_name(mesh.vertices[mesh.faces[faces]].mean(axis=(0, 1)))}"
        for reported, faces in kinds.items()
        if faces.any()
    )


def _cells(mesh: TriangleMesh) -> Int[ndarray, "m 2"]:
    """The cells in front and at the back of each face; 0 is the outside. An open edge leads from the one to the
    other."""
    import igl.copyleft.cgal as cgal

    count, cells = cgal.extract_cells(np.array(mesh.vertices), mesh.faces.astype(np.int64))
    edges, counts = edges_of(mesh)
    sides = edge_names(half_edges(mesh), len(mesh.vertices))
    rim = np.isin(sides, edge_names(edges[counts == 1], len(mesh.vertices))).any(axis=1)
    front, back = cells[rim].T
    graph = sp.coo_array((np.ones(len(front)), (front, back)), shape=(count, count))
    return np.asarray(sp.csgraph.connected_components(graph, directed=False)[1][cells], dtype=np.int64)


def _part_cells(mesh: TriangleMesh, cells: Int[ndarray, "m 2"]) -> Bool[ndarray, " c"]:
    """Which cells are of the part."""
    count = int(cells.max()) + 1
    front, back = cells.T
    corners = mesh.vertices - mesh.vertices.mean(axis=0)
    signed = np.linalg.det(corners[mesh.faces])
    volumes = np.bincount(back, signed, count) - np.bincount(front, signed, count)
    part = np.zeros(count, dtype=bool)
    largest = int(np.argmax(np.where(np.arange(count) > 0, volumes, 0.0)))
    if largest == 0:
        return part
    aside = (cells != largest).all(axis=1)
    graph = sp.coo_array((np.ones(int(aside.sum())), (front[aside], back[aside])), shape=(count, count))
    around = sp.csgraph.connected_components(graph, directed=False)[1]
    part |= around != around[0]
    part[largest] = True
    grown = True
    while grown:
        behind = [cell for cell in np.flatnonzero(~part)[1:] if _is_behind_wall(mesh, cells, part, int(cell))]
        part[behind] = True
        grown = bool(behind)
    return part


def _is_behind_wall(mesh: TriangleMesh, cells: Int[ndarray, "m 2"], part: Bool[ndarray, " c"], cell: int) -> bool:
    """Whether a cell is a piece of the part behind a wall, not debris upon it: it is no smaller than parts are, or the
    outer surface goes on over it more smoothly than below it, where it would turn sharply."""
    on_front, on_back = part[cells].T
    of_part = on_front != on_back
    of_cell = (cells == cell).any(axis=1)
    shared = of_part & of_cell
    if not shared.any():
        return False
    areas = np.linalg.norm(mesh.face_vectors, axis=1) / 2
    if areas[of_cell].sum() > DEBRIS * areas[of_part].sum():
        return True
    outward = np.where(on_back | (~of_part & (cells[:, 1] == cell)), 1.0, -1.0)[:, None] * unit(mesh.face_vectors)
    beside, below, over = (
        _normals_at_edges(mesh, faces, outward) for faces in (of_part & ~shared, shared, of_cell & ~shared)
    )
    rim = sorted(beside.keys() & below.keys() & over.keys())
    if not rim:
        return False
    along, under, above = (np.array([normals[edge] for edge in rim]) for normals in (beside, below, over))
    without = float(dots(along, under).mean())
    return without < SMOOTH and without < float(dots(along, above).mean())


def _normals_at_edges(
    mesh: TriangleMesh, faces: Bool[ndarray, " m"], normals: Float[ndarray, "m 3"]
) -> dict[tuple[int, int], ndarray]:
    """The normal of one of these faces at each of their edges."""
    sides = np.sort(half_edges(mesh)[faces], axis=2)
    return {(int(a), int(b)): normal for trio, normal in zip(sides, normals[faces], strict=True) for a, b in trio}
