"""Triangles of polygons: a fan from the first corner where it lies inside the polygon, else ear clipping
(Meisters 1975)."""

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.mesh.files.formats.content import Content, ContentError

LARGEST_POLYGON = 2000
"""Most corners of a polygon: ear clipping takes time with their square (measured: 0.1 s for 1000)."""


def triangles_of(content: Content) -> Int64[ndarray, "m 3"]:
    """The triangles of all polygons, in their order. ContentError where a corner names no vertex of the
    content, or a polygon is too large."""
    corners = content.corners
    counts = content.counts
    starts = np.cumsum(counts) - counts
    wrong = np.flatnonzero((corners < 0) | (corners >= len(content.vertices)))
    if len(wrong):
        face = int(np.searchsorted(starts, wrong[0], side="right")) - 1
        raise ContentError(f"face {face} names a vertex outside 0..{len(content.vertices) - 1}")
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    if counts.max() > LARGEST_POLYGON:
        what = f"face {int(counts.argmax())} has {counts.max()} corners, {LARGEST_POLYGON} are allowed"
        raise ContentError(what, "triangulate the mesh and export it again")

    polygon = np.repeat(np.arange(len(counts)), counts - 2)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    first = starts[polygon]
    triangles = np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1)
    turned = np.unique(polygon[_turned(content.vertices, triangles, polygon, len(counts))])
    for item in turned:
        own = corners[starts[item] : starts[item] + counts[item]]
        triangles[polygon == item] = _ears(content.vertices, own)
    return triangles


def strip_triangles(strips: list[ndarray]) -> list[ndarray]:
    """The triangles of strips of vertex numbers; -1 begins a strip anew, every other triangle is turned."""
    triangles = []
    for strip in strips:
        pieces = np.split(strip, np.flatnonzero(strip == -1))
        for piece in pieces:
            run = piece[piece != -1]
            for k in range(len(run) - 2):
                triangles.append(run[k : k + 3] if k % 2 == 0 else run[[k + 1, k, k + 2]])
    return triangles


def _turned(
    vertices: Float[ndarray, "n 3"], triangles: Int64[ndarray, "m 3"], polygon: Int64[ndarray, " m"], count: int
) -> ndarray:
    """Which triangles of a fan face away from their polygon, whose area vector is the sum of theirs."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    sums = np.stack([np.bincount(polygon, areas[:, k], count) for k in range(3)], axis=1)
    return np.einsum("mi,mi->m", areas, sums[polygon]) < 0


def _ears(vertices: Float[ndarray, "n 3"], corners: Int64[ndarray, " k"]) -> Int64[ndarray, "m 3"]:
    """The triangles of one polygon, ears cut off one by one in its mean plane; where no ear is left, which
    happens where it crosses itself, the next corner is cut."""
    points = vertices[corners] - vertices[corners[0]]
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    flat = np.delete(points, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):
        flat = flat * [1.0, -1.0]
    left = list(range(len(corners)))
    triangles = []
    at = 0
    tried = 0
    while len(left) > 3:
        trio = [left[at - 1], left[at], left[(at + 1) % len(left)]]
        if tried >= len(left) or _is_ear(flat, trio, left):
            triangles.append(trio)
            del left[at]
            tried = 0
        else:
            at += 1
            tried += 1
        at %= len(left)
    return corners[np.array([*triangles, left])]


def _is_ear(flat: Float[ndarray, "k 2"], trio: list[int], left: list[int]) -> bool:
    """Whether a corner turns left and no other corner that is left lies in its triangle."""
    a, b, c = flat[trio]
    if _side(a, b, c) <= 0:
        return False
    others = flat[[k for k in left if k not in trio]]
    inside = (_side(a, b, others) >= 0) & (_side(b, c, others) >= 0) & (_side(c, a, others) >= 0)
    return not inside.any()


def _side(a: ndarray, b: ndarray, points: ndarray) -> ndarray:
    """Twice the signed area of the triangles a, b, points: positive to the left of the way from a to b."""
    across = (b[0] - a[0]) * (points[..., 1] - a[1]) - (b[1] - a[1]) * (points[..., 0] - a[0])
    return np.asarray(across)
