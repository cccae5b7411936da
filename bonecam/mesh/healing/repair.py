"""Repair: make one closed, manifold, outward, genus-0 part of a mesh, and say what was changed.

Three stages, each tried only where the one before left faults: cleaning in the order that worked (duplicates,
null faces, non-manifold edges, reorient, **then** close holes); the outside of a surface that cuts itself (an
exact union, Zhou et al. 2016: it keeps every visible face where it is); and last a new skin shrunk round the
cleaned part (alpha wrap, Portaneri et al. 2022). What comes out is checked and measured against what came in;
a surface that moved by more than `LARGEST_DEVIATION` of the diagonal is refused. Handles are never cut, parts
never chosen or fused: that is for a person to decide.
"""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.errors import MeshError, counted
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.healing.faults import Fault, faults_of, holes_of
from bonecam.mesh.healing.topology import edges_of, pieces_of
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.meshlab import from_meshset, meshlab, to_meshset
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces
from bonecam.progress import Progress, report, silent

LARGEST_DEVIATION = 0.02
"""Largest distance between the mesh before and after, as a share of the diagonal."""
TOLD = 5e-4
"""Least deviation that the report tells, mm: what its three decimals show."""
WIDEST_HOLE = 0.5
"""Widest hole that is closed, as a share of the diagonal."""
DEBRIS = 0.05
"""Loose pieces up to this share of the largest piece's area are dropped."""
FLAT = 1e-3
"""Least thickness of a solid, as a share of the diagonal."""
ASIDE = 1e-4
"""How far beside a face its two sides are looked at, as a share of the diagonal."""
WRAP_ALPHA, WRAP_OFFSET = 0.01, 0.001
"""Ball that shrinks round the part, and the distance it stops at, as shares of the diagonal."""
_REMEDIES = {
    "genus": "fill the opening in a mesh editor",
    "parts": "save the one to machine by itself",
    "open": "close it in a mesh editor",
}

_TIDYING = (
    ("meshing_remove_null_faces", "faces", "removed {} without area", "face"),
    ("meshing_remove_duplicate_vertices", "vertices", "merged {}", "duplicate vertex"),
    ("meshing_remove_duplicate_faces", "faces", "removed {}", "duplicate face"),
)
_CUTTING = (
    ("meshing_repair_non_manifold_edges", "faces", "removed {} at edges with more than two faces", "face"),
    ("meshing_repair_non_manifold_vertices", "vertices", "split {} where surfaces touch", "vertex"),
)


@dataclass(frozen=True, eq=False)
class _State:
    """A mesh on its way, with what was done to it."""

    mesh: TriangleMesh
    done: tuple[str, ...] = ()

    def then(self, mesh: TriangleMesh, *sentences: str) -> "_State":
        return _State(mesh, self.done + sentences)


def repair(mesh: TriangleMesh, *, progress: Progress = silent) -> tuple[TriangleMesh, tuple[str, ...]]:
    """One closed, manifold, outward part of genus 0 without self-intersections, and sentences that tell what
    was changed.

    MeshError names what is wrong, where (mm), what was tried, and the remedy; its evidence has `place` and
    `tried`.
    """
    report(progress, 0.0, "looking for faults")
    _refuse_flat(mesh)
    kept = _one_part(_without_strays(_State(mesh)))
    if not (faults := faults_of(kept.mesh)):
        return kept.mesh, kept.done
    _refuse_handles(faults, kept)
    tidied = _without_fins(_filtered(kept, _TIDYING))
    cleaned = _clean(tidied)
    trouble = _refusal(faults, kept)
    for k, stage in enumerate((_as_cleaned, _united, _wrapped)):
        report(progress, (k + 1) / 4, f"repairing: {faults[0]}")
        state = stage(cleaned)
        if found := faults_of(state.mesh):
            _refuse_handles(found, state)
            trouble = _refusal(found, state)
        elif (deviation := _moved(tidied.mesh, cleaned.mesh, state.mesh))[
            0
        ] <= LARGEST_DEVIATION * kept.mesh.diagonal:
            told = f"moved no part of the surface by more than {deviation[0]:.3f} mm"
            return state.mesh, (*state.done, *((told,) if deviation[0] >= TOLD else ()))
        else:
            trouble = _unfaithful(*deviation, state)
    raise trouble


def _as_cleaned(state: _State) -> _State:
    """What cleaning gave may be good enough."""
    return state


def _refuse_handles(faults: tuple[Fault, ...], state: _State) -> None:
    """MeshError where the mesh is sound but for its handles: no stage mends those."""
    if any(fault.kind == "genus" for fault in faults) and {fault.kind for fault in faults} <= {
        "genus",
        "intersecting",
    }:
        raise _refusal(tuple(fault for fault in faults if fault.kind == "genus"), state)


