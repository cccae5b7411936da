"""What cutting in layers takes: the tool comes down on the part along fixed lines.

The lines that a tool comes down on the part along, by two coordinates a and b: parallel ones, a (mm) measured across
the part, b (mm) along it: z where the lines are level. The height of a point on its line is its distance from the
plane, mm. A chart of other lines, as a strategy may have it, is one that tells otherwise where they lie.

How far a ball comes down along a line until it touches the part (drop cutter, here by sphere tracing).

The distance of the ball to the part is the step that it can take safely, so that it never enters the part, and a
tool that is nowhere wider than its ball has a free way down too.

The in-process material: a height field on the lines that the tool comes down along.

Curves of a tool over a chart: polylines in its coordinates, with the heights of the ball's centre, sampled until
straight moves deviate by no more than the chord tolerance.

One layer: its contacts, the tool axis of each, and the material that stands while it is cut.

Curves of a ball raised along its axes, so that no straight move between two of their points gouges the part.

Where a curve was sampled its ball is free; the moves between are as good as the sampling, which knows nothing of the
gouge tolerance.

How deep balls enter the mesh of what stands while a layer is cut.

Finishing by parallel passes b = const of a ball that touches the part, limited in scallop.

Passes begin a flat side step apart. Between two passes whose centres are D apart across the feed, the cusp is

    h = R - sqrt(R^2 - D^2 / 4) + q,

q being how far the centre of a ball half-way lies below the line between the two (negative on a bulge). Where
h is above the limit a pass is put half-way, only as long as it is needed, and so on.

Roughing a layer: curves one after the other, each only where its ball still finds material.

Finishing from one direction: parallel passes of a ball that touches the part.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.arrays import dots, runs_of, unit
from bonecam.job import PathJob
from bonecam.kernels.distances import cut_heights, lower
from bonecam.material.dexels import CutDexels, ball_depths, enters_beside
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.contacts import POST_CLEARANCE, gouge_free_lifts, planned_tolerance
from bonecam.tool.cutter import MAX_DEPTH_RADII, Cutter
from bonecam.tool.path import ContactPath
from bonecam.workholding.post import Post

Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class FlatChart:
    """Lines parallel to the unit `axis`, at all pairs of the evenly spaced coordinates `a` across and `b` (mm) along;
    the unit vectors `across`, of a, and `along`, of b, are at right angles to it and to one another."""

    axis: Float[ndarray, "3"]
    across: Float[ndarray, "3"]
    a: Float[ndarray, " p"]
    b: Float[ndarray, " q"]
    along: Float[ndarray, "3"] = field(default_factory=Z.copy)

    def bases(self, a: Float[ndarray, " n"], b: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """The points of height 0 on the lines (a, b)."""
        return a[:, None] * self.across + b[:, None] * self.along

    def axes(self, a: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """The unit directions of the lines, away from the part."""
        return np.tile(self.axis, (len(a), 1))

    def coordinates(
        self, points: Float[ndarray, "n 3"]
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
        """a, b and the height of points."""
        return points @ self.across, points @ self.along, points @ self.axis

    def near(
        self, a: Float[ndarray, " n"], heights: Float[ndarray, " n"], radius: float
    ) -> tuple[Int[ndarray, " n"], Int[ndarray, " n"]]:
        """The first and the last line across that balls at these places may meet."""
        step = self.a[1] - self.a[0]
        first = np.ceil((a - radius - self.a[0]) / step).astype(np.int64)
        last = np.floor((a + radius - self.a[0]) / step).astype(np.int64)
        return first.clip(0), last.clip(max=len(self.a) - 1)

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and the highest a that passes run to."""
        return self.a[0], self.a[-1]

    @property
    def rows(self) -> Int[ndarray, " r"]:
        """The numbers of the lines across, one after the other with a cell of the grid between."""
        return np.arange(len(self.a))

    def framed(self, cells: Bool[ndarray, "p q"]) -> Bool[ndarray, "p2 q2"]:
        """Cells of the grid with those round it."""
        return np.pad(cells, 1)


