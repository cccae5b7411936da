"""How far a repair moved the surface, outward and inward, and what it left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths, unit
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces, probes, side_by_side

ASIDE = 1e-4
"""How far beside a face its two sides are looked at, as a share of the diagonal."""
NOT_MOVED = 1e-9
"""Distances up to this are rounding, mm."""
FIRST_LOOKED_AT = 1000
"""Of so many farthest points the side is looked at first, of twice as many then, until both sides are met."""


@dataclass(frozen=True, eq=False)
class SurfaceMovement:
    """Largest distances, mm, from the old surface to the new one: `outward` of old points that lie in the new solid
    (something was added over them), `inward` of those outside it; `place` is the point of the larger."""

    outward: float
    inward: float
    place: Float[ndarray, "3"]

    @property
    def largest(self) -> float:
        """The larger of both, mm."""
        return max(self.outward, self.inward)


def surface_moves(before: TriangleMesh, after: TriangleMesh, solid: TriangleMesh | None = None) -> SurfaceMovement:
    """How far the corners and middles of the old faces are from the new surface.

    Old faces with material on both sides, as the closed `solid` tells where it is given, lie inside another part of
    the surface: they are no outside and do not count.
    """
    points = probes(before) if solid is None else _outside(before, solid)
    distances = np.linalg.norm(exact_closest(after, points)[0] - points, axis=1)
    order = np.argsort(-distances, kind="stable")
    farthest: dict[bool, float] = {}
    start = 0
    count = FIRST_LOOKED_AT
    while len(farthest) < 2 and start < len(order) and distances[order[start]] > NOT_MOVED:
        some = order[start : start + count]
        inside = np.abs(winding_numbers(after, points[some])) > 0.5
        for side in (True, False):
            if side not in farthest and (inside == side).any():
                farthest[side] = float(distances[some[np.argmax(inside == side)]])
        start += count
        count *= 2
    return SurfaceMovement(
        farthest.get(True, 0.0), farthest.get(False, 0.0), points[order[0]] if len(order) else np.zeros(3)
    )


def _outside(mesh: TriangleMesh, solid: TriangleMesh) -> Float[ndarray, "n 3"]:
    """Corners and middles of the faces that have the material of the closed `solid` on one side at most there."""
    corners = mesh.vertices[mesh.faces]
    middles = corners.mean(1, keepdims=True)
    points = np.concatenate([corners, middles], axis=1)
    aside = unit(mesh.face_vectors)[:, None] * mesh.diagonal * ASIDE
    inset = points + ASIDE * (middles - points)
    covered = [winding_numbers(solid, (inset + side * aside).reshape(-1, 3)) > 0.5 for side in (1, -1)]
    return points.reshape(-1, 3)[~(covered[0] & covered[1])]


def winding_numbers(mesh: TriangleMesh, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """How often the mesh goes round each point: about 1 inside, 0 outside, -1 inside a mesh that is inside out.

    The mesh need not be closed (Barill et al. 2018).
    """
    import igl

    vertices = np.array(mesh.vertices)
    return np.asarray(igl.fast_winding_number(vertices, mesh.faces.astype(np.int64), points)).ravel()


def without(mesh: TriangleMesh, left_out: Sequence[TriangleMesh], kept: TriangleMesh) -> TriangleMesh:
    """The mesh as it was before a repair, without the faces that are nearer to what was left out than to what was
    kept."""
    if not left_out:
        return mesh
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    away, apart = (lengths(exact_closest(other, middles)[0] - middles) for other in (kept, side_by_side(left_out)))
    return keep_faces(mesh, away <= apart + NOT_MOVED)
