"""Upright cylinders about the Z axis: the post, the chuck, what stands on the table.

The bar that stock, neck and stub are turned from, and the collet that holds it.

Bars: the diameters that dealers keep of drawn round bar, in whole mm up to 20, even ones up to 40, then by 5 mm.
Collets: nuts of ER collets and what they hold (DIN ISO 15488), the slim kind up to 16 mm; beyond these a three-jaw
chuck.

The underside of a part: how high it is over some places, and where it is lowest.

The tailstock: what holds the part at its free end, a pin or a second neck under the arm of a bracket.

A table that tilts takes the part along, and what holds its free end has to come too: so the arm is carried by a column
that stands on the table beside the part. Arm and column are of steel. The arm stands as a row of upright discs that
holds it.

The post that holds the part: a cylinder about the Z axis from the table (z = 0) up to the part; and what holds the
free end, which stays uncut likewise.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.errors import JobError, ToolPathError
from bonecam.job import HoldingJob, field_error
from bonecam.job.holding_section import PIN
from bonecam.machine.bodies import Table
from bonecam.mesh.triangle_mesh import TriangleMesh


@dataclass(frozen=True)
class Column:
    """A solid upright cylinder: its radius, z of its top and bottom (-inf: without end), and where its axis stands, mm:
    the Z axis if nothing else is said; `name` is what it is told as."""

    radius: float
    top: float
    bottom: float = 0.0
    x: float = 0.0
    y: float = 0.0
    name: str = field(default="post", compare=False)

    @property
    def row(self) -> tuple[float, float, float, float, float]:
        """Radius, top, bottom, x and y, as compiled code takes them."""
        return self.radius, self.top, self.bottom, self.x, self.y

    def distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Signed distance to the solid, negative inside, mm."""
        out = np.hypot(points[:, 0] - self.x, points[:, 1] - self.y) - self.radius
        up = np.maximum(points[:, 2] - self.top, self.bottom - points[:, 2])
        return np.minimum(np.maximum(out, up), 0.0) + np.hypot(np.maximum(out, 0.0), np.maximum(up, 0.0))

    def holds(self, points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Which points lie inside."""
        return np.asarray(self.distance(points) < 0)

    def grown(self, by: float) -> "Column":
        """The column that holds everything within `by` mm of this one."""
        return replace(self, radius=self.radius + by, top=self.top + by, bottom=self.bottom - by)


COLLETS = ((10.0, 22.0), (13.0, 28.0), (16.0, 35.0), (20.0, 50.0), (26.0, 63.0))
"""The thickest bar that a collet holds, and the diameter of its nut, mm: ER 16, 20, 25 with slim nuts, ER 32, 40."""
JAWS = 30.0
"""What jaws stand over a thicker bar to each side, mm."""
COLLET_TOP = 100.0
"""Top of the collet that is found, over the table, mm: a spindle of 110 mm at 90 degrees clears the table."""
RISER = (60.0, 50.0)
"""Diameter and height of the riser under it, mm; a wider collet has one as wide as itself."""
STUB = 15.0
"""Length of the stub that is found, mm: the collet keeps out of the way of the tool, and the bar is stiff."""


def next_bar(diameter: float) -> float:
    """The diameter of the thinnest bar to be had that is as thick as this, mm."""
    step = 1.0 if diameter <= 20 else 2.0 if diameter <= 40 else 5.0
    return step * math.ceil(round(diameter / step, 6))


def collet_for(bar: float) -> float:
    """The diameter of the collet nut, or of the chuck, that holds a bar of this diameter, mm."""
    return next((nut for thickest, nut in COLLETS if bar <= thickest), bar + 2 * JAWS)


def in_collet(holding: HoldingJob, bar: float) -> HoldingJob:
    """The holding with a collet that holds a bar of this diameter (mm), on a riser."""
    nut = collet_for(bar)
    on_riser = replace(holding, riser_diameter=max(RISER[0], nut), riser_height=RISER[1])
    return replace(on_riser, chuck_diameter=nut, chuck_height=COLLET_TOP)


def settled_stub(holding: HoldingJob, width: float) -> HoldingJob:
    """The holding with the sizes of bar and collet that it leaves open, for a stock that is `width` mm wide.

    A holding that names nothing gets riser, collet and stub. JobError where the bar is thinner than the stock that is
    turned from it, or the chuck no wider than the bar.
    """
    if holding.names_nothing:
        bar = next_bar(width)
        return replace(in_collet(holding, bar), stub_diameter=bar, stub_length=STUB)
    if not holding.stub_length:
        return holding
    bar = holding.stub_diameter or next_bar(width)
    if bar < width:
        bound = f"the stock that is turned from this bar is {width:.2f} mm wide: give a thicker bar"
        raise field_error("holding", "stub_diameter", bar, bound)
    if 0 < holding.chuck_diameter <= bar:
        bound = f"it is to hold a bar of {bar:g} mm: give a wider chuck"
        raise field_error("holding", "chuck_diameter", holding.chuck_diameter, bound)
    return replace(holding, stub_diameter=bar)


FLAT = 0.1
"""Faces whose unit normals rise or fall by less are walls, which nothing stands against."""


def places_on_disc(radius: float) -> Float[ndarray, "73 2"]:
    """Places (x, y) on a disc of a radius about the Z axis, mm."""
    angle = np.arange(24) * (2 * np.pi / 24)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([np.zeros((1, 2)), *(radius * f * ring for f in (1 / 3, 2 / 3, 1.0))])


def lower_end(part: TriangleMesh, height: float) -> Float[ndarray, "2"]:
    """The (x, y) of the face that lies most in the middle of what is within `height` mm of the part's lowest one, walls
    left out."""
    middles = part.vertices[part.faces].mean(axis=1)
    normals = part.face_vectors
    flat = np.abs(normals[:, 2]) > FLAT * np.linalg.norm(normals, axis=1)
    low = middles[flat & (middles[:, 2] <= middles[flat, 2].min() + height)][:, :2]
    return np.asarray(low[np.argmin(np.linalg.norm(low - low.mean(axis=0), axis=1))])


def undersides(part: TriangleMesh, places: ndarray) -> ndarray:
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


REACH = 100.0
"""The column stands so far from the lower neck where the table is wide enough, mm: a spindle of 110 mm comes between
them."""
UPSIDE_DOWN = np.array([1.0, -1.0, -1.0])
"""What turns a mesh over about X."""


def upper_place(part: TriangleMesh, holding: HoldingJob) -> tuple[float, float]:
    """Where pin or upper neck stand (x, y): the job's place, or over the part's highest one."""
    if holding.tailstock_x or holding.tailstock_y:
        return holding.tailstock_x, holding.tailstock_y
    x, y = lower_end(_turned_over(part), holding.tailstock_diameter)
    return float(x), -float(y)


SETTLED = ("tailstock_x", "tailstock_y", "tailstock_height")
"""Fields of [holding] that are found for a tailstock, and that a job without one may still have of another part."""


def with_pin(holding: HoldingJob) -> tuple[str, HoldingJob] | None:
    """What gives a holding a pin at the free end, as fields of a job in words, and the holding with it; None where it
    has a tailstock. Place and height that a job still has of a tailstock are forgotten: they may not fit the part."""
    if holding.has_tailstock:
        return None
    left = [f"holding.{name} = 0" for name in SETTLED if getattr(holding, name)]
    change = " and ".join([f'holding.tailstock = "{PIN}"', *left])
    return change, replace(holding, tailstock=PIN, tailstock_x=0.0, tailstock_y=0.0, tailstock_height=0.0)


def pin_above(part: TriangleMesh, holding: HoldingJob) -> Column | None:
    """Pin or upper neck: it ends where all of its lower end has met the part's upper side, at most one diameter into
    it, and hangs from the arm; None where a holding has none. JobError where it misses the part, or the arm would be
    in it."""
    if not holding.has_tailstock:
        return None
    radius = holding.tailstock_diameter / 2
    x, y = upper_place(part, holding)
    heights = undersides(_turned_over(part), places_on_disc(radius) + np.array([x, -y]))
    met = -heights[np.isfinite(heights)]
    if not len(met):
        bound = f"at ({x:.2f}, {y:.2f}) nothing of the part is under the {holding.tailstock}: give tailstock_x and "
        raise field_error("holding", "tailstock_x", x, f"{bound}tailstock_y of a place over the part, or neither")
    bottom = float(max(met.min(), met.max() - holding.tailstock_diameter))
    settled = holding.tailstock_height if holding.length else 0.0
    top = settled or float(met.max()) + holding.tailstock_length
    if top <= met.max():
        bound = f"the part reaches up to {met.max():.2f} mm there, the arm would be in it: give more, or 0"
        raise field_error("holding", "tailstock_height", holding.tailstock_height, bound)
    return Column(radius, top, bottom, x, y)


def bracket(holding: HoldingJob, pin: Column) -> dict[str, tuple[Column, ...]]:
    """The column on the table and the arm from there to the pin, by name; the holding tells how far off it stands."""
    angle = math.radians(holding.tailstock_azimuth_deg)
    foot = holding.tailstock_reach * np.array([math.cos(angle), math.sin(angle)])
    top = pin.top + holding.tailstock_arm
    half = holding.tailstock_arm / 2
    way = foot - [pin.x, pin.y]
    # discs on the corners of squares as wide as the arm
    count = max(math.ceil(float(np.linalg.norm(way)) / holding.tailstock_arm), 1)
    shares = np.arange(count) / count
    radius = math.hypot(half, float(np.linalg.norm(way)) / count / 2)
    arm = tuple(
        Column(radius, top, pin.top, float(pin.x + share * way[0]), float(pin.y + share * way[1])) for share in shares
    )
    column = Column(holding.tailstock_column / 2, top, 0.0, float(foot[0]), float(foot[1]))
    return {"column": (column,), "arm": arm}


def tailstock_columns(holding: HoldingJob) -> dict[str, tuple[Column, ...]]:
    """Column and arm of a holding whose sizes are settled, by name; none where it has no tailstock."""
    if not (holding.has_tailstock and holding.tailstock_height):
        return {}
    under = Column(holding.tailstock_diameter / 2, holding.tailstock_height, 0.0)
    return bracket(holding, replace(under, x=holding.tailstock_x, y=holding.tailstock_y))


def tailstock_bodies(holding: HoldingJob) -> tuple[Column, ...]:
    """The columns of `tailstock_columns`, in one row."""
    return sum(tailstock_columns(holding).values(), ())


def settled_bracket(holding: HoldingJob, part: TriangleMesh, table: Table) -> HoldingJob:
    """The holding with the place of its pin and the reach of its column. JobError where the column stands beside the
    table, or the arm's height is given over a table from which the part's is not."""
    if not holding.has_tailstock:
        return holding
    if holding.tailstock_height and not holding.length:
        bound = "how high the part stands is found, so its arm too: give holding.length too, or tailstock_length alone"
        raise field_error("holding", "tailstock_height", holding.tailstock_height, bound)
    half = min(table.radius, table.half_width, table.half_depth)
    room = half - holding.tailstock_column / 2
    reach = holding.tailstock_reach or min(REACH, room)
    if not 0 < reach <= room:
        wide = f"a column of {holding.tailstock_column:g} mm stands on a table of {2 * half:g} mm"
        bound = f"{wide} at {room:g} mm at most"
        raise field_error("holding", "tailstock_reach", reach, f"{bound}: give less, or a thinner column")
    x, y = upper_place(part, holding)
    return replace(holding, tailstock_x=x, tailstock_y=y, tailstock_reach=reach)


def settled_height(holding: HoldingJob, pin: Column | None, stock: Float[ndarray, "n 3"]) -> HoldingJob:
    """The holding with the height of its arm, over a part that stands where it will be cut, in a stock with these
    `stock` places on its surface (mm). JobError where arm or column are in it."""
    if pin is None:
        return holding
    bodies = bracket(holding, pin)
    if min(column.distance(stock).min() for column in bodies["arm"]) <= 0:
        high = float(stock[:, 2].max())
        bound = f"the arm begins at {pin.top:.2f} mm, in the stock, which ends at {high:.2f} mm: give "
        raise field_error(
            "holding",
            "tailstock_length",
            holding.tailstock_length,
            f"{bound}{math.ceil(holding.tailstock_length + high - pin.top + 1):g} mm or more",
        )
    if bodies["column"][0].distance(stock).min() <= 0:
        widest = float(np.hypot(stock[:, 0], stock[:, 1]).max())
        enough = math.ceil(widest + holding.tailstock_column / 2 + 1)
        bound = f"the column stands in the stock: give {enough:g} mm or more"
        raise field_error("holding", "tailstock_reach", holding.tailstock_reach, bound)
    return replace(holding, tailstock_height=pin.top)


def refuse_tailstock(holding: HoldingJob, what: str) -> None:
    """JobError where a holding has a tailstock, of which `what` knows nothing."""
    if holding.has_tailstock:
        raise JobError(
            f"[holding] tailstock = {holding.tailstock!r}: {what} knows no tailstock: give 'none', or use `convert`",
            section="holding",
            field="tailstock",
        )


def _turned_over(part: TriangleMesh) -> TriangleMesh:
    """The mesh turned over about X."""
    return TriangleMesh(part.vertices * UPSIDE_DOWN, part.faces)


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