def windows(
    chart: FlatChart, a: Float[ndarray, " n"], b: Float[ndarray, " n"], heights: Float[ndarray, " n"], radius: float
) -> Int[ndarray, "n 4"]:
    """First and last line of the grid that each ball may meet, across and along."""
    along = chart.b[1] - chart.b[0]
    first, last = chart.near(a, heights, radius)
    begin = np.ceil((b - radius - chart.b[0]) / along).astype(np.int64).clip(0)
    end = np.floor((b + radius - chart.b[0]) / along).astype(np.int64).clip(max=len(chart.b) - 1)
    return np.column_stack([first, last, begin, end])


TOUCHING = 2e-4
"""A ball that is no farther from the part touches it, mm."""
DROP_STEPS = 150
"""Steps of a ball at most; one that has not come to rest (it slides along a wall) stays where it is."""


@dataclass(frozen=True, eq=False)
class Ball:
    """A ball (radius, mm) that keeps `allowance` mm from the part, and POST_CLEARANCE from the post."""

    radius: float
    allowance: float
    part: MeshDistance
    post: Post

    def clearance(self, centres: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """How far balls may move in any direction, mm, before they are too near; all centres lie outside."""
        off = self.radius + self.allowance
        from_part = self.part.unsigned(centres) - off
        from_post = self.post.distance(centres) - self.radius - POST_CLEARANCE
        return np.minimum(from_part, from_post)

    def touches(self, centres: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether balls are as near to the part as they may be."""
        near = self.radius + self.allowance + 10 * TOUCHING
        return self.part.unsigned(centres, 2 * near) < near


def drop(
    bases: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    clearance: Callable[[Float[ndarray, "k 3"]], Float[ndarray, " k"]],
    top: float,
    floor: float,
) -> Float[ndarray, " n"]:
    """The heights at which points that come down their lines from `top` come to rest, at `floor` at the latest."""
    heights = np.full(len(bases), float(top))
    moving = np.arange(len(bases))
    for _ in range(DROP_STEPS):
        step = clearance(bases[moving] + heights[moving, None] * axes[moving])
        heights[moving] -= np.maximum(step, 0.0)
        moving = moving[(step > TOUCHING) & (heights[moving] >= floor)]
        if not len(moving):
            break
    return np.maximum(heights, floor)


def drop_balls(
    chart: FlatChart, a: Float[ndarray, " n"], b: Float[ndarray, " n"], ball: Ball, top: float, floor: float
) -> Float[ndarray, " n"]:
    """The heights of ball centres that came down their lines from `top`, mm; at `floor` at the lowest."""
    return drop(chart.bases(a, b), chart.axes(a), ball.clearance, top, floor)


CELL = 0.15
"""Distance of the lines, mm."""
DEVIATION = 0.2
"""How far the material may reach out of its mesh, mm: a cell, and the slope of a wall in it."""
LEAST_AREA = 1e-9
"""Faces of less area (mm^2) are none."""


@dataclass(frozen=True, eq=False)
class HeightField:
    """Material between the heights `bottoms` and `tops` (p, q), mm, on the lines of a chart; none where equal."""

    chart: FlatChart
    tops: Float[ndarray, "p q"]
    bottoms: Float[ndarray, "p q"]

    @cached_property
    def _lines(self) -> tuple[Float[ndarray, "p q 3"], Float[ndarray, "p 3"]]:
        """Bases of all lines and their directions."""
        a, b = np.meshgrid(self.chart.a, self.chart.b, indexing="ij")
        bases = self.chart.bases(a.ravel(), b.ravel()).reshape(*a.shape, 3)
        return bases, self.chart.axes(self.chart.a)

    @property
    def solid(self) -> Bool[ndarray, "p q"]:
        """Which lines meet material."""
        return self.tops > self.bottoms

    def cut(
        self, a: Float[ndarray, " n"], b: Float[ndarray, " n"], heights: Float[ndarray, " n"], radius: float
    ) -> Float[ndarray, " n"]:
        """The largest height (mm) that each ball with its centre at `heights` would remove on its own."""
        centres = self.chart.bases(a, b) + heights[:, None] * self.chart.axes(a)
        depths = np.zeros(len(a))
        near = windows(self.chart, a, b, heights, radius)
        bases, axes = self._lines
        cut_heights(
            heights=self.tops,
            bottoms=self.bottoms,
            bases=bases,
            axes=axes,
            centres=centres,
            windows=near,
            radius=radius,
            cut=depths,
        )
        return depths

    def lowered(
        self, a: Float[ndarray, " n"], b: Float[ndarray, " n"], heights: Float[ndarray, " n"], radius: float
    ) -> "HeightField":
        """The material without what balls with their centres at `heights` remove."""
        centres = self.chart.bases(a, b) + heights[:, None] * self.chart.axes(a)
        tops = self.tops.copy()
        bases, axes = self._lines
        near = windows(self.chart, a, b, heights, radius)
        lower(tops, bases, axes, centres, windows=near, radius=radius)
        return replace(self, tops=np.maximum(tops, self.bottoms))

    def mesh(self) -> TriangleMesh:
        """Closed faces round the cells whose corners all meet material."""
        bases, axes = self._lines
        upper = bases + self.tops[..., None] * axes[:, None]
        under = bases + self.bottoms[..., None] * axes[:, None]
        p, q = self.tops.shape
        rows = self.chart.rows
        solid, ring = self.solid[rows], np.arange(p * q).reshape(p, q)[rows]
        cells = solid[:-1, :-1] & solid[1:, :-1] & solid[:-1, 1:] & solid[1:, 1:]
        # Two triangles above and two below each solid cell, and two on each of its sides without a neighbour
        i, j = np.nonzero(cells)
        corners = ring[i, j], ring[i + 1, j], ring[i + 1, j + 1], ring[i, j + 1]
        quads = [np.column_stack(corners), np.column_stack([c + p * q for c in corners[::-1]])]
        wide = self.chart.framed(cells)
        beside = (wide[i + 1, j], wide[i + 2, j + 1], wide[i + 1, j + 2], wide[i, j + 1])
        for side, neighbour in enumerate(beside):
            first, last = corners[side][~neighbour], corners[(side + 1) % 4][~neighbour]
            quads.append(np.column_stack([last, first, first + p * q, last + p * q]))
        quad = np.vstack(quads)
        faces = np.vstack([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])

        # The mesh of the vertices that faces use, its faces outward. Vertices at one place, as all lines have one on
        # the axis, are one; faces without area are left out.
        vertices = np.vstack([upper.reshape(-1, 3), under.reshape(-1, 3)])
        points, number = np.unique(vertices + 0.0, axis=0, return_inverse=True)  # -0.0 + 0.0 is 0.0
        faces = number.reshape(-1)[faces]
        a, b, c = (points[faces[:, k]] for k in range(3))
        faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > LEAST_AREA]
        used, index = np.unique(faces, return_inverse=True)
        mesh = TriangleMesh(points[used], index.reshape(faces.shape).astype(np.int32))
        return mesh if mesh.volume > 0 else TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


Heights = Callable[[Float[ndarray, " n"], Float[ndarray, " n"]], Float[ndarray, " n"]]
"""Heights (mm) of the ball's centre at coordinates a and b."""
FIRST_STEP = 0.3
"""Points are so far apart at first, mm."""
SHORTEST = 0.005
"""Moves are not divided further than this, mm: at the edge of an undercut heights jump."""
MOST_HALVINGS = 12
"""Times that moves are halved at most."""


@dataclass(frozen=True, eq=False)
class LayerCurves:
    """Points (n,) of curves one behind the other, with the number of the `line` of each."""

    line: Int[ndarray, " n"]
    a: Float[ndarray, " n"]
    b: Float[ndarray, " n"]
    heights: Float[ndarray, " n"]

    def take(self, index: Int[ndarray, " k"]) -> "LayerCurves":
        """The points with these numbers."""
        return LayerCurves(self.line[index], self.a[index], self.b[index], self.heights[index])

    def centres(self, chart: FlatChart) -> Float[ndarray, "n 3"]:
        """The ball centres at the points."""
        return chart.bases(self.a, self.b) + self.heights[:, None] * chart.axes(self.a)

    def joined(self) -> Bool[ndarray, " n"]:
        """Whether each point and the next are on one line."""
        return np.r_[self.line[1:] == self.line[:-1], False]


def join(pieces: Sequence[LayerCurves]) -> LayerCurves:
    """Curves one behind the other, each piece a line."""
    line = np.repeat(np.arange(len(pieces)), [len(piece.a) for piece in pieces])
    a, b, heights = (
        np.concatenate([np.zeros(0), *(getattr(piece, name) for piece in pieces)]) for name in ("a", "b", "heights")
    )
    return LayerCurves(line, a, b, heights)


def sample(
    lines: Sequence[Float[ndarray, "_ 2"]], chart: FlatChart, height_of: Heights, width: float, tolerance: float
) -> LayerCurves:
    """The points of polylines (a, b); `width` is the length (mm) of a unit of a where it is largest."""
    # First points are no farther apart than FIRST_STEP
    numbers, points = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 2))]
    for number, polyline in enumerate(lines):
        steps = np.diff(polyline, axis=0)
        counts = np.ceil(np.hypot(steps[:, 0] * width, steps[:, 1]) / FIRST_STEP).astype(np.int64).clip(1)
        ends = np.r_[0, np.cumsum(counts)]
        places = np.arange(ends[-1] + 1)
        points.append(np.column_stack([np.interp(places, ends, polyline[:, k]) for k in range(2)]))
        numbers.append(np.full(len(places), number))
    a, b = np.vstack(points).T
    curves = LayerCurves(np.concatenate(numbers), a, b, height_of(a, b))
    fresh = curves.joined()
    for _ in range(MOST_HALVINGS):
        begins = np.flatnonzero(fresh)
        middle_a = (curves.a[begins] + curves.a[begins + 1]) / 2
        middle_b = (curves.b[begins] + curves.b[begins + 1]) / 2
        heights = height_of(middle_a, middle_b)
        centres = curves.centres(chart)
        starts, stops = centres[begins], centres[begins + 1]
        middles = LayerCurves(curves.line[begins], middle_a, middle_b, heights)

        # Distance of each point from the segment from its start to its end, mm
        middle = middles.centres(chart)
        along = stops - starts
        square = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
        share = np.clip(((middle - starts) * along).sum(axis=1) / square, 0.0, 1.0)
        off = np.linalg.norm(middle - starts - share[:, None] * along, axis=1)

        needed = (off > tolerance) & (np.linalg.norm(stops - starts, axis=1) > SHORTEST)
        if not needed.any():
            break
        indices = begins[needed] + 1
        curves = LayerCurves(
            np.insert(curves.line, indices, curves.line[begins[needed]]),
            np.insert(curves.a, indices, middle_a[needed]),
            np.insert(curves.b, indices, middle_b[needed]),
            np.insert(curves.heights, indices, heights[needed]),
        )
        added = indices + np.arange(len(indices))
        fresh = np.zeros(len(curves.a), dtype=bool)
        fresh[added] = fresh[added - 1] = True
    return curves


