"""Any closed convex mesh as stock. Inside, the nearest wall is a face's plane; outside, the nearest point is
that of libigl's tree (float64)."""

from dataclasses import InitVar, dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import StockError, place_name, require_type
from bonecam.job import StockJob
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.files.mesh_files import read_whole
from bonecam.mesh.meshlab import split_edges
from bonecam.mesh.smooth_surface import convex_hull
from bonecam.mesh.solids import half_edges
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces
from bonecam.mesh.units import MM_OF
from bonecam.setup.rounding import RoundedStock, deepest_point, half_spaces_of, offset_polyhedron
from bonecam.setup.stock import LARGEST, LyingPart, Schedule, Stock, StockKind, box_sizes

FLAT = 1e-5
"""A point of the mesh may lie this far inside its hull, as a share of the mesh's diagonal: the rounding of a
file in float32. A mesh whose volume is less than its area times that is flat."""
MISTAKEN_UNIT = 100
"""The file of a stock that is so many times smaller than the part may be in metres."""
HALVINGS = 50
"""Bisections of the scale of the smallest copy: to the last bit."""
LARGEST_SCALE = 1e4
"""Largest scale that is tried."""


@dataclass(frozen=True, eq=False)
class ConvexStock(Stock):
    """The body inside a closed convex outward mesh, mm. StockError names the place where the mesh is not
    closed or not convex, or flat, or farther from the origin than LARGEST.

    A mesh that is `proven` convex, being a hull or a copy of a stock's mesh, is not checked again.
    """

    surface: TriangleMesh
    kind: str = "mesh"
    file: str = ""
    proven: InitVar[bool] = False

    def __post_init__(self, proven: bool) -> None:
        require_type(self.surface, TriangleMesh, "surface", "TriangleMesh, such as read_mesh(file)")
        reach = np.abs(self.surface.vertices).max(initial=0.0)
        if reach > LARGEST:
            raise StockError(
                f"the stock reaches {reach:g} mm from the origin: give one in mm, {LARGEST:g} at most",
                distance=float(reach),
            )
        if not proven:
            object.__setattr__(self, "surface", keep_faces(self.surface))
            mesh = self.surface
            edges = half_edges(mesh).reshape(-1, 2)
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
            _require_convex(self.surface)

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner of the bounding box, mm."""
        return self.surface.bounds

    @property
    def sizes(self) -> dict[str, float]:
        """The extents of the stock along X, Y and Z, mm."""
        return box_sizes(self.bounds)

    def move(self, shift: Float[ndarray, "3"]) -> "ConvexStock":
        """The body translated by `shift`, mm."""
        return self._with(self.surface.vertices + shift)

    def on_axis(self, height: float) -> "ConvexStock":
        """The body with the middle of its box on the Z axis at a height, mm."""
        return self.move(np.array([0.0, 0.0, height]) - self.middle)

    def scale(self, factor: float) -> "ConvexStock":
        """The body scaled by `factor` about its middle."""
        return self._with(self.middle + factor * (self.surface.vertices - self.middle))

    @property
    def inradius(self) -> float:
        """Radius of the largest ball inside the body, mm."""
        return deepest_point(half_spaces_of(self.surface))[1]

    def offset(self, distance: float) -> "ConvexStock":
        """The body with its faces moved outwards by `distance` mm (negative: inwards)."""
        return ConvexStock(offset_polyhedron(self.surface, distance), proven=True)

    def round_edges(self, radius: float) -> RoundedStock:
        """The body with its edges and corners rounded by `radius` mm."""
        return RoundedStock(self.offset(-radius), radius)

    def larger(self, points: Float[ndarray, "n 3"], lack: float) -> str:
        """The remedy where `points` need up to `lack` mm more material: a larger body, scale or unit."""
        remedy = super().larger(points, lack)
        if not self.file:
            return remedy
        remedy += ", or a larger stock.scale (0 finds the smallest copy that holds it)"
        size = np.linalg.norm(np.ptp(points, axis=0))
        metres = MISTAKEN_UNIT * np.linalg.norm(np.ptp(self.bounds, axis=0)) < size
        return remedy + (", or stock.scale = 1000 where its file is in metres" if metres else "")

    def _with(self, vertices: ndarray) -> "ConvexStock":
        return replace(self, surface=TriangleMesh(vertices, self.surface.faces), proven=True)

    @cached_property
    def _normals(self) -> Float[ndarray, "f 3"]:
        size = np.linalg.norm(self.surface.face_vectors, axis=1, keepdims=True)
        return self.surface.face_vectors / np.where(size > 0, size, 1.0)

    def distances_and_normals(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"]]:
        """Signed distances (mm) and outward normals in one pass.

        A point outside lies on the other side of its nearest point than the body's middle does; a point
        inside on the same side.
        """
        closest, face = exact_closest(self.surface, points)
        away = points - closest
        distance = np.linalg.norm(away, axis=1)
        touching = distance <= np.finfo(float).eps * 16 * self.surface.diagonal
        sign = np.where((away * (closest - self.surface.vertices.mean(0))).sum(1) < 0, -1.0, 1.0)
        unit = away * (sign / np.where(touching, 1.0, distance))[:, None]
        return sign * distance, np.where(touching[:, None], self._normals[face], unit)

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """The body's mesh, its edges split until they are as short as those of a cylinder as wide."""
        return split_edges(self.surface, float(np.sqrt(8 * chord_tolerance * self.diameter)))


