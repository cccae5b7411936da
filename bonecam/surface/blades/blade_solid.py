"""The closed solid of a blade: the skin of its sections, with its blunt edge and both ends closed.

Two chains of vertices are joined by a strip of triangles that advances on both alike: the edges s = low and s = high
of an open surface, and at each end the two sides of the blade between the two points farthest from one another.
"""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.mesh.healing.mesh_faults import holes_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tspline import TSpline


def blade_solid(surface: TSpline, chord_tolerance: float) -> TriangleMesh:
    """The closed outward mesh of a surface without poles, within `chord_tolerance` mm of it where that is.

    SurfaceError where no closed outward mesh comes of it.
    """
    tessellation = surface.tessellate_with_parameters(chord_tolerance)
    s, t = tessellation.parameters.T
    points = tessellation.mesh.vertices
    (left, right), (low, high) = surface.domain
    faces = [tessellation.mesh.faces]
    if not surface.closed_in_s:
        first, last = (_sorted(s == side, t) for side in (left, right))
        faces.append(_strip(first, t[first], last, t[last]))
    for end in (low, high):
        loop = _sorted(t == end, s)
        faces.append(_cap(loop if end == low else loop[::-1], points))
    solid = TriangleMesh(points, np.vstack(faces).astype(np.int32))
    if holes_of(solid) or not solid.volume > 0:
        raise SurfaceError(
            f"the blade encloses {solid.volume:.3g} mm^3 and keeps {len(holes_of(solid))} holes: give sections that "
            "run once round it, from the hub outward"
        )
    return solid


def _sorted(chosen: ndarray, along: Float[ndarray, " n"]) -> Int[ndarray, " k"]:
    """The chosen vertices in the order of a parameter."""
    index = np.flatnonzero(chosen)
    return index[np.argsort(along[index])]


def _cap(loop: Int[ndarray, " k"], points: Float[ndarray, "n 3"]) -> Int[ndarray, "f 3"]:
    """Triangles that close a loop and run against it."""
    away = np.linalg.norm(points[loop][:, None] - points[loop], axis=2)
    start, end = sorted(int(i) for i in np.unravel_index(np.argmax(away), away.shape))
    one = loop[start : end + 1][::-1]
    other = np.r_[loop[end:], loop[: start + 1]]
    return _strip(one, _fractions(points[one]), other, _fractions(points[other]))


def _fractions(chain: Float[ndarray, "k 3"]) -> Float[ndarray, " k"]:
    """Length along a chain up to each of its points, as a share of the whole."""
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=1))]
    return along / along[-1]


def _strip(
    one: Int[ndarray, " a"], at_one: Float[ndarray, " a"], other: Int[ndarray, " b"], at_other: Float[ndarray, " b"]
) -> Int[ndarray, "f 3"]:
    """Triangles between two chains of vertices at growing places, forward along the first."""
    faces = []
    i = j = 0
    while i + 1 < len(one) or j + 1 < len(other):
        if j + 1 == len(other) or (i + 1 < len(one) and at_one[i + 1] <= at_other[j + 1]):
            faces.append((one[i], one[i + 1], other[j]))
            i += 1
        else:
            faces.append((one[i], other[j + 1], other[j]))
            j += 1
    triangles = np.array(faces)
    apart = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return triangles[apart]
