"""Undercut hollows, as pores with a narrow mouth: cut out and closed over by new faces.

The walls of such a hollow cannot be moved into its mouth without lying over one another. They go, and the hole that
they leave is triangulated.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.healing.topology import edges_of, genus, neighbour_middles, pieces_of
from bonecam.mesh.meshlab import from_meshset, to_meshset
from bonecam.mesh.remeshing import bisect_faces
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh

ON = 1e-6
"""A face whose middle is nearer than this, mm, to what was left of the surface belongs to it and not to a cap."""
SMOOTHINGS = 20
"""Rounds in which the points inside caps are put where they belong, at most: each after one that moved them to the
middle of their neighbours, as faces of the one before cut each other."""


@dataclass(frozen=True, eq=False)
class Capped:
    """A closed mesh some faces of which were replaced by caps; `old` are the numbers that its vertices had before, of
    which those in caps (the last) have none."""

    mesh: TriangleMesh
    old: Int[ndarray, " k"]


def cap_folds(
    mesh: TriangleMesh,
    hollow: Bool[ndarray, " v"],
    onto_ball: Float[ndarray, "v 3"],
    longest: float,
    onto: Callable[[Float[ndarray, "n 3"]], Float[ndarray, "n 3"]],
) -> Capped | None:
    """The mesh with the vertices of a `hollow` moved to `onto_ball`, and with caps in place of the faces there that cut
    each other then: as few of those round them as are needed, all of the hollow at most. `longest`, `onto` and what
    comes back are those of `cap`."""
    moved = TriangleMesh(np.where(hollow[:, None], onto_ball, mesh.vertices), mesh.faces)
    walls = hollow[mesh.faces].all(axis=1)
    out = np.zeros(len(walls), dtype=bool)
    out[self_intersections(moved)] = True
    out &= walls
    rings = 1
    capped = cap(moved, out, longest, onto)
    while capped is None and not (out == walls).all():
        before = out
        for _ in range(rings):
            out = walls & np.isin(mesh.faces, mesh.faces[out]).any(axis=1)
        if (out == before).all():
            break
        capped = cap(moved, out, longest, onto)
        rings *= 2
    return capped


def cap(
    mesh: TriangleMesh,
    hollow: Bool[ndarray, " f"],
    longest: float,
    onto: Callable[[Float[ndarray, "n 3"]], Float[ndarray, "n 3"]],
) -> Capped | None:
    """The closed mesh without the faces of `hollow`, the holes that they leave closed; None where that is no closed
    body without handles that does not cut itself, as over a groove all the way round.

    Edges in caps are at most `longest` mm; `onto` moves the points (mm) inside them to where they belong.
    """
    old, faces = np.unique(mesh.faces[~hollow], return_inverse=True)
    left = TriangleMesh(mesh.vertices[old], faces.reshape(-1, 3).astype(np.int32))
    if not len(left.faces):
        return None
    meshset = to_meshset(left)
    meshset.meshing_close_holes(maxholesize=len(mesh.faces), selfintersection=True)
    closed = from_meshset(meshset)
    if len(closed.vertices) != len(old) or not _is_ball(closed):
        return None
    while True:
        corners = closed.vertices[closed.faces]
        in_caps = lengths(exact_closest(left, corners.mean(axis=1))[0] - corners.mean(axis=1)) > ON
        too_long = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1) > longest
        if not (in_caps & too_long).any():
            break
        closed = bisect_faces(closed, in_caps & too_long)
    inside = np.ones(len(closed.vertices), dtype=bool)
    inside[closed.faces[~in_caps]] = False
    vertices = np.array(closed.vertices)
    for _ in range(SMOOTHINGS if inside.any() else 1):
        vertices[inside] = onto(vertices[inside])
        capped = TriangleMesh(vertices.copy(), closed.faces)
        if not len(self_intersections(capped)):
            return Capped(capped, old)
        vertices[inside] = neighbour_middles(capped)[inside]
    return None


def _is_ball(mesh: TriangleMesh) -> bool:
    """Whether a mesh is closed, in one piece and without handles."""
    return bool((edges_of(mesh)[1] == 2).all() and pieces_of(mesh).max() == 0 and genus(mesh) == 0)
