"""Tool positions that are arrived at one after the other, with their feeds.

The clearance surface: the capsule at a fixed distance round the stock, on which the ball centre runs from
pass to pass.

What links between passes are planned in: obstacles, limits, clearance surface and feeds, and the proof
that polylines of poses are free.

The traverse from one point of the clearance surface to another: the ball centre runs on the surface, the
axis keeps its lean to the surface normal.

A convex stock is missed by the whole tool while the axis stays close enough to the outward normal: the plane
between them separates the two. Each traverse is checked all the same.

Retracts: from a contact off the surface, at the link feed until the whole tool keeps the clearance, then rapid
to the clearance surface. Backwards they are the approaches, whose last part is at the plunge feed where it leads onto
a contact.

A retract runs along the tool axis, or bends off into a direction that is level or rises, so that a drooping
holder does not sink to the table; or, where none of these is free, into one that leans from the axis to some side.

Transfers: retract from one contact, traverse on the clearance surface, approach another contact.

Where no traverse is free, the transfer goes by way of the safe point above the stock.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, perpendicular, unit
from bonecam.machine.limits import MachineLimits, polar_angles, with_polar_angles
from bonecam.material.dexels import CELL, move_depths
from bonecam.material.in_process_stock import InProcessStock
from bonecam.planning.axes.lead import LEAVING
from bonecam.planning.collision import CollisionChecker, interpolate_poses
from bonecam.planning.contacts import UNCERTAIN, moves_gouge_free
from bonecam.planning.layers import HeightMesh
from bonecam.setup.capsule import Capsule
from bonecam.tool.path import MoveKind

SAME = 1e-9
"""Poses whose coordinates (mm, and those of the axis) differ by less are one."""
Pose = tuple[Float[ndarray, "3"], Float[ndarray, "3"]]
"""Ball centre and unit tool axis."""


@dataclass(frozen=True)
class Feeds:
    """Feeds of links and of plunges, and the number given to rapid moves, mm/min."""

    link: float
    plunge: float
    rapid: float


@dataclass(frozen=True, eq=False)
class LinkMoves:
    """Row i: the move that arrives at ball centre i with axis i: its kind and feed (mm/min)."""

    kinds: Int[ndarray, " n"]
    centres: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    feeds: Float[ndarray, " n"]

    def __len__(self) -> int:
        return len(self.kinds)


NO_MOVES = LinkMoves(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
"""Nothing is between two runs: the tool cuts straight on."""


def moves_of(kind: MoveKind, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], feed: float) -> LinkMoves:
    """Moves of one kind at one feed."""
    return LinkMoves(np.full(len(centres), int(kind)), centres, axes, np.full(len(centres), feed))


def join_moves(moves: Sequence[LinkMoves]) -> LinkMoves:
    """All moves, one behind the other."""
    return LinkMoves(
        np.concatenate([m.kinds for m in moves]),
        np.vstack([m.centres for m in moves]),
        np.vstack([m.axes for m in moves]),
        np.concatenate([m.feeds for m in moves]),
    )


def without_rests(moves: LinkMoves) -> LinkMoves:
    """The moves but those that stay at the pose of the move before."""
    steps = np.diff(np.hstack([moves.centres, moves.axes]), axis=0)
    still = (np.abs(steps) < SAME).all(axis=1)
    kept = np.r_[True, ~still][: len(moves)]
    return LinkMoves(moves.kinds[kept], moves.centres[kept], moves.axes[kept], moves.feeds[kept])


SEARCH_ROUNDS = 8
"""Times that the interval of an exit is divided."""
SEARCH_PARTS = 64
"""Parts that the interval of an exit is divided into each time."""


@dataclass(frozen=True, eq=False)
class ClearanceSurface:
    """The surface at distance `clearance` (mm) from the stock, with coordinates on it: the azimuth about the
    stock's axis (radians), and the arc length along the meridian from the lower pole (mm)."""

    stock: Capsule
    clearance: float

    @property
    def radius(self) -> float:
        """Radius of the capsule, mm."""
        return self.stock.radius + self.clearance

    @property
    def top(self) -> float:
        """Arc length of the upper pole, mm."""
        return 2 * self._quarter + self._span

    @property
    def _quarter(self) -> float:
        """Arc length of the quarter circle of a cap, mm."""
        return self.radius * np.pi / 2

    @property
    def _low(self) -> Float[ndarray, "3"]:
        """Centre of the lower cap."""
        return np.asarray(self.stock.start)

    @cached_property
    def _span(self) -> float:
        """Distance between the centres of the caps, mm."""
        return float(np.linalg.norm(np.asarray(self.stock.end) - self._low))

    @cached_property
    def _frame(self) -> Float[ndarray, "3 3"]:
        """Columns: two directions across the axis (azimuth 0 and a quarter turn), and the axis."""
        span = np.asarray(self.stock.end) - self._low
        axis = span / self._span if self._span > 0 else np.array([0.0, 0.0, 1.0])
        side = np.eye(3)[0] if abs(axis[0]) < 0.9 else np.eye(3)[1]
        x = side - (side @ axis) * axis
        x /= np.linalg.norm(x)
        return np.column_stack([x, np.cross(axis, x), axis])

    def exit_lengths(self, centres: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """How far each ball goes in its direction until it leaves the inside of the surface, mm; 0 where it
        is outside."""
        low = np.zeros(len(centres))
        across = 2 * (self._span + 2 * self.radius)
        high = across + np.linalg.norm(centres - self._low, axis=1)
        rows = np.arange(len(centres))
        for _ in range(SEARCH_ROUNDS):
            reach = np.linspace(low, high, SEARCH_PARTS + 1, axis=1)[:, 1:]
            points = centres[:, None] + reach[:, :, None] * directions[:, None]
            distance = self.stock.signed_distance(points.reshape(-1, 3)).reshape(reach.shape)
            outside = distance >= self.clearance
            first = np.where(outside.any(axis=1), outside.argmax(axis=1), SEARCH_PARTS - 1)
            low = np.where(first > 0, reach[rows, first - 1], low)
            high = reach[rows, first]
        return np.where(self.stock.signed_distance(centres) >= self.clearance, 0.0, high)

    def coordinates(self, point: Float[ndarray, "3"]) -> tuple[float, float, float]:
        """Azimuth (NaN on the axis), arc length and height above the surface of a point outside the stock's
        axis."""
        local = self._frame.T @ (point - self._low)
        across = float(np.hypot(local[0], local[1]))
        up = float(local[2])
        azimuth = float(np.arctan2(local[1], local[0])) if across > 1e-9 * self.radius else np.nan
        along = float(np.clip(up, 0.0, self._span))
        above = up - np.clip(up, 0.0, self._span)
        height = float(np.hypot(across, above)) - self.radius
        arc = self._quarter + along + self.radius * float(np.arctan2(above, across))
        return azimuth, arc, height

    def frames(
        self, azimuth: Float[ndarray, " n"], arc: Float[ndarray, " n"], height: Float[ndarray, " n"]
    ) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3 3"]]:
        """Points of given coordinates, and frames whose columns are the outward normal, up the meridian, and
        round the capsule."""
        past = arc - self._quarter
        angle = (past - np.clip(past, 0.0, self._span)) / self.radius
        out = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(len(azimuth))])
        up = np.array([0.0, 0.0, 1.0])
        normal = np.cos(angle)[:, None] * out + np.sin(angle)[:, None] * up
        rise = np.cos(angle)[:, None] * up - np.sin(angle)[:, None] * out
        along = np.clip(past, 0.0, self._span)[:, None] * up
        local = along + (self.radius + height)[:, None] * normal
        columns = np.stack([normal, rise, np.cross(normal, rise)], axis=2)
        return self._low + local @ self._frame.T, self._frame @ columns


