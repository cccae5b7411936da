"""Any closed convex mesh as stock. Inside, the nearest wall is a face's plane; outside, the nearest point is
libigl's (exact)."""

from dataclasses import InitVar, dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import StockError, place_name, require_type
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.hull import convex_hull
from bonecam.mesh.remeshing import split_edges
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import LARGEST, Stock, sides

FLAT = 1e-5
"""A point of the mesh may lie this far inside its hull (of the mesh's diagonal): the rounding of a file in
float32. A mesh whose volume is less than its area times that is flat."""


@dataclass(frozen=True, eq=False)
class ConvexStock(Stock):
    """The body inside a closed convex outward mesh, mm. StockError names the place where the mesh is not
    closed or not convex, or flat, or farther from the origin than LARGEST.

    A mesh that is `proven` to be a hull, or a copy of a stock's, is not looked at again.
    """

    surface: TriangleMesh
    kind: str = "mesh"
    file: str = ""
    proven: InitVar[bool] = False

    def __post_init__(self, proven: bool) -> None:
        require_type(self.surface, TriangleMesh, "surface", "TriangleMesh, such as read_mesh(file)")
        if (reach := np.abs(self.surface.vertices).max(initial=0.0)) > LARGEST:
            raise StockError(
                f"the stock reaches {reach:g} mm from the origin: give one in mm, {LARGEST:g} at most",
                distance=float(reach),
            )
        if not proven:
            used, faces = np.unique(self.surface.faces, return_inverse=True)
            object.__setattr__(
                self,
                "surface",
                TriangleMesh(self.surface.vertices[used], faces.reshape(-1, 3).astype(np.int32)),
            )
            _require_closed(self.surface)
            _require_convex(self.surface)

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner, mm."""
        return self.surface.bounds

    @property
    def diameter(self) -> float:
        """The longer side across the Z axis, mm."""
        return float((self.bounds[1] - self.bounds[0])[:2].max())

    @property
    def length(self) -> float:
        """Extent along Z, mm."""
        return float(self.bounds[1, 2] - self.bounds[0, 2])

    @property
    def sizes(self) -> dict[str, float]:
        """Its extents along X, Y and Z, mm."""
        return sides(self.bounds)

    @property
    def middle(self) -> Float[ndarray, "3"]:
        """The middle of the bounding box."""
        return np.asarray(self.bounds.mean(0))

    def moved(self, shift: Float[ndarray, "3"]) -> "ConvexStock":
        """The same body elsewhere."""
        return self._with(self.surface.vertices + shift)

    def scaled(self, factor: float) -> "ConvexStock":
        """The same body `factor` times as large about its middle."""
        return self._with(self.middle + factor * (self.surface.vertices - self.middle))

    def _with(self, vertices: ndarray) -> "ConvexStock":
        return replace(self, surface=TriangleMesh(vertices, self.surface.faces), proven=True)

    @cached_property
    def _normals(self) -> Float[ndarray, "f 3"]:
        size = np.linalg.norm(self.surface.face_vectors, axis=1, keepdims=True)
        return np.asarray(self.surface.face_vectors / np.where(size > 0, size, 1.0))

    def way_out(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"]]:
        """Both from one question.

        The way out to the nearest point leads away from all of the body, its middle too; the way in towards
        it.
        """
        closest, face = exact_closest(self.surface, points)
        away = points - closest
        distance = np.linalg.norm(away, axis=1)
        touching = distance <= np.finfo(float).eps * 16 * self.surface.diagonal
        side = np.where((away * (closest - self.surface.vertices.mean(0))).sum(1) < 0, -1.0, 1.0)
        out = np.where(
            touching[:, None], self._normals[face], away * (side / np.where(touching, 1.0, distance))[:, None]
        )
        return side * distance, out

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance to the surface, mm, negative inside."""
        return self.way_out(points)[0]

    def outward(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals at the nearest points; away from the edge or corner where that is the
        nearest."""
        return self.way_out(points)[1]

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """The mesh itself, its edges split until they are as short as those of a cylinder as wide would
        be."""
        return split_edges(self.surface, float(np.sqrt(8 * chord_tolerance * self.diameter)))


def _edges(mesh: TriangleMesh) -> ndarray:
    return np.vstack([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)])


def _require_closed(mesh: TriangleMesh) -> None:
    edges = _edges(mesh)
    forward = edges[:, 0].astype(np.int64) * len(mesh.vertices) + edges[:, 1]
    backward = edges[:, 1].astype(np.int64) * len(mesh.vertices) + edges[:, 0]
    lonely = np.flatnonzero(~np.isin(forward, backward))
    if not len(edges) or len(lonely) or len(np.unique(forward)) < len(forward):
        place = mesh.vertices[edges[lonely[0] if len(lonely) else 0]].mean(0) if len(edges) else np.zeros(3)
        raise StockError(
            f"the stock's mesh is not closed at {place_name(place)}: close it", distance=0.0, place=place
        )
    if abs(mesh.volume) <= FLAT * mesh.diagonal * mesh.area:
        raise StockError(
            "the stock's mesh is flat and holds nothing: give a solid body",
            distance=0.0,
            place=mesh.vertices[0],
        )
    if mesh.volume <= 0:
        raise StockError(
            "the stock's mesh is turned inside out: flip its faces", distance=0.0, place=mesh.vertices[0]
        )


def _require_convex(mesh: TriangleMesh) -> None:
    """Every vertex, edge middle and face middle lies on the convex hull, and the volumes agree."""
    edges, hull = _edges(mesh), convex_hull(mesh.vertices)
    probes = np.vstack([mesh.vertices, mesh.vertices[edges].mean(1), mesh.vertices[mesh.faces].mean(1)])
    inside = np.linalg.norm(probes - exact_closest(hull, probes)[0], axis=1)
    worst = int(np.argmax(inside))
    if inside[worst] > FLAT * mesh.diagonal:
        raise StockError(
            f"the stock is not convex: it lies {inside[worst]:.3f} mm inside its convex hull at {place_name(probes[worst])}: give the hull",
            distance=float(inside[worst]),
            place=probes[worst],
        )
    if abs(mesh.volume - hull.volume) > FLAT * mesh.diagonal * mesh.area:
        told = f"the stock is no single convex body: its faces hold {mesh.volume:.1f} mm3, their convex hull {hull.volume:.1f}"
        raise StockError(f"{told}: give the hull", distance=0.0, place=probes[worst])
