"""Stocks with edges, rounded: what a morph can follow.

Whether the stock holds the part with a margin, and what to change where it does not.

Convex polyhedra as intersections of half-spaces n . x + d <= 0, rows (n, d) of an array (k, 4).

A convex body with all its edges rounded: a core and everything within `radius` of it. A morph can follow
it, an edge it cannot.

Rounding a stock S by rho takes S eroded by rho as core: of all bodies inside S that a ball of radius rho can
roll round, this is the largest. A cylinder bar rounded by its radius is the published capsule (Gan et al.
2014, section 4.2).

The largest radius by which the edges of a stock can be rounded and still hold the part.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from bonecam.arrays import ROUNDING
from bonecam.errors import StockError, place_name
from bonecam.mesh.meshlab import bisect_faces
from bonecam.mesh.smooth_surface import convex_hull
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.capsule import smallest_capsule
from bonecam.setup.stock import Stock

MARGIN = 0.05
"""Least material that the stock must have outside the part, mm: half the default finishing depth."""


def require_inside(
    stock: Stock, points: Float[ndarray, "n 3"], margin: float, otherwise: str = "", spare: float = 0.0
) -> None:
    """Raise StockError where a point has less than `margin` mm of the stock's material outside it.

    The remedy asks for `spare` mm more, by which a surface that is fitted to the points may leave them; `otherwise` is
    added to it. Evidence: `distance` (signed, mm) and `place` of the worst point.
    """
    distance = stock.signed_distance(points)
    worst = int(np.argmax(distance))
    if distance[worst] <= -margin + ROUNDING:
        return
    if distance[worst] > 0:
        trouble = f"leaves it by {distance[worst]:.3f} mm"
    else:
        trouble = f"comes within {abs(distance[worst]):.3f} mm of its wall"
    where = place_in(stock, points[worst])
    remedy = stock.larger(points[distance > -margin - spare], float(distance[worst]) + margin + spare)
    raise StockError(
        f"the stock ({stock}) does not hold the part, which {trouble} at {where}: {remedy}{otherwise}",
        distance=float(distance[worst]),
        place=points[worst],
    )


def place_in(stock: Stock, place: Float[ndarray, "3"]) -> str:
    """A place (mm) as messages name it, with the stock's heights in the same frame."""
    low, high = stock.bounds[:, 2]
    return f"{place_name(place)} (the stock reaches from z = {low:.2f} to {high:.2f})"


COPLANAR = 1e-7
"""Planes are one where unit normals and offsets (mm) agree to this, which is the rounding of a hull's planes."""
MERGED = 0.01
"""Corners of an offset body nearer to each other than this, mm, are one: the slivers between them make
distances take three times as long."""
MERGED_SHARE = 0.1
"""MERGED is at most this share of the radius of the largest ball inside the offset body."""


def half_spaces_of(mesh: TriangleMesh) -> Float[ndarray, "k 4"]:
    """The half-spaces of a convex mesh's faces, outward unit normals, coplanar faces once."""
    return _first_of_cells(np.asarray(ConvexHull(mesh.vertices).equations), COPLANAR)


def deepest_point(planes: Float[ndarray, "k 4"]) -> tuple[Float[ndarray, "3"], float]:
    """Centre and radius of the largest ball inside half-spaces with unit normals; negative where none is.

    The linear program max r, n . x + r <= -d (the Chebyshev centre: Boyd & Vandenberghe 2004, section 4.3.1).
    """
    A = np.column_stack([planes[:, :3], np.ones(len(planes))])
    solution = linprog([0, 0, 0, -1], A_ub=A, b_ub=-planes[:, 3], bounds=[(None, None)] * 4)
    ball = np.asarray(solution.x, dtype=np.float64)
    return ball[:3], float(ball[3])


def intersect(planes: Float[ndarray, "k 4"], inside: Float[ndarray, "3"]) -> TriangleMesh:
    """The closed outward mesh of the intersection of half-spaces, given a point strictly inside."""
    return convex_hull(_corners(planes, inside))


def offset_polyhedron(mesh: TriangleMesh, distance: float) -> TriangleMesh:
    """The convex mesh with its faces moved outwards by `distance` mm, corners nearer than MERGED merged."""
    planes = half_spaces_of(mesh)
    moved = np.column_stack([planes[:, :3], planes[:, 3] - distance])
    inside, depth = deepest_point(moved)
    corners = _first_of_cells(_corners(moved, inside), min(MERGED, MERGED_SHARE * depth))
    return convex_hull(corners)


def _first_of_cells(rows: Float[ndarray, "n d"], cell: float) -> Float[ndarray, "m d"]:
    """The first of the rows that lie in one cell of a grid of this width."""
    _, first = np.unique(np.round(rows / cell), axis=0, return_index=True)
    return rows[np.sort(first)]


def _corners(planes: Float[ndarray, "k 4"], inside: Float[ndarray, "3"]) -> Float[ndarray, "n 3"]:
    return np.asarray(HalfspaceIntersection(planes, inside).intersections)


LARGEST_TURN = 0.5
"""Cosine of the largest angle between a face's normal and the surface's normals at its corners."""
ALL = 0.98
"""A radius of this share of a stock's inradius is all of it: what is left of the core is too thin to compute
with."""
BISECTIONS = 60
"""Most rounds of bisection of a mesh: more than twice as many as halve every edge of a bone's stock down to a
micron."""


