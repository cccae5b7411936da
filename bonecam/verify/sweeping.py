"""The material while a program runs: levels are swept one after the other, the three sets of rays side by side.

The moves read from a text are straight pieces of the ball centre's path, level by level as the comments of the text
name the levels. What stands is told as heights along the normals of a surface, what stands of a post that is parted as
the area of its sections.

Gouges and leftovers are told by normal probes on the part's exact surface, cut by every ball: lines along the normal
(the vector method, Chappel 1983). What is left on one is the height of the lowest cut, exact to rounding; where no
ball came within REACH the material that stands is measured along the probe.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import distance_transform_edt

from bonecam.arrays import angles_between, numbered
from bonecam.errors import ProgramError
from bonecam.kernels.rays import (
    SAMPLES,
    TILE,
    WATCHED,
    Bricks,
    Capsules,
    Edges,
    ProbesByCell,
    RaySet,
    bound_clearances,
    cut_normal_probes,
    in_material,
    mark_bricks,
    probe_cells,
    summarise,
)
from bonecam.kernels.removal import Pieces, SweepResult, sweep
from bonecam.material.dexels import with_more_room
from bonecam.material.rays import RayGrid, lay_grid, lay_rays, least_cell, order
from bonecam.mechanics.edges import NO_EDGES_ASKED
from bonecam.mechanics.loads import Finished, Standing
from bonecam.mesh.facets import vertex_areas
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.motions import Motions
from bonecam.planning.layers import FlatChart, HeightField
from bonecam.runtime.threads import in_pieces
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import CALLED, PARTING
from bonecam.verify.gouge import centre_bows
from bonecam.workholding.post import Post

STRAIGHT = 0.001
"""The path of the ball's centre deviates from its pieces by this at most, mm."""
SWAY = 0.02
"""The far end of the holder is at most so far (mm) from where it would be if the axis turned along great
circles between the ends of a piece; flutes, ten times nearer, a tenth of it."""
SMALL_TURN = 0.5
"""While the rotary words turn by less (radians), the axis turns by the angle between its ends; else by that
of the words at most."""


def straight_pieces(motions: Motions, moves: Int[ndarray, " m"], cutter: Cutter) -> Pieces:
    """The pieces of consecutive moves of one cutter, in the part's frame.

    Of a move whose start is unknown (after a retract to the end of the machine's travel) only its end is one.
    """
    control = motions.controls[cutter.number]
    end = motions.words[moves]
    known = motions.known_start[moves]
    before = motions.words[np.maximum(moves - 1, 0)]
    start = np.where(known[:, None], before, end)
    bows = np.where(known, centre_bows(control, start, end), 0.0)
    _, first_axes = control.poses(start)
    _, last_axes = control.poses(end)
    # an axis that turns by a, while its words turn by w, sways from a great circle by at most a w / 4
    words = np.abs(end[:, 3:] - start[:, 3:]).sum(1)
    turns = np.where(words < SMALL_TURN, angles_between(first_axes, last_axes), words)
    sways = cutter.length * turns * words / 4
    counts = np.ceil(np.sqrt(np.maximum(bows / 8 / STRAIGHT, sways / SWAY))).astype(np.int64).clip(1)

    above = len(cutter.profile) - 1
    owner, place = numbered(counts)
    tips, axes = control.between(start[owner], end[owner], place / counts[owner])
    end_tips, end_axes = control.between(start[owner], end[owner], (place + 1) / counts[owner])
    return Pieces(
        cutter.centres_of(tips, axes),
        cutter.centres_of(end_tips, end_axes),
        start_axes=axes,
        end_axes=end_axes,
        moves=moves[owner],
        reach=np.zeros(len(owner)),
        probed=(motions.rapid | motions.links)[moves][owner],
        bounds=np.full((len(owner), above), np.inf),
        near=np.zeros((len(owner), above, 2)),
    )


AIR = 1e-4
"""A feed move that removes less is in air, mm^3: a hundredth of a move of 0.2 mm at a depth of 0.1."""
RUBBING = 0.02
"""A cutter that goes less deep rubs rather than cuts, mm: about the radius of its edges."""


