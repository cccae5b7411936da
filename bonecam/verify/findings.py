"""What a simulation tells: values, and the section `removal` of the report.

Normal probes tell in the end what stays on the part, and where a ball went into it. A program is judged against the
mesh as given too: fit and repairs lead from that to the design surface, which every path follows. What a program does
to the part as given is measured from its text alone: how deep a ball goes into the faces that were given, and how far
the surface that the simulation leaves lies inside and outside of them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import angles_between
from bonecam.errors import VerifyError, place_name
from bonecam.job import Job
from bonecam.machine.limits import MachineLimits
from bonecam.mechanics.result import Mechanics
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.healing import winding_numbers
from bonecam.mesh.part import Part
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.motions import Motions
from bonecam.planning.contacts import at_post
from bonecam.verify.gouge import Gouge
from bonecam.verify.sweeping import NormalProbes, SimulatedStock, StockHeights
from bonecam.workholding.post import Post

REMEDY = "mend the mesh there, raise surface.max_control_points, or raise surface.largest_deviation"
"""What to do where a program goes too deep into the mesh as given."""


@dataclass(frozen=True, eq=False)
class GivenSurface:
    """Distances to the faces as given, without debris and inner shells that were left out, in the program's frame; the
    tool may go into them by `allowed` mm (`allowed_depth`).

    The mesh need not be closed: distances have no sign. That no ball's centre is inside the part is told by the design
    surface, which is closed.
    """

    distance: MeshDistance
    allowed: float

    def signed(self, points: Float[ndarray, "n 3"], wanted: float | Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """The distance of each point, mm, or `wanted` where that is less."""
        return self.distance.unsigned(points, wanted)

    def move(self, pose: Float[ndarray, "4 4"]) -> "GivenSurface":
        """The faces under a rigid transform (4, 4)."""
        return GivenSurface(MeshDistance(self.distance.mesh.move(pose)), self.allowed)

    def check_gouge(self, gouge: Gouge) -> None:
        """VerifyError where a ball goes too deep into the faces."""
        _check_ball(gouge, self.allowed)


def allowed_depth(job: Job, missed: float, smoothed: float) -> float:
    """How deep a program of the job may go into the mesh as given, mm: by the largest deviation of the job, the
    deviation of the fit (`missed`), the gouge tolerance, and what a smooth surface in place of coarse facets took off
    them (`smoothed`, which `mesh.smooth_within` bounds)."""
    return job.surface.largest_deviation + missed + job.path.gouge_tolerance + smoothed


def given_surface(part: Part, job: Job, report: Mapping[str, Any]) -> GivenSurface:
    """The part as given, and how deep a program of the job may go into it, with the fit's deviation as the `report` has
    it."""
    missed = report["surface"]["deviation_max_mm"]
    smoothed = part.smoothing.inward if part.smoothing else 0.0
    return GivenSurface(part.given_distance, allowed_depth(job, missed, smoothed))


@dataclass(frozen=True)
class GivenRemoval:
    """How far the surface that a program leaves lies `inside` the mesh as given at most, and `outside` of it away from
    the post, mm, each with its place; and where a `ball` goes deepest into it, None where the proof of the text tells
    that. Both may be `allowed` mm."""

    inside: float
    inside_place: tuple[float, float, float]
    outside: float
    outside_place: tuple[float, float, float]
    allowed: float
    ball: Gouge | None = None

    @property
    def report(self) -> dict[str, Any]:
        """`given` of the removal's report."""
        return {
            "gouge_max_mm": round(max(self.inside, 0.0), 4),
            "gouge_place": [round(value, 3) for value in self.inside_place],
            "left_max_mm": round(max(self.outside, 0.0), 4),
            "left_place": [round(value, 3) for value in self.outside_place],
        }

    def check(self) -> None:
        """VerifyError where a ball goes, or what is left lies, too deep inside."""
        if self.ball is not None:
            _check_ball(self.ball, self.allowed)
        if self.inside > self.allowed:
            raise VerifyError(
                f"what is left lies {self.inside:.4f} mm inside the mesh as given at {place_name(self.inside_place)}, "
                f"allowed {self.allowed:.4f}: {REMEDY}",
                line=0,
                place=self.inside_place,
                error=self.inside,
            )