@dataclass(frozen=True, eq=False)
class Layer:
    """`axes` (n, 3) of the contacts of `path`, which are not to be changed; `material` stands before it."""

    path: ContactPath
    axes: Float[ndarray, "n 3"]
    material: HeightField


def layer_of(
    curves: LayerCurves,
    kept: Bool[ndarray, " n"],
    chart: FlatChart,
    cutter: Cutter,
    material: HeightField,
    ball: Ball | None = None,
) -> Layer:
    """The layer of the `kept` points of curves, each stretch of them one pass.

    Contacts are those of the `ball` with the part; without one they are the tips of the tool.
    """
    axes = chart.axes(curves.a)
    centres = curves.centres(chart)
    normals = axes if ball is None else unit(centres - ball.part.closest(centres)[0])
    feeds = np.gradient(centres, axis=0) if len(centres) > 1 else axes
    feeds = unit(feeds + np.finfo(float).tiny)
    begins = kept & (np.r_[True, ~kept[:-1]] | np.r_[True, np.diff(curves.line) != 0])
    passes = np.cumsum(begins)
    single = np.bincount(passes[kept], minlength=passes.max(initial=0) + 1) < 2
    index = np.flatnonzero(kept & ~single[passes])
    path = ContactPath(
        level=0,
        cutter=cutter,
        pass_index=passes[index],
        parameters=np.full((len(index), 2), np.nan),
        contacts=(centres - cutter.radius * normals)[index],
        normals=normals[index],
        feeds=feeds[index],
        centres=centres[index],
        lifts=np.zeros(len(index)),
        ramp=np.zeros(len(index), dtype=bool),
        uncut=np.zeros((0, 3)),
        reasons=(),
    )
    return Layer(path, axes[index], material)


