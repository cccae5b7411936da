"""A convex body with all its edges rounded: a core and everything within `radius` of it. A morph can follow
it, an edge it cannot.

Rounding a stock S by rho takes S eroded by rho as core: of all bodies inside S that a ball of radius rho can
roll round, this is the largest. A cylinder bar rounded by its radius is the published capsule (Gan et al.
2014, section 4.2).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from bonecam.arrays import ROUNDING
from bonecam.errors import StockError, place_name
from bonecam.mesh.hull import convex_hull
from bonecam.mesh.remeshing import bisected
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.box import Box
from bonecam.setup.convex import ConvexStock
from bonecam.setup.cylinder import Cylinder
from bonecam.setup.stock import Capsule, Stock, place_in, smallest_capsule

THIN, HALVINGS, SAME = 0.98, 20, 1e-7
UPRIGHT = 0.5
"""Cosine of the most a face may be turned from the surface at its corners."""
BISECTIONS = 60
"""More than twice as often as halves every edge of a bone's stock down to a micron."""
ROOM = 0.25
"""Levels that pass between the part and the stock's wall need some: in less, waves of one break the next, and
mending grows."""
MERGED, THICK = 0.01, 0.1
"""Corners of a moved mesh that are as near to each other (mm, and as a share of the radius of what fits in)
are one: the slivers between them make distances take three times as long."""