@dataclass(frozen=True, eq=False)
class Group:
    """Consecutive moves (m,) of one cutter on one level; `level` is None where no comment names one. `rest` numbers
    the rest paths of the level from 1; 0 is its own path. Those of PARTING and BLANK number their steps."""

    level: int | None
    rest: int
    tool: int
    moves: Int[ndarray, " m"]


def groups_of(text: str, motions: Motions, dialect: Dialect) -> Iterator[Group]:
    """The moves in their order, divided where the path or the cutter changes."""
    marks = list(_level_comments(text, dialect))
    names: list[tuple[int | None, int]] = [(None, 0), *((level, rest) for _, level, rest in marks)]
    lines = np.array([line for line, *_ in marks], dtype=np.int64)
    mark = np.searchsorted(lines, motions.lines)
    changes = (np.diff(mark) != 0) | (np.diff(motions.tools) != 0)
    for moves in np.split(np.arange(len(mark)), np.flatnonzero(changes) + 1):
        level, rest = names[mark[moves[0]]]
        yield Group(level, rest, int(motions.tools[moves[0]]), moves)


def _level_comments(text: str, dialect: Dialect) -> Iterator[tuple[int, int, int]]:
    """Line (from 1), level and number of the rest path of each comment that begins a path, as `posting.write` writes
    them."""
    words = rf"(?:LEVEL (\d+)(?: REST (\d+))?|({'|'.join(CALLED)}) (\d+))"
    comment = re.escape(dialect.comment.replace("{text}", "TEXT")).replace("TEXT", words)
    pattern = re.compile(rf"^(?:\d+ )?{comment}$", re.MULTILINE)
    line = 1
    at = 0
    for match in pattern.finditer(text):
        line += text.count("\n", at, match.start())
        at = match.start()
        level, rest, name, step = match.groups()
        yield line, *((CALLED[name], int(step)) if name else (int(level), int(rest or 0)))


def feed_minutes(motions: Motions) -> Float[ndarray, " n"]:
    """The time of each feed move, as its feed and the speeds of the machine's rotary axes allow; 0 for rapids
    and moves whose start is unknown."""
    machine = motions.controls[int(motions.tools[0])].machine
    with np.errstate(divide="ignore", invalid="ignore"):
        by_feed = np.where(motions.inverse_time, 1 / motions.feed_rates, motions.lengths / motions.feed_rates)
    turns = np.abs(np.diff(motions.words[:, 3:], axis=0, prepend=motions.words[:1, 3:]))
    by_axes = (turns / np.array([axis.speed for axis in machine.rotary])).max(1)
    return np.where(motions.rapid | ~motions.known_start, 0.0, np.maximum(by_feed, by_axes))


def time_shares(
    moves: Int[ndarray, " m"],
    minutes: Float[ndarray, " n"],
    volumes: Float[ndarray, " n"],
    motions: Motions,
    radius: float,
) -> tuple[float, float]:
    """Shares of the feed time of some moves of a ball of `radius` (mm): in air, of all; and rubbing, of those that are
    no links, where less goes than from a plane by a ball that enters it by RUBBING. `minutes` are
    those of all moves of the text, `volumes` (mm^3) what they remove."""
    cuts = moves[~motions.links[moves]]
    reach = radius - RUBBING
    section = radius**2 * np.arccos(reach / radius) - reach * np.sqrt(radius**2 - reach**2)
    rubs = volumes[cuts] < section * motions.lengths[cuts]
    return _share(minutes[moves], volumes[moves] < AIR), _share(minutes[cuts], rubs)


def _share(minutes: Float[ndarray, " m"], which: Bool[ndarray, " m"]) -> float:
    total = float(minutes.sum())
    return float(minutes[which].sum()) / total if total > 0 else 0.0