def split(curves: LayerCurves, kept: Bool[ndarray, " n"]) -> list[Int[ndarray, " _"]]:
    """The points of each stretch of `kept` ones on a line."""
    index = np.flatnonzero(kept)
    if not len(index):
        return []
    breaks = (np.diff(index) > 1) | (np.diff(curves.line[index]) != 0)
    return [run for run in np.split(index, np.flatnonzero(breaks) + 1) if len(run) > 1]


def nearest_order(
    runs: Sequence[tuple[Float[ndarray, "3"], Float[ndarray, "3"]]], start: Float[ndarray, "3"] | None
) -> list[tuple[int, bool]]:
    """The order of runs (their two ends) in which each begins nearest to where the one before ended, and whether
    each is run backwards."""
    left = set(range(len(runs)))
    ends = np.array(runs).reshape(-1, 2, 3)
    order: list[tuple[int, bool]] = []
    here = start
    while left:
        some = np.array(sorted(left))
        if here is None:
            k = int(some[0])
            backwards = False
        else:
            away = np.linalg.norm(ends[some] - here, axis=2)
            row, side = np.unravel_index(int(np.argmin(away)), away.shape)
            k = int(some[row])
            backwards = bool(side)
        order.append((k, backwards))
        here = ends[k, 0 if backwards else 1]
        left.remove(k)
    return order


