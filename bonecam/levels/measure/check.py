"""What is measured between neighbouring levels; a level that fails is an error with the place and the patch
around it.

Depth of cut k: how far points of level k lie from level k - 1 (what the cutter at level k - 1 has to remove),
and the other way round. Nesting: no point of level k - 1 lies outside level k. Points are the vertices of the
tessellations and the surface in the middle of every face; nearest places are found on the tessellations,
distances taken to the surfaces (`sheet.py`), the stock is measured exactly. Self-intersections are those of
the tessellation.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError, place_name
from bonecam.levels.measure.measured_surface import Sheet
from bonecam.levels.problem.tolerances import DEPTH_TOLERANCE, NEST_TOLERANCE, STOCK_TOLERANCE
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh, probes
from bonecam.setup.stock import Stock

REMAINS, BINS, PATCH = 1.0, 20, 2.0


@dataclass(frozen=True, eq=False)
class Measure:
    """One cut measured, mm, and where the worst was found.

    `full_mean` is over the points of the inner level that had at least a full depth of material to move
    through, `full_area` (mm^2) their share of its surface. `near_limits` are parameters of all points of the
    outer level that use up half a tolerance or more, or where it cuts itself.
    """

    depth_max: float
    depth_mean: float
    depth_max_back: float
    full_mean: float
    full_area: float
    histogram: Float[ndarray, "b"]
    nesting_min: float
    outside: float
    crossing: ndarray
    deepest: Float[ndarray, "3"]
    deepest_back: Float[ndarray, "3"]
    hindmost: Float[ndarray, "3"]
    outermost: Float[ndarray, "3"]
    near_limits: Float[ndarray, "k 2"]

    @property
    def self_intersections(self) -> int:
        """Faces of the outer level that cut others."""
        return len(self.crossing)


def _areas(mesh: TriangleMesh) -> Float[ndarray, "f"]:
    return np.asarray(np.linalg.norm(mesh.face_vectors, axis=1) / 2)


def measure(inner: Sheet, outer: Sheet | TriangleMesh, stock: Stock, limit: float) -> Measure:
    """The cut from `outer` (level k, or the mesh of the stock, the last) down to `inner` (level k - 1)."""
    inside, count = inner.points, len(inner.mesh.vertices)
    gap = ahead = -stock.signed_distance(inside)
    near_limits = np.empty((0, 2))
    mesh = outer if isinstance(outer, TriangleMesh) else outer.mesh
    crossing = self_intersections(mesh)
    if isinstance(outer, TriangleMesh):
        outside = probes(outer)
        leaves, depth = stock.signed_distance(outside), np.abs(inner.closely(outside)[0])
    else:
        outside = outer.points
        leaves, depth = stock.signed_distance(outside), inner.apart(outside, outer.parameters)
        deep = np.flatnonzero(depth > limit)
        depth[deep] = np.abs(inner.closely(outside[deep], outer.parameters[deep])[0])
        ahead = -outer.signed(inside, inner.parameters)
        behind = np.flatnonzero(ahead < 0)
        nesting, feet_at = outer.closely(inside[behind], inner.parameters[behind])
        ahead[behind] = -nesting
        deep = np.flatnonzero(ahead > limit)
        ahead[deep] = -outer.closely(inside[deep], inner.parameters[deep])[0]
        too_far_back = ahead > limit + DEPTH_TOLERANCE / 2
        too_far = (depth > limit + DEPTH_TOLERANCE / 2) | (leaves > STOCK_TOLERANCE / 2)
        crossed = outer.grid.parameters[np.unique(mesh.faces[crossing])]
        near_limits = np.vstack(
            [
                outer.parameters[too_far],
                inner.parameters[too_far_back],
                feet_at[nesting > NEST_TOLERANCE / 2],
                crossed,
            ]
        )
    middle, weights, areas = depth[len(mesh.vertices) :], _areas(mesh), _areas(inner.mesh)
    full = np.zeros(len(areas), dtype=bool) if mesh is outer else gap[count:] >= REMAINS * limit
    return Measure(
        float(depth.max()),
        float(np.average(middle, weights=weights)),
        float(ahead.max()),
        float(np.average(np.abs(ahead[count:][full]), weights=areas[full])) if full.any() else limit,
        float(areas[full].sum()),
        np.histogram(np.minimum(middle, limit), bins=BINS, range=(0, limit), weights=weights / weights.sum())[
            0
        ],
        float(ahead.min()),
        float(leaves.max()),
        crossing,
        outside[np.argmax(depth)],
        inside[np.argmax(ahead)],
        inside[np.argmin(ahead)],
        outside[np.argmax(leaves)],
        near_limits,
    )


def require(
    cut: int,
    found: Measure,
    limit: float,
    outer: TriangleMesh,
    behind: float = NEST_TOLERANCE,
    outside: float = STOCK_TOLERANCE,
) -> None:
    """Raise LevelError with the level, the place and the patch (a mesh) where a measure of cut `cut` is out
    of tolerance."""
    for depth, place in ((found.depth_max, found.deepest), (found.depth_max_back, found.deepest_back)):
        if depth > limit + DEPTH_TOLERANCE:
            _fail(cut, f"is {depth:.4f} mm deep, more than {limit} mm,", place, outer)
    if found.nesting_min < -behind:
        _fail(cut, f"falls {-found.nesting_min:.4f} mm behind the level before", found.hindmost, outer)
    if found.outside > outside:
        _fail(cut, f"leaves the stock by {found.outside:.4f} mm", found.outermost, outer)
    if found.self_intersections:
        crossing = outer.vertices[outer.faces[found.crossing]].mean(1)
        _fail(cut, f"cuts itself in {found.self_intersections} faces", crossing[0], outer)


def _fail(level: int, trouble: str, place: Float[ndarray, "3"], mesh: TriangleMesh) -> None:
    raise LevelError(
        f"level {level} {trouble} at {place_name(place)}: give a higher stiffness or more control points there",
        level=level,
        place=place,
        patch=patch_of(mesh, place),
    )


def patch_of(mesh: TriangleMesh, place: Float[ndarray, "3"]) -> TriangleMesh:
    """The faces of a mesh within PATCH mm of a place (at least the nearest one), without the other
    vertices."""
    distance = np.linalg.norm(mesh.vertices[mesh.faces] - place, axis=2).min(1)
    faces = mesh.faces[distance <= max(PATCH, float(distance.min()))]
    kept, faces = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.vertices[kept], faces.reshape(-1, 3).astype(np.int32))
