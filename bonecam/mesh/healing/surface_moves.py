"""How far a repair moved the surface, outward and inward."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import exact_closest
from bonecam.mesh.triangle_mesh import TriangleMesh

ASIDE = 1e-4
"""How far beside a face its two sides are looked at, as a share of the diagonal."""


@dataclass(frozen=True, eq=False)
class Moves:
    """Largest distances, mm, from the old surface to the new one: `outward` of old points that lie in the new solid
    (something was added over them), `inward` of those outside it; `place` is the point of the larger."""

    outward: float
    inward: float
    place: Float[ndarray, "3"]

    @property
    def largest(self) -> float:
        """The larger of both, mm."""
        return max(self.outward, self.inward)


def surface_moves(before: TriangleMesh, after: TriangleMesh, solid: TriangleMesh | None = None) -> Moves:
    """How far the corners and middles of the old faces are from the new surface.

    Old faces with material on both sides, as the closed `solid` tells where it is given, lie inside another part of
    the surface: they are no outside and do not count.
    """
    corners = before.vertices[before.faces]
    middles = corners.mean(1, keepdims=True)
    points = np.concatenate([corners, middles], axis=1)
    places = points.reshape(-1, 3)
    distances = np.linalg.norm(exact_closest(after, places)[0] - places, axis=1)
    if solid is not None:
        vectors = before.face_vectors[:, None]
        normals = vectors / np.maximum(np.linalg.norm(vectors, axis=2, keepdims=True), np.finfo(float).tiny)
        aside = normals * before.diagonal * ASIDE
        inset = points + ASIDE * (middles - points)
        covered = [winding_numbers(solid, (inset + side * aside).reshape(-1, 3)) > 0.5 for side in (1, -1)]
        distances[covered[0] & covered[1]] = 0.0
    inside = np.abs(winding_numbers(after, places)) > 0.5
    outward, inward = (float(distances[which].max(initial=0.0)) for which in (inside, ~inside))
    return Moves(outward, inward, places[int(np.argmax(distances))])


def winding_numbers(mesh: TriangleMesh, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """How often the mesh goes round each point: about 1 inside, 0 outside, -1 inside a mesh that is inside out.

    The mesh need not be closed (Barill et al. 2018).
    """
    import igl

    vertices = np.array(mesh.vertices)
    return np.asarray(igl.fast_winding_number(vertices, mesh.faces.astype(np.int64), points)).ravel()
