"""Repair: make one closed, manifold, outward, genus-0 part of a mesh, and say what was changed.

Three stages, each tried only where the one before left faults: cleaning in the order that worked (duplicates, null
faces, non-manifold edges, reorient, **then** close holes), cutting out the faces that cut others and closing the gaps,
and last a new skin shrunk round the part (alpha wrap, Portaneri et al. 2022). What comes out is checked and measured
against what came in; a part that moved by more than `LARGEST_DEVIATION` of its diagonal is refused. Handles are never
cut and parts never chosen or fused: that is for a person to decide.
"""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from bonecam.errors import MeshError
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.faults import Fault, faults_of, holes_of
from bonecam.mesh.files import from_meshset, meshlab, to_meshset
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.topology import pieces_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, report, silent

LARGEST_DEVIATION = 0.02
"""Largest distance between the mesh before and after, as a share of the diagonal."""
WIDEST_HOLE = 0.5
"""Widest hole that is closed, as a share of the diagonal."""
DEBRIS = 0.05
"""Loose pieces up to this share of the largest piece's area are dropped."""
FLAT = 1e-3
"""Least thickness of a solid, as a share of the diagonal."""
WRAP_ALPHA, WRAP_OFFSET = 0.01, 0.001
"""Ball that shrinks round the part, and the distance it stops at, as shares of the diagonal."""
_REMEDIES = {
    "genus": "fill the opening in a mesh editor",
    "parts": "save the one to machine by itself",
    "open": "close it in a mesh editor",
}

_CLEANING = (
    ("meshing_remove_unreferenced_vertices", "vertices", "removed {} vertices of no face"),
    ("meshing_remove_duplicate_vertices", "vertices", "merged {} duplicate vertices"),
    ("meshing_remove_duplicate_faces", "faces", "removed {} duplicate faces"),
    ("meshing_remove_null_faces", "faces", "removed {} faces without area"),
    ("meshing_repair_non_manifold_edges", "faces", "removed {} faces at edges with more than two faces"),
    ("meshing_repair_non_manifold_vertices", "vertices", "split {} vertices where surfaces touch"),
)


@dataclass(frozen=True, eq=False)
class _State:
    """A mesh on its way, with what was done to it."""

    mesh: TriangleMesh
    done: tuple[str, ...] = ()

    def then(self, mesh: TriangleMesh, *sentences: str) -> "_State":
        return _State(mesh, self.done + sentences)


def repair(mesh: TriangleMesh, *, progress: Progress = silent) -> tuple[TriangleMesh, tuple[str, ...]]:
    """One closed, manifold, outward part of genus 0 without self-intersections, and sentences that tell what was changed.

    MeshError names what is wrong, where (mm), what was tried, and the remedy; its evidence has `faults`, `place` and `tried`.
    """
    report(progress, 0.0, "looking for faults")
    _refuse_flat(mesh)
    kept = _one_part(_State(mesh))
    state, faults = kept, faults_of(kept.mesh)
    stages = (_clean, _without_intersections, _wrapped)
    for k, stage in enumerate(stages):
        if not faults or {fault.kind for fault in faults} == {"genus"}:
            break
        report(progress, (k + 1) / 4, f"repairing: {faults[0]}")
        state = stage(kept if stage is _wrapped else state)
        faults = faults_of(state.mesh)
    if faults:
        raise _refusal(faults, state)
    if state is kept:
        return state.mesh, state.done
    return state.mesh, (*state.done, _measured(kept.mesh, state))


def _refusal(faults: tuple[Fault, ...], state: _State) -> MeshError:
    tried = f" after repair ({'; '.join(state.done)})" if state.done else ""
    remedy = next((_REMEDIES[fault.kind] for fault in faults if fault.kind in _REMEDIES), "mend it there in a mesh editor")
    message = f"the mesh has {', '.join(map(str, faults))}{tried}: {remedy}"
    return MeshError(message, faults=faults, place=faults[0].place, tried=state.done)


def _refuse_flat(mesh: TriangleMesh) -> None:
    if not len(mesh.faces):
        raise MeshError("the mesh has no faces: give a surface mesh")
    used = mesh.vertices[np.unique(mesh.faces)]
    thickness = np.ptp((used - used.mean(0)) @ np.linalg.svd(used - used.mean(0), full_matrices=False)[2].T, axis=0).min()
    if thickness < FLAT * mesh.diagonal:
        what = f"the mesh is flat: {thickness:.3g} mm thick, {mesh.diagonal:.3g} mm from corner to corner"
        raise MeshError(f"{what}: give a solid part", thickness=float(thickness))


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
        raise MeshError(f"{what}: save the one to machine by itself", parts=len(areas), areas=areas, place=place)
    told = f"dropped {len(others)} loose pieces of at most {others.max() / areas[largest]:.2%} of the part's area"
    return state.then(_compact(welded, pieces == largest), told)


