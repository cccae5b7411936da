"""The underside of a part: how high it is over some places, and where it is lowest."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh

FLAT = 0.1
"""Faces whose unit normals rise or fall by less are walls, which nothing stands against."""


def places_on_disc(radius: float) -> Float[ndarray, "73 2"]:
    """Places (x, y) on a disc of a radius about the Z axis, mm."""
    angle = np.arange(24) * (2 * np.pi / 24)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([np.zeros((1, 2)), *(radius * f * ring for f in (1 / 3, 2 / 3, 1.0))])


def lower_end(part: TriangleMesh, height: float) -> Float[ndarray, "2"]:
    """The (x, y) of the face that lies most in the middle of what is within `height` mm of the part's lowest one, walls
    left out."""
    middles = part.vertices[part.faces].mean(axis=1)
    normals = part.face_vectors
    flat = np.abs(normals[:, 2]) > FLAT * np.linalg.norm(normals, axis=1)
    low = middles[flat & (middles[:, 2] <= middles[flat, 2].min() + height)][:, :2]
    return np.asarray(low[np.argmin(np.linalg.norm(low - low.mean(axis=0), axis=1))])


def undersides(part: TriangleMesh, places: ndarray) -> ndarray:
    """Lowest z of the part above each (x, y); inf where it is missed."""
    a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
    u, v = (b - a)[:, :2], (c - a)[:, :2]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    steep = np.abs(area) <= np.finfo(float).eps * part.diagonal**2
    area = np.where(steep, 1.0, area)
    lowest = np.full(len(places), np.inf)
    for i, place in enumerate(places):
        w = place - a[:, :2]
        p = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / area
        q = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / area
        hit = ~steep & (p >= 0) & (q >= 0) & (p + q <= 1)
        if hit.any():
            lowest[i] = (a[hit, 2] + p[hit] * (b - a)[hit, 2] + q[hit] * (c - a)[hit, 2]).min()
    return lowest
