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
"""Every so many levels take part in the choice of the grid."""
SEAM = 0.5
"""Corners of a face whose s are farther apart than this share of a turn lie on both sides of the seam."""


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

    @property
    def sample_parameters(self) -> Float[ndarray, "n 2"]:
        """Parameters of the vertices, then of the faces' middles."""
        return np.vstack([self.parameters, self.middles])

    def mesh(self, control_points: Float[ndarray, "c 3"]) -> TriangleMesh:
        """The tessellation of the level with these control points."""
        return TriangleMesh(self.R @ control_points, self.faces)

    def points(self, control_points: Float[ndarray, "c 3"]) -> Float[ndarray, "n 3"]:
        """Points of the level with these control points at `sample_parameters`."""
        return np.vstack([self.R @ control_points, self.R_middles @ control_points])


def level_grid(surface: TSpline, levels: Sequence[Float[ndarray, "c 3"]], chord_tolerance: float) -> LevelGrid:
    """The grid on which the levels are within about `chord_tolerance` of their surfaces."""
    chosen = [*levels[:-1:STRIDE], levels[-1]]
    parameters, faces = shared_parameters(
        [surface.with_control_points(np.asarray(P)) for P in chosen[::-1]], chord_tolerance
    )
    low, high = surface.domain[1]
    off_poles = (parameters[faces, 1] > low) & (parameters[faces, 1] < high)
    corner = np.take_along_axis(faces, np.argmax(off_poles, axis=1)[:, None], axis=1)[:, 0]
    own = np.where(off_poles.any(1)[:, None], off_poles, True)

    # (s, t) in the middle of each face; s within half a turn of `first`, the mean over the corners that have an s of
    # their `own`, which poles have not
    first = parameters[corner, 0]
    offset = parameters[faces, 0] - first[:, None]
    offset -= np.round(offset) * (np.abs(offset) > SEAM)
    s = first + (offset * own).sum(1) / own.sum(1)
    middles = np.column_stack([np.mod(s, 1.0), parameters[faces, 1].mean(1)])

    return _grid(surface, parameters, middles, faces, chord_tolerance)


def open_level_grid(surface: TSpline, target: TSpline, chord_tolerance: float) -> LevelGrid:
    """The grid of an open surface and of the levels up to `target`, over the same T-mesh: the tessellation of
    whichever of the two needs more faces."""
    tessellations = [each.tessellate_with_parameters(chord_tolerance) for each in (surface, target)]
    finer = max(tessellations, key=lambda tessellation: len(tessellation.mesh.faces))
    faces = finer.mesh.faces

    # (s, t) in the middle of each face, also where it lies across a seam; a period of 0 means none
    period = surface.elements().period
    first = finer.parameters[faces[:, 0]]
    turn = np.array(period)
    offset = finer.parameters[faces] - first[:, None]
    offset -= turn * np.round(offset / np.where(turn > 0, turn, 1.0))
    middles = first + offset.mean(1)

    return _grid(surface, finer.parameters, middles, faces, chord_tolerance)


def _grid(surface: TSpline, parameters: ndarray, middles: ndarray, faces: ndarray, chord_tolerance: float) -> LevelGrid:
    """The grid with these parameters of vertices and faces' middles."""
    R = surface.basis(*parameters.T)[0]
    R_middles = surface.basis(*middles.T)[0]
    faces = frozen(faces, np.int32)
    return LevelGrid(
        frozen(parameters), frozen(middles), R=R, R_middles=R_middles, faces=faces, chord_tolerance=chord_tolerance
    )
