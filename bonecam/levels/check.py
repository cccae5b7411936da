"""What is measured on the tessellations of neighbouring levels; a level that fails is an error with the place.

Depth of cut k: how far points of level k lie from level k - 1 (what the cutter at level k - 1 has to remove), and the other
way round. Nesting: no point of level k - 1 lies outside level k. The stock is measured exactly, not by its mesh.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError
from bonecam.levels.stock import Stock
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh

DEPTH_TOLERANCE, NEST_TOLERANCE, STOCK_TOLERANCE = 0.002, 0.001, 0.001
REMAINS, BINS = 1.0, 20


@dataclass(frozen=True, eq=False)
class Measure:
    """One cut measured, mm. `mean` is over the points of the outer level where a full depth of material was left to move."""

    depth_max: float
    depth_mean: float
    depth_max_back: float
    full_mean: float
    histogram: Float[ndarray, "b"]
    nesting_min: float
    outside: float
    self_intersections: int


def probes(mesh: TriangleMesh) -> Float[ndarray, "n 3"]:
    """The mesh's vertices and the middles of its faces."""
    return np.vstack([mesh.vertices, mesh.vertices[mesh.faces].mean(1)])


def _weights(mesh: TriangleMesh) -> Float[ndarray, "f"]:
    area = np.linalg.norm(mesh.face_vectors, axis=1)
    return np.asarray(area / area.sum())


def signed(mesh: TriangleMesh, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
    """Distance of each point to the closed mesh, negative inside: by the closest face's side, and where that says outside, by rays."""
    to_mesh = MeshDistance(mesh)
    closest, face = to_mesh.closest(points)
    across = points - closest
    distance = np.linalg.norm(across, axis=1)
    side = np.where(np.einsum("ij,ij->i", across, mesh.face_vectors[face]) > 0, 1.0, -1.0)
    doubtful = np.flatnonzero((side > 0) & (distance > NEST_TOLERANCE))
    if len(doubtful):
        side[doubtful] = np.where(to_mesh.inside(points[doubtful]), -1.0, 1.0)
    return np.asarray(side * distance)


def measure(inner: TriangleMesh, outer: TriangleMesh, stock: Stock, limit: float, last: bool) -> Measure:
    """The cut from `outer` (level k; the stock itself where `last`) down to `inner` (level k - 1)."""
    inside, outside = probes(inner), probes(outer)
    depth = MeshDistance(inner).unsigned(outside)
    ahead = -stock.signed_distance(inside) if last else -signed(outer, inside)
    middles, weights = slice(len(outer.vertices), None), _weights(outer)
    back, area = np.abs(ahead[len(inner.vertices) :]), _weights(inner)
    full = -stock.signed_distance(inside[len(inner.vertices) :]) >= REMAINS * limit
    full_mean = float(np.average(back[full], weights=area[full])) if full.any() and not last else limit
    return Measure(
        float(depth.max()),
        float(depth[middles] @ weights),
        float(np.abs(ahead).max()),
        full_mean,
        np.histogram(depth[middles], bins=BINS, range=(0, limit), weights=weights)[0],
        float(ahead.min()),
        float(stock.signed_distance(outside).max()),
        0 if last else len(self_intersections(outer)),
    )


def require(
    cut: int, found: Measure, limit: float, inner: TriangleMesh, outer: TriangleMesh, stock: Stock, behind: float = NEST_TOLERANCE
) -> None:
    """Raise LevelError with the level and the place where a measure of cut `cut` is out of tolerance."""
    if found.depth_max > limit + DEPTH_TOLERANCE:
        points = probes(outer)
        _fail(cut, f"is {found.depth_max:.4f} mm deep, more than {limit} mm,", points[np.argmax(MeshDistance(inner).unsigned(points))])
    if found.nesting_min < -behind:
        points = probes(inner)
        place = points[np.argmax(MeshDistance(outer).signed(points))]
        _fail(cut, f"falls {-found.nesting_min:.4f} mm behind the level before", place)
    if found.outside > STOCK_TOLERANCE:
        points = probes(outer)
        _fail(cut, f"leaves the stock by {found.outside:.4f} mm", points[np.argmax(stock.signed_distance(points))])
    if found.self_intersections:
        first = self_intersections(outer)[0]
        _fail(cut, f"cuts itself in {found.self_intersections} faces", outer.vertices[outer.faces[first]].mean(0))


def _fail(level: int, trouble: str, place: ndarray) -> None:
    where = f"({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f})"
    raise LevelError(f"level {level} {trouble} at {where}: give a higher stiffness or more control points there", level=level, place=place)
