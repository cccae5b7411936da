"""Isolines of a field on a closed mesh, each traced face by face as one loop.

A value that meets a vertex counts the vertex as below, so no isoline passes through a vertex and each crossed
face is crossed once, from the edge where the field falls to the edge where it rises (in the face's own
direction). Walking so keeps the higher side on the left seen from outside.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import MeshError
from bonecam.mesh.healing.topology import neighbours_of
from bonecam.mesh.triangle_mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class Isolines:
    """The isolines of `field`, a number at each vertex of a closed `mesh`; `neighbours` are those of its
    faces."""

    mesh: TriangleMesh
    field: Float[ndarray, " v"]
    neighbours: Int[ndarray, "m 3"]

    @classmethod
    def of(cls, mesh: TriangleMesh, field: Float[ndarray, " v"]) -> "Isolines":
        """Isolines of one number a vertex; MeshError where the mesh is not closed."""
        return cls(mesh, field, neighbours_of(mesh))

    def loop(self, value: float) -> Float[ndarray, "k 3"]:
        """The corners of the one closed isoline at `value`, higher side on the left; MeshError where it is
        none or several."""
        faces, rising = self._crossed(value)
        if not len(faces):
            raise MeshError(f"no isoline at {value:.6g}: give a value inside the field's range", value=value)
        order = self._walk(faces, rising)
        if len(order) != len(faces):
            place = self.mesh.vertices[self.mesh.faces[np.setdiff1d(faces, order)[0], 0]]
            where = ", ".join(f"{x:.2f}" for x in place)
            message = (
                f"the isoline at {value:.6g} falls into several loops, one near ({where}): the mesh has a "
                "handle or badly shaped faces"
            )
            raise MeshError(f"{message}; repair it or remesh it finer", value=value, place=place)
        return self._crossings(order, rising[np.searchsorted(faces, order)], value)

    def length(self, value: float) -> float:
        """Total length of the isoline at `value`, of all its loops."""
        faces, rising = self._crossed(value)
        falling = self._edges(self.field > value, faces, rises=False)
        ends = self._crossings(faces, rising, value) - self._crossings(faces, falling, value)
        return float(np.linalg.norm(ends, axis=1).sum())

    def area_below(self, value: float) -> float:
        """Area of the surface where the field is below `value`, exact on each face."""
        low, middle, high = self._sorted_corners
        cut_low = (value - low) ** 2 / ((middle - low) * (high - low) + np.finfo(float).tiny)
        cut_high = 1 - (high - value) ** 2 / ((high - middle) * (high - low) + np.finfo(float).tiny)
        share = np.select([value <= low, value < middle, value < high], [np.zeros_like(low), cut_low, cut_high], 1.0)
        return float(share @ self._areas)

    @cached_property
    def _sorted_corners(self) -> Float[ndarray, "3 m"]:
        return np.sort(self.field[self.mesh.faces], axis=1).T

    @cached_property
    def _areas(self) -> Float[ndarray, " m"]:
        return np.asarray(np.linalg.norm(self.mesh.face_vectors, axis=1) / 2)

    def _crossed(self, value: float) -> tuple[Int[ndarray, " k"], Int[ndarray, " k"]]:
        """The crossed faces in rising order, and for each the local edge (from its vertex to the next) where
        the field rises."""
        above = self.field > value
        count = above[self.mesh.faces].sum(1)
        faces = np.flatnonzero((count > 0) & (count < 3))
        return faces, self._edges(above, faces, rises=True)

    def _edges(self, above: Bool[ndarray, " v"], faces: Int[ndarray, " k"], *, rises: bool) -> Int[ndarray, " k"]:
        """The local edge of each crossed face where the field rises through the value, or falls."""
        corners = above[self.mesh.faces[faces]]
        following = np.roll(corners, -1, axis=1)
        return np.argmax((~corners & following) if rises else (corners & ~following), axis=1)

    def _walk(self, faces: Int[ndarray, " k"], rising: Int[ndarray, " k"]) -> Int[ndarray, " n"]:
        """The crossed faces in the order of the loop that begins at the first of them."""
        successor = np.searchsorted(faces, self.neighbours[faces, rising]).tolist()
        order = [0]
        here = successor[0]
        while here != 0:
            order.append(here)
            here = successor[here]
        return faces[order]

    def _crossings(self, faces: Int[ndarray, " k"], edges: Int[ndarray, " k"], value: float) -> Float[ndarray, "k 3"]:
        """Where the isoline crosses one edge of each face."""
        start = self.mesh.faces[faces, edges]
        end = self.mesh.faces[faces, (edges + 1) % 3]
        share = (value - self.field[start]) / (self.field[end] - self.field[start])
        return self.mesh.vertices[start] + share[:, None] * (self.mesh.vertices[end] - self.mesh.vertices[start])
