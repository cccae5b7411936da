"""One parameter mesh for several surfaces over the same T-mesh, fine enough for each of them.

The mesh of `surface.tessellate` for the first surface is refined where the second one needs it, and so on:
every edge and face is measured on every surface, so that all their tessellations lie within the chord
tolerance and correspond vertex by vertex.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int32
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.tessellation.rings import ring_mesh
from bonecam.surface.tessellation.tessellate import MARGIN, ROUNDS, _Draft, _edges, _edges_to_split, _split_edges
from bonecam.surface.tmesh.surface import Surface


def shared_parameters(
    surfaces: Sequence[Surface], chord_tolerance: float
) -> tuple[Float[ndarray, "n 2"], Int32[ndarray, "m 3"]]:
    """(s, t) of the vertices (a pole's s is 0) and the faces; raises SurfaceError where the tolerance cannot
    be reached."""
    parameters, poles, faces = ring_mesh(surfaces[0], chord_tolerance)
    draft = _Draft(
        surface=surfaces[0],
        parameters=parameters,
        poles=poles,
        points=surfaces[0].positions(*parameters.T),
        faces=faces,
        fresh=np.ones(len(faces), dtype=bool),
    )
    for surface in surfaces:
        draft.surface = surface
        draft.points = surface.positions(*draft.parameters.T)
        draft.fresh = np.ones(len(draft.faces), dtype=bool)
        for _ in range(ROUNDS):
            edges, edge_of_face = _edges(draft.faces)
            marked = _edges_to_split(draft, edges, edge_of_face, MARGIN * chord_tolerance, None)
            if not marked.any():
                break
            _split_edges(draft, edges, edge_of_face, marked)
        else:
            raise SurfaceError(
                f"the surfaces cannot be tessellated together to {chord_tolerance} mm: raise the tolerance"
            )
    return draft.parameters, draft.faces.astype(np.int32)
