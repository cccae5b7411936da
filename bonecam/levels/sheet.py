"""A level as it is measured: its tessellation, for the way to the nearest place, and the surface itself, for the distance.

A tessellation lies up to its chord tolerance off the surface, which is more than levels may be off. So a point's nearest place on
the mesh is where Newton starts on the surface; what is said of a level is the distance to its surface.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int32
from numpy import ndarray

from bonecam.levels.grid import LevelGrid
from bonecam.levels.limits import feet
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tspline import TSpline

STEPS, CLOSE_STEPS, DOUBTFUL = 3, 20, 0.1


@dataclass(frozen=True, eq=False)
class Sheet:
    """One level on the shared grid."""

    surface: TSpline
    grid: LevelGrid

    @cached_property
    def mesh(self) -> TriangleMesh:
        """The tessellation."""
        return self.grid.mesh(self.surface.control_points)

    @cached_property
    def distance(self) -> MeshDistance:
        """To the tessellation."""
        return MeshDistance(self.mesh)

    @cached_property
    def points(self) -> Float[ndarray, "n 3"]:
        """Points of the surface: the mesh's vertices, then those in the middle of every face."""
        return np.vstack([self.mesh.vertices, self.grid.R_middles @ self.surface.control_points])

    @property
    def parameters(self) -> Float[ndarray, "n 2"]:
        """Theirs."""
        return np.vstack([self.grid.parameters, self.grid.middles])

    def signed(self, points: Float[ndarray, "n 3"], corner: Int32[ndarray, " f"]) -> Float[ndarray, " n"]:
        """Distance (mm, negative inside) of vertices, found on the mesh, and of the points in the middle of faces behind them.

        These are looked for from the feet of a vertex of theirs, `corner`: too far off now and then, never too near.
        """
        count = len(points) - len(corner)
        distance = np.empty(len(points))
        distance[:count], s, t = self._from_mesh(points[:count], STEPS)
        _, _, foot, n = feet(self.surface, points[count:], s[corner], t[corner], STEPS)
        distance[count:] = _signed(points[count:], foot, n)
        return self._inside_out(points, distance)

    def closely(self, points: Float[ndarray, "n 3"], parameters: Float[ndarray, "n 2"] | None = None) -> Float[ndarray, " n"]:
        """The same of any points, with more steps, from the nearest place on the mesh and from these parameters: the nearer foot."""
        distance = self._from_mesh(points, CLOSE_STEPS)[0]
        if parameters is None:
            return self._inside_out(points, distance)
        _, _, foot, n = feet(self.surface, points, parameters[:, 0], parameters[:, 1], CLOSE_STEPS)
        own = _signed(points, foot, n)
        return self._inside_out(points, np.where(np.abs(own) < np.abs(distance), own, distance))

    def _from_mesh(self, points: ndarray, steps: int) -> tuple[ndarray, ndarray, ndarray]:
        """Signed distances and the parameters of the feet, looked for from the nearest corner of the nearest face."""
        nearest, face = self.distance.closest(points)
        corners = self.grid.faces[face]
        away = np.linalg.norm(self.mesh.vertices[corners] - nearest[:, None], axis=2)
        start = self.grid.parameters[corners[np.arange(len(points)), np.argmin(away, axis=1)]]
        s, t, foot, n = feet(self.surface, points, start[:, 0], start[:, 1], steps)
        return _signed(points, foot, n), s, t

    def _inside_out(self, points: ndarray, distance: ndarray) -> ndarray:
        """Beyond a crease the nearest place's own side misleads: what seems far outside is asked by rays."""
        doubtful = np.flatnonzero(distance > DOUBTFUL)
        if len(doubtful):
            distance[doubtful] *= np.where(self.distance.inside(points[doubtful]), -1.0, 1.0)
        return distance


def _signed(points: ndarray, foot: ndarray, n: ndarray) -> ndarray:
    across = points - foot
    return np.asarray(np.copysign(np.linalg.norm(across, axis=1), np.einsum("ij,ij->i", across, n)))
