"""What a simulation tells: values, and the section `removal` of the report."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.mechanics.result import Mechanics
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.verify.removal.given import GivenRemoval, NotJudged
from bonecam.verify.removal.stock_heights import StockHeights
from bonecam.verify.removal.sweeping import SimulatedStock

LINK_ALLOWED = 0.02
"""What the moves from one pass to the next may remove, mm^3: the scallops of 0.05 mm that a ball
of 4 mm crosses on a step of 1 mm."""
RAPID_ALLOWED = 1e-4
"""A rapid that removes no more is not said to cut, mm^3: a cube of 0.05 mm, the default cell."""


@dataclass(frozen=True)
class Spot:
    """A figure (mm or mm^3), and the line of the text and the place (mm, part's frame) where it was found."""

    value: float
    line: int
    place: tuple[float, float, float]


@dataclass(frozen=True)
class LevelRemoval:
    """What the moves of one path removed: of a level's own one, or (`rest` from 1) of one of its rest paths before;
    `index` is None where the text names no level.

    `deepest` is the largest depth of cut (None where nothing was cut), `depths` (n,) are those at places evenly spread
    over the surface that was cut, mm; `over_limit` is what the deepest exceeds its limit by, mm (None where no limit
    is known), `over_allowed` what it may: the scallop that the level before may leave, and half of a cell, as far as a
    depth is uncertain. `removed` in mm^3; `air_time_share`: share of the feed time whose moves remove less than AIR;
    `rubbing_time_share`: share of the time of the cuts in which less goes than at a depth of RUBBING (`groups.py`).
    `links` (mm^3) is what the moves between passes remove, `link_depth` the deepest cut of one (None: none cuts).
    """

    index: int | None
    rest: int
    tool: int
    removed: float
    deepest: Spot | None
    depths: Float[ndarray, " n"] = field(compare=False, repr=False)
    over_limit: float | None
    over_allowed: float
    air_time_share: float
    rubbing_time_share: float
    links: float
    link_depth: Spot | None

    @property
    def depth_mean(self) -> float:
        """The mean depth of the cut, mm; 0 where nothing was cut."""
        return float(self.depths.mean()) if len(self.depths) else 0.0

    @property
    def depth_p99(self) -> float:
        """The depth that 99 % of the surface cut stay below, mm; 0 where nothing was cut."""
        return float(np.percentile(self.depths, 99)) if len(self.depths) else 0.0


@dataclass(frozen=True)
class Clearance:
    """Least signed distance (mm) of `part` of the tool from what stands, `None` where nothing came near;
    `touched` is the first line in which they meet, 0 for none. Of the bodies of a machine `part` is the one and `other`
    the other that come nearest to each other, and `touched` a line in which they do."""

    part: str
    least: Spot | None
    touched: int
    other: str = ""


@dataclass(frozen=True, eq=False)
class Left:
    """What stays on the part: `heights` (n,) over the vertices of `mesh`, mm (negative: gouged).

    `highest` and `deepest_gouge` are the largest leftover away from the post and the deepest gouge. `by_reason`: mm^2
    that keep more than LEFT at the `post` and in the fillet that the cutter leaves round it, likewise at what holds the
    free end (`tailstock`), in hollows that are too narrow for the smallest ball (`gouge`), where that ball would fit
    but no tool axis of the machine leads there (`limits`, if that was asked), and where it would fit (`reachable`, at
    the normal probes of that name). `areas_over`: mm^2 away from the post that keep more than each of some heights, mm.
    """

    mesh: TriangleMesh
    heights: Float[ndarray, " n"]
    highest: Spot
    deepest_gouge: Spot
    by_reason: dict[str, float]
    areas_over: dict[float, float] = field(default_factory=dict)
    reachable: Int[ndarray, " k"] = field(default_factory=lambda: np.zeros(0, dtype=np.int64), repr=False)

    @property
    def area(self) -> float:
        """What keeps more than LEFT away from the post, mm^2."""
        return sum(area for reason, area in self.by_reason.items() if reason not in ("post", "tailstock"))


@dataclass(frozen=True, eq=False)
class Removal:
    """What a program does to its stock. `cell` is the distance of the rays, mm.

    `rapid_volume` (mm^3) is what rapids remove, `rapid_contact` the first of them that removes more than is allowed;
    `link_contact` the moves between two passes that remove most, where that is more than LINK_ALLOWED. `shank`,
    `holder` and `spindle` keep their clearance from stock, part and post, the whole tool that of `table` from table,
    chuck and what stands there, and that of `tailstock` from one, if there is one. `left` is None where no part was
    given. `volume` is what stands in the end, `volume_error` how far the three sets of rays differ in it, mm^3.
    `move_volumes` (mm^3) has one row a move of the text, `remaining` is what stands in the end. `standing` is what
    stood on the surfaces that were given, in machining order. `shell` is the clearance of the whole tool from the shell
    of a second clamping, None in a first one. `bridge` (mm) is the diameter of what stands of the post where it is
    parted, None where it is not. `given` is what is left beside the mesh as given, or why that is not known; None where
    a part has none. `mechanics` is None where force and bending were not asked. `bodies` is the least clearance between
    the bodies of the machine's links and tool, table, stock and one another, None where it has none.
    """

    cell: float
    levels: tuple[LevelRemoval, ...]
    rapid_volume: float
    rapid_contact: Spot | None
    link_contact: Spot | None
    shank: Clearance
    holder: Clearance
    spindle: Clearance
    table: Clearance
    left: Left | None
    volume: float
    volume_error: float
    move_volumes: Float[ndarray, " m"]
    remaining: SimulatedStock
    standing: tuple[StockHeights, ...] = ()
    bridge: float | None = None
    shell: Clearance | None = None
    given: GivenRemoval | NotJudged | None = None
    mechanics: Mechanics | None = None
    tailstock: Clearance | None = None
    bodies: Clearance | None = None

    @property
    def report(self) -> dict[str, Any]:
        """The section `removal` of the report."""
        names = ("shank", "holder", "spindle", "table")
        clearances = {name: getattr(self, name).least for name in names}
        for name in ("shell", "tailstock", "bodies"):
            kept: Clearance | None = getattr(self, name)
            if kept is not None:
                clearances[name] = kept.least
        return {
            "cell_mm": self.cell,
            "levels": [_level_figures(level) for level in self.levels],
            "rapid_contact_mm3": _rounded(self.rapid_volume),
            "links": self._link_figures(),
            "clearance_mm": {name: _rounded(spot.value) if spot else None for name, spot in clearances.items()},
            "left": _left_figures(self.left) if self.left else None,
            "given": self.given.report if self.given else None,
            "bridge_diameter_mm": None if self.bridge is None else _rounded(self.bridge),
        }

    @property
    def sections(self) -> dict[str, Any]:
        """The sections `removal`, and `mechanics` if that was asked, of the report."""
        bent = {"mechanics": self.mechanics.report} if self.mechanics else {}
        return {"removal": self.report, **bent}

    def _link_figures(self) -> dict[str, Any]:
        depths = [level.link_depth for level in self.levels if level.link_depth]
        deepest = max(depths, key=lambda spot: spot.value, default=None)
        most = self.link_contact
        return {
            "removed_mm3": _rounded(sum(level.links for level in self.levels)),
            "allowed_mm3": LINK_ALLOWED,
            "most_mm3": _rounded(most.value) if most else None,
            "most_line": most.line if most else None,
            "depth_max_mm": _rounded(deepest.value) if deepest else 0.0,
            "depth_max_line": deepest.line if deepest else None,
        }


def _level_figures(level: LevelRemoval) -> dict[str, Any]:
    deepest = level.deepest
    return {
        "index": level.index,
        "rest": level.rest,
        "removed_mm3": _rounded(level.removed),
        "depth_max_mm": _rounded(deepest.value) if deepest else 0.0,
        "depth_max_line": deepest.line if deepest else None,
        "depth_p99_mm": _rounded(level.depth_p99),
        "depth_mean_mm": _rounded(level.depth_mean),
        "over_limit_mm": None if level.over_limit is None else _rounded(level.over_limit),
        "air_time_share": _rounded(level.air_time_share),
        "rubbing_time_share": _rounded(level.rubbing_time_share),
        "links_mm3": _rounded(level.links),
        "links_depth_mm": _rounded(level.link_depth.value) if level.link_depth else 0.0,
    }


def _left_figures(left: Left) -> dict[str, Any]:
    return {
        "area_over_0_02_mm2": round(left.area, 3),
        "part_mm2": round(left.mesh.area, 3),
        "areas_over_mm2": {f"{height:g}": round(area, 3) for height, area in left.areas_over.items()},
        "max_mm": _rounded(max(left.highest.value, 0.0)),
        "place": [round(value, 3) for value in left.highest.place],
        "by_reason": {reason: round(area, 3) for reason, area in left.by_reason.items()},
        "gouge_max_mm": _rounded(max(left.deepest_gouge.value, 0.0)),
    }


def _rounded(value: float) -> float:
    return round(float(value), 4)