CHECK_STEPS = 4
"""Steps that a straight move is divided into for its proof."""

SPARE = 0.5
"""The clearance surface is farther from the stock than the clearance by this much, mm: straight rapids of 3 mm
between its points dip 0.15 mm below it, and the proof of a step needs half of its length."""

UP = np.array([0.0, 0.0, 1.0])

IN_AIR = UNCERTAIN
"""A ball that is no deeper in the material is in air, mm: as accurately as the depth is known."""

CUT_ALLOWED = 0.01
"""What lies between two cuts, a link and the arcs at its ends, removes no more together, mm^3: half of what the
simulation of the posted program allows."""

ARC_ALLOWED = CUT_ALLOWED / 4
"""An arc removes no more of that, mm^3: the rest is left to what lies between two arcs."""

RAPID_SPARE = CELL
"""Rapids keep so far from the material, mm, as its rays tell it: they meet all that is wider than their distance."""

Polyline = tuple[Float[ndarray, "_ 3"], Float[ndarray, "_ 3"]]
"""Ball centres and axes of straight moves."""


@dataclass(frozen=True, eq=False)
class LinkSpace:
    """`clearance` (mm) is kept between tool and material in rapids; `gouge_tolerance` (mm) by a ball that moves
    along the level. `material` is what stands before the level is cut; None: it is not known. `lead_radius` (mm): cuts
    begin and end on arcs of at most this radius; 0: straight."""

    checker: CollisionChecker
    limits: MachineLimits
    feeds: Feeds
    clearance: float
    gouge_tolerance: float
    material: InProcessStock | HeightMesh | None = None
    lead_radius: float = 0.0

    @property
    def ball_radius(self) -> float:
        """Radius of the ball that holds the end of the cutter, mm."""
        return self.checker.cutter.radius

    @cached_property
    def surface(self) -> ClearanceSurface:
        """The surface that ball centres traverse on."""
        return ClearanceSurface(self.checker.scene.stock, self.clearance + SPARE + self.ball_radius)

    @cached_property
    def safe_pose(self) -> Pose:
        """Ball centre and axis of the point above the stock where a level begins and ends."""
        beside = self.checker.scene.clamping.beside
        # what holds the free end stands in the way from above: come from the side away from its column
        wanted = np.array([-beside[0].x, -beside[0].y, 0.0]) if beside else UP
        axis = self.limits.nearest(unit(wanted[None]))[0]
        if (axis != UP).any():
            # beside the upper end, where a tool that lies comes and goes along its axis
            reach = self.surface.radius + self.clearance
            return np.asarray(self.surface.stock.end) + reach * axis, axis
        top = np.array([self.surface.top])
        height = np.array([self.clearance])
        centre, _ = self.surface.frames(np.zeros(1), top, height)
        return centre[0], axis

    def ball_free(self, starts: Float[ndarray, "m 3"], ends: Float[ndarray, "m 3"]) -> Bool[ndarray, " m"]:
        """Whether the ball keeps the gouge tolerance on straight moves of its centre: the collision checks
        hold a thinner one against the level."""
        free = np.ones(len(starts), dtype=bool)
        for obstacle in self.checker.scene.remaining:
            free[free] = moves_gouge_free(starts[free], ends[free], self.ball_radius, self.gouge_tolerance, obstacle)
        return free

    def in_air(self, centres: Float[ndarray, "k p 3"]) -> Bool[ndarray, " k"]:
        """Whether the ball removes nothing at all of the p centres of each link."""
        if self.material is None or not len(centres):
            return np.ones(len(centres), dtype=bool)
        depth, _ = self.material.depths(centres.reshape(-1, 3), self.ball_radius)
        return np.asarray((depth <= IN_AIR).reshape(centres.shape[:2]).all(axis=1))

    def known_in_air(self, centres: Float[ndarray, "k 3"]) -> Bool[ndarray, " k"]:
        """Whether the ball is in air at each centre; nowhere where the material is not known."""
        return self.in_air(centres[:, None]) & (self.material is not None)

    def no_deeper_between(self, starts: Float[ndarray, "m 3"], ends: Float[ndarray, "m 3"]) -> Bool[ndarray, " m"]:
        """Whether the ball goes no deeper on each straight move of its centre than at the deepest of all their ends."""
        if self.material is None or not len(starts):
            return np.ones(len(starts), dtype=bool)
        depths = self.material.depths
        radius = self.ball_radius
        deepest = max(float(depths(centres, radius)[0].max()) for centres in (starts, ends))
        return move_depths(depths, starts, ends, radius) <= max(deepest, 0.0) + IN_AIR

    def left_in_air(
        self, contacts: Float[ndarray, "k 3"], centres: Float[ndarray, "k p 3"], deepest: float = IN_AIR
    ) -> Bool[ndarray, " k"]:
        """Whether the ball goes no deeper than `deepest` (mm) at the p centres that follow each contact, but into what
        it has removed there."""
        if self.material is None or not len(centres):
            return np.ones(len(centres), dtype=bool)
        points = centres.reshape(-1, 3)
        behind = np.repeat(contacts, centres.shape[1], axis=0)
        entered = self.material.entered_anew(points, behind, self.ball_radius, deepest)
        return np.asarray(~entered.reshape(centres.shape[:2]).any(axis=1))

    def cuts_little(
        self, lines: Sequence[Polyline], contacts: Sequence[Polyline], allowed: Float[ndarray, " k"]
    ) -> Bool[ndarray, " k"]:
        """Whether neither the ball alone nor ball and flutes remove more than is `allowed` (mm^3) on straight moves
        through the poses of each line, but for what they have removed at the contacts of that line."""
        if self.material is None or self.material.rays is None:
            return np.ones(len(lines), dtype=bool)
        return self.material.rays.cut_little(lines, contacts, self.checker.cutter, allowed)

    def rapids_cut_nothing(self, lines: Sequence[Polyline]) -> Bool[ndarray, " k"]:
        """Whether a ball that is thicker by RAPID_SPARE removes nothing on straight moves through the poses of each
        line."""
        if self.material is None or self.material.rays is None:
            return np.ones(len(lines), dtype=bool)
        nowhere = [(np.zeros((0, 3)), np.zeros((0, 3)))] * len(lines)
        removed = self.material.rays.balls.removed_by(lines, nowhere, self.ball_radius + RAPID_SPARE)
        return removed == 0

    def polylines_free(self, polylines: Sequence[Polyline], *, cutting: bool) -> Bool[ndarray, " k"]:
        """Whether all moves of each polyline are proven free; `cutting` as in
        `CollisionChecker.moves_free`."""
        if not polylines:
            return np.zeros(0, dtype=bool)
        starts = np.vstack([centres[:-1] for centres, _ in polylines])
        ends = np.vstack([centres[1:] for centres, _ in polylines])
        first = np.vstack([axes[:-1] for _, axes in polylines])
        last = np.vstack([axes[1:] for _, axes in polylines])
        start_tips = self.checker.cutter.tips_of(starts, first)
        end_tips = self.checker.cutter.tips_of(ends, last)
        tips, axes = interpolate_poses(start_tips, end_tips, first, last, CHECK_STEPS)

        joined = np.tile(np.r_[np.ones(CHECK_STEPS, dtype=bool), False], len(first))
        steps_free = self.checker.moves_free(tips, axes, joined, cutting=cutting) | ~joined
        free = steps_free.reshape(len(first), -1).all(axis=1)
        if cutting:
            free[free] = self.ball_free(starts[free], ends[free])
        polyline = np.repeat(np.arange(len(polylines)), [len(centres) - 1 for centres, _ in polylines])
        return np.bincount(polyline, ~free, len(polylines)) == 0


