"""Repair: make one closed, manifold, outward, genus-0 part of a mesh, and say what was changed.

Seams are merged, debris and inner shells left out, where they are: the rest keeps its vertices to the bit. Then
three stages, each tried only where the one before left faults: cleaning in the order that worked (duplicates,
null faces, non-manifold edges, reorient, **then** close holes); the outside of a surface that cuts itself (an
exact union, Zhou et al. 2016: it keeps every visible face where it is); and last a new skin shrunk round the
cleaned part (alpha wrap, Portaneri et al. 2022). What comes out is checked and measured against what came in;
a surface that moved by more than `LARGEST_DEVIATION` of the diagonal is refused. Handles are never cut, parts
never chosen or fused: that is for a person to decide.
"""

import numpy as np

from bonecam.errors import MeshError, counted, place_name
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.healing.cleaning import clean, drop_fins, drop_unused, tidy
from bonecam.mesh.healing.components import keep_part
from bonecam.mesh.healing.mesh_faults import Fault, faults_of
from bonecam.mesh.healing.repair_state import Repair, RepairState
from bonecam.mesh.healing.seams import weld_seams
from bonecam.mesh.healing.surface_moves import SurfaceMovement, surface_moves
from bonecam.mesh.meshlab import from_meshset, meshlab, to_meshset
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, report, silent

LARGEST_DEVIATION = 0.02
"""Largest distance between the mesh before and after, as a share of the diagonal."""
FLAT = 1e-3
"""Least thickness of a solid, as a share of the diagonal."""
_REMEDIES = {
    "genus": "fill the opening in a mesh editor",
    "parts": "save the one to machine by itself",
    "open": "close it in a mesh editor",
}


def repair(mesh: TriangleMesh, *, progress: Progress = silent) -> tuple[TriangleMesh, tuple[Repair, ...]]:
    """One closed, manifold, outward part of genus 0 without self-intersections, and what was changed.

    MeshError names what is wrong, where (mm), what was tried, and the remedy; its evidence has `place` and
    `tried`.
    """
    report(progress, 0.0, "looking for faults")
    _refuse_flat(mesh)
    kept = keep_part(drop_fins(drop_unused(weld_seams(RepairState(mesh)))))
    faults = faults_of(kept.mesh)
    if not faults:
        return kept.mesh, kept.done
    _refuse_handles(faults, kept)

    tidied = tidy(kept)
    cleaned = clean(tidied)
    trouble = _refusal(faults, kept)
    for k, stage in enumerate((_as_cleaned, unite, wrap)):
        report(progress, (k + 1) / 4, f"repairing: {faults[0]}")
        state = stage(cleaned)
        remaining = faults_of(state.mesh)
        if remaining:
            _refuse_handles(remaining, state)
            trouble = _refusal(remaining, state)
            continue
        moves = surface_moves(tidied.mesh, state.mesh, cleaned.mesh)
        if moves.largest <= LARGEST_DEVIATION * kept.mesh.diagonal:
            return state.mesh, state.done
        trouble = _deviation_refusal(moves, state)
    raise trouble


def _as_cleaned(state: RepairState) -> RepairState:
    """The cleaned mesh itself, which may be good enough."""
    return state


def _refuse_handles(faults: tuple[Fault, ...], state: RepairState) -> None:
    """MeshError where a mesh has no faults but handles (and self-intersections): no stage removes handles."""
    if any(fault.kind == "genus" for fault in faults) and {fault.kind for fault in faults} <= {"genus", "intersecting"}:
        raise _refusal(tuple(fault for fault in faults if fault.kind == "genus"), state)


def _refusal(faults: tuple[Fault, ...], state: RepairState) -> MeshError:
    tried = f" after repair ({state.changes})" if state.done else ""
    remedy = next(
        (_REMEDIES[fault.kind] for fault in faults if fault.kind in _REMEDIES), "mend it there in a mesh editor"
    )
    message = f"the mesh has {', '.join(map(str, faults))}{tried}: {remedy}"
    return MeshError(message, faults=faults, place=faults[0].place, tried=state.done)


def _deviation_refusal(moves: SurfaceMovement, state: RepairState) -> MeshError:
    what = f"the repair ({state.changes}) moves the surface by {moves.largest:.2f} mm near {place_name(moves.place)}"
    return MeshError(f"{what}: mend the mesh there in a mesh editor", place=moves.place, tried=state.done)


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
        what = (
            f"the mesh ({faces}) is flat: {round(float(thickness), 9):.3g} mm thick, {size:.3g} mm from "
            "corner to corner"
        )
        raise MeshError(f"{what}: give a solid part", thickness=float(thickness))


WRAP_ALPHA = 0.01
"""Radius of the ball that shrinks round the part, as a share of the diagonal."""
WRAP_OFFSET = 0.001
"""Distance from the part at which it stops, as a share of the diagonal."""
OFF = 3.0
"""So many times that distance from the old surface the new skin is a guess."""


def unite(state: RepairState) -> RepairState:
    """The outside of a surface that cuts itself: the exact boundary of what it encloses at least once (Zhou et al.
    2016); the mesh as it is where it encloses no volume.
    """
    import igl.copyleft.cgal as cgal

    try:
        vertices, faces, _ = cgal.mesh_boolean(
            np.array(state.mesh.vertices), state.mesh.faces.astype(np.int64), type_str="union"
        )
    except RuntimeError:
        return state
    after = TriangleMesh(vertices, np.asarray(faces, dtype=np.int32))
    if not len(after.faces):
        return state
    depth = np.linalg.norm(exact_closest(after, state.mesh.vertices)[0] - state.mesh.vertices, axis=1)
    cut = len(self_intersections(state.mesh))
    what = f"the outside of {counted(cut, 'face')} that cut each other" if cut else "the outside only"
    message = f"kept {what} (what lay up to {depth.max():.2f} mm inside is gone)"
    return keep_part(state.moved(after, message, state.mesh))


def wrap(state: RepairState) -> RepairState:
    """A new skin shrunk round the part (alpha wrap, Portaneri et al. 2022)."""
    size = state.mesh.diagonal
    pure = meshlab().PureValue
    meshset = to_meshset(state.mesh)
    shares = {"alpha": WRAP_ALPHA, "offset": WRAP_OFFSET}
    if "alpha" in meshset.filter_parameter_values("generate_alpha_wrap"):
        given = {name: pure(share * size) for name, share in shares.items()}
    else:  # MeshLab up to 2023.12
        given = {f"{name}_fraction": share for name, share in shares.items()}
    meshset.generate_alpha_wrap(**given)
    message = f"shrank a new skin round the part (ball {WRAP_ALPHA * size:.2f} mm, offset {WRAP_OFFSET * size:.3f} mm)"
    return state.moved(from_meshset(meshset), message, state.mesh, off=OFF * WRAP_OFFSET * size)
