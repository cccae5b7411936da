"""The surface through an open mesh of one piece with four corners, such as the side of a blade.

The mesh is laid out on a rectangle whose sides are the four runs of its edge between the corners: a harmonic map
(Eck et al. 1995). Rows of points at equal distances in the rectangle are skinned like rows from a file, and as many of
them are taken as bring the surface near enough to the mesh, and the mesh to it.
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, lengths, unit
from bonecam.errors import SurfaceError
from bonecam.mesh.distance import barycentric, exact_closest, hausdorff
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.skinning.skin import skin
from bonecam.surface.tspline import TSpline

FEWEST, MOST = 10, 80
"""Rows, and points a row, of the first and of the last trial."""
SPAN = 0.02
"""A corner of the edge is seen over this share of its length before and behind it."""
APART = 0.05
"""Corners are this share of the edge's length apart at least."""
CHORD_SHARE = 0.1
"""Chord tolerance of the tessellation that deviations are measured to, in shares of the tolerance."""


def patch_surface(mesh: TriangleMesh, tolerance: float) -> TSpline:
    """The open T-spline within `tolerance` (mm) of an open mesh (mm) and all its vertices, facing as its triangles do;
    the four sharpest corners of the mesh's edge are its corners.

    SurfaceError where the mesh has no edge or more than one, no four corners, or where MOST rows are not enough.
    """
    flat, size = _layout(mesh)
    count = FEWEST
    while True:
        # Rows of points on the mesh at equal distances in the rectangle, `count` both ways
        u, v = (np.linspace(0.0, side, count) for side in size)
        asked = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        raised = TriangleMesh(np.column_stack([flat, np.zeros(len(flat))]), mesh.faces)
        nearest, face = exact_closest(raised, np.column_stack([asked, np.zeros(len(asked))]))
        shares = barycentric(raised.vertices[mesh.faces[face]], nearest)
        points = np.einsum("nk,nkd->nd", shares, mesh.vertices[mesh.faces[face]])
        rows = list(points.reshape(count, count, 3))

        surface = skin(rows, tolerance / 2, closed=False)
        skinned = surface.tessellate(CHORD_SHARE * tolerance)
        deviation = max(hausdorff(skinned, mesh))
        if deviation <= tolerance:
            return surface
        count *= 2
        if count > MOST:
            raise SurfaceError(
                f"the surface through the mesh misses it by {deviation:.3g} mm: smooth the mesh, "
                f"or raise surface.tolerance ({tolerance:g} mm)",
                deviation_mm=deviation,
            )


def _layout(mesh: TriangleMesh) -> tuple[Float[ndarray, "v 2"], Float[ndarray, "2"]]:
    """The vertices in a rectangle, and the rectangle's size, mm."""
    import igl

    loops = igl.boundary_loop_all(mesh.faces)
    if len(loops) != 1:
        what = f"has {len(loops)} edges" if len(loops) else "is closed"
        raise SurfaceError(f"a patch of one piece has one edge, this mesh {what}: cut it open", edges=len(loops))
    edge = np.asarray(loops[0], dtype=np.int64)
    sides = _sides(mesh.vertices, edge)
    ways = [np.r_[0.0, np.cumsum(lengths(np.diff(mesh.vertices[side], axis=0)))] for side in sides]
    size = np.array([(ways[k][-1] + ways[k + 2][-1]) / 2 for k in (0, 1)])
    corners = np.array([[0, 0], [size[0], 0], size, [0, size[1]], [0, 0]])
    border_points = []
    for k, way in enumerate(ways):
        share = way[:-1, None] / way[-1]
        border_points.append((1 - share) * corners[k] + share * corners[k + 1])
    border = np.concatenate([side[:-1] for side in sides])
    flat = igl.harmonic(mesh.vertices, mesh.faces, border, np.vstack(border_points), 1)
    return flat, size


def _sides(vertices: Float[ndarray, "v 3"], edge: Int[ndarray, " e"]) -> list[Int[ndarray, " _"]]:
    """The runs of the edge between its four sharpest corners, both ends included."""
    points = vertices[edge]
    along = np.r_[0.0, np.cumsum(lengths(np.diff(points, axis=0, append=points[:1])))]
    whole = along[-1]
    along = along[:-1]

    def at(place: Float[ndarray, " e"]) -> Float[ndarray, "e 3"]:
        wrapped = np.mod(place, whole)
        return np.column_stack(
            [np.interp(wrapped, np.r_[along, whole], np.r_[points[:, k], points[0, k]]) for k in range(3)]
        )

    before = points - at(along - SPAN * whole)
    behind = at(along + SPAN * whole) - points
    turn = angles_between(unit(before), unit(behind))
    corners: list[int] = []
    for place in np.argsort(-turn):
        apart = [abs((along[place] - along[corner] + whole / 2) % whole - whole / 2) for corner in corners]
        if len(corners) < 4 and min(apart, default=whole) >= APART * whole:
            corners.append(int(place))
    if len(corners) < 4:
        raise SurfaceError("the edge of the mesh has no four corners: give a patch with four sides")
    corners.sort()
    rolled = np.roll(edge, -corners[0])
    bounds = [*(corner - corners[0] for corner in corners), len(edge)]
    closed = np.r_[rolled, rolled[:1]]
    return [closed[low : high + 1] for low, high in pairwise(bounds)]
