"""Directions as the triangles of an icosahedron on the unit sphere, each divided into four, several times."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.kernels.closest.direction_maps import SphereTriangles
from bonecam.kernels.closest.largest_ellipses import LeafMesh

COARSEST, FINEST = 2, 4
"""Times that the 20 triangles are divided: those that are tried first (320, in cones of 10.8 degrees), and leaves
(5,120 of 2.7 degrees, 4 degrees apart at most)."""


@lru_cache(maxsize=1)
def sphere_leaves() -> tuple[SphereTriangles, LeafMesh]:
    """The triangles of all levels, and the leaves as a mesh."""
    vertices, faces = _icosahedron()
    levels = []
    for level in range(FINEST + 1):
        if level:
            # With every face in four, those of face i from 4 i on
            edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
            ends, which = np.unique(edges, axis=0, return_inverse=True)
            middles = unit(vertices[ends].sum(axis=1))
            c, a, b = (which.reshape(-1, 3) + len(vertices)).T
            i, j, k = faces.T
            parts = np.stack([(i, c, b), (j, a, c), (k, b, a), (a, b, c)])
            vertices = np.vstack([vertices, middles])
            faces = parts.transpose(2, 0, 1).reshape(-1, 3)
        if level >= COARSEST:
            levels.append(_circles(vertices[faces]))
    starts = np.cumsum([0, *(len(caps) for _, caps in levels)])
    centres, caps = (np.concatenate(part) for part in zip(*levels))

    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    ends, which = np.unique(edges, axis=0, return_inverse=True)
    order = np.argsort(which.ravel(), kind="stable")
    return SphereTriangles(centres, caps, starts), LeafMesh(vertices, faces, ends, (order // 3).reshape(-1, 2))


def leaf_centres() -> Float[ndarray, "5120 3"]:
    """Unit vectors to the centres of the leaves."""
    triangles, _ = sphere_leaves()
    return triangles.centres[triangles.starts[-2] :]


def _icosahedron() -> tuple[Float[ndarray, "12 3"], Int[ndarray, "20 3"]]:
    """Its unit vertices, and its faces, counter-clockwise from outside."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [(0, a, b * golden) for a in (-1, 1) for b in (-1, 1)]
    vertices = unit(np.array([np.roll(corner, k) for k in range(3) for corner in corners]))
    near = vertices @ vertices.T > 0.4
    faces = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    turned = np.array(faces)
    inward = np.linalg.det(vertices[turned]) < 0
    turned[inward] = turned[inward][:, [0, 2, 1]]
    return vertices, turned


def _circles(corners: Float[ndarray, "f 3 3"]) -> tuple[Float[ndarray, "f 3"], Float[ndarray, " f"]]:
    """The centre of each triangle, and the largest angle (radians) to a corner, its rounding included."""
    centres = unit(corners.sum(axis=1))
    return centres, np.arccos(np.einsum("fi,fci->fc", centres, corners).min(axis=1)) + 1e-9
