"""A box bar upright on Z as stock: exact distances; nearest points of its edges and corners have no single
normal."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import StockError
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock, numbers, sides


@dataclass(frozen=True, eq=False)
class Box(Stock):
    """All points between two corners, mm. Raises StockError where there are none."""

    low: Float[ndarray, "3"]
    high: Float[ndarray, "3"]
    kind: str = "box"

    def __post_init__(self) -> None:
        object.__setattr__(self, "low", numbers("a box's low corner", self.low, 3))
        object.__setattr__(self, "high", numbers("a box's high corner", self.high, 3))
        if not (self.low < self.high).all():
            width, depth, length = self.high - self.low
            raise StockError(f"a box of {width:g} x {depth:g} x {length:g} mm: give all three positive")

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner, mm."""
        return np.array([self.low, self.high])

    @property
    def diameter(self) -> float:
        """The longer side across the axis, mm."""
        return float((self.high - self.low)[:2].max())

    @property
    def length(self) -> float:
        """Extent along Z, mm."""
        return float(self.high[2] - self.low[2])

    @property
    def sizes(self) -> dict[str, float]:
        """Its sides along X, Y and Z, mm."""
        return sides(self.bounds)

    @property
    def middle(self) -> Float[ndarray, "3"]:
        """The middle of the body."""
        return np.asarray((self.low + self.high) / 2)

    def moved(self, shift: Float[ndarray, "3"]) -> "Box":
        """The same box elsewhere."""
        return Box(self.low + shift, self.high + shift)

    def _past(self, points: ndarray) -> tuple[ndarray, ndarray]:
        """How far each point is past the nearer of each pair of faces (n, 3), and on which side."""
        from_middle = points - self.middle
        return np.abs(from_middle) - (self.high - self.low) / 2, np.where(from_middle >= 0, 1.0, -1.0)

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance to the surface, mm, negative inside."""
        past, _ = self._past(points)
        return np.asarray(np.minimum(past.max(1), 0) + np.linalg.norm(np.maximum(past, 0), axis=1))

    def outward(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals at the nearest points; away from the edge or corner where that is the
        nearest."""
        past, side = self._past(points)
        outside = np.maximum(past, 0)
        nearest_face = np.eye(3)[np.argmax(past, axis=1)]
        n = np.where((past.max(1) > 0)[:, None], outside, nearest_face)
        return np.asarray(side * n / np.linalg.norm(n, axis=1, keepdims=True))

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh of nearly even faces, as fine as that of a cylinder as wide would be."""
        step = np.sqrt(4 * chord_tolerance * self.diameter)
        counts = np.maximum(2, np.ceil((self.high - self.low) / step)).astype(int)
        corners, quads = _lattice(counts)
        faces = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
        return TriangleMesh(self.low + corners / counts * (self.high - self.low), faces)


def _lattice(counts: ndarray) -> tuple[ndarray, ndarray]:
    """Corners (n, 3) and outward quads (m, 4) on the surface of a lattice of counts cells."""
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        i, j = (k.ravel() for k in np.meshgrid(np.arange(counts[u]), np.arange(counts[v]), indexing="ij"))
        for end in (0, counts[axis]):
            quad = np.zeros((len(i), 4, 3), dtype=int)
            quad[:, :, axis] = end
            quad[:, :, u] = np.column_stack([i, i + 1, i + 1, i])
            quad[:, :, v] = np.column_stack([j, j, j + 1, j + 1])
            quads.append(quad if end else quad[:, ::-1])
    corners, index = np.unique(np.vstack(quads).reshape(-1, 3), axis=0, return_inverse=True)
    return corners, index.reshape(-1, 4)
