"""One parameter mesh for all levels of a morph, so that their tessellations correspond vertex by vertex.

Neighbouring levels that touch then touch in their tessellations too, and what is measured between them is not
the difference of two chord errors. Fine only where one of the levels needs it: of every STRIDE-th level, the
first and the last.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int32
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tessellation.shared import shared_parameters
from bonecam.surface.tspline import TSpline

STRIDE = 3
TURN = 0.5  # of s: corners of a face that are farther apart lie on both sides of the seam


@dataclass(frozen=True, eq=False)
class LevelGrid:
    """Parameters (s, t) of the vertices and of the faces' middles, the basis `R`, `R_middles` there, and the
    faces.

    The tessellations lie within about `chord_tolerance` mm of the levels.
    """

    parameters: Float[ndarray, "v 2"]
    middles: Float[ndarray, "f 2"]
    R: sp.csr_array
    R_middles: sp.csr_array
    faces: Int32[ndarray, "f 3"]
    chord_tolerance: float

    def mesh(self, control_points: Float[ndarray, "c 3"]) -> TriangleMesh:
        """The tessellation of the level with these control points."""
        return TriangleMesh(self.R @ control_points, self.faces)


def level_grid(
    surface: TSpline, levels: Sequence[Float[ndarray, "c 3"]], chord_tolerance: float
) -> LevelGrid:
    """The grid on which the levels are within about `chord_tolerance` of their surfaces."""
    chosen = [*levels[:-1:STRIDE], levels[-1]]
    parameters, faces = shared_parameters(
        [surface.with_control_points(np.asarray(P)) for P in chosen[::-1]], chord_tolerance
    )
    low, high = surface.domain[1]
    inner = (parameters[faces, 1] > low) & (parameters[faces, 1] < high)
    corner = np.take_along_axis(faces, np.argmax(inner, axis=1)[:, None], axis=1)[:, 0]
    middles = _middles(parameters, faces, parameters[corner, 0], np.where(inner.any(1)[:, None], inner, True))
    R, R_middles = (surface.basis(p[:, 0], p[:, 1])[0] for p in (parameters, middles))
    return LevelGrid(
        frozen(parameters), frozen(middles), R, R_middles, frozen(faces, np.int32), chord_tolerance
    )


def _middles(parameters: ndarray, faces: ndarray, first: ndarray, own: ndarray) -> ndarray:
    """(s, t) in the middle of each face, near `first` round the seam; s over the corners that have one of
    their `own`."""
    offset = parameters[faces, 0] - first[:, None]
    offset -= np.round(offset) * (np.abs(offset) > TURN)
    s = first + (offset * own).sum(1) / own.sum(1)
    return np.column_stack([np.mod(s, 1.0), parameters[faces, 1].mean(1)])
