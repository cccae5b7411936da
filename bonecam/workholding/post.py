"""The post that holds the part: a cylinder about the Z axis from the table (z = 0) up to the part."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import ToolPathError
from bonecam.job import HoldingJob, field_error
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.workholding.column import Column

FLAT = 0.1
"""Faces whose unit normals rise or fall by less are walls: the post does not end there."""

MISSES = "the post of diameter {:g} mm on the Z axis misses the part"
"""What is told of a post above which there is no part."""
NECKS = (4.0, 5.0, 6.0, 8.0, 10.0)
"""Diameters that are tried where a job leaves it open, mm."""

FLUSH = 0.2
"""A post meets an underside well that rises over its top by this share of its diameter at most."""


@dataclass(frozen=True)
class Post:
    """Radius and top (z), mm."""

    radius: float
    top: float

    @property
    def column(self) -> Column:
        """The post as a solid, from the table up."""
        return Column(self.radius, self.top)

    def distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Signed distance to the solid cylinder, negative inside, mm."""
        return self.column.distance(points)

    def footprint(self, part: TriangleMesh) -> float:
        """Area of the part under the post, mm^2: its stump stands there."""
        inside = self.distance(part.vertices[part.faces].mean(axis=1)) < 0
        return float(np.linalg.norm(part.face_vectors[inside], axis=1).sum() / 2)


def post_below(part: TriangleMesh, holding: HoldingJob, lying: tuple[float, float] = (0.0, 0.0)) -> Post:
    """The post that ends where all of its top has met the part's underside, at most one diameter into it.

    Raises ValueError where its diameter is still to be found, ToolPathError where no line of the post meets the part,
    with the offset that would do; `lying` is the one it has.
    """
    if not holding.diameter:
        raise ValueError(
            "holding.diameter = 0: the neck is still to be found, as `convert` does: give a diameter"
        )
    radius = holding.diameter / 2
    heights = _undersides(part, _places(radius))
    met = heights[np.isfinite(heights)]
    if not len(met):
        x, y = np.array(lying) - _lower_end(part, holding.diameter)
        raise ToolPathError(
            f"{MISSES.format(holding.diameter)}: bring the part's lower end over it with "
            f"stock.offset_x = {x:.2f} and stock.offset_y = {y:.2f} (or mesh.upright), or give a larger "
            "holding.diameter",
            diameter=holding.diameter,
            offset=(x, y),
        )
    return Post(radius, float(min(met.max(), met.min() + holding.diameter)))


def checked_post(part: TriangleMesh, width: float, holding: HoldingJob, lying: tuple[float, float]) -> Post:
    """The post below the part in a stock whose narrower side is `width` mm.

    A diameter that is still to be found is the thickest of NECKS that stub and chuck allow here. JobError where it is
    as wide as the stock, ToolPathError where it misses the part, which lies off the axis by `lying`.
    """
    if not holding.diameter:
        narrowest = min(width, holding.stub_diameter or width, holding.chuck_diameter or width)
        thinner = [neck for neck in NECKS if neck < narrowest]
        return post_below(part, replace(holding, diameter=max(thinner, default=NECKS[0])), lying)
    if holding.diameter >= width:
        bound = f"the stock is {width:.2f} mm wide"
        raise field_error(
            "holding",
            "diameter",
            holding.diameter,
            f"{bound}: give a post that is thinner than the part's lower end",
        )
    return post_below(part, holding, lying)


def thickest_below(part: TriangleMesh) -> float:
    """The thickest of NECKS (mm) all of whose top meets the part's underside within FLUSH of its diameter; the thinnest
    where none does."""

    def flush(diameter: float) -> bool:
        heights = _undersides(part, _places(diameter / 2))
        return bool(np.isfinite(heights).all() and np.ptp(heights) <= FLUSH * diameter)

    return max(filter(flush, NECKS), default=NECKS[0])


def _places(radius: float) -> Float[ndarray, "73 2"]:
    """Places (x, y) on the top of a post of a radius, mm."""
    angle = np.arange(24) * (2 * np.pi / 24)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([np.zeros((1, 2)), *(radius * f * ring for f in (1 / 3, 2 / 3, 1.0))])


def _lower_end(part: TriangleMesh, height: float) -> Float[ndarray, "2"]:
    """The (x, y) of the face that lies most in the middle of what is within `height` mm of the part's lowest
    one, walls left out."""
    middles = part.vertices[part.faces].mean(axis=1)
    normals = part.face_vectors
    flat = np.abs(normals[:, 2]) > FLAT * np.linalg.norm(normals, axis=1)
    low = middles[flat & (middles[:, 2] <= middles[flat, 2].min() + height)][:, :2]
    return np.asarray(low[np.argmin(np.linalg.norm(low - low.mean(axis=0), axis=1))])


def _undersides(part: TriangleMesh, places: ndarray) -> ndarray:
    """Lowest z of the part above each (x, y); inf where it is missed."""
    a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
    u, v = (b - a)[:, :2], (c - a)[:, :2]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    steep = np.abs(area) <= np.finfo(float).eps * part.diagonal**2
    area = np.where(steep, 1.0, area)
    lowest = np.full(len(places), np.inf)
    for i, place in enumerate(places):
        w = place - a[:, :2]
        p = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / area
        q = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / area
        hit = ~steep & (p >= 0) & (q >= 0) & (p + q <= 1)
        if hit.any():
            lowest[i] = (a[hit, 2] + p[hit] * (b - a)[hit, 2] + q[hit] * (c - a)[hit, 2]).min()
    return lowest
