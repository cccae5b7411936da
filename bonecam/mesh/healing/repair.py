"""Repair: make one closed, manifold, outward, genus-0 part of a mesh, and say what was changed.

Three stages, each tried only where the one before left faults: cleaning in the order that worked (duplicates,
null faces, non-manifold edges, reorient, **then** close holes); the outside of a surface that cuts itself (an
exact union, Zhou et al. 2016: it keeps every visible face where it is); and last a new skin shrunk round the
cleaned part (alpha wrap, Portaneri et al. 2022). What comes out is checked and measured against what came in;
a surface that moved by more than `LARGEST_DEVIATION` of the diagonal is refused. Handles are never cut, parts
never chosen or fused: that is for a person to decide.
"""

import numpy as np
from numpy import ndarray

from bonecam.errors import MeshError, place_name
from bonecam.mesh.healing.cleaning import clean, drop_unused_vertices, keep_largest_piece, tidy
from bonecam.mesh.healing.faults import Fault, faults_of
from bonecam.mesh.healing.repair_deviation import largest_deviation
from bonecam.mesh.healing.repair_state import RepairState
from bonecam.mesh.healing.resurfacing import unite, wrap
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, report, silent

LARGEST_DEVIATION = 0.02
"""Largest distance between the mesh before and after, as a share of the diagonal."""
TOLD = 5e-4
"""Least deviation that the report tells, mm: what its three decimals show."""
FLAT = 1e-3
"""Least thickness of a solid, as a share of the diagonal."""
_REMEDIES = {
    "genus": "fill the opening in a mesh editor",
    "parts": "save the one to machine by itself",
    "open": "close it in a mesh editor",
}


def repair(mesh: TriangleMesh, *, progress: Progress = silent) -> tuple[TriangleMesh, tuple[str, ...]]:
    """One closed, manifold, outward part of genus 0 without self-intersections, and sentences that tell what
    was changed.

    MeshError names what is wrong, where (mm), what was tried, and the remedy; its evidence has `place` and
    `tried`.
    """
    report(progress, 0.0, "looking for faults")
    _refuse_flat(mesh)
    kept = keep_largest_piece(drop_unused_vertices(RepairState(mesh)))
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
        found = faults_of(state.mesh)
        if found:
            _refuse_handles(found, state)
            trouble = _refusal(found, state)
            continue
        deviation, place = largest_deviation(tidied.mesh, cleaned.mesh, state.mesh)
        if deviation <= LARGEST_DEVIATION * kept.mesh.diagonal:
            told = f"moved no part of the surface by more than {deviation:.3f} mm"
            return state.mesh, (*state.done, *((told,) if deviation >= TOLD else ()))
        trouble = _deviation_refusal(deviation, place, state)
    raise trouble


def _as_cleaned(state: RepairState) -> RepairState:
    """The cleaned mesh itself, which may be good enough."""
    return state


def _refuse_handles(faults: tuple[Fault, ...], state: RepairState) -> None:
    """MeshError where a mesh has no faults but handles (and self-intersections): no stage removes handles."""
    if any(fault.kind == "genus" for fault in faults) and {fault.kind for fault in faults} <= {
        "genus",
        "intersecting",
    }:
        raise _refusal(tuple(fault for fault in faults if fault.kind == "genus"), state)


def _refusal(faults: tuple[Fault, ...], state: RepairState) -> MeshError:
    tried = f" after repair ({'; '.join(state.done)})" if state.done else ""
    remedy = next(
        (_REMEDIES[fault.kind] for fault in faults if fault.kind in _REMEDIES),
        "mend it there in a mesh editor",
    )
    message = f"the mesh has {', '.join(map(str, faults))}{tried}: {remedy}"
    return MeshError(message, faults=faults, place=faults[0].place, tried=state.done)


def _deviation_refusal(distance: float, place: ndarray, state: RepairState) -> MeshError:
    what = f"the repair ({'; '.join(state.done)}) moves the surface by {distance:.2f} mm near {place_name(place)}"
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
        what = (
            f"the mesh ({faces}) is flat: {round(float(thickness), 9):.3g} mm thick, {size:.3g} mm from "
            "corner to corner"
        )
        raise MeshError(f"{what}: give a solid part", thickness=float(thickness))
