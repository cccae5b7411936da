"""A cylinder bar along Z as stock. Distances are exact; at its edges the normal points from the edge to the
point that asks."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import StockError
from bonecam.job import StockJob
from bonecam.mesh.solids import cylinder
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.capsule import Capsule
from bonecam.setup.rounding import ALL, RoundedStock
from bonecam.setup.stock import LyingPart, Schedule, Stock, StockKind, finite_numbers, half_size, larger_sizes
from bonecam.setup.stocks.capsule import capsule_of_fewest_cuts


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
        centre = finite_numbers("a cylinder's centre", self.centre, 2)
        object.__setattr__(self, "centre", tuple(centre.tolist()))
        given = [self.radius, self.bottom, self.top]
        sizes = finite_numbers("a cylinder's radius, bottom and top", given, 3)
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
        """The middle of the axis, mm."""
        return np.array([*self.centre, (self.bottom + self.top) / 2])

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner of the bounding box, mm."""
        half = np.array([self.radius, self.radius, self.length / 2])
        return np.array([self.middle - half, self.middle + half])

    def move(self, shift: Float[ndarray, "3"]) -> "Cylinder":
        """The bar translated by `shift`, mm."""
        x, y, z = (float(value) for value in shift)
        centre = (self.centre[0] + x, self.centre[1] + y)
        return Cylinder(self.radius, self.bottom + z, self.top + z, centre)

    def offset(self, distance: float) -> "Cylinder":
        """The bar with its wall and ends moved outwards by `distance` mm; StockError where nothing is left."""
        return Cylinder(self.radius + distance, self.bottom - distance, self.top + distance, self.centre)

    def round_edges(self, radius: float) -> Stock:
        """The bar with its edges rounded by `radius` mm; by all of its own radius a capsule."""
        if radius >= ALL * self.radius and self.length > 2 * self.radius:
            start = np.array([*self.centre, self.bottom + self.radius])
            end = np.array([*self.centre, self.top - self.radius])
            return Capsule(start, end, self.radius)
        return RoundedStock(self.offset(-radius), radius)

    larger = larger_sizes

    def _local(self, points: ndarray) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """For each point the unit vector (n, 2) across the axis, the distances outside the wall and outside the
        nearer end (mm), and the sign of that end's normal."""
        flat = points[:, :2] - np.array(self.centre)
        reach = np.linalg.norm(flat, axis=1)
        on_axis = reach <= np.finfo(float).eps * self.radius
        across = np.where(on_axis[:, None], [1.0, 0.0], flat / np.where(on_axis, 1.0, reach)[:, None])
        up = points[:, 2] - self.middle[2]
        return across, reach - self.radius, np.abs(up) - self.length / 2, np.where(up >= 0, 1.0, -1.0)

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance of each point to the surface, mm, negative inside."""
        _, wall, end, _ = self._local(points)
        outside = np.hypot(np.maximum(wall, 0), np.maximum(end, 0))
        return np.minimum(np.maximum(wall, end), 0) + outside

    def normals(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals at the nearest points; from the edge to the point where the nearest is on an
        edge."""
        across, wall, end, side = self._local(points)
        inside = (wall <= 0) & (end <= 0)
        a = np.where(inside, wall >= end, np.maximum(wall, 0))
        b = np.where(inside, wall < end, np.maximum(end, 0))
        size = np.hypot(a, b)
        return np.column_stack([across * (a / size)[:, None], side * b / size])

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh, its vertices on the surface, its faces within `chord_tolerance` mm of it and
        of nearly one size."""
        upright = cylinder(self.radius, self.bottom, self.top, chord_tolerance)
        return TriangleMesh(upright.vertices + np.array([*self.centre, 0.0]), upright.faces)


def _make(job: StockJob, part: LyingPart, schedule: Schedule) -> Cylinder:
    """The bar of a job; without sizes the one round the best capsule, because it is rounded to that."""
    if not (job.diameter or job.length):
        capsule = capsule_of_fewest_cuts(part.points, job, schedule)
        bottom, top = capsule.bounds[:, 2].tolist()
        return Cylinder(capsule.radius, bottom, top)
    reach = np.hypot(part.points[:, 0], part.points[:, 1])
    radius = half_size(job.diameter, reach, job.allowance)
    half = half_size(job.length, part.points[:, 2] - part.middle, job.allowance)
    return Cylinder(radius, part.middle - half, part.middle + half)


KIND = StockKind(("diameter", "length"), _make, "a round bar, both ends faced flat")