@dataclass(frozen=True, eq=False)
class RoundedStock(Stock):
    """All points within `radius` mm of `core`."""

    core: Stock
    radius: float
    kind: str = "rounded"

    @property
    def diameter(self) -> float:
        """Largest extent across the Z axis, mm."""
        return self.core.diameter + 2 * self.radius

    @property
    def length(self) -> float:
        """Extent along the axis, mm."""
        return self.core.length + 2 * self.radius

    @property
    def middle(self) -> Float[ndarray, "3"]:
        """The middle of the body, mm."""
        return self.core.middle

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner of the bounding box, mm."""
        return self.core.bounds + self.radius * np.array([[-1.0], [1.0]])

    has_edges = False

    def move(self, shift: Float[ndarray, "3"]) -> "RoundedStock":
        """The body translated by `shift`, mm."""
        return RoundedStock(self.core.move(shift), self.radius)

    def offset(self, distance: float) -> Stock:
        """The body and everything within `distance` mm of it; for a negative one what is as deep inside it."""
        radius = self.radius + distance
        return RoundedStock(self.core, radius) if radius > 0 else self.core.offset(radius)

    def round_edges(self, radius: float) -> "RoundedStock":
        """The body itself: it has no edges."""
        return self

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance of each point to the surface, mm, negative inside."""
        return self.core.signed_distance(points) - self.radius

    def normals(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals of the surface at the points nearest to `points`."""
        return self.core.normals(points)

    def distances_and_normals(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"]]:
        """Signed distances (mm) and outward normals in one pass."""
        distance, normals = self.core.distances_and_normals(points)
        return distance - self.radius, normals

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh without self-intersections, its vertices on the surface, its faces within
        `chord_tolerance` mm of it.

        The nearest points on a convex body to a mesh round it lie in the same order, no farther apart. Faces
        are bisected until they are near enough.
        """
        axis = np.array([*self.middle[:2], 0.0])
        core = self.core.mesh(chord_tolerance).vertices - axis
        around = smallest_capsule(core, self.radius + chord_tolerance).move(axis)
        mesh = self._project(around.mesh(chord_tolerance), 0)
        for _ in range(BISECTIONS):
            # Which faces may be farther than `chord_tolerance` mm from the surface, or are tilted against it. The body
            # lies below the plane that touches it over the middle of a face: that plane's height over the corners
            # bounds the depth. A closed mesh of which no face is turned over covers the convex body once.
            corners = mesh.vertices[mesh.faces]
            middles = corners.mean(1)
            distance, normals = self.distances_and_normals(middles)
            height = -distance - np.einsum("fcx,fx->fc", corners - middles[:, None], normals).min(1)
            at_corners = self.normals(mesh.vertices)[mesh.faces]
            turned = np.einsum("fcx,fx->fc", at_corners, mesh.face_vectors).min(1)
            tilted = turned < LARGEST_TURN * np.linalg.norm(mesh.face_vectors, axis=1)
            coarse = (height > chord_tolerance) | tilted
            if not coarse.any():
                return mesh
            mesh = self._project(bisect_faces(mesh, coarse), len(mesh.vertices))
        place = mesh.vertices[mesh.faces[np.argmax(coarse), 0]]
        raise StockError(
            f"no mesh of the rounded stock is within {chord_tolerance:g} mm of it at {place_name(place)}: "
            "give a stock with rounder "
            "edges, or raise levels.chord_tolerance",
            distance=chord_tolerance,
            place=place,
        )

    def _project(self, mesh: TriangleMesh, first: int) -> TriangleMesh:
        """The mesh with its vertices from the `first` on moved to the nearest surface points."""
        moved = np.vstack([mesh.vertices[:first], self.closest_points(mesh.vertices[first:])])
        return TriangleMesh(moved, mesh.faces)


LEAST = 0.1
"""Smallest radius that is tried, in inradii of the stock: less leaves edges that a morph cannot follow."""
HALVINGS = 20
"""Bisections of the radius: to a millionth of the inradius."""
ROOM = 0.25
"""Material, mm, left over the part for the levels that pass between it and the stock's wall: in less, waves of
one level break the next."""


def round_most(stock: Stock, points: Float[ndarray, "n 3"], margin: float) -> Stock | None:
    """The stock rounded by the largest radius that leaves `margin` mm over every point; None where LEAST of
    its inradius does not.

    ROOM mm, or half of what the stock itself has over a point, is left where some radius does that.
    """
    inradius = stock.inradius
    room = np.clip(-stock.signed_distance(points) / 2, margin, max(margin, ROOM))

    def holds(radius: float) -> bool:
        return bool((stock.round_edges(radius).signed_distance(points) + room).max() <= ROUNDING)

    low = LEAST * inradius
    high = ALL * inradius
    if holds(high):
        return stock.round_edges(high)
    if not holds(low):
        room[:] = margin
        if not holds(low):
            return None
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return stock.round_edges(low)


def require_roundable(stock: Stock, points: Float[ndarray, "n 3"], margin: float, otherwise: str = "") -> Stock:
    """The stock with its edges rounded as far as the part allows; a stock without edges itself.

    StockError with the place where the part comes too near to an edge for any radius; `otherwise` is added to
    its remedy.
    """
    if not stock.has_edges:
        return stock
    rounded = round_most(stock, points, margin)
    if rounded is None:
        least = stock.round_edges(LEAST * stock.inradius)
        worst = points[np.argmax(least.signed_distance(points))]
        raise StockError(
            f"the part comes too near to the edges of the stock ({stock}) at {place_in(stock, worst)} "
            f"to round them: give a larger stock or a capsule{otherwise}",
            distance=float(stock.signed_distance(worst[None])[0]),
            place=worst,
        )
    return rounded
