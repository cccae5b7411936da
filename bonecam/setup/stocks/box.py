"""A box bar, its sides parallel to the coordinate axes, as stock. Distances are exact; at edges and corners the
normal points from there to the point that asks."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import ConvexHull

from bonecam.errors import StockError
from bonecam.job import StockJob
from bonecam.mesh.pose import rotation
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.rounding import RoundedStock
from bonecam.setup.stock import (
    LyingPart,
    Schedule,
    Stock,
    StockKind,
    box_sizes,
    finite_numbers,
    half_size,
    larger_sizes,
)


@dataclass(frozen=True, eq=False)
class Box(Stock):
    """All points between two corners, mm. Raises StockError where there are none."""

    low: Float[ndarray, "3"]
    high: Float[ndarray, "3"]
    kind: str = "box"

    def __post_init__(self) -> None:
        object.__setattr__(self, "low", finite_numbers("a box's low corner", self.low, 3))
        object.__setattr__(self, "high", finite_numbers("a box's high corner", self.high, 3))
        if not (self.low < self.high).all():
            width, depth, length = self.high - self.low
            raise StockError(f"a box of {width:g} x {depth:g} x {length:g} mm: give all three positive")

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner, mm."""
        return np.array([self.low, self.high])

    @property
    def sizes(self) -> dict[str, float]:
        """The sides of the stock along X, Y and Z, mm."""
        return box_sizes(self.bounds)

    def move(self, shift: Float[ndarray, "3"]) -> "Box":
        """The box translated by `shift`, mm."""
        return Box(self.low + shift, self.high + shift)

    def offset(self, distance: float) -> "Box":
        """The box with its faces moved outwards by `distance` mm; StockError where nothing is left."""
        return Box(self.low - distance, self.high + distance)

    def round_edges(self, radius: float) -> RoundedStock:
        """The box with its edges and corners rounded by `radius` mm."""
        return RoundedStock(self.offset(-radius), radius)

    larger = larger_sizes

    def _outside(self, points: ndarray) -> tuple[ndarray, ndarray]:
        """How far each point is outside the nearer face of each pair (n, 3), mm, and the signs of those faces'
        normals."""
        from_middle = points - self.middle
        distance = np.abs(from_middle) - (self.high - self.low) / 2
        return distance, np.where(from_middle >= 0, 1.0, -1.0)

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance of each point to the surface, mm, negative inside."""
        distance, _ = self._outside(points)
        return np.minimum(distance.max(1), 0) + np.linalg.norm(np.maximum(distance, 0), axis=1)

    def normals(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals at the nearest points; from the edge or corner to the point where the nearest is
        on one."""
        distance, sign = self._outside(points)
        nearest_face = np.eye(3)[np.argmax(distance, axis=1)]
        normal = np.where((distance.max(1) > 0)[:, None], np.maximum(distance, 0), nearest_face)
        return sign * normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh of faces of nearly one size, as fine as the mesh of a cylinder as wide."""
        step = np.sqrt(4 * chord_tolerance * self.diameter)
        counts = np.maximum(2, np.ceil((self.high - self.low) / step)).astype(int)
        # Corners (n, 3) and outward quads (m, 4) on the surface of a lattice of counts cells.
        lattice = []
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            i, j = (k.ravel() for k in np.meshgrid(np.arange(counts[u]), np.arange(counts[v]), indexing="ij"))
            for end in (0, counts[axis]):
                quad = np.zeros((len(i), 4, 3), dtype=int)
                quad[:, :, axis] = end
                quad[:, :, u] = np.column_stack([i, i + 1, i + 1, i])
                quad[:, :, v] = np.column_stack([j, j, j + 1, j + 1])
                lattice.append(quad if end else quad[:, ::-1])
        corners, index = np.unique(np.vstack(lattice).reshape(-1, 3), axis=0, return_inverse=True)
        quads = index.reshape(-1, 4)
        faces = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
        return TriangleMesh(self.low + corners / counts * (self.high - self.low), faces)


def _make(job: StockJob, part: LyingPart, schedule: Schedule) -> Box:
    """The box of a job; sides that are not given leave the allowance."""
    middle = np.array([0.0, 0.0, part.middle])
    sizes = zip((job.width, job.depth, job.length), (part.points - middle).T)
    half = np.array([half_size(size, extent, job.allowance) for size, extent in sizes])
    return Box(middle - half, middle + half)


def _turn(job: StockJob, points: Float[ndarray, "n 3"]) -> tuple[float, Float[ndarray, "2"]] | None:
    """The turn of the smallest base, where neither width nor depth nor a turn is given."""
    if job.width or job.depth or job.turn_deg:
        return None
    # The turn (degrees) after which the rectangle round the points, `allowance` mm larger to each side, has the least
    # area, and its middle then. A side of it lies along one of the hull's edges (Freeman & Shapira 1975).
    flat = points[:, :2]
    hull = flat[ConvexHull(flat).vertices]
    edges = np.roll(hull, -1, axis=0) - hull
    turns = np.mod(-np.degrees(np.arctan2(edges[:, 1], edges[:, 0])), 90.0)
    bases = [hull @ rotation(0.0, 0.0, float(turn))[:2, :2].T for turn in turns]
    least = int(np.argmin([np.prod(np.ptp(base, axis=0) + 2 * job.allowance) for base in bases]))
    return float(turns[least]), (bases[least].min(0) + bases[least].max(0)) / 2


KIND = StockKind(
    ("width", "depth", "length"), _make, "a square bar, its sides along X and Y, both ends faced flat", turn=_turn
)