SAMPLES = 65
"""Poses a traverse is sampled with, before it is thinned out."""
MAX_STEP = 3.0
"""Length of a rapid move of a traverse, mm."""
MAX_TURN = np.radians(5.0)
"""Turn of the axis in a rapid move of a traverse, radians."""


@dataclass(frozen=True)
class TraverseOptions:
    """How a traverse runs: `rise` (mm) higher in its middle, the `long_way` round the stock's axis, or
    `over_pole`: by the upper pole, where the axis stands upright; `one_azimuth`: the axis keeps the azimuth of the
    pose that leans more, so that an axis about Z stands still."""

    rise: float = 0.0
    long_way: bool = False
    over_pole: bool = False
    one_azimuth: bool = False


def traverse(
    surface: ClearanceSurface, first: Pose, last: Pose, limits: MachineLimits, options: TraverseOptions
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Ball centres and axes from the first pose to the last, both included."""
    a, b = surface.coordinates(first[0]), surface.coordinates(last[0])
    azimuths = [value for value in (a[0], b[0]) if not np.isnan(value)]
    start = azimuths[0] if azimuths else 0.0
    end = azimuths[-1] if not np.isnan(b[0]) else start
    if options.over_pole:
        # The traverse up to the upper pole (approached at an azimuth), where the axis stands upright, and down again
        pole = surface.frames(np.array([start]), np.array([surface.top]), np.array([options.rise]))[0][0], UP
        up = traverse(surface, first, pole, limits, TraverseOptions(options.rise))
        down = traverse(surface, pole, last, limits, TraverseOptions(options.rise))
        return np.vstack([up[0], down[0][1:]]), np.vstack([up[1], down[1][1:]])

    turn = float(np.mod(end - start + np.pi, 2 * np.pi) - np.pi)
    if options.long_way:
        turn -= np.copysign(2 * np.pi, turn)
    f = np.linspace(0, 1, SAMPLES)
    azimuth = start + f * turn
    arc = (1 - f) * a[1] + f * b[1]
    height = (1 - f) * a[2] + f * b[2] + options.rise * np.sin(np.pi * f)
    centres, frames = surface.frames(azimuth, arc, height)

    ends = surface.frames(np.array([start, start + turn]), np.array([a[1], b[1]]), np.array([a[2], b[2]]))[1]
    leans = np.stack([ends[0].T @ first[1], ends[1].T @ last[1]])
    lean = unit((1 - f)[:, None] * leans[0] + f[:, None] * leans[1] + 1e-12)
    axes = np.einsum("nij,nj->ni", frames, lean)
    angles = np.clip(polar_angles(axes), limits.smallest, limits.largest)
    if options.one_azimuth:
        leaning = min(first[1], last[1], key=lambda axis: abs(axis[2]))
        axes = np.repeat(leaning[None], SAMPLES, axis=0)
    axes = unit(with_polar_angles(axes, angles))
    if limits.reached is not None:
        axes = limits.nearest(axes)
    centres[[0, -1]] = [first[0], last[0]]
    axes[[0, -1]] = [first[1], last[1]]

    # Drop poses while the steps since the last kept one amount to less than MAX_STEP or MAX_TURN
    length = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    step = length / MAX_STEP + angles_between(axes[1:], axes[:-1]) / MAX_TURN
    whole = np.floor(np.cumsum(step))
    kept = np.r_[0, 1 + np.flatnonzero(np.diff(whole) > 0), len(centres) - 1]
    kept = kept[np.r_[True, np.diff(kept) > 0]]
    return centres[kept], axes[kept]


RAPID_MARGIN = 0.15
"""Rapids begin and end where the tool is farther from the material than the clearance by this much, mm."""
POLAR_ANGLES = np.radians([90.0, 70.0, 45.0])
"""Polar angles (radians) of the directions that a drooping axis is left in."""
BENDS = (0.0, 1.5, LEAVING)
"""Lengths along the axis before a retract bends off, mm: the ball may have to leave a hollow first."""
MIN_LENGTH = 1.0
"""Length of a retract at least, mm."""
LEANS = np.radians([8.0, 16.0, 30.0])
"""Angles (radians) from the tool axis of the directions that are tried last: between twisted blades the way out is not
along the axis."""
AROUND = 8
"""So many of them round the axis at each angle."""
LENGTHS = np.array([0, 0.1, 0.25, 0.5, 1, 1.5, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 26, 34, 45, 60, 80], dtype=np.float64)
"""Lengths of a retract (mm) at which it is checked, and at one of which the rapid part may begin; BENDS are
among them."""
DEEPEST = 0.05
"""How deep (mm) a retract may go into what stands beside its contact where none is in air: a ball of 2 mm removes
0.016 mm3 so."""
MIN_LAST_STEP = 0.05
"""The last of these lengths is at least this much before the end of the retract, mm."""


@dataclass(frozen=True, eq=False)
class Departure:
    """How a contact is left: so far along the tool axis (mm), and then in a direction."""

    along_axis: float
    direction: Float[ndarray, "3"]


@dataclass(frozen=True, eq=False)
class Retract:
    """The moves from a pose to the clearance surface, and the pose they end at; no moves where the tool is
    there already. Backwards its links go at `entry_feed` (mm/min)."""

    moves: LinkMoves
    end: Pose
    entry_feed: float


def safe_retract(space: LinkSpace) -> Retract:
    """The retract from the safe point, where nothing has to be done."""
    return Retract(NO_MOVES, space.safe_pose, space.feeds.link)


def approach(retract: Retract, feeds: Feeds) -> LinkMoves:
    """The retract backwards from its end, the contact left out: rapids, then links at its entry feed."""
    out = retract.moves
    kinds = out.kinds[:0:-1]
    speeds = np.where(kinds == MoveKind.LINK, retract.entry_feed, feeds.rapid)
    return LinkMoves(kinds, out.centres[-2::-1], out.axes[-2::-1], speeds)


def departures(axis: Float[ndarray, "3"]) -> list[Departure]:
    """The ways to leave a contact in the order they are tried: along the axis; then level or rising at once; then the
    same behind longer BENDS; then at once in directions that lean from the axis."""
    angle = float(polar_angles(axis[None])[0])
    rising = [with_polar_angles(axis[None], np.array([limit]))[0] for limit in POLAR_ANGLES if angle > limit]
    side = perpendicular(axis[None])[0]
    turns = 2 * np.pi * np.arange(AROUND) / AROUND
    ring = np.outer(np.cos(turns), side) + np.outer(np.sin(turns), np.cross(axis, side))
    leaning = [np.cos(lean) * axis + np.sin(lean) * each for lean in LEANS for each in ring]
    ways = [Departure(0.0, axis)] + [Departure(bend, d) for bend in BENDS for d in rising]
    return ways + [Departure(0.0, d) for d in leaning if d[2] >= min(axis[2], 0.0)]


def find_retracts(
    space: LinkSpace, poses: Sequence[Pose], behind_arc: Bool[ndarray, " n"] | None = None
) -> list[Retract | None]:
    """The first departure of each pose that is proven free and in air, or else the first that is free and goes no
    deeper than DEEPEST; None where there is none. The same departure of all poses is tried at once. Those that lie
    `behind_arc` share with their arc what may be removed."""
    arcs = np.zeros(len(poses), dtype=np.int64) if behind_arc is None else behind_arc.astype(np.int64)
    choices = [departures(axis) for _, axis in poses]
    retracts: list[Retract | None] = [None] * len(poses)
    entering: list[list[tuple[Retract, ndarray]]] = [[] for _ in poses]
    for k in range(max((len(ways) for ways in choices), default=0)):
        left = [i for i, ways in enumerate(choices) if retracts[i] is None and k < len(ways)]
        tried = _free_ways(space, [poses[i] for i in left], [choices[i][k] for i in left], arcs[left])
        for i, way in zip(left, tried, strict=True):
            if way is not None and _in_air(space, way[1], IN_AIR):
                retracts[i] = way[0]
            elif way is not None:
                entering[i].append(way)
    return [
        retract or next((shallow for shallow, link in ways if _in_air(space, link, DEEPEST)), None)
        for retract, ways in zip(retracts, entering, strict=True)
    ]


def _free_ways(
    space: LinkSpace, poses: Sequence[Pose], chosen: Sequence[Departure], arcs: Int[ndarray, " n"]
) -> list[tuple[Retract, Float[ndarray, "_ 3"]] | None]:
    """The retract of each pose by its departure, and the ball centres of its link at which it is checked; None where
    its ball cuts, or it is not proven free. Rays are asked before: in a pocket most departures cut, and the proofs take
    ten times as long."""
    if not poses:
        return []
    along = np.array([departure.along_axis for departure in chosen])
    corners = np.array([c + d.along_axis * axis for (c, axis), d in zip(poses, chosen, strict=True)])
    directions = np.array([departure.direction for departure in chosen])
    whole = np.maximum(along + space.surface.exit_lengths(corners, directions), MIN_LENGTH)
    ways = []
    lines = []
    for (centre, axis), departure, length in zip(poses, chosen, whole, strict=True):
        lengths = np.r_[LENGTHS[length - MIN_LAST_STEP > LENGTHS], length]
        along_axis = np.outer(np.minimum(lengths, departure.along_axis), axis)
        beyond = np.outer(np.maximum(lengths - departure.along_axis, 0), departure.direction)
        ways.append((departure, lengths))
        lines.append((centre + along_axis + beyond, np.repeat(axis[None], len(lengths), axis=0)))

    starts = [(centre[None], axis[None]) for centre, axis in poses]
    little = np.flatnonzero(space.cuts_little(lines, starts, CUT_ALLOWED - ARC_ALLOWED * arcs)).tolist()
    free_ways: list[tuple[Retract, ndarray] | None] = [None] * len(poses)
    proven = _proven_ways(space, [lines[i] for i in little], [ways[i] for i in little])
    for i, way in zip(little, proven, strict=True):
        free_ways[i] = way
    return free_ways


def _proven_ways(
    space: LinkSpace, lines: Sequence[Polyline], ways: Sequence[tuple[Departure, Float[ndarray, " _"]]]
) -> list[tuple[Retract, Float[ndarray, "_ 3"]] | None]:
    """The retract on each line, by a departure at some lengths, in straight moves but for the bend, and the ball
    centres of its link; None where it is not proven free."""
    if not lines:
        return []

    # The point of each retract from which on the tool keeps the clearance: links turn to rapids there
    centres = np.vstack([line[0] for line in lines])
    axes = np.vstack([line[1] for line in lines])
    free = space.checker.free_in_air(centres, axes, RAPID_MARGIN)
    standoffs = []
    for here in np.split(free, np.cumsum([len(line[0]) for line in lines])[:-1]):
        near = np.flatnonzero(~here)
        first_far = int(near[-1]) + 1 if len(near) else 1
        standoffs.append(min(first_far, len(here) - 1))

    links = [(c[: k + 1], v[: k + 1]) for (c, v), k in zip(lines, standoffs, strict=True)]
    free = space.polylines_free(links, cutting=True)
    rapid = [i for i in np.flatnonzero(free).tolist() if standoffs[i] + 1 < len(lines[i][0])]
    rapids = [(lines[i][0][standoffs[i] :], lines[i][1][standoffs[i] :]) for i in rapid]
    free[rapid] = space.polylines_free(rapids, cutting=False)
    free[rapid] &= space.rapids_cut_nothing(rapids)
    retracts: list[tuple[Retract, ndarray] | None] = [None] * len(lines)
    for i in np.flatnonzero(free).tolist():
        (centres, axes), (departure, lengths), standoff = lines[i], ways[i], standoffs[i]
        bend = np.flatnonzero((lengths == departure.along_axis) & (lengths > 0))
        stops = np.unique(np.r_[bend, standoff, len(centres) - 1])
        is_link = stops <= standoff
        kinds = np.where(is_link, int(MoveKind.LINK), int(MoveKind.RAPID))
        moves = LinkMoves(kinds, centres[stops], axes[stops], np.where(is_link, space.feeds.link, space.feeds.rapid))
        retracts[i] = Retract(moves, (centres[-1], axes[-1]), space.feeds.plunge), links[i][0]
    return retracts


def _in_air(space: LinkSpace, centres: Float[ndarray, "n 3"], deepest: float) -> bool:
    """Whether the ball goes no deeper than `deepest` (mm) on its way from the contact that comes first."""
    halfway = (centres[1:] + centres[:-1]) / 2
    return bool(space.left_in_air(centres[:1], np.vstack([centres[1:], halfway])[None], deepest)[0])


TRAVERSES = (
    TraverseOptions(),
    TraverseOptions(long_way=True),
    TraverseOptions(rise=5.0),
    TraverseOptions(over_pole=True),
    TraverseOptions(rise=15.0, over_pole=True),
    TraverseOptions(rise=15.0),
    TraverseOptions(rise=15.0, long_way=True),
)
"""The traverses between two poses in the order they are tried: short and low first."""
SAFE = -1
"""The safe point, in the place of a contact's index."""


@dataclass(frozen=True, eq=False)
class Transfers:
    """Transfers between poses (by index into `poses`, or SAFE), by the first of the `traverses` that is free; each is
    looked for once.

    A transfer leaves its first pose out, and its last one where that is a contact. `in_air` are the poses (by index)
    that are no contacts but stand in air: they are approached at the feed of links.
    """

    space: LinkSpace
    poses: Sequence[Pose]
    traverses: Sequence[TraverseOptions] = TRAVERSES
    in_air: frozenset[int] = frozenset()
    _retracts: dict[int, Retract | None] = field(default_factory=dict, init=False)
    _found: dict[tuple[int, int], LinkMoves | None] = field(default_factory=dict, init=False)

    def find(self, pairs: Sequence[tuple[int, int]]) -> list[LinkMoves | None]:
        """The transfer of each pair, None where there is none; all pairs at once are quicker than one by one."""
        fresh = [pair for pair in dict.fromkeys(pairs) if pair not in self._found]
        self._retracts[SAFE] = safe_retract(self.space)
        poses = dict.fromkeys(pose for pair in fresh for pose in pair)
        new = [pose for pose in poses if pose not in self._retracts]
        behind_arc = np.array([k in self.in_air for k in new], dtype=bool)
        ways = find_retracts(self.space, [self.poses[k] for k in new], behind_arc)
        for pose, led, way in zip(new, behind_arc, ways, strict=True):
            self._retracts[pose] = replace(way, entry_feed=self.space.feeds.link) if way and led else way

        ends = [(self._retracts[a], self._retracts[b]) for a, b in fresh]
        possible = [(out, into) for out, into in ends if out is not None and into is not None]
        moves = iter(_find_transfers(self.space, possible, self.traverses))
        self._found.update((pair, next(moves) if all(both) else None) for pair, both in zip(fresh, ends, strict=True))
        return [self._found[pair] for pair in pairs]


def _find_transfers(
    space: LinkSpace, pairs: Sequence[tuple[Retract, Retract]], options: Sequence[TraverseOptions]
) -> list[LinkMoves | None]:
    """The transfer from the pose of each first retract to that of the second."""
    # The first of those `tried` between each two poses on the clearance surface that is free, its first pose left out;
    # the same one of all pairs is tried at once.
    ends = [(out.end, into.end) for out, into in pairs]
    traverses: list[LinkMoves | None] = [None] * len(ends)
    for option in options:
        left = [k for k, moves in enumerate(traverses) if moves is None]
        routes = [traverse(space.surface, *ends[k], space.limits, option) for k in left]
        free = np.array([space.limits.allow(axes).all() for _, axes in routes], dtype=bool)
        free[free] = space.polylines_free([route for route, ok in zip(routes, free) if ok], cutting=False)
        for k, (centres, axes), ok in zip(left, routes, free, strict=True):
            if ok:
                traverses[k] = moves_of(MoveKind.RAPID, centres[1:], axes[1:], space.feeds.rapid)
    transfers = [
        None if moves is None else join_moves([out.moves, moves, approach(into, space.feeds)])
        for moves, (out, into) in zip(traverses, pairs, strict=True)
    ]
    blocked = [k for k, (out, into) in enumerate(pairs) if transfers[k] is None and len(out.moves) and len(into.moves)]
    if blocked:
        safe = safe_retract(space)
        home = _find_transfers(space, [(pairs[k][0], safe) for k in blocked], options)
        back = _find_transfers(space, [(safe, pairs[k][1]) for k in blocked], options)
        for k, first, second in zip(blocked, home, back, strict=True):
            transfers[k] = None if first is None or second is None else join_moves([first, second])
    return transfers
