"""One parameter grid for all levels of a morph, so that their tessellations correspond vertex by vertex.

Neighbouring levels that touch (at the stock's wall) then touch in their tessellations too, and what is measured
between them is not the difference of two chord errors. Rings lie closer where some level bends more along t.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int32
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.levels.stock import ring_faces
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tspline import TSpline

PROBES, LEAST_AROUND, LEAST_RINGS, PEAK = 160, 24, 12, 0.1


@dataclass(frozen=True, eq=False)
class LevelGrid:
    """Rings of `around` points at `rings` and the two poles; `R` (vertices, control points)."""

    rings: Float[ndarray, " m"]
    around: int
    R: sp.csr_array
    faces: Int32[ndarray, "f 3"]

    def mesh(self, control_points: Float[ndarray, "c 3"]) -> TriangleMesh:
        """The tessellation of the level with these control points."""
        return TriangleMesh(self.R @ control_points, self.faces)


def level_grid(surface: TSpline, levels: Sequence[Float[ndarray, "c 3"]], chord_tolerance: float) -> LevelGrid:
    """The grid on which every one of the levels is within about `chord_tolerance` of its surface.

    A step h leaves a chord error of h^2 |S''| / 8; half the tolerance goes to each direction.
    """
    low, high = surface.domain[1]
    t = np.linspace(low, high, PROBES + 2)[1:-1]
    s, tt = (v.ravel() for v in np.meshgrid(np.arange(PROBES) / PROBES, t))
    *_, R_ss, _, R_tt = surface.basis(s, tt, 2)
    bend_s, bend_t = np.zeros(len(s)), np.zeros(len(s))
    for control_points in levels:
        bend_s = np.maximum(bend_s, np.linalg.norm(R_ss @ control_points, axis=1))
        bend_t = np.maximum(bend_t, np.linalg.norm(R_tt @ control_points, axis=1))
    around = max(LEAST_AROUND, int(np.ceil(np.sqrt(bend_s.max() / (4 * chord_tolerance)))))
    rings = _rings(t, bend_t.reshape(PROBES, PROBES).max(1), low, high, chord_tolerance)
    gs, gt = (v.ravel() for v in np.meshgrid(np.arange(around) / around, rings))
    R = surface.basis(np.append(gs, [0.0, 0.0]), np.append(gt, [low, high]))[0]
    return LevelGrid(frozen(rings), around, R, frozen(ring_faces(len(rings), around), np.int32))


def _rings(t: ndarray, bend: ndarray, low: float, high: float, chord_tolerance: float) -> ndarray:
    """Ring parameters with steps sqrt(4 tolerance / bend), ends left out."""
    wide = np.maximum.reduce([np.roll(np.pad(bend, 1, mode="edge"), k)[1:-1] for k in (-1, 0, 1)])
    density = np.sqrt(np.maximum(wide, PEAK * wide.max()) / (4 * chord_tolerance))
    x = np.concatenate([[low], t, [high]])
    y = np.concatenate([density[:1], density, density[-1:]])
    total = np.concatenate([[0.0], np.cumsum(np.diff(x) * (y[1:] + y[:-1]) / 2)])
    count = max(LEAST_RINGS, int(np.ceil(total[-1])))
    return np.asarray(np.interp(np.linspace(0, total[-1], count + 1)[1:-1], total, x))