def link_volumes(
    volumes: Float[ndarray, " n"], links: Bool[ndarray, " n"]
) -> tuple[Float[ndarray, " k"], Int[ndarray, " k"]]:
    """What each link removes, mm^3, and its move that removes most; a link is a stretch of consecutive feed moves
    behind a comment LINK of the text."""
    begins = np.flatnonzero(links & ~np.r_[False, links[:-1]])
    ends = np.flatnonzero(links & ~np.r_[links[1:], False]) + 1
    removed = np.array([volumes[a:b].sum() for a, b in zip(begins, ends, strict=True)])
    most = np.array([a + int(np.argmax(volumes[a:b])) for a, b in zip(begins, ends, strict=True)], dtype=np.int64)
    return removed, most


def tools_of(motions: Motions, cutters: Sequence[Cutter]) -> dict[int, Cutter]:
    """The cutters by number; ProgramError where the text describes one otherwise."""
    if not len(motions.tips):
        raise ProgramError("the program moves nothing: there is no removal to simulate", line=0)
    known = {cutter.number: cutter for cutter in cutters}
    for number in np.unique(motions.tools).tolist():
        radius = motions.controls[number].radius
        if number not in known or abs(known[number].radius - radius) > 1e-4:
            have = f"of radius {known[number].radius:g} mm" if number in known else "not there"
            raise ProgramError(
                f"the text calls tool {number} with a ball of radius {radius:g} mm, which is {have} in the job: "
                "give the job that the program was made with",
                tool=number,
            )
    return known


HIGHEST = 5.0
"""Material is told up to this height, mm."""
STEP = 0.02
"""Material is measured in steps of this, mm."""
SECTION = 0.02
"""Sections are measured at places so far apart, mm."""
HEIGHTS = 0.05
"""Sections of the post are no farther apart, mm."""


@dataclass(frozen=True, eq=False)
class StockHeights:
    """Heights (n,) of what stands on the vertices of a level's mesh `before` and `after` its moves, mm."""

    level: int
    before: Float[ndarray, " n"]
    after: Float[ndarray, " n"]


def parted_bridge(
    groups: Sequence[Group],
    motions: Motions,
    tools: Mapping[int, Cutter],
    post: Post,
    sets: Sequence[RaySet],
    grid: RayGrid,
) -> float | None:
    """Diameter (mm) of the circle with the area of what stands of the post where it is thinnest, at the heights of the
    parting cuts; None where no path parts."""
    parting = [group for group in groups if group.level == PARTING]
    if not parting:
        return None
    moves = np.concatenate([group.moves for group in parting])
    cuts = moves[~(motions.links | motions.rapid)[moves]]
    cut = motions.tips[cuts, 2] + tools[parting[0].tool].radius * motions.axes[cuts, 2]
    heights = np.linspace(cut.min(), cut.max(), 1 + int(np.ceil(np.ptp(cut) / HEIGHTS)))
    side = np.arange(-post.radius, post.radius, SECTION) + SECTION / 2
    x, y, z = (each.ravel() for each in np.meshgrid(side, side, heights))
    held = np.zeros(len(x), dtype=bool)
    in_material(*sets, grid.of_points(np.column_stack([x, y, z])), held)
    held &= np.hypot(x, y) < post.radius
    least = min(int(held[z == height].sum()) for height in heights)
    return float(2 * SECTION * np.sqrt(least / np.pi))


def stock_heights(
    points: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    sets: Sequence[RaySet],
    grid: RayGrid,
    step: float = STEP,
) -> Float[ndarray, " n"]:
    """How high (mm, HIGHEST at most, in whole `step`s) unbroken material stands on each point along its unit normal."""
    heights = np.zeros(len(points))
    standing = np.arange(len(points))
    for height in np.arange(step, HIGHEST + step / 2, step):
        held = np.zeros(len(standing), dtype=bool)
        in_material(*sets, grid.of_points(points[standing] + height * normals[standing]), held)
        standing = standing[held]
        if not len(standing):
            break
        heights[standing] = height
    return heights


