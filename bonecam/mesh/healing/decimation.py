"""Large meshes with fewer faces: quadric edge collapse (Garland and Heckbert 1997), by MeshLab, measured.

The later stages need memory and time for every face, and gain nothing from faces that are much smaller than
the deviation of the surface that is fitted (0.08 mm).
"""

import numpy as np

from bonecam.errors import MeshError
from bonecam.mesh.distance import hausdorff
from bonecam.mesh.healing.cleaning import drop_unused
from bonecam.mesh.healing.repair_state import Repair, RepairState
from bonecam.mesh.healing.seams import weld_seams
from bonecam.mesh.meshlab import from_meshset, to_meshset
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, report, silent

MOST_FACES = 50_000
"""A mesh of more faces is decimated to so many, 0.0025 mm apart on a phalanx of
28 mm with 571,904 faces."""
LARGEST_DEVIATION = 0.008
"""Largest distance between the mesh before and after, either way, mm: a tenth of the fit's default tolerance."""
TRIES = 2
"""Numbers of faces that are tried: each time twice as many."""


def decimate(
    mesh: TriangleMesh, most: int = MOST_FACES, *, progress: Progress = silent
) -> tuple[TriangleMesh, tuple[Repair, ...]]:
    """The mesh (mm) with at most `most` faces, its seams merged before, and what was changed; a mesh that has no more
    comes back as it is.

    Twice as many where fewer move the surface by more than LARGEST_DEVIATION, MeshError where that moves it
    too.
    """
    if len(mesh.faces) <= most:
        return mesh, ()
    state = drop_unused(weld_seams(RepairState(mesh)))
    deviation = np.inf
    for k in range(TRIES):
        target = most * 2**k
        report(progress, k / TRIES, f"decimating {len(mesh.faces)} faces to {target}")
        fewer = _collapse_edges(state.mesh, target)
        if not 0 < len(fewer.faces) <= target:
            continue
        deviation = max(hausdorff(mesh, fewer))
        if deviation <= LARGEST_DEVIATION:
            message = f"decimated {len(mesh.faces)} faces to {len(fewer.faces)}, {deviation:.4f} mm apart at most"
            return fewer, state.moved(fewer, message).done
    moved = f"moves the surface by {deviation:.3f} mm" if np.isfinite(deviation) else "is not possible"
    raise MeshError(
        f"the mesh has {len(mesh.faces)} faces, and decimating it to {most * 2 ** (TRIES - 1)} {moved}: smooth "
        f"it, or decimate it to {most} in a mesh editor",
        faces=len(mesh.faces),
        deviation=deviation,
    )


def _collapse_edges(mesh: TriangleMesh, target: int) -> TriangleMesh:
    """The mesh with edges collapsed until `target` faces are left."""
    meshset = to_meshset(mesh)
    meshset.meshing_decimation_quadric_edge_collapse(
        targetfacenum=target, preservenormal=True, preserveboundary=True, preservetopology=True
    )
    return from_meshset(meshset)
