"""Distances to a mesh in bulk: our own tree (float64, as far as asked), open3d's ray casting for what is
inside, libigl's closest points.

open3d works in float32: the scene is shifted to the mesh's centre, so the error of `closest` is near 6e-8 of
the part's size (measured 5e-6 mm near the origin). `exact_closest` is float64.
"""

from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.kernels.closest_points import boxes_of, distances_within, tree_order
from bonecam.mesh.triangle_mesh import TriangleMesh, probes
from bonecam.runtime.loading import loaded_once
from bonecam.runtime.threads import in_pieces

LEAF = 4
"""Triangles of a leaf of the tree, at most."""
CHUNK = 8192
"""Points a thread asks for lower bounds at a time: the same whatever the number of threads, so that each search begins
alike;"""
EXACT_CHUNK = 1024
"""and for distances, which are the same wherever a search begins."""
KEPT_TREES = 8
"""Of so many meshes that exact closest points were asked for last the tree is kept."""


@loaded_once
def _open3d() -> tuple[Any, Any]:
    """open3d's tensors and its scenes for ray casting."""
    import open3d.core as o3c
    from open3d.t.geometry import RaycastingScene

    return o3c.Tensor, RaycastingScene


class MeshDistance:
    """Closest points, distances and inside tests against one mesh; ValueError where it has no faces.

    Points in the order of a path are found two to three times as fast as in no order.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        if not len(mesh.faces):
            raise ValueError("the mesh has no faces: there is nothing to measure the distance to")
        self.mesh = mesh
        self._centre = mesh.bounds.mean(0)
        self._tensor, scene = _open3d()
        self._scene: Any = scene(nthreads=0)
        self._scene.add_triangles(self._put(mesh.vertices), self._tensor(mesh.faces.astype(np.uint32)))

    @cached_property
    def tree(self) -> tuple[Float[ndarray, "f 9"], Float[ndarray, "b 6"]]:
        """That of the mesh (`tree_of`)."""
        return tree_of(self.mesh)

    def _put(self, points: Float[ndarray, "n 3"]) -> Any:
        return self._tensor(np.ascontiguousarray(points - self._centre, dtype=np.float32))

    def _within(
        self, points: Float[ndarray, "n 3"], limits: Float[ndarray, " n"], slack: float = 0.0
    ) -> Float[ndarray, " n"]:
        """Distance to the surface, or the limit where that is less; a lower bound of it with a `slack`."""
        points = np.require(points, np.float64, ["C", "W"])
        tree = self.tree

        def work(some: slice) -> Float[ndarray, " m"]:
            return np.asarray(distances_within(points[some], limits[some], slack, *tree))

        return np.concatenate(in_pieces(work, len(points), CHUNK if slack else EXACT_CHUNK))

    def unsigned(
        self, points: Float[ndarray, "n 3"], wanted: float | Float[ndarray, " n"] = np.inf
    ) -> Float[ndarray, " n"]:
        """Distance of each point to the surface, mm; where it exceeds `wanted`, that: it is the cheaper
        bound."""
        return self._within(points, _limits(wanted, len(points)))

    def lower_bound(self, points: Float[ndarray, "n 3"], slack: float) -> Float[ndarray, " n"]:
        """A lower bound of the distance of each point to the surface, mm, less than it by no more than the share
        `slack`: far from the surface the answer is several times as quick."""
        return self._within(points, np.full(len(points), np.inf), slack)

    def signed(
        self,
        points: Float[ndarray, "n 3"],
        wanted: float | Float[ndarray, " n"] = np.inf,
        may_be_inside: bool | Bool[ndarray, " n"] = True,
    ) -> Float[ndarray, " n"]:
        """Distance of each point to the closed surface, mm, negative inside; where it exceeds `wanted`, that:
        it is the cheaper bound. Only points that `may_be_inside` are tested for that."""
        limits = _limits(wanted, len(points))
        distance = self._within(points, limits)
        inside = np.array(np.broadcast_to(may_be_inside, len(points)))
        inside[inside] = self.inside(points[inside])
        deep = np.flatnonzero(inside & (distance >= limits) & np.isfinite(limits))
        distance[deep] = self._within(points[deep], np.full(len(deep), np.inf))
        return np.where(inside, -distance, distance)

    def closest(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n 3"], Int[ndarray, " n"]]:
        """The closest surface point of each point, and its face."""
        closest = self._scene.compute_closest_points(self._put(points))
        return closest["points"].numpy() + self._centre, closest["primitive_ids"].numpy().astype(np.int64)

    def inside(self, points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether each point lies inside the closed surface (three rays each, the majority)."""
        return self._scene.compute_occupancy(self._put(points), nsamples=3).numpy() > 0.5