def height_field_of_rays(
    chart: FlatChart, top: float, floor: float, sets: Sequence[RaySet], grid: RayGrid
) -> HeightField:
    """The material on the lines of a chart from the height `top`, which is above all of it, down to `floor`, mm."""
    axis = chart.axes(chart.a[:1])[0]
    a, b = (each.ravel() for each in np.meshgrid(chart.a, chart.b, indexing="ij"))
    # How high (mm) above its start material reaches on each line, looked for from starts that lie above all of it down
    # to the `depth` (negative), in steps of STEP; `depth` where there is none
    starts = chart.bases(a, b) + top * axis
    depth = floor - top
    heights = np.full(len(starts), depth)
    going = np.arange(len(starts))
    for down in np.arange(0.0, depth, -STEP):
        held = np.zeros(len(going), dtype=bool)
        in_material(*sets, grid.of_points(starts[going] + down * axis), held)
        heights[going[held]] = down
        going = going[~held]
        if not len(going):
            break
    tops = top + heights.reshape(len(chart.a), len(chart.b))
    return HeightField(chart, tops, np.full(tops.shape, floor))


def rays_above(rays: RaySet, grid: RayGrid, direction: int, height: float) -> RaySet:
    """A copy of the rays along a direction of the grid without what lies below the height z, mm."""
    u, v, _ = order(direction)
    i, j = np.nonzero(rays.tile_of >= 0)
    ray = np.arange(TILE * TILE)
    points = np.zeros((len(i), len(ray), 3))
    points[:, :, u] = rays.cell * (TILE * i[:, None] + ray % TILE + 0.5)
    points[:, :, v] = rays.cell * (TILE * j[:, None] + ray // TILE + 0.5)
    foot = grid.in_part(points.reshape(-1, 3))[:, 2].reshape(points.shape[:2])
    least = np.empty(foot.shape, dtype=np.float32)
    least[rays.tile_of[i, j]] = (height - foot) / grid.rotation[direction, 2]

    lows, highs = np.maximum(rays.spans[:, :, ::2], least[:, :, None]), rays.spans[:, :, 1::2]
    used = np.arange(lows.shape[2]) < rays.counts[:, :, None]
    kept = used & (lows < highs)
    first = np.argsort(~kept, axis=2, kind="stable")
    spans = np.stack([np.take_along_axis(ends, first, axis=2) for ends in (lows, highs)], axis=3)
    cut = rays._replace(
        spans=spans.reshape(rays.spans.shape),
        counts=kept.sum(axis=2).astype(np.uint8),
        low=rays.low.copy(),
        high=rays.high.copy(),
        mask=rays.mask.copy(),
        stale=rays.stale.copy(),
    )
    summarise(cut)
    return cut


CHORD = 0.002
"""Chord tolerance, mm, of the tessellation at whose vertices normal probes stand: about 0.15 mm apart on a small
bone."""
REACH = 0.3
"""Cuts up to this height above the surface are exact, mm."""
CELL = 0.5
"""Side of the cells that normal probes are found by, mm."""
NOT_CUT, CUT_BEFORE = -1, -2
"""Owners of a normal probe that no move has cut, and of one that only moves of the program before have."""


@dataclass(eq=False)
class NormalProbes:
    """Normal probes at `points` (n, 3) along unit `normals`, each standing for `areas` (n,) mm^2 of `mesh`'s surface.

    `heights` (mm) and `owners` (the move that cut a probe lowest, NOT_CUT or CUT_BEFORE) change while moves are taken.
    """

    mesh: TriangleMesh
    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    areas: Float[ndarray, " n"]
    heights: Float[ndarray, " n"] = field(init=False)
    owners: Int[ndarray, " n"] = field(init=False)

    def __post_init__(self) -> None:
        self.by_cell, self.cell_starts, self.corner = probe_cells(self.points, CELL)
        self.heights = np.full(len(self.points), REACH)
        self.owners = np.full(len(self.points), NOT_CUT)

    @property
    def finished(self) -> Finished:
        """The places of the surface as they have been cut; what is told of them changes with further cuts."""
        return Finished(self.mesh, self.points, self.normals, self.areas, self.owners)

    def move(self, pose: Float[ndarray, "4 4"]) -> "NormalProbes":
        """The normal probes under a rigid transform (4, 4), as they have been cut before another program is run."""
        turn = pose[:3, :3].T
        shift = pose[:3, 3]
        moved = NormalProbes(self.mesh.move(pose), self.points @ turn + shift, self.normals @ turn, self.areas)
        cut = self.owners != NOT_CUT
        moved.heights[cut] = self.heights[cut]
        moved.owners[cut] = CUT_BEFORE
        return moved

    def cut(self, pieces: Pieces, radius: float) -> None:
        """Cut the normal probes by a ball on its pieces, and by the flutes above it where they may reach material."""
        points, normals = self.points[self.by_cell], self.normals[self.by_cell]
        probes = ProbesByCell(points, normals, self.cell_starts, self.corner, CELL)
        heights = self.heights[self.by_cell]
        owners = self.owners[self.by_cell]
        # What a ball sweeps on its pieces, and the flutes above it where they may reach material.
        fluted = pieces.reach > 0
        # the ball at the top of a capsule must end where the flutes do
        rises = np.maximum(pieces.reach[fluted] - radius, 0.0)
        tops = pieces.ends[fluted] + rises[:, None] * pieces.end_axes[fluted]
        starts = np.vstack([pieces.starts, pieces.ends[fluted]])
        ends = np.vstack([pieces.ends, tops])
        names = np.r_[pieces.moves, pieces.moves[fluted]]
        capsules = Capsules(starts, ends, np.full(len(starts), radius), names)
        cut_normal_probes(probes, REACH, capsules, heights, owners, from_top=False)
        self.heights[self.by_cell] = heights
        self.owners[self.by_cell] = owners

    def measure_the_uncut(self, sets: Sequence[RaySet], grid: RayGrid) -> None:
        """Set the heights of normal probes that no ball came near to those of the material that stands on them."""
        uncut = np.flatnonzero(self.owners == NOT_CUT)
        self.heights[uncut] = stock_heights(self.points[uncut], self.normals[uncut], sets, grid)


def normal_probes_on(part: TSpline, chord_tolerance: float = CHORD) -> NormalProbes:
    """Normal probes at the vertices of a fine tessellation, on the exact surface and along its exact normals."""
    tessellation = part.tessellate_with_parameters(chord_tolerance)
    s, t = tessellation.parameters.T
    return NormalProbes(tessellation.mesh, part.positions(s, t), part.normals(s, t), vertex_areas(tessellation.mesh))


BRICK = 0.4
"""Side of the bricks, mm, in which tools are first looked at; larger where the box holds more than
MOST_BRICKS."""
MOST_BRICKS = 400_000
"""A distance transform of so many takes 0.05 s."""
BRICK_RAYS = 3
"""Every third ray either way marks the bricks."""
PARTS = ("shank", "holder", "spindle")
"""Parts of the tool that cut nothing."""
ALLOWED_TOUCH = -0.02
"""Signed distance of PARTS from material that is no collision yet, mm: rays and steps tell it to
0.02."""
BOUNDED = 4096
"""Pieces whose clearances are bounded at once."""


@dataclass(frozen=True)
class Accuracy:
    """Distance of the rays (`cell`, mm) and the memory that they and a copy of them may take (MB); where that does not
    suffice, a cell that fits is taken if `coarser`, or else refused."""

    cell: float = 0.05
    memory_mb: float = 500.0
    coarser: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.cell < np.inf:
            raise ValueError(f"a cell of {self.cell} mm: give a positive one, such as 0.05")


@dataclass(frozen=True, eq=False)
class SimulatedStock:
    """The material that stands: three `sets` of rays of a `grid`, and the `normal_probes` on the part (None where none
    is given), as they have been cut."""

    sets: Sequence[RaySet]
    grid: RayGrid
    normal_probes: NormalProbes | None

    @property
    def probes(self) -> NormalProbes:
        """The normal probes, of a stock that has them."""
        assert self.normal_probes is not None
        return self.normal_probes

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner of the box of all rays, mm."""
        corners = self.grid.in_part(np.array(list(product(*zip(np.zeros(3), self.grid.size, strict=True)))))
        return np.array([corners.min(axis=0), corners.max(axis=0)])

    def move(self, pose: Float[ndarray, "4 4"]) -> "SimulatedStock":
        """The material under a rigid transform (4, 4); the rays are shared."""
        normal_probes = self.normal_probes.move(pose) if self.normal_probes is not None else None
        return SimulatedStock(self.sets, self.grid.move(pose), normal_probes)

    def above(self, height: float) -> "SimulatedStock":
        """The material above a height z, mm, in rays of its own."""
        sets = [rays_above(rays, self.grid, k, height) for k, rays in enumerate(self.sets)]
        return SimulatedStock(sets, self.grid, self.normal_probes)


def material_of(bodies: Sequence[Stock], part: TSpline | None, accuracy: Accuracy) -> SimulatedStock:
    """The union of convex bodies, and the normal probes on a `part`; JobError where the rays need too much memory."""
    grid = lay_grid(bodies, accuracy.cell)
    if accuracy.coarser:
        grid = lay_grid(bodies, max(accuracy.cell, least_cell(bodies, grid, accuracy.memory_mb)))
    return SimulatedStock(lay_rays(bodies, grid, accuracy.memory_mb), grid, normal_probes_on(part) if part else None)


class Sweeping:
    """Material that moves are taken out of; used for one program.

    `sets` are the rays along the three directions of `grid`, `found` what each has told so far; the material lies
    within `bounds`.
    """

    def __init__(self, sets: Sequence[RaySet], grid: RayGrid, bounds: Float[ndarray, "2 3"], moves: int) -> None:
        self.sets = list(sets)
        self.grid = grid
        self.bounds = bounds
        self.found = [
            SweepResult(np.zeros(moves), np.zeros(moves), np.full(3, WATCHED), np.full(3, -1), np.full(3, -1))
            for _ in range(3)
        ]

    def run(
        self, pieces: Pieces, cutter: Cutter, beside: Callable[[Pieces], None], edges: Sequence[Edges] = NO_EDGES_ASKED
    ) -> Pieces:
        """Take the pieces of one cutter out of the material, in their order, while a core that has no set of
        rays to cut works on them `beside`; returns them with their `reach`. Each set of rays answers what its `edges`
        engage before each piece is cut."""
        sections, parts = sections_of(cutter)
        least = np.max([swept.least for swept in self.found], axis=0)
        # The bricks of the material that stands now.
        extent = self.bounds[1] - self.bounds[0]
        size = max(BRICK, float(np.cbrt(extent.prod() / MOST_BRICKS)))
        corner = self.bounds[0] - size
        occupied = np.zeros(np.ceil(extent / size).astype(int) + 2, dtype=bool)
        for direction, rays in enumerate(self.sets):
            rotation = np.ascontiguousarray(self.grid.rotation[order(direction)])
            mark_bricks(rays, rotation, self.grid.corner, BRICK_RAYS, corner, size=size, occupied=occupied)
        spare = size / SAMPLES / 2 + BRICK_RAYS * self.grid.cell
        if occupied.any():
            distance = distance_transform_edt(~occupied) * size
        else:
            distance = np.full(occupied.shape, float(np.linalg.norm(extent)) + WATCHED)
        # The pieces with what the bricks tell of flutes, which matter where they may meet material, and of the sections
        # above them, which do where they may come nearer than they have
        watched = np.r_[0.0, least[parts[1:]]]
        bricks = Bricks(distance, corner, size, spare)
        bounds = np.empty((len(pieces.starts), len(sections)))
        near = np.empty((len(pieces.starts), len(sections), 2))

        def bound(some: slice) -> None:
            poses = (pieces.starts, pieces.ends, pieces.start_axes, pieces.end_axes)
            sliced = [pose[some] for pose in poses]
            bound_clearances(*sliced, sections, watched, bricks, bounds[some], near[some])

        in_pieces(bound, len(bounds), BOUNDED)
        reach = np.where(bounds[:, 0] < 0, near[:, 0, 1], 0.0)
        bounded = pieces._replace(reach=reach, bounds=bounds[:, 1:].copy(), near=near[:, 1:].copy())

        def work(which: slice) -> None:
            if which.start < len(self.sets):
                self._sweep(bounded, sections, parts, which.start, edges[which.start])
            else:
                beside(bounded)

        in_pieces(work, len(self.sets) + 1, 1)
        return bounded

    def _sweep(
        self, pieces: Pieces, sections: Float[ndarray, "s 4"], parts: Int[ndarray, " s"], direction: int, edges: Edges
    ) -> None:
        """Take the pieces out of one set of rays, with more room on them where it is needed."""
        # The pieces in the coordinates of the rays along one of the grid's directions.
        columns = order(direction)
        turned = pieces._replace(
            starts=np.ascontiguousarray(self.grid.of_points(pieces.starts)[:, columns]),
            ends=np.ascontiguousarray(self.grid.of_points(pieces.ends)[:, columns]),
            start_axes=np.ascontiguousarray(self.grid.of_vectors(pieces.start_axes)[:, columns]),
            end_axes=np.ascontiguousarray(self.grid.of_vectors(pieces.end_axes)[:, columns]),
        )
        radius = float(sections[0, 2])
        swept = self.found[direction]
        at = 0
        while at < len(pieces.starts):
            rays = self.sets[direction]
            at = sweep(
                rays=rays,
                pieces=turned,
                radius=radius,
                sections=sections[1:],
                parts=parts[1:],
                allowed=ALLOWED_TOUCH,
                first=at,
                found=swept,
                turn=direction,
                edges=edges,
            )
            if at < len(pieces.starts):
                self.sets[direction] = with_more_room(rays)

    @property
    def standing(self) -> Standing:
        """What stands now."""
        return Standing(self.sets, self.grid, float(self.bounds[1, 2]), float(np.ptp(self.bounds[:, :2], axis=0).min()))

    @property
    def volumes(self) -> Float[ndarray, " n"]:
        """What each move has removed, the mean of the three sets, mm^3."""
        return np.mean([swept.volumes for swept in self.found], axis=0)

    @property
    def depths(self) -> Float[ndarray, " n"]:
        """How deep each rapid and link cuts, by the set that tells it best, mm; 0 for cutting moves."""
        return np.min([swept.depths for swept in self.found], axis=0)

    def clearance(self, part: int) -> tuple[float, int]:
        """The least signed distance (mm) of one of the PARTS from material, and its move (-1: more than WATCHED
        everywhere); of one that enters material that of the first move that does."""
        touching = [swept for swept in self.found if swept.touched[part] >= 0]
        if touching:
            first = min(touching, key=lambda swept: int(swept.touched[part]))
            return float(first.least[part]), int(first.touched[part])
        best = min(self.found, key=lambda swept: float(swept.least[part]))
        return float(best.least[part]), int(best.where[part])

    def touched(self, part: int) -> int:
        """The first move in which one of the PARTS enters material, -1 for none."""
        moves = [int(swept.touched[part]) for swept in self.found if swept.touched[part] >= 0]
        return min(moves, default=-1)


def volumes(sets: Sequence[RaySet]) -> list[float]:
    """The volume of the material as each set tells it, mm^3."""
    totals = []
    for rays in sets:
        used = np.arange(rays.spans.shape[2] // 2) < rays.counts[:, :, None]
        lengths = (rays.spans[:, :, 1::2] - rays.spans[:, :, ::2])[used]
        totals.append(float(lengths.sum(dtype=np.float64)) * rays.cell**2)
    return totals


def sections_of(cutter: Cutter) -> tuple[Float[ndarray, "s 4"], Int[ndarray, " s"]]:
    """The stack of a tool above its ball's centre: from, to (mm from there) and the radius at either end; and which
    of PARTS each is, -1 for the flutes, which come first."""
    rows = [(one.start - cutter.radius, one.end - cutter.radius, one.radius, one.end_radius) for one in cutter.profile]
    return np.array(rows), np.array([-1, *(PARTS.index(one.name) for one in cutter.profile[1:])])
