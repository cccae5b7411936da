"""A level as it is measured: its tessellation, for the way to the nearest place, and the surface itself, for
the distance.

A tessellation lies up to its chord tolerance off the surface, which is more than levels may be off. So a
point's nearest place on the mesh is where Newton starts on the surface; what is said of a level is the
distance to its surface.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.levels.measure.grid import LevelGrid
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.query.closest_point import closest_points_near
from bonecam.surface.tspline import TSpline

STEPS, CLOSE_STEPS, DOUBTFUL, CHORDS = 3, 20, 0.1, 2.0
"""Rays tell the side of points that are more than DOUBTFUL mm and CHORDS chord tolerances off."""


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

    def apart(self, points: Float[ndarray, "n 3"], parameters: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
        """Distance (mm) of points from the foot that Newton finds from these parameters: never too near."""
        return np.abs(self._from(points, parameters, STEPS)[0])

    def signed(
        self, points: Float[ndarray, "n 3"], parameters: Float[ndarray, "n 2"]
    ) -> Float[ndarray, " n"]:
        """The same, negative inside."""
        return self._sided(points, self._from(points, parameters, STEPS)[0])

    def closely(
        self, points: Float[ndarray, "n 3"], parameters: Float[ndarray, "n 2"] | None = None
    ) -> tuple[ndarray, ndarray]:
        """The same with more steps, from the nearest place on the mesh too: the nearer foot. And the
        parameters (n, 2) of the feet."""
        distance, places = self._from_mesh(points, CLOSE_STEPS)
        if parameters is not None:
            own, own_places = self._from(points, parameters, CLOSE_STEPS)
            nearer = np.abs(own) < np.abs(distance)
            distance, places = np.where(nearer, own, distance), np.where(nearer[:, None], own_places, places)
        return self._sided(points, distance), places

    def _from(self, points: ndarray, parameters: ndarray, steps: int) -> tuple[ndarray, ndarray]:
        """Signed distances and the parameters of the feet, by Newton from the given ones."""
        s, t, foot, n = closest_points_near(self.surface, points, parameters[:, 0], parameters[:, 1], steps)
        across = points - foot
        return np.copysign(np.linalg.norm(across, axis=1), dots(across, n)), np.column_stack([s, t])

    def _from_mesh(self, points: ndarray, steps: int) -> tuple[ndarray, ndarray]:
        """The same from the nearest corner of the nearest face."""
        nearest, face = self.distance.closest(points)
        corners = self.grid.faces[face]
        away = np.linalg.norm(self.mesh.vertices[corners] - nearest[:, None], axis=2)
        return self._from(
            points, self.grid.parameters[corners[np.arange(len(points)), np.argmin(away, axis=1)]], steps
        )

    def _sided(self, points: ndarray, distance: ndarray) -> ndarray:
        """Beyond a crease the nearest place's own side misleads: of what is farther off than the mesh can be,
        rays tell the side."""
        far = np.flatnonzero(np.abs(distance) > max(DOUBTFUL, CHORDS * self.grid.chord_tolerance))
        if len(far):
            distance[far] = np.abs(distance[far]) * np.where(self.distance.inside(points[far]), -1.0, 1.0)
        return distance