def _refusal(faults: tuple[Fault, ...], state: _State) -> MeshError:
    tried = f" after repair ({'; '.join(state.done)})" if state.done else ""
    remedy = next(
        (_REMEDIES[fault.kind] for fault in faults if fault.kind in _REMEDIES),
        "mend it there in a mesh editor",
    )
    message = f"the mesh has {', '.join(map(str, faults))}{tried}: {remedy}"
    return MeshError(message, faults=faults, place=faults[0].place, tried=state.done)


def _unfaithful(distance: float, place: ndarray, state: _State) -> MeshError:
    where = ", ".join(f"{x:.2f}" for x in place)
    what = f"the repair ({'; '.join(state.done)}) moves the surface by {distance:.2f} mm near ({where})"
    return MeshError(f"{what}: mend the mesh there in a mesh editor", place=place, tried=state.done)


def _refuse_flat(mesh: TriangleMesh) -> None:
    if not len(mesh.faces):
        raise MeshError("the mesh has no faces: give a surface mesh")
    used = mesh.vertices[np.unique(mesh.faces)]
    size = float(np.linalg.norm(np.ptp(used, axis=0)))
    thickness = np.ptp(
        (used - used.mean(0)) @ np.linalg.svd(used - used.mean(0), full_matrices=False)[2].T, axis=0
    ).min()
    if thickness < FLAT * size:
        faces = "one triangle" if len(mesh.faces) == 1 else f"{len(mesh.faces)} triangles"
        what = f"the mesh ({faces}) is flat: {round(float(thickness), 9):.3g} mm thick, {size:.3g} mm from corner to corner"
        raise MeshError(f"{what}: give a solid part", thickness=float(thickness))


def _without_strays(state: _State) -> _State:
    """Vertices of no face would widen the bounds: they go even where nothing else is wrong."""
    strays = len(state.mesh.vertices) - len(np.unique(state.mesh.faces))
    if not strays:
        return state
    return state.then(
        keep_faces(state.mesh),
        f"removed {counted(strays, 'vertex')} of no face",
    )


def _one_part(state: _State) -> _State:
    """The largest piece, where the others are debris; MeshError where they are parts."""
    welded = _state_after(state, "meshing_remove_duplicate_vertices").mesh
    pieces = pieces_of(welded)
    areas = np.bincount(pieces, np.linalg.norm(welded.face_vectors, axis=1) / 2)
    if len(areas) == 1:
        return state
    largest = int(np.argmax(areas))
    others = np.delete(areas, largest)
    if others.max() > DEBRIS * areas[largest]:
        second = int(np.argsort(-areas, kind="stable")[1])
        place = welded.vertices[welded.faces[pieces == second]].mean((0, 1))
        where = ", ".join(f"{x:.2f}" for x in place)
        what = f"the mesh has {len(areas)} separate parts, the second largest near ({where}) mm"
        raise MeshError(
            f"{what}: save the one to machine by itself", parts=len(areas), areas=areas, place=place
        )
    told = f"dropped {counted(len(others), 'loose piece')} of at most {others.max() / areas[largest]:.2%} of the part's area"
    return state.then(keep_faces(welded, pieces == largest), told)


def _state_after(state: _State, name: str, elements: str = "", sentence: str = "", noun: str = "") -> _State:
    """`state` after one MeshLab filter, with its sentence where the number of its elements changed."""
    meshset = to_meshset(state.mesh)
    getattr(meshset, name)()
    mesh = from_meshset(meshset)
    changed = abs(len(getattr(mesh, elements)) - len(getattr(state.mesh, elements))) if elements else 0
    return state.then(mesh, *((sentence.format(counted(changed, noun)),) if changed else ()))


def _clean(state: _State) -> _State:
    """Non-manifold places cut apart, then orientation, then holes."""
    return _outward(_closed(_oriented(_one_part(_filtered(state, _CUTTING)))))


def _filtered(state: _State, filters: tuple[tuple[str, str, str, str], ...]) -> _State:
    for name, elements, sentence, noun in filters:
        state = _state_after(state, name, elements, sentence, noun)
    return state


def _without_fins(state: _State) -> _State:
    """Faces that stick out from an edge of three faces and end in the open: MeshLab would take away the
    smallest face instead."""
    edges, counts = edges_of(state.mesh)
    sides = np.sort(state.mesh.faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).astype(np.int64)
    names = edges.astype(np.int64) @ [len(state.mesh.vertices), 1]
    found = counts[np.searchsorted(names, sides @ [len(state.mesh.vertices), 1])]
    fins = (found == 1).any(1) & (found > 2).any(1)
    if not (count := int(fins.sum())):
        return state
    return state.then(
        keep_faces(state.mesh, ~fins),
        f"removed {counted(count, 'face')} that {'stick' if count > 1 else 'sticks'} out",
    )


