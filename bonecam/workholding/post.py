"""The post that holds the part: a cylinder about the Z axis from the table (z = 0) up to the part; and what holds the
free end, which stays uncut likewise."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import ToolPathError
from bonecam.job import HoldingJob, field_error
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.workholding.column import Column
from bonecam.workholding.tailstock import pin_above
from bonecam.workholding.undersides import lower_end, places_on_disc, undersides

MISSES = "the post of diameter {:g} mm on the Z axis misses the part"
"""What is told of a post above which there is no part."""
NECKS = (4.0, 5.0, 6.0, 8.0, 10.0)
"""Diameters that are tried where a job leaves it open, mm."""

FLUSH = 0.2
"""A post meets an underside well that rises over its top by this share of its diameter at most."""


@dataclass(frozen=True)
class Post:
    """Radius and top (z), mm; and the `pin` or upper neck of a tailstock at the free end, which stays uncut as the post
    does."""

    radius: float
    top: float
    pin: Column | None = None

    @property
    def column(self) -> Column:
        """The post as a solid, from the table up."""
        return Column(self.radius, self.top)

    @property
    def alone(self) -> "Post":
        """The post without what holds the free end."""
        return replace(self, pin=None)

    @property
    def solids(self) -> tuple[Column, ...]:
        """What stays uncut: the post, and what holds the free end."""
        return (self.column,) if self.pin is None else (self.column, self.pin)

    def lift(self, by: float) -> "Post":
        """The post that is so much longer, mm; what holds the free end goes up with it."""
        pin = self.pin and replace(self.pin, top=self.pin.top + by, bottom=self.pin.bottom + by)
        return Post(self.radius, self.top + by, pin)

    def distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Signed distance to the solids, negative inside, mm."""
        return np.asarray(np.min([solid.distance(points) for solid in self.solids], axis=0))


def footprint(column: Column, part: TriangleMesh) -> float:
    """Area of the part under a post, or under what holds its free end, mm^2: its stump stands there."""
    inside = column.distance(part.vertices[part.faces].mean(axis=1)) < 0
    return float(np.linalg.norm(part.face_vectors[inside], axis=1).sum() / 2)


def post_below(part: TriangleMesh, holding: HoldingJob, lying: tuple[float, float] = (0.0, 0.0)) -> Post:
    """The post that ends where all of its top has met the part's underside, at most one diameter into it.

    Raises ValueError where its diameter is still to be found, ToolPathError where no line of the post meets the part,
    with the offset that would do; `lying` is the one it has.
    """
    if not holding.diameter:
        raise ValueError("holding.diameter = 0: the neck is still to be found, as `convert` does: give a diameter")
    radius = holding.diameter / 2
    heights = undersides(part, places_on_disc(radius))
    met = heights[np.isfinite(heights)]
    if not len(met):
        x, y = np.array(lying) - lower_end(part, holding.diameter)
        raise ToolPathError(
            f"{MISSES.format(holding.diameter)}: bring the part's lower end over it with "
            f"stock.offset_x = {x:.2f} and stock.offset_y = {y:.2f} (or mesh.upright), or give a larger "
            "holding.diameter",
            diameter=holding.diameter,
            offset=(x, y),
        )
    top = float(min(met.max(), met.min() + holding.diameter))
    return Post(radius, top, pin_above(part, holding))


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
            "holding", "diameter", holding.diameter, f"{bound}: give a post that is thinner than the part's lower end"
        )
    return post_below(part, holding, lying)


def thickest_below(part: TriangleMesh) -> float:
    """The thickest of NECKS (mm) all of whose top meets the part's underside within FLUSH of its diameter; the thinnest
    where none does."""

    def flush(diameter: float) -> bool:
        heights = undersides(part, places_on_disc(diameter / 2))
        return bool(np.isfinite(heights).all() and np.ptp(heights) <= FLUSH * diameter)

    return max(filter(flush, NECKS), default=NECKS[0])