@dataclass(frozen=True)
class NotJudged:
    """Why a program was not judged against the mesh as given."""

    why: str

    @property
    def report(self) -> dict[str, str]:
        """`given` of the removal's report."""
        return {"skipped": f"not judged against the mesh as given: {self.why}"}

    def move(self, pose: Float[ndarray, "4 4"]) -> "NotJudged":
        """There is nothing to move."""
        return self

    def check(self) -> None:
        """Nothing is known that would refuse the program."""


def measure_given(
    normal_probes: NormalProbes, held: Bool[ndarray, " n"], given: GivenSurface, ball: Gouge | None = None
) -> GivenRemoval:
    """Where the cut probes end, beside the mesh as given; those `held` at the post tell gouges only. `ball` is where
    one goes deepest, if that was measured."""
    ends = normal_probes.points + normal_probes.heights[:, None] * normal_probes.normals
    away = given.distance.unsigned(ends)
    away = np.where(np.abs(winding_numbers(given.distance.mesh, ends)) > 0.5, -away, away)
    lowest = int(np.argmin(away))
    highest = int(np.argmax(np.where(held, -np.inf, away)))
    low, high = (tuple(float(value) for value in ends[k]) for k in (lowest, highest))
    return GivenRemoval(
        inside=-float(away[lowest]),
        inside_place=(low[0], low[1], low[2]),
        outside=float(away[highest]),
        outside_place=(high[0], high[1], high[2]),
        allowed=given.allowed,
        ball=ball,
    )


def into_given(nc: Mapping[str, Any]) -> Iterator[str]:
    """How deep the ball goes into the mesh as given, in words, where `nc` of a report tells it."""
    if "gouge_to_given_max_mm" in nc:
        yield f"{nc['gouge_to_given_max_mm']:.3f} mm into the mesh as given at most"


def given_lines(given: Mapping[str, Any] | None) -> Iterator[str]:
    """`given` of a removal's report in words, a line each."""
    if not given:
        return
    if "skipped" in given:
        yield str(given["skipped"])
        return
    inside, outside = given["gouge_max_mm"], given["left_max_mm"]
    yield f"what is left lies {inside:.3f} mm inside the mesh as given at most, {outside:.3f} mm outside"


