"""A cylinder bar about the Z axis as stock: exact distances; its edges have no single normal, where any
between is given."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import StockError
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock, numbers, revolved


@dataclass(frozen=True, eq=False)
class Cylinder(Stock):
    """All points within `radius` of the Z axis with bottom <= z <= top, mm. Raises StockError where there are
    none."""

    radius: float
    bottom: float
    top: float
    centre: tuple[float, float] = (0.0, 0.0)
    kind: str = "cylinder"

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", tuple(numbers("a cylinder's centre", self.centre, 2).tolist()))
        sizes = numbers("a cylinder's radius, bottom and top", [self.radius, self.bottom, self.top], 3)
        for name, size in zip(("radius", "bottom", "top"), sizes.tolist(), strict=True):
            object.__setattr__(self, name, size)
        if not (self.radius > 0 and self.bottom < self.top):
            raise StockError(
                f"a bar of diameter {2 * self.radius:g} and length {self.top - self.bottom:g} mm: give both positive"
            )

    @property
    def diameter(self) -> float:
        """Diameter, mm."""
        return 2 * self.radius

    @property
    def length(self) -> float:
        """Length, mm."""
        return self.top - self.bottom

    @property
    def middle(self) -> Float[ndarray, "3"]:
        """The middle of the axis."""
        return np.array([*self.centre, (self.bottom + self.top) / 2])

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner, mm."""
        half = np.array([self.radius, self.radius, self.length / 2])
        return np.array([self.middle - half, self.middle + half])

    def moved(self, shift: Float[ndarray, "3"]) -> "Cylinder":
        """The same bar elsewhere."""
        centre = (self.centre[0] + float(shift[0]), self.centre[1] + float(shift[1]))
        return Cylinder(self.radius, self.bottom + float(shift[2]), self.top + float(shift[2]), centre)

    def _local(self, points: ndarray) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """For each point: across (unit, (n, 2)), distance past the wall, past the nearer end, and the end's
        side."""
        flat = points[:, :2] - np.array(self.centre)
        reach = np.linalg.norm(flat, axis=1)
        on_axis = reach <= np.finfo(float).eps * self.radius
        across = np.where(on_axis[:, None], [1.0, 0.0], flat / np.where(on_axis, 1.0, reach)[:, None])
        up = points[:, 2] - self.middle[2]
        return across, reach - self.radius, np.abs(up) - self.length / 2, np.where(up >= 0, 1.0, -1.0)

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance to the surface, mm, negative inside."""
        _, wall, end, _ = self._local(points)
        return np.asarray(
            np.minimum(np.maximum(wall, end), 0) + np.hypot(np.maximum(wall, 0), np.maximum(end, 0))
        )

    def outward(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals at the nearest points; away from the edge for points whose nearest is on the
        edge."""
        across, wall, end, side = self._local(points)
        inside = (wall <= 0) & (end <= 0)
        a = np.where(inside, wall >= end, np.maximum(wall, 0))
        b = np.where(inside, wall < end, np.maximum(end, 0))
        size = np.hypot(a, b)
        return np.column_stack([across * (a / size)[:, None], side * b / size])

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh, its vertices on the surface, its faces within `chord_tolerance` of it and
        nearly even."""
        turn = np.arccos(max(1 - chord_tolerance / (2 * self.radius), 0.0))
        around = max(12, int(np.ceil(np.pi / turn)))
        step = 2 * np.pi * self.radius / around
        disc = np.linspace(0, self.radius, max(2, int(np.ceil(self.radius / step))) + 1)[1:]
        rises = np.linspace(self.bottom, self.top, max(2, int(np.ceil(self.length / step))) + 1)
        reach = np.concatenate([disc, np.full(len(rises) - 2, self.radius), disc[::-1]])
        height = np.concatenate([np.full(len(disc), self.bottom), rises[1:-1], np.full(len(disc), self.top)])
        upright = revolved(reach, height, (self.bottom, self.top), around)
        return TriangleMesh(upright.vertices + np.array([*self.centre, 0.0]), upright.faces)
