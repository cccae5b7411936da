"""The tailstock: what holds the part at its free end, a pin or a second neck under the arm of a bracket.

A table that tilts takes the part along, and what holds its free end has to come too: so the arm is carried by a column
that stands on the table beside the part. Arm and column are of steel. The arm stands as a row of upright discs that
holds it.
"""

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import JobError
from bonecam.job import HoldingJob, field_error
from bonecam.job.holding.tailstock_section import PIN
from bonecam.machine.bodies import Table
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.workholding.column import Column
from bonecam.workholding.undersides import lower_end, places_on_disc, undersides

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