@dataclass(frozen=True, eq=False)
class Rounded(Stock):
    """All points within `radius` mm of `core`."""

    core: Stock
    radius: float
    kind: str = "rounded"

    @property
    def diameter(self) -> float:
        """Largest extent across the axis, mm."""
        return self.core.diameter + 2 * self.radius

    @property
    def length(self) -> float:
        """Extent along the axis, mm."""
        return self.core.length + 2 * self.radius

    @property
    def middle(self) -> Float[ndarray, "3"]:
        """The middle of the body."""
        return self.core.middle

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner, mm."""
        return self.core.bounds + self.radius * np.array([[-1.0], [1.0]])

    def moved(self, shift: Float[ndarray, "3"]) -> "Rounded":
        """The same body elsewhere."""
        return Rounded(self.core.moved(shift), self.radius)

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance to the surface, mm, negative inside."""
        return self.core.signed_distance(points) - self.radius

    def outward(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals at the nearest points."""
        return self.core.outward(points)

    def way_out(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"]]:
        """Both, as the core answers them."""
        distance, out = self.core.way_out(points)
        return distance - self.radius, out

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh that does not cut itself, its vertices on the surface, its faces within
        `chord_tolerance` of it.

        The nearest points on a convex body to a mesh round it lie in the same order, no farther apart. Faces
        are cut until they are true.
        """
        axis = np.array([*self.middle[:2], 0.0])
        around = smallest_capsule(
            self.core.mesh(chord_tolerance).vertices - axis, self.radius + chord_tolerance
        ).moved(axis)
        mesh = self._pulled(around.mesh(chord_tolerance), 0)
        for _ in range(BISECTIONS):
            if not (untrue := self._untrue(mesh, chord_tolerance)).any():
                return mesh
            mesh = self._pulled(bisected(mesh, untrue), len(mesh.vertices))
        place = mesh.vertices[mesh.faces[np.argmax(untrue), 0]]
        raise StockError(
            f"no mesh of the rounded stock is within {chord_tolerance:g} mm of it at {place_name(place)}: give a stock with rounder "
            "edges, or raise levels.chord_tolerance",
            distance=chord_tolerance,
            place=place,
        )

    def _pulled(self, mesh: TriangleMesh, first: int) -> TriangleMesh:
        """The vertices from the `first` on taken to the surface, where those before them are."""
        return TriangleMesh(
            np.vstack([mesh.vertices[:first], self.nearest(mesh.vertices[first:])]), mesh.faces
        )

    def _untrue(self, mesh: TriangleMesh, chord_tolerance: float) -> Bool[ndarray, " f"]:
        """Which faces may lie too deep, or are tilted.

        The body lies below the plane that touches it over the middle of a face: that plane's height over the
        corners bounds the depth. A closed mesh of which no face is turned over covers the convex body once.
        """
        corners = mesh.vertices[mesh.faces]
        middles = corners.mean(1)
        distance, out = self.way_out(middles)
        height = -distance - np.einsum("fcx,fx->fc", corners - middles[:, None], out).min(1)
        upright = np.einsum("fcx,fx->fc", self.outward(mesh.vertices)[mesh.faces], mesh.face_vectors).min(1)
        return np.asarray(
            (height > chord_tolerance) | (upright < UPRIGHT * np.linalg.norm(mesh.face_vectors, axis=1))
        )


def offset(stock: Stock, distance: float) -> Stock:
    """The body bounded by the stock's flat and round walls moved by `distance` mm (negative: inwards); edges
    stay edges.

    Raises StockError (or ValueError for a capsule) where nothing is left.
    """
    if isinstance(stock, Capsule):
        return Capsule(stock.start, stock.end, stock.radius + distance)
    if isinstance(stock, Cylinder):
        return Cylinder(stock.radius + distance, stock.bottom - distance, stock.top + distance, stock.centre)
    if isinstance(stock, Box):
        return Box(stock.low - distance, stock.high + distance)
    if isinstance(stock, ConvexStock):
        return _offset_planes(stock, distance)
    raise ValueError(f"a {stock.kind} has no walls to move")


def planes_of(mesh: TriangleMesh) -> Float[ndarray, "k 4"]:
    """Unit normals and offsets, n . x + d <= 0 inside, of a convex mesh's faces; coplanar faces once."""
    return _once(np.asarray(ConvexHull(mesh.vertices).equations), SAME)


def _offset_planes(stock: ConvexStock, distance: float) -> ConvexStock:
    planes = planes_of(stock.surface)
    moved = np.column_stack([planes[:, :3], planes[:, 3] - distance])
    inside, depth = _deepest(moved)
    return ConvexStock(convex_hull(_once(_corners(moved, inside), min(MERGED, THICK * depth))), proven=True)


def _once(rows: ndarray, cell: float) -> ndarray:
    """Of rows that lie in one cell of a grid the first."""
    _, first = np.unique(np.round(rows / cell), axis=0, return_index=True)
    return np.asarray(rows[np.sort(first)])


def _deepest(planes: ndarray) -> tuple[ndarray, float]:
    """The point farthest inside n . x + d <= 0, and how far."""
    A = np.column_stack([planes[:, :3], np.ones(len(planes))])
    found = np.asarray(
        linprog([0, 0, 0, -1], A_ub=A, b_ub=-planes[:, 3], bounds=[(None, None)] * 4).x, dtype=np.float64
    )
    return found[:3], float(found[3])


def intersection(planes: Float[ndarray, "k 4"], inside: Float[ndarray, "3"]) -> TriangleMesh:
    """The closed outward mesh of all points with n . x + d <= 0, given one strictly inside."""
    return convex_hull(_corners(planes, inside))


def _corners(planes: ndarray, inside: ndarray) -> ndarray:
    return np.asarray(HalfspaceIntersection(planes, inside).intersections)


def inradius(stock: Stock) -> float:
    """Radius of the largest ball inside the stock, mm."""
    if isinstance(stock, ConvexStock):
        return _deepest(planes_of(stock.surface))[1]
    return float(-stock.signed_distance(stock.middle[None])[0])


def rounded(stock: Stock, radius: float) -> Stock:
    """The stock with its edges rounded by `radius` mm; a cylinder rounded wholly is a capsule."""
    if isinstance(stock, Cylinder) and radius >= THIN * stock.radius and stock.length > 2 * stock.radius:
        foot = np.array([*stock.centre, stock.bottom + stock.radius])
        return Capsule(foot, np.array([*stock.centre, stock.top - stock.radius]), stock.radius)
    return Rounded(offset(stock, -radius), radius)


def roundest(stock: Stock, points: Float[ndarray, "n 3"], margin: float) -> Stock | None:
    """The stock rounded by the largest radius that leaves `margin` mm over every point; None where a tenth of
    its inradius does not.

    ROOM mm, or half of what the stock itself has over a point, is left where some radius does that.
    """
    most = inradius(stock)
    room = np.clip(-stock.signed_distance(points) / 2, margin, max(margin, ROOM))

    def holds(radius: float) -> bool:
        return bool((rounded(stock, radius).signed_distance(points) + room).max() <= ROUNDING)

    low, high = 0.1 * most, THIN * most
    if holds(high):
        return rounded(stock, high)
    if not holds(low):
        room[:] = margin
        if not holds(low):
            return None
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return rounded(stock, low)


def require_roundable(
    stock: Stock, points: Float[ndarray, "n 3"], margin: float, otherwise: str = ""
) -> Stock:
    """The roundest body inside the stock; StockError with the place where the part comes too near to an edge
    for any.

    `otherwise` ends its remedy.
    """
    inner = stock if isinstance(stock, Capsule | Rounded) else roundest(stock, points, margin)
    if inner is None:
        worst = points[np.argmax(rounded(stock, 0.1 * inradius(stock)).signed_distance(points))]
        raise StockError(
            f"the part comes too near to the edges of the stock ({stock}) at {place_in(stock, worst)} "
            f"to round them: give a larger stock or a capsule{otherwise}",
            distance=float(stock.signed_distance(worst[None])[0]),
            place=worst,
        )
    return inner