def _require_convex(mesh: TriangleMesh) -> None:
    """Every vertex, edge middle and face middle lies on the convex hull, and the volumes agree."""
    edges = half_edges(mesh).reshape(-1, 2)
    hull = convex_hull(mesh.vertices)
    probes = np.vstack([mesh.vertices, mesh.vertices[edges].mean(1), mesh.vertices[mesh.faces].mean(1)])
    inside = np.linalg.norm(probes - exact_closest(hull, probes)[0], axis=1)
    worst = int(np.argmax(inside))
    if inside[worst] > FLAT * mesh.diagonal:
        raise StockError(
            f"the stock is not convex: it lies {inside[worst]:.3f} mm inside its convex hull at "
            f"{place_name(probes[worst])}: give the hull",
            distance=float(inside[worst]),
            place=probes[worst],
        )
    if abs(mesh.volume - hull.volume) > FLAT * mesh.diagonal * mesh.area:
        message = (
            f"the stock is no single convex body: its faces hold {mesh.volume:.1f} mm3, their convex hull "
            f"{hull.volume:.1f}"
        )
        raise StockError(f"{message}: give the hull", distance=0.0, place=probes[worst])


def _make(job: StockJob, part: LyingPart, schedule: Schedule) -> ConvexStock:
    """The body of the job's file with the middle of its box on the axis; scale 0: the smallest copy that
    leaves the allowance."""
    if not job.mesh:
        raise StockError("a stock of kind 'mesh' needs a file: give stock.mesh = \"block.stl\" (mm, Z upright)")
    try:
        read = read_whole(job.mesh)
        mesh = TriangleMesh(read.mesh.vertices * MM_OF[read.unit or "mm"], read.mesh.faces)
        given = ConvexStock(mesh, file=job.mesh)
    except StockError as error:
        raise StockError(f"{job.mesh}: {error}", file=job.mesh, **error.evidence) from error
    stock = given.on_axis(part.middle)
    return stock.scale(job.scale or smallest_scale(stock, part.points, job.allowance))


def smallest_scale(stock: ConvexStock, points: Float[ndarray, "n 3"], allowance: float) -> float:
    """The least factor on the stock's size that leaves `allowance` mm over every point, by bisection."""

    def holds(scale: float) -> bool:
        return bool(stock.scale(scale).signed_distance(points).max() <= -allowance)

    low = 0.0
    high = 1.0
    while not holds(high):
        low = high
        high = 2 * high
        if high > LARGEST_SCALE:
            raise StockError(
                f"{stock.file}: no copy of this body on the Z axis holds the part: move the part with "
                "stock.offset_x, offset_y"
            )
    for _ in range(HALVINGS):
        between = (low + high) / 2
        low, high = (low, between) if holds(between) else (between, high)
    return high


KIND = StockKind(("mesh", "scale"), _make, "the body of its file, made before")
