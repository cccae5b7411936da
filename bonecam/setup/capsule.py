"""A capsule: a cylinder with half-balls at its ends, the stock of Gan et al. 2014 (section 4.2).

It is every point within `radius` of an axis segment, so that its signed distance is exact everywhere:
|x - nearest axis point| - radius.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import StockError
from bonecam.kernels import distances
from bonecam.mesh.solids import half_angle, revolve, segments_around
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock, finite_numbers, larger_sizes

RADII = 241
"""So many radii are tried where a capsule is found: volumes then differ by 0.3 % from one to the next."""
RADIUS_SPAN = 1.6
"""The largest radius that is tried, in radii of the thinnest capsule."""
ENCLOSED_CHORD = 0.02
"""Chord tolerance, mm, of the mesh of a stock that a capsule is put round."""
ENCLOSED_ALLOWANCE = 0.03
"""Material, mm, between that mesh and the capsule: more than the chord tolerance."""


@dataclass(frozen=True, eq=False)
class Capsule(Stock):
    """All points within `radius` of the segment from `start` to `end`, mm. Raises StockError where there are
    none."""

    start: Float[ndarray, "3"]
    end: Float[ndarray, "3"]
    radius: float
    kind: str = "capsule"

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", finite_numbers("a capsule's start", self.start, 3))
        object.__setattr__(self, "end", finite_numbers("a capsule's end", self.end, 3))
        object.__setattr__(self, "radius", float(finite_numbers("a capsule's radius", [self.radius], 1)[0]))
        if self.radius <= 0:
            raise StockError(f"a capsule of radius {self.radius:g} mm: give a positive one")

    @property
    def diameter(self) -> float:
        """Diameter, mm."""
        return 2 * self.radius

    @property
    def length(self) -> float:
        """Length over both caps, mm."""
        return float(np.linalg.norm(self.end - self.start)) + 2 * self.radius

    @property
    def volume(self) -> float:
        """Volume, mm^3."""
        return float(np.pi * self.radius**2 * (self.length - 2 * self.radius / 3))

    @property
    def middle(self) -> Float[ndarray, "3"]:
        """The middle of the axis, mm."""
        return (self.start + self.end) / 2

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner of the bounding box, mm."""
        low = np.minimum(self.start, self.end) - self.radius
        high = np.maximum(self.start, self.end) + self.radius
        return np.array([low, high])

    has_edges = False
    has_flats = False

    def move(self, shift: Float[ndarray, "3"]) -> "Capsule":
        """The capsule translated by `shift`, mm."""
        return Capsule(self.start + shift, self.end + shift, self.radius)

    def offset(self, distance: float) -> "Capsule":
        """The capsule about the same axis whose radius is `distance` mm larger; StockError where none is left."""
        return Capsule(self.start, self.end, self.radius + distance)

    def round_edges(self, radius: float) -> "Capsule":
        """The capsule itself: it has no edges."""
        return self

    def distances_and_normals(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"]]:
        """Signed distances (mm) and outward normals in one pass."""
        points = np.require(points, np.float64, ["C", "W"])
        distance = np.empty(len(points))
        normals = np.empty((len(points), 3))
        axis = self.end - self.start
        distances.distances_and_normals(
            points,
            self.start,
            axis=axis,
            radius=float(self.radius),
            sideways=self._frame[0],
            distance=distance,
            out=normals,
        )
        return distance, normals

    larger = larger_sizes

    @cached_property
    def _frame(self) -> Float[ndarray, "3 3"]:
        """Two unit vectors across the axis and the axis itself, right-handed."""
        axis = self.end - self.start
        size = np.linalg.norm(axis)
        along = axis / size if size > 0 else np.array([0.0, 0.0, 1.0])
        across = np.cross(np.eye(3)[1 if abs(along[1]) < 0.9 else 0], along)
        across /= np.linalg.norm(across)
        return np.array([across, np.cross(along, across), along])

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh, its vertices on the surface, its faces within `chord_tolerance` mm of it and
        of nearly one size."""
        around = segments_around(self.radius, chord_tolerance)
        quarter = max(4, int(np.ceil(np.pi / 4 / half_angle(self.radius, chord_tolerance))))
        latitude = np.linspace(0, np.pi / 2, quarter + 1)
        straight = self.length - 2 * self.radius
        rises = np.linspace(0, straight, int(np.ceil(straight / (2 * np.pi * self.radius / around))) + 1)

        height = self.radius * np.concatenate([-np.cos(latitude[1:-1]), 0 * rises, np.cos(latitude[-2:0:-1])])
        radii = self.radius * np.concatenate([np.sin(latitude[1:-1]), 0 * rises + 1, np.sin(latitude[-2:0:-1])])
        lift = np.concatenate([np.zeros(quarter - 1), rises, np.full(quarter - 1, straight)])
        upright = revolve(radii, height + lift, (-self.radius, self.length - self.radius), around)
        return TriangleMesh(upright.vertices @ self._frame + self.start, upright.faces)


def enclosing_capsules(points: Float[ndarray, "n 3"], allowance: float) -> list[Capsule]:
    """Capsules on the Z axis that hold the points with `allowance` mm of material around them, from the
    thinnest to RADIUS_SPAN times as thick.

    For a radius the caps move in until a point is `allowance` below their surface.
    """
    if allowance <= 0:
        raise StockError(
            f"an allowance of {allowance} mm leaves no material round the part: give a positive one", distance=allowance
        )
    reach = np.linalg.norm(points[:, :2], axis=1)
    radii = reach.max() * np.linspace(1 + 1e-9, RADIUS_SPAN, RADII)
    return [shortest_capsule(points, reach, float(inner), float(inner) + allowance) for inner in radii]


def shortest_capsule(
    points: Float[ndarray, "n 3"], reach: Float[ndarray, " n"], inner: float, radius: float
) -> Capsule:
    """The shortest capsule of `radius` on the Z axis whose axis segment is within `inner` of every point; mm.

    `reach` are the distances of the points from the Z axis, each less than `inner`.
    """
    rise = np.sqrt(inner**2 - reach**2)
    low = float((points[:, 2] + rise).min())
    high = float((points[:, 2] - rise).max())
    if low > high:
        low = high = (low + high) / 2
    return Capsule(np.array([0, 0, low]), np.array([0, 0, high]), radius)


def smallest_capsule(points: Float[ndarray, "n 3"], allowance: float) -> Capsule:
    """The capsule of `enclosing_capsules` of the least volume."""
    return min(enclosing_capsules(points, allowance), key=lambda enclosing: enclosing.volume)


def enclosing_capsule(stock: Stock) -> Capsule:
    """An upright capsule round a stock; for a capsule that itself."""
    if isinstance(stock, Capsule):
        return stock
    axis = np.array([stock.middle[0], stock.middle[1], 0.0])
    vertices = stock.mesh(ENCLOSED_CHORD).vertices
    return smallest_capsule(vertices - axis, ENCLOSED_ALLOWANCE).move(axis)