def _state_after(state: _State, name: str, counted: str = "", sentence: str = "") -> _State:
    """`state` after one MeshLab filter, with its sentence where the counted elements changed."""
    meshset = to_meshset(state.mesh)
    getattr(meshset, name)()
    mesh = from_meshset(meshset)
    changed = abs(len(getattr(mesh, counted)) - len(getattr(state.mesh, counted))) if counted else 0
    return state.then(mesh, *((sentence.format(changed),) if changed else ()))


def _clean(state: _State) -> _State:
    """MeshLab's cleaning, then orientation, then holes."""
    for name, counted, sentence in _CLEANING:
        state = _state_after(state, name, counted, sentence)
    return _outward(_closed(_oriented(_one_part(state))))


def _oriented(state: _State) -> _State:
    """Faces of one piece oriented alike."""
    after = _state_after(state, "meshing_re_orient_faces_coherently").mesh
    turned = int((np.einsum("ij,ij->i", after.face_vectors, state.mesh.face_vectors) < 0).sum())
    turned = min(turned, len(after.faces) - turned)
    return state.then(after, *((f"turned {turned} faces round",) if turned else ()))


def _outward(state: _State) -> _State:
    if state.mesh.volume >= 0:
        return state
    return state.then(TriangleMesh(state.mesh.vertices, state.mesh.faces[:, ::-1]), "turned the whole surface outward")


def _closed(state: _State) -> _State:
    """Holes closed, the narrow ones and the wide ones up to WIDEST_HOLE."""
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
    return state.then(after, f"closed {closed} of {len(holes)} holes with {added} faces, the widest {widths[widest]:.2f} mm across")


def _without_intersections(state: _State) -> _State:
    """Up to three times: the faces that cut others taken out with their neighbours, and the gap closed."""
    for ring in range(1, 4):
        cut = self_intersections(state.mesh)
        if not len(cut):
            return state
        touched = np.isin(state.mesh.faces, state.mesh.faces[cut]).any(1) if ring > 1 else np.isin(np.arange(len(state.mesh.faces)), cut)
        if touched.all():
            return state
        state = _clean(state.then(_compact(state.mesh, ~touched), f"cut out {touched.sum()} faces at {len(cut)} that cut others"))
    return state


def _wrapped(state: _State) -> _State:
    """A new skin shrunk round the part."""
    size = state.mesh.diagonal
    pure = meshlab().PureValue
    meshset = to_meshset(state.mesh)
    meshset.generate_alpha_wrap(alpha=pure(WRAP_ALPHA * size), offset=pure(WRAP_OFFSET * size))
    told = f"shrank a new skin round the part (ball {WRAP_ALPHA * size:.2f} mm, offset {WRAP_OFFSET * size:.3f} mm)"
    return state.then(from_meshset(meshset), told)


def _compact(mesh: TriangleMesh, keep: ndarray) -> TriangleMesh:
    """The faces that are kept, with their vertices only."""
    used, faces = np.unique(mesh.faces[keep], return_inverse=True)
    return TriangleMesh(mesh.vertices[used], faces.reshape(-1, 3).astype(np.int32))


def _measured(before: TriangleMesh, state: _State) -> str:
    """The sentence with the largest distance from the corners and middles of the old faces to the new mesh; MeshError where it is too large."""
    corners = before.vertices[before.faces]
    points = np.concatenate([corners.reshape(-1, 3), corners.mean(1)])
    distances = np.linalg.norm(exact_closest(state.mesh, points)[0] - points, axis=1)
    worst = int(np.argmax(distances))
    if distances[worst] > LARGEST_DEVIATION * before.diagonal:
        where = ", ".join(f"{x:.2f}" for x in points[worst])
        what = f"the repair ({'; '.join(state.done)}) moves the surface by {distances[worst]:.2f} mm near ({where})"
        raise MeshError(f"{what}: mend the mesh there in a mesh editor", place=points[worst], tried=state.done)
    return f"moved no part of the surface by more than {distances[worst]:.3f} mm"