MAX_LIFT_RADII = 0.5
"""A ball is raised by no more of its radii: the place is left out instead."""


def gouge_free(
    curves: LayerCurves,
    kept: Bool[ndarray, " n"],
    chart: FlatChart,
    part: MeshDistance,
    radius: float,
    gouge_tolerance: float,
) -> tuple[LayerCurves, Bool[ndarray, " n"]]:
    """The curves of a ball of this radius (mm) with the `kept` points raised, and which of these stay: on moves between
    those that follow one another on a line the ball keeps the `gouge_tolerance` (mm) to the part."""
    axes = chart.axes(curves.a)
    lifts = gouge_free_lifts(
        curves.centres(chart) - radius * axes,
        axes,
        radius=radius,
        tolerance=planned_tolerance(gouge_tolerance),
        obstacles=[part],
        joined=kept & np.r_[kept[1:], False] & curves.joined(),
        max_lift=MAX_LIFT_RADII * radius,
    )
    return replace(curves, heights=curves.heights + np.nan_to_num(lifts)), kept & np.isfinite(lifts)


@dataclass(frozen=True, eq=False)
class HeightMesh:
    """The closed mesh of a height field, known from cell to cell, or of another body out of which what stands reaches
    by the `deviation` at most, mm; its vertices are as near to one another as cells. `rays` are what stands, where that
    is known: the mesh misses ribs that are narrower than cells, and places that were left out."""

    mesh: TriangleMesh
    deviation: float = DEVIATION
    rays: CutDexels | None = None

    def depths(
        self, centres: Float[ndarray, "n 3"], radius: float
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
        """How deep a ball of this radius at each centre enters the material at most (mm; negative: it is off), and the
        unit direction out of the mesh at its nearest place."""
        depths, outward = ball_depths(self._surface, centres, radius)
        return depths + self.deviation, outward

    def entered_anew(
        self, centres: Float[ndarray, "n 3"], contacts: Float[ndarray, "n 3"], radius: float, depth: float
    ) -> Bool[ndarray, " n"]:
        """Whether a ball of this radius at each centre enters the mesh by more than `depth` (mm) where one at its
        contact has not been."""
        return enters_beside(
            self._places, *ball_depths(self._surface, centres, radius), centres, contacts, radius, depth
        )

    @cached_property
    def _surface(self) -> MeshDistance:
        return MeshDistance(self.mesh)

    @cached_property
    def _places(self) -> KDTree:
        return KDTree(self.mesh.vertices)


HALVINGS = 6
"""Times that the distance of passes is halved at most: on a wall they never come near enough."""
SPARE = 0.4
"""Passes between others are longer than needed by this at each end, mm."""
SPACING = 0.12
"""Distance of the places on a pass where cusps are computed, mm."""


def flat_step(radius: float, scallop: float) -> float:
    """Distance (mm) of passes of a ball on a plane that leave cusps of `scallop` mm."""
    return float(2 * np.sqrt(scallop * (2 * radius - scallop)))


def scan_lines(
    chart: FlatChart, ball: Ball, scallop: float, height_of: Heights, extent: tuple[float, float], width: float
) -> list[Float[ndarray, "2 2"]]:
    """Straight lines (a, b) in the order from the highest b down, run to and fro; `extent` is that of b, `width` the
    length (mm) of a unit of a where it is largest."""
    low, high = chart.span
    a = np.linspace(low, high, max(int(np.ceil((high - low) * width / SPACING)), 2) + 1)
    count = max(int(np.ceil((extent[1] - extent[0]) / flat_step(ball.radius, scallop))), 1)
    rows = {float(b): np.ones(len(a), dtype=bool) for b in np.linspace(*extent, count + 1)}

    def heights_on(passes: list[float]) -> dict[float, Float[ndarray, " n"]]:
        heights = height_of(np.tile(a, len(passes)), np.repeat(passes, len(a)))
        return dict(zip(passes, heights.reshape(-1, len(a)), strict=True))

    heights = heights_on(list(rows))
    gaps = [(one, other, np.ones(len(a), dtype=bool)) for one, other in zip(list(rows), list(rows)[1:])]
    margin = max(int(np.ceil(SPARE / SPACING)), 1)
    for _ in range(HALVINGS):
        halves = []
        heights |= heights_on([(one + other) / 2 for one, other, _ in gaps])
        for one, other, asked in gaps:
            b = (one + other) / 2
            high_cusps = asked & _too_high(chart, ball, scallop=scallop, a=a, passes=(one, b, other), heights=heights)
            if high_cusps.any():
                # The mask and `margin` places on both sides of it
                rows[b] = np.convolve(high_cusps, np.ones(2 * margin + 1), mode="same")[: len(high_cusps)] > 0.5
                halves += [(one, b, rows[b]), (b, other, rows[b])]
        gaps = halves

    # The stretches of all rows from the highest down, every other row backwards
    lines: list[Float[ndarray, "2 2"]] = []
    for number, b in enumerate(sorted(rows, reverse=True)):
        segments = [np.array([[a[i], b], [a[j - 1], b]]) for i, j in runs_of(rows[b]) if j - i > 1]
        lines += [line[::-1] for line in reversed(segments)] if number % 2 else segments
    return lines


def _too_high(
    chart: FlatChart,
    ball: Ball,
    scallop: float,
    a: Float[ndarray, " n"],
    passes: tuple[float, float, float],
    heights: dict[float, Float[ndarray, " n"]],
) -> Bool[ndarray, " n"]:
    """Where the cusp between the first and the last of three passes exceeds the limit."""
    axes = chart.axes(a)
    one, half, other = (chart.bases(a, np.full(len(a), b)) + heights[b][:, None] * axes for b in passes)
    on_part = ball.touches(half)
    normals = unit(half - ball.part.closest(half)[0])
    feeds = unit(np.gradient(half, axis=0) + np.finfo(float).tiny)
    between = other - one
    across = between - dots(between, feeds)[:, None] * feeds
    square = (across**2).sum(axis=1) / 4
    radius = ball.radius
    cusp = radius - np.sqrt(np.maximum(radius**2 - square, 0.0))
    return on_part & (cusp + dots((one + other) / 2 - half, normals) > scallop)


LEAD = 1.0
"""Passes begin before the material and end behind it by this, mm; shorter gaps in the material are kept."""


@dataclass(frozen=True, eq=False)
class Rough:
    """How a layer is roughed: its cutter, the part that it does not gouge, the tolerances of the job, the height (mm)
    that a cut has at least and the length (mm) of a unit of a."""

    cutter: Cutter
    part: MeshDistance
    job: PathJob
    least: float
    width: float


def rough_layer(
    sets: Sequence[Sequence[Float[ndarray, "_ 2"]]], height_of: Heights, material: HeightField, rough: Rough
) -> tuple[Layer, HeightField]:
    """The layer that cuts sets of polylines (a, b) one set after the other, and the material behind it. Where a move
    would gouge the part the ball is raised, or the place left out."""
    chart = material.chart
    radius = rough.cutter.radius
    before = material
    pieces = list[LayerCurves]()
    here = None
    polylines = [line for lines in sets for line in lines]
    every = sample(polylines, chart, height_of, rough.width, rough.job.chord_tolerance)
    all_points = np.ones(len(every.line), dtype=bool)
    every, free = gouge_free(
        every, all_points, chart=chart, part=rough.part, radius=radius, gouge_tolerance=rough.job.gouge_tolerance
    )
    ends = np.searchsorted(every.line, np.cumsum([len(lines) for lines in sets]))
    for points in np.split(np.arange(len(every.line)), ends[:-1]):
        curves = every.take(points)
        cut = material.cut(curves.a, curves.b, curves.heights, radius)
        centres = curves.centres(chart)
        # The needed points and those within LEAD of them along their line.
        needed = cut > rough.least
        kept = np.zeros(len(needed), dtype=bool)
        for line in np.unique(curves.line[needed]):
            rows = np.flatnonzero(curves.line == line)
            along = np.r_[0.0, np.linalg.norm(np.diff(centres[rows], axis=0), axis=1).cumsum()]
            at = along[needed[rows]]
            place = np.searchsorted(at, along)
            ahead = np.abs(along - at[np.maximum(place - 1, 0)])
            behind = np.abs(at[np.minimum(place, len(at) - 1)] - along)
            kept[rows] = np.minimum(ahead, behind) <= LEAD
        runs = split(curves, free[points] & kept)
        order = nearest_order([(centres[run[0]], centres[run[-1]]) for run in runs], here)
        for number, backwards in order:
            run = runs[number][::-1] if backwards else runs[number]
            pieces.append(curves.take(run))
            here = centres[run[-1]]
        if runs:
            swept = _swept([curves.take(run) for run in runs], rough.width)
            material = material.lowered(*swept, radius)
    joined = join(pieces)
    layer = layer_of(joined, np.ones(len(joined.a), dtype=bool), chart, rough.cutter, before)
    return layer, material


def rough_down(
    sets: Sequence[Sequence[Float[ndarray, "_ 2"]]],
    tips: Sequence[float],
    ball: Ball,
    material: HeightField,
    rough: Rough,
) -> tuple[list[Layer], HeightField]:
    """The layers that find material where the tip comes down sets of polylines to each of the heights `tips` (mm), as
    far as the part lets the `ball` come, and the material behind them; the first of `tips` is above all."""
    chart, radius = material.chart, ball.radius
    layers = []
    for tip in tips[1:]:

        def height_of(a: Float[ndarray, " n"], b: Float[ndarray, " n"], at: float = float(tip)) -> ndarray:
            return drop_balls(chart, a, b=b, ball=ball, top=tips[0] + radius, floor=at + radius)

        layer, material = rough_layer(sets, height_of, material, rough)
        if len(layer.path.contacts):
            layers.append(layer)
    return layers, material


def _swept(runs: Sequence[LayerCurves], width: float) -> tuple[ndarray, ndarray, ndarray]:
    """a, b and heights on the moves of runs, half a cell apart."""
    samples = []
    for run in runs:
        steps = np.hypot(np.diff(run.a) * width, np.diff(run.b)) + np.abs(np.diff(run.heights))
        counts = np.ceil(steps / (CELL / 2)).astype(np.int64).clip(1)
        ends = np.r_[0, np.cumsum(counts)]
        at = np.arange(ends[-1] + 1)
        samples.append(np.column_stack([np.interp(at, ends, values) for values in (run.a, run.b, run.heights)]))
    a, b, heights = np.vstack(samples).T
    return a, b, heights


Wanted = Callable[[Float[ndarray, "n 3"]], Bool[ndarray, " n"]]
"""Which contacts are wanted."""
FACING = 0.02
"""Places whose normal turns away from the tool by more (its cosine) are on its other side."""
HIDDEN = 0.02
"""A ball that rests higher than this above a place does not reach it, mm."""


def finish_layer(
    ball: Ball,
    cutter: Cutter,
    material: HeightField,
    job: PathJob,
    heights: tuple[float, float],
    extent: tuple[float, float],
    width: float,
    wanted: Wanted | None = None,
) -> tuple[Layer, HeightField]:
    """The passes over all that the ball touches between its highest and lowest `heights` (centre, mm), or of that
    over the `wanted` places, and the material behind them; `extent` is that of b, `width` the length (mm) of a unit of
    a.

    Where more than MAX_DEPTH_RADII of material is above a contact the ball comes down on it in steps; where that does
    not do, the contact is left out (`covered`).
    """
    chart = material.chart
    top, floor = heights

    def height_of(a: Float[ndarray, " n"], b: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        return drop_balls(chart, a, b=b, ball=ball, top=top, floor=floor)

    lines = scan_lines(chart, ball, scallop=cutter.scallop, height_of=height_of, extent=extent, width=width)
    curves = sample(lines, chart, height_of, width, job.chord_tolerance)
    centres = curves.centres(chart)
    kept = ball.touches(centres) & (curves.heights > floor)
    if wanted is not None:
        kept[kept] = wanted(ball.part.closest(centres[kept])[0])
    raised, kept = gouge_free(
        curves, kept, chart=chart, part=ball.part, radius=ball.radius, gouge_tolerance=job.gouge_tolerance
    )
    # Before the curves, once or more, these raised by MAX_DEPTH_RADII of the ball where it would sink deeper into the
    # material; which of their points are kept, not those that are still too deep; and the material behind them
    deepest = MAX_DEPTH_RADII * ball.radius
    count = int(np.ceil(depths_in(material, raised.centres(chart), ball.radius)[kept].max(initial=0.0) / deepest))
    pieces, used = list[LayerCurves](), list[ndarray]()
    left = material
    for step in range(max(count, 1) - 1, -1, -1):
        higher = replace(raised, heights=raised.heights + step * deepest)
        sunk = depths_in(left, higher.centres(chart), ball.radius)
        cut = kept & (sunk <= deepest) & ((sunk > 0) | (step == 0))
        # The first point of each line but the first
        pieces += [higher.take(run) for run in np.split(np.arange(len(cut)), np.flatnonzero(np.diff(higher.line)) + 1)]
        used.append(cut)
        if cut.any():
            left = left.lowered(*_swept([higher.take(run) for run in split(higher, cut)], width), ball.radius)
    cut = np.concatenate(used)
    layer = layer_of(join(pieces), cut, chart=chart, cutter=cutter, material=material, ball=ball)
    covered = kept & ~cut[-len(kept) :]
    uncut = ball.part.closest(centres[covered])[0]
    path = replace(layer.path, uncut=uncut, reasons=("covered",) * len(uncut))
    return replace(layer, path=path), left


def depths_in(material: HeightField, centres: Float[ndarray, "n 3"], radius: float) -> Float[ndarray, " n"]:
    """How deep balls of `radius` sink into the material, mm; negative where they keep off it."""
    return radius - MeshDistance(material.mesh()).signed(centres, radius)


def unreached(
    points: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    chart: FlatChart,
    ball: Ball,
    heights: tuple[float, float],
    extent: tuple[float, float],
) -> Bool[ndarray, " n"]:
    """Which places of the part no pass touches, however close passes are."""
    centres = points + ball.radius * normals
    a, b, wanted = chart.coordinates(centres)
    rests = drop_balls(chart, a, b, ball, *heights)
    facing = dots(normals, chart.axes(a)) >= -FACING
    inside = (b >= extent[0]) & (b <= extent[1]) & (wanted > heights[1])
    return ~(facing & inside & (rests - wanted < HIDDEN))
