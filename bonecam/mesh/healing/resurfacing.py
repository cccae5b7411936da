"""A new surface of a damaged part: the outside of one that cuts itself, or a skin shrunk round it."""

import numpy as np

from bonecam.errors import counted
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.healing.components import keep_part
from bonecam.mesh.healing.repair_state import RepairState
from bonecam.mesh.meshlab import from_meshset, meshlab, to_meshset
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh

WRAP_ALPHA = 0.01
"""Radius of the ball that shrinks round the part, as a share of the diagonal."""
WRAP_OFFSET = 0.001
"""Distance from the part at which it stops, as a share of the diagonal."""


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
    meshset.generate_alpha_wrap(alpha=pure(WRAP_ALPHA * size), offset=pure(WRAP_OFFSET * size))
    message = f"shrank a new skin round the part (ball {WRAP_ALPHA * size:.2f} mm, offset {WRAP_OFFSET * size:.3f} mm)"
    return state.moved(from_meshset(meshset), message, state.mesh)