def _check_ball(gouge: Gouge, allowed: float) -> None:
    """VerifyError where a ball goes more than `allowed` mm into the mesh as given."""
    if gouge.depth > allowed:
        place = place_name(gouge.place)
        raise VerifyError(
            f"line {gouge.line}: the ball goes {gouge.depth:.4f} mm into the mesh as given at {place}, allowed "
            f"{allowed:.4f}: {REMEDY}",
            line=gouge.line,
            place=gouge.place,
            error=gouge.depth,
        )


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
    `rubbing_time_share`: share of the time of the cuts in which less goes than at a depth of RUBBING (`sweeping.py`).
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
    `touched` is the first line in which they meet, 0 for none. `other` is what it comes nearest to of table and
    clamping. Of the bodies of a machine `part` is the one and `other` the other that come nearest to each other, and
    `touched` a line in which they do."""

    part: str
    least: Spot | None
    touched: int
    other: str = ""

    def __str__(self) -> str:
        return f"{self.part}{self.other and f' to {self.other}'}, line {self.least.line}" if self.least else ""


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
        names = ("shank", "holder", "spindle", "table", "shell", "tailstock", "bodies")
        kept: dict[str, Clearance | None] = {name: getattr(self, name) for name in names}
        clearances = {name: clearance.least for name, clearance in kept.items() if clearance is not None}
        depths = [level.link_depth for level in self.levels if level.link_depth]
        deepest = max(depths, key=lambda spot: spot.value, default=None)
        most = self.link_contact
        return {
            "cell_mm": self.cell,
            "levels": [_level_figures(level) for level in self.levels],
            "rapid_contact_mm3": _rounded(self.rapid_volume),
            "links": {
                "removed_mm3": _rounded(sum(level.links for level in self.levels)),
                "allowed_mm3": LINK_ALLOWED,
                "most_mm3": _rounded(most.value) if most else None,
                "most_line": most.line if most else None,
                "depth_max_mm": _rounded(deepest.value) if deepest else 0.0,
                "depth_max_line": deepest.line if deepest else None,
            },
            "clearance_mm": {name: _rounded(spot.value) if spot else None for name, spot in clearances.items()},
            "clearance_near": {name: str(one) for name, one in kept.items() if one is not None and one.least},
            "left": {
                "area_over_0_02_mm2": round(self.left.area, 3),
                "part_mm2": round(self.left.mesh.area, 3),
                "areas_over_mm2": {f"{height:g}": round(area, 3) for height, area in self.left.areas_over.items()},
                "max_mm": _rounded(max(self.left.highest.value, 0.0)),
                "place": [round(value, 3) for value in self.left.highest.place],
                "by_reason": {reason: round(area, 3) for reason, area in self.left.by_reason.items()},
                "gouge_max_mm": _rounded(max(self.left.deepest_gouge.value, 0.0)),
            }
            if self.left
            else None,
            "given": self.given.report if self.given else None,
            "bridge_diameter_mm": None if self.bridge is None else _rounded(self.bridge),
        }

    @property
    def sections(self) -> dict[str, Any]:
        """The sections `removal`, and `mechanics` if that was asked, of the report."""
        bent = {"mechanics": self.mechanics.report} if self.mechanics else {}
        return {"removal": self.report, **bent}


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


def _rounded(value: float) -> float:
    return round(float(value), 4)


LEFT = 0.02
"""More material than this is left over, mm: twice the scallop height of a default finishing cutter."""
HEIGHTS = (LEFT, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
"""What keeps more than each of these is told as an area, mm."""
ENTERS = 0.01
"""A ball on a place that enters the part beside it by more does not fit there, mm: the gouge tolerance of a job."""


def measure_left(normal_probes: NormalProbes, post: Post | None, radius: float, motions: Motions) -> Left:
    """What stays; the post, if there is one, and the fillet stay that a ball of `radius` (mm, the smallest) leaves
    round it."""
    at_lower = held = np.zeros(len(normal_probes.points), dtype=bool)
    if post is not None:
        held = at_post(normal_probes.points, normal_probes.normals, post, radius)
        at_lower = at_post(normal_probes.points, normal_probes.normals, post.alone, radius)
    over = normal_probes.heights > LEFT
    away = np.where(held, -np.inf, normal_probes.heights)
    highest = int(np.argmax(away))
    lowest = int(np.argmin(normal_probes.heights))
    standing = np.flatnonzero(over & ~held)

    # Whether a ball that touches the part at these normal probes would enter it at another normal probe
    centres = normal_probes.points[standing] + radius * normal_probes.normals[standing]
    nearest, _ = cKDTree(normal_probes.points).query(centres)
    hollow = nearest < radius - ENTERS

    return Left(
        mesh=normal_probes.mesh,
        heights=normal_probes.heights,
        highest=_spot(float(normal_probes.heights[highest]), highest, normal_probes, motions),
        deepest_gouge=_spot(-float(normal_probes.heights[lowest]), lowest, normal_probes, motions),
        areas_over={
            height: float(normal_probes.areas[~held & (normal_probes.heights > height)].sum()) for height in HEIGHTS
        },
        by_reason={
            "post": float(normal_probes.areas[over & at_lower].sum()),
            "tailstock": float(normal_probes.areas[over & held & ~at_lower].sum()),
            "gouge": float(normal_probes.areas[standing[hollow]].sum()),
            "reachable": float(normal_probes.areas[standing[~hollow]].sum()),
        },
        reachable=standing[~hollow],
    )


def beside_limits(left: Left, normal_probes: NormalProbes, limits: MachineLimits, tilt: float) -> Left:
    """What stays, with the reason `limits` of the places where the ball fits, but no tool axis of the machine is within
    `tilt` (rad) of the normal: the ends of a part on a machine that lays its tool across them."""
    normals = normal_probes.normals[left.reachable]
    beyond = angles_between(normals, limits.nearest(normals)) > tilt
    areas = normal_probes.areas[left.reachable]
    by_reason = {"reachable": float(areas[~beyond].sum()), "limits": float(areas[beyond].sum())}
    return replace(left, by_reason=left.by_reason | by_reason, reachable=left.reachable[~beyond])


def _spot(value: float, normal_probe: int, normal_probes: NormalProbes, motions: Motions) -> Spot:
    """A figure at a normal probe, and the line of the move that cut it lowest (0: none did)."""
    x, y, z = (float(v) for v in normal_probes.points[normal_probe])
    owner = int(normal_probes.owners[normal_probe])
    return Spot(value, int(motions.lines[owner]) if owner >= 0 else 0, (x, y, z))