def tree_of(mesh: TriangleMesh) -> tuple[Float[ndarray, "f 9"], Float[ndarray, "b 6"]]:
    """The triangles of a mesh in the order of a tree, and its boxes (`kernels.closest.triangle_tree`)."""
    corners = mesh.vertices[mesh.faces]
    leaves = 1 << ((len(corners) - 1) // LEAF).bit_length()
    triangles = corners.reshape(-1, 9)[tree_order(corners.mean(axis=1), leaves)]
    return triangles, boxes_of(triangles, leaves)


def _limits(wanted: float | ndarray, count: int) -> Float[ndarray, " n"]:
    return np.maximum(np.broadcast_to(np.asarray(wanted, dtype=np.float64), count), 0.0)


def hausdorff(one: TriangleMesh, other: TriangleMesh) -> tuple[float, float]:
    """The largest distance (mm) of the vertices and face middles of the first mesh from the second, and of the
    second from the first; ValueError where one has no faces."""
    there = MeshDistance(other).unsigned(probes(one)).max()
    back = MeshDistance(one).unsigned(probes(other)).max()
    return float(there), float(back)


def lowest_between(
    near: Float[ndarray, " n"], far: Float[ndarray, " n"], length: Float[ndarray, " n"]
) -> Float[ndarray, " n"]:
    """No point of a straight way of `length` is nearer to a body than this, with at least `near` and `far`
    (>= 0) at its ends.

    For every point q of the body, Stewart's theorem gives |c(u) - q|^2 = (1-u) |c0-q|^2 + u |c1-q|^2 - u
    (1-u) length^2.
    """
    a, b, s2 = near**2, far**2, length**2
    ahead = np.clip(a - b, -s2, s2)  # beyond, the lowest is at an end
    u = 0.5 + ahead / np.maximum(2 * s2, np.finfo(float).tiny)
    return np.asarray(np.sqrt(np.maximum((1 - u) * a + u * b - u * (1 - u) * s2, 0)))


def exact_closest(
    mesh: TriangleMesh, points: Float[ndarray, "n 3"]
) -> tuple[Float[ndarray, "n 3"], Int[ndarray, " n"]]:
    """The closest surface point of each point and its face, in float64 (libigl's AABB tree)."""
    tree, vertices, faces = _exact_tree(mesh)
    _, face, closest = tree.squared_distance(vertices, faces, np.ascontiguousarray(points, dtype=np.float64))
    return np.asarray(closest).reshape(-1, 3), np.asarray(face, dtype=np.int64).ravel()


@lru_cache(maxsize=KEPT_TREES)
def _exact_tree(mesh: TriangleMesh) -> tuple[Any, ndarray, ndarray]:
    """libigl's tree, and the vertices and faces that it is asked with; a stock of many faces is asked
    hundreds of times."""
    import igl

    if not len(mesh.faces):
        raise ValueError("the mesh has no faces: there is nothing to measure the distance to")
    tree = igl.AABB()
    vertices = np.array(mesh.vertices)
    faces = mesh.faces.astype(np.int64)
    tree.init(vertices, faces)
    return tree, vertices, faces


def barycentric(corners: Float[ndarray, "n 3 3"], points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Weights of the corners of each triangle at a point in it, clipped to it."""
    a = corners[:, 1] - corners[:, 0]
    b = corners[:, 2] - corners[:, 0]
    c = points - corners[:, 0]
    aa, ab, bb, ac, bc = (dots(x, y) for x, y in ((a, a), (a, b), (b, b), (a, c), (b, c)))
    scale = 1 / np.maximum(aa * bb - ab * ab, np.finfo(float).tiny)
    v, w = (bb * ac - ab * bc) * scale, (aa * bc - ab * ac) * scale
    weights = np.clip(np.column_stack([1 - v - w, v, w]), 0, 1)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