def _oriented(state: _State) -> _State:
    """Faces of one piece oriented alike."""
    after = _state_after(state, "meshing_re_orient_faces_coherently").mesh
    turned = int((dots(after.face_vectors, state.mesh.face_vectors) < 0).sum())
    turned = min(turned, len(after.faces) - turned)
    return state.then(after, *((f"turned {counted(turned, 'face')} round",) if turned else ()))


def _outward(state: _State) -> _State:
    if state.mesh.volume >= 0:
        return state
    return state.then(
        TriangleMesh(state.mesh.vertices, state.mesh.faces[:, ::-1]), "turned the whole surface outward"
    )


def _closed(state: _State) -> _State:
    """Holes closed, up to WIDEST_HOLE across."""
    holes = holes_of(state.mesh)
    if not holes:
        return state
    widths = [float(np.linalg.norm(np.ptp(state.mesh.vertices[rim], axis=0))) for rim in holes]
    widest = int(np.argmax(widths))
    if widths[widest] > WIDEST_HOLE * state.mesh.diagonal:
        place = state.mesh.vertices[holes[widest]].mean(0)
        where = ", ".join(f"{x:.2f}" for x in place)
        what = f"the mesh is an open sheet: a hole {widths[widest]:.1f} mm wide near ({where})"
        raise MeshError(f"{what}: give a closed solid", place=place, width=widths[widest], tried=state.done)
    meshset = to_meshset(state.mesh)
    meshset.meshing_close_holes(maxholesize=len(state.mesh.faces) + 3, selfintersection=False)
    after = from_meshset(meshset)
    closed = len(holes) - len(holes_of(after))
    added = len(after.faces) - len(state.mesh.faces)
    which = f"{closed} of {counted(len(holes), 'hole')}" if closed < len(holes) else counted(closed, "hole")
    widest_told = f"{'the widest ' if len(holes) > 1 else ''}{widths[widest]:.2f} mm across"
    return state.then(after, f"closed {which} with {counted(added, 'face')}, {widest_told}")


def _united(state: _State) -> _State:
    """The outside of a surface that cuts itself: the boundary of what it winds round at least once, exact."""
    import igl.copyleft.cgal as cgal

    try:
        vertices, faces, _ = cgal.mesh_boolean(
            np.array(state.mesh.vertices), state.mesh.faces.astype(np.int64), type_str="union"
        )
    except RuntimeError:  # it bounds no volume: the next stage is for that
        return state
    after = TriangleMesh(vertices, np.asarray(faces, dtype=np.int32))
    if not len(after.faces):
        return state
    depth = np.linalg.norm(exact_closest(after, state.mesh.vertices)[0] - state.mesh.vertices, axis=1)
    cut = len(self_intersections(state.mesh))
    what = f"the outside of {counted(cut, 'face')} that cut each other" if cut else "the outside only"
    told = f"kept {what} (what lay up to {depth.max():.2f} mm inside is gone)"
    return _one_part(state.then(after, told))


def _wrapped(state: _State) -> _State:
    """A new skin shrunk round the part."""
    size = state.mesh.diagonal
    pure = meshlab().PureValue
    meshset = to_meshset(state.mesh)
    meshset.generate_alpha_wrap(alpha=pure(WRAP_ALPHA * size), offset=pure(WRAP_OFFSET * size))
    told = f"shrank a new skin round the part (ball {WRAP_ALPHA * size:.2f} mm, offset {WRAP_OFFSET * size:.3f} mm)"
    return state.then(from_meshset(meshset), told)


def _moved(before: TriangleMesh, cleaned: TriangleMesh, after: TriangleMesh) -> tuple[float, ndarray]:
    """Largest distance (mm) from the corners and middles of the old faces to the new surface, and where.

    Old faces with the solid on both sides lie inside another part of the surface: they are no outside and do
    not count.
    """
    import igl

    corners, vectors = before.vertices[before.faces], before.face_vectors
    middles = corners.mean(1, keepdims=True)
    points = np.concatenate([corners, middles], axis=1).reshape(-1, 3)
    distances = np.linalg.norm(exact_closest(after, points)[0] - points, axis=1)
    normals = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny)
    aside = np.repeat(normals, 4, axis=0) * before.diagonal * ASIDE
    inset = (points.reshape(-1, 4, 3) + ASIDE * (middles - points.reshape(-1, 4, 3))).reshape(-1, 3)
    solid = np.array(cleaned.vertices), cleaned.faces.astype(np.int64)
    within = [np.asarray(igl.winding_number(*solid, inset + side * aside)).ravel() > 0.5 for side in (1, -1)]
    distances[within[0] & within[1]] = 0.0
    worst = int(np.argmax(distances))
    return float(distances[worst]), points[worst]
