"""Iso-height and rotary milling (compared with morphing by Gan et al. 2014).

`RoundChart`: lines that leave the Z axis at right angles; a is the angle about it (radians), b (mm) is z. The height of
a point on its line is its distance from the axis, mm.

The curves of a slice: the outline that the ball's centre may come up to, and its offsets a side step apart.

Iso-height (Z-level) milling of a bone from both sides.

The part stands on its post along Z and is not clamped again: the tool is level, and the two sides are two indexed
positions of the rotary axes, C turned by 180 degrees between them (3+2 milling). The first side is the one towards
which the part is thinnest. From each side slices of one height go down by the depth of roughing cuts until the
outline of the part and its finishing cutter are passed; then each side is finished by parallel passes round the part.
What neither side sees stays.

Sectional rotary milling of a bone: "the part keeps turning around its pivot while the tool feeds from the radial
direction" (Gan et al. 2014, section 5.3).

The tool axis is level and points at the Z axis, about which the part turns. A layer is a row of sections z = const,
from the free end down to the post; the tool feeds in by the depth of roughing cuts from layer to layer, and out where
the part is in its way. A last layer finishes with sections as close as the scallop asks for. The tool stays beside the
part: beyond its ends, and nearer to the axis than CORE, nothing is cut, so that the ends stay.

The tool paths of a strategy that works in layers, with the tool axes that it fixes: iso-height milling from two
sides, sectional rotary milling. They are linked and checked for collisions as the levels of a morph are.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from contourpy import contour_generator
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import distance_transform_edt, gaussian_filter, map_coordinates

from bonecam import Job
from bonecam.arrays import unit
from bonecam.errors import OrientationError
from bonecam.levels import Level
from bonecam.machine import MachineLimits
from bonecam.material import uncut_rays
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.planning import (
    Ball,
    FlatChart,
    HeightField,
    HeightMesh,
    Layer,
    Rough,
    Scene,
    distance_to_part,
    drop,
    drop_balls,
    finish_layer,
    flat_step,
    flute_slack,
    orient,
    parting_paths,
    rough_down,
    rough_layer,
    unreached,
)
from bonecam.progress import Progress, report, silent
from bonecam.setup import Stock, enclosing_capsule
from bonecam.tool import Cutter, ToolPath
from bonecam.workholding import Post, clamping_of, post_below

CELL = 0.15
"""Distance of the lines, mm."""


@dataclass(frozen=True, eq=False)
class RoundChart(FlatChart):
    """Lines that leave the Z axis at right angles, at the angles `a` about it from the `axis` X and the heights `b`:
    the last a is followed by the first."""

    @classmethod
    def of(cls, a: Float[ndarray, " p"], b: Float[ndarray, " q"]) -> "RoundChart":
        """The lines at these angles and heights."""
        x, y, _ = np.eye(3)
        return cls(x, y, a, b)

    def bases(self, a: Float[ndarray, " n"], b: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """The points of height 0, on the axis."""
        return b[:, None] * self.along

    def axes(self, a: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """The unit directions of the lines, away from the axis."""
        return np.column_stack([np.cos(a), np.sin(a), np.zeros(len(a))])

    def coordinates(
        self, points: Float[ndarray, "n 3"]
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
        """a, b and the height of points."""
        return np.arctan2(points[:, 1], points[:, 0]), points[:, 2], np.hypot(points[:, 0], points[:, 1])

    def near(
        self, a: Float[ndarray, " n"], heights: Float[ndarray, " n"], radius: float
    ) -> tuple[Int[ndarray, " n"], Int[ndarray, " n"]]:
        """The first and the last line across that balls at these places may meet, counted on beyond the last one."""
        step = self.a[1] - self.a[0]
        # how far from their own line, in radians, balls meet others
        wide = np.where(heights > radius, np.arcsin(radius / np.maximum(heights, radius)), np.pi)
        first = np.ceil((a - wide - self.a[0]) / step).astype(np.int64)
        last = np.floor((a + wide - self.a[0]) / step).astype(np.int64)
        return first, np.minimum(last, first + len(self.a) - 1)

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and the highest a that passes run to: once round."""
        return self.a[0], self.a[-1] + (self.a[1] - self.a[0])

    @property
    def rows(self) -> Int[ndarray, " r"]:
        """The numbers of the lines across, one after the other, round to the first."""
        return np.r_[np.arange(len(self.a)), 0]

    def framed(self, cells: Bool[ndarray, "p q"]) -> Bool[ndarray, "p2 q2"]:
        """Cells of the grid with those round it, across those of the other end."""
        wide = np.pad(cells, 1)
        wide[[0, -1], 1:-1] = cells[[-1, 0]]
        return wide


def stock_field(chart: FlatChart, stock: Stock, top: float) -> HeightField:
    """The stock on the lines of a chart; `top` (mm) is higher than all of it."""
    a, b = (each.ravel() for each in np.meshgrid(chart.a, chart.b, indexing="ij"))
    bases = chart.bases(a, b)
    axes = chart.axes(a)
    shape = len(chart.a), len(chart.b)
    if isinstance(chart, RoundChart):
        tops = drop(bases, axes, stock.signed_distance, top, 0.0).reshape(shape)
        return HeightField(chart, tops, np.zeros(shape))
    tops = drop(bases, axes, stock.signed_distance, top, -top)
    bottoms = -drop(bases, -axes, stock.signed_distance, top, -top)
    middle = (tops + bottoms) / 2
    missed = tops <= bottoms
    return HeightField(
        chart, np.where(missed, middle, tops).reshape(shape), np.where(missed, middle, bottoms).reshape(shape)
    )


def turned_over(material: HeightField) -> HeightField:
    """The material on parallel lines as it is seen from the other side."""
    return HeightField(from_behind(material.chart), -material.bottoms, -material.tops)


def from_behind(chart: FlatChart) -> FlatChart:
    """A chart as seen from the other side: its lines stay, its tool axis is reversed."""
    return replace(chart, axis=-chart.axis)


PLACES = 8000
"""About so many places of the part are asked whether a strategy reaches them."""


def places_of(part: TriangleMesh) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """About PLACES places all over the part, and their unit normals."""
    vectors = part.face_vectors
    lengths = np.linalg.norm(vectors, axis=1)
    some = np.flatnonzero(lengths > 0)[:: max(len(lengths) // PLACES, 1)]
    return part.vertices[part.faces[some]].mean(axis=1), vectors[some] / lengths[some, None]


Free = Callable[[Float[ndarray, " n"], Float[ndarray, " n"]], Bool[ndarray, " n"]]
"""Whether balls of a slice are free at coordinates a and b."""
SPACED = 0.3
"""The outline is found at places about so far apart, mm: on an arc of the radius of a 2 mm ball it runs 6 um off the
straight lines between them."""
OFF = 0.3
"""A curve so far from the outline is free, mm: two cells, as the outline is known from cell to cell."""
HALVINGS = 6
"""Times that the distance to the outline is halved: to a hundredth of OFF."""
STRAIGHT = 0.02
"""Offset curves deviate from their polylines by this at most, mm."""
SMOOTH = 1.0
"""The distance to the outline is smoothed over so many cells: it is known from cell to cell only."""


def offset_curves(
    chart: FlatChart, rests: Float[ndarray, "p q"], height: float, step: float, is_free: Free
) -> list[list[Float[ndarray, "_ 2"]]]:
    """Polylines (a, b) of the slice on which the centre of a ball is at `height`, the farthest from the part first
    and its outline last; `rests` are the heights at which balls come to rest on the part.

    Above the part they are the offsets of its ridge.
    """
    blocked = rests > height

    # The highest place on each line along a
    ridge = np.zeros(rests.shape, dtype=bool)
    ridge[np.argmax(rests, axis=0), np.arange(rests.shape[1])] = True

    has_outline = blocked.any()
    away = distance_transform_edt(~(blocked if has_outline else ridge)) * (chart.b[1] - chart.b[0])
    away = gaussian_filter(away, SMOOTH)
    offsets = np.arange(1, int(away.max() / step) + 1) * step
    contours = contour_generator(chart.b, chart.a, away)
    curves = [[thinned(line[:, ::-1]) for line in contours.lines(offset) if len(line) > 2] for offset in offsets[::-1]]
    if not has_outline:
        # A straight line along the middle of the ridge
        across = np.median(chart.a[np.argmax(ridge, axis=0)])
        return [*curves, [np.column_stack([np.full(2, across), chart.b[[0, -1]]])]]
    outline = []
    for line in (each[:, ::-1] for each in contours.lines(OFF)):
        if len(line) > 2:
            # its points about SPACED apart, with its ends: what is straight here may not be on the outline
            along = np.r_[0.0, np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum()]
            steps = np.diff(np.floor(along / SPACED), prepend=-1.0)
            steps[-1] = 1.0
            # The points of a line that is OFF the outline moved on to it: as near as balls are free.
            spaced = line[steps > 0]
            cell = chart.b[1] - chart.b[0]
            coordinates = ((spaced - [chart.a[0], chart.b[0]]) / cell).T
            slopes = [map_coordinates(slope, coordinates, order=1, mode="nearest") for slope in np.gradient(away)]
            inward = -unit(np.column_stack(slopes) + np.finfo(float).tiny)
            near, far = np.zeros(len(spaced)), np.full(len(spaced), 2 * OFF)
            for _ in range(HALVINGS):
                middle = (near + far) / 2
                free = is_free(*(spaced + middle[:, None] * inward).T)
                near, far = np.where(free, middle, near), np.where(free, far, middle)
            outline.append(thinned(spaced + near[:, None] * inward))
    return [*curves, outline]


def thinned(line: Float[ndarray, "n 2"], tolerance: float = STRAIGHT) -> Float[ndarray, "k 2"]:
    """The polyline with only so many of its points that no other is farther from it than `tolerance`
    (Douglas & Peucker 1973)."""
    kept = {0, len(line) // 2, len(line) - 1}
    open_ = list(pairwise(sorted(kept)))
    while open_:
        first, last = open_.pop()
        if last - first < 2:
            continue
        along = line[last] - line[first]
        length = max(float(np.hypot(*along)), np.finfo(float).tiny)
        beside = line[first + 1 : last] - line[first]
        off = np.abs(beside[:, 0] * along[1] - beside[:, 1] * along[0]) / length
        worst = first + 1 + int(np.argmax(off))
        if off.max() > tolerance:
            kept.add(worst)
            open_ += [(first, worst), (worst, last)]
    return line[sorted(kept)]


EDGE = 0.05
"""Places whose normal is at right angles to the tool within this cosine are on the outline."""


def iso_height_layers(
    part: MeshDistance, stock: Stock, post: Post, roughing: Cutter, finishing: Cutter, job: Job
) -> tuple[list[Layer], ndarray]:
    """The layers in machining order, and the places of the part that neither side reaches."""
    ball = Ball(roughing.radius, job.levels.finishing_depth, part, post)
    fine = Ball(finishing.radius, 0.0, part, post)

    # The two sides, towards which the part is thinnest: its lines, and the tip heights (mm) of its first and last slice
    points, normals = places_of(part.mesh)
    axis = np.r_[np.linalg.eigh(np.cov(points[:, :2].T))[1][:, 0], 0.0]
    across = np.cross(np.array([0.0, 0.0, 1.0]), axis)
    outer = stock.mesh(CELL / 2).vertices
    room = roughing.radius + CELL
    a = np.arange((outer @ across).min() - room, (outer @ across).max() + room + CELL, CELL)
    b = np.arange(outer[:, 2].min() - room, outer[:, 2].max() + room + CELL, CELL)
    chart = FlatChart(axis, across, a, b)
    outline = (points @ axis)[np.abs(normals @ axis) < EDGE]
    ends = outer @ axis
    sides = [
        (chart, float(ends.max()), float(outline.min()) - finishing.radius),
        (from_behind(chart), float(-ends.min()), float(-outline.max()) - finishing.radius),
    ]

    material = stock_field(chart, stock, sides[0][1] + roughing.radius)
    layers: list[Layer] = []
    for _, top, floor in sides:
        rough_layers, material = _rough_side(top, floor, ball, material, roughing, job)
        layers += rough_layers
        material = turned_over(material)

    extent = float(b[0]), float(b[-1])
    left = np.ones(len(points), dtype=bool)
    for chart, top, floor in sides:
        heights = top + finishing.radius, floor + finishing.radius
        layer, material = finish_layer(
            fine, finishing, material=material, job=job.path, heights=heights, extent=extent, width=1.0
        )
        layers.append(layer)
        left &= unreached(points, normals, chart=chart, ball=fine, heights=heights, extent=extent)
        material = turned_over(material)
    return layers, points[left]


def _rough_side(
    first: float, last: float, ball: Ball, material: HeightField, cutter: Cutter, job: Job
) -> tuple[list[Layer], HeightField]:
    """The slices that find material, from the top down: tip heights (mm) of the `first` and the `last`."""
    chart = material.chart
    a, b = (each.ravel() for each in np.meshgrid(chart.a, chart.b, indexing="ij"))
    top = first + cutter.radius
    lowest = last + cutter.radius
    rests = drop_balls(chart, a, b=b, ball=ball, top=top, floor=lowest - 1.0).reshape(material.tops.shape)
    count = int(np.ceil((first - last) / job.levels.layer_depth))
    rough = Rough(cutter, ball.part, job.path, job.path.least_depth, 1.0)
    step = flat_step(cutter.radius, cutter.scallop)
    layers = []
    for height in np.linspace(top, lowest, count + 1)[1:]:

        def is_free(a: Float[ndarray, " n"], b: Float[ndarray, " n"], at: float = float(height)) -> ndarray:
            # most balls that are not free are not so in their place: that is asked first, the way down takes many steps
            free = ball.clearance(chart.bases(a, b) + at * chart.axes(a)) >= 0.0
            free[free] = drop_balls(chart, a[free], b=b[free], ball=ball, top=top, floor=at) <= at
            return free

        def height_of(a: Float[ndarray, " n"], b: Float[ndarray, " n"], at: float = float(height)) -> ndarray:
            return np.full(len(a), at)

        sets = offset_curves(chart, rests, float(height), step, is_free)
        layer, material = rough_layer(sets, height_of, material, rough)
        if len(layer.path.contacts):
            layers.append(layer)
    return layers, material


CORE = 1.0
"""The tip of the tool comes no nearer to the axis, mm: what lies beyond the free end stays on a core of the part."""


def rotary_layers(
    part: MeshDistance, stock: Stock, post: Post, roughing: Cutter, finishing: Cutter, job: Job
) -> tuple[list[Layer], Float[ndarray, "u 3"]]:
    """The layers in machining order, and the places of the part that no section reaches."""
    outer = stock.mesh(CELL / 2).vertices
    largest = float(np.hypot(outer[:, 0], outer[:, 1]).max())
    angles = np.linspace(0, 2 * np.pi, int(np.ceil(2 * np.pi * largest / CELL)), endpoint=False)
    room = roughing.radius + CELL
    chart = RoundChart.of(angles, np.arange(outer[:, 2].min() - room, outer[:, 2].max() + room + CELL, CELL))
    extent = float(part.mesh.bounds[0, 2]), float(part.mesh.bounds[1, 2])
    material = stock_field(chart, stock, largest + roughing.radius)
    ball = Ball(roughing.radius, job.levels.finishing_depth, part, post)

    # The roughing layers that find material, from the outermost in; `largest` (mm) is the radius of the stock
    sections = np.linspace(
        *extent[::-1], 1 + int(np.ceil(np.ptp(extent) / flat_step(roughing.radius, roughing.scallop)))
    )
    rough = Rough(roughing, ball.part, job.path, job.path.least_depth, largest)
    tips = np.linspace(largest, CORE, 1 + int(np.ceil((largest - CORE) / job.levels.layer_depth)))
    turn = [0.0, 2 * np.pi]
    sets = [[np.column_stack([turn[:: -1 if k % 2 else 1], [b, b]])] for k, b in enumerate(sections)]
    layers, material = rough_down(sets, tips.tolist(), ball, material, rough)

    fine = Ball(finishing.radius, 0.0, part, post)
    heights = largest + finishing.radius, CORE + finishing.radius
    layer, _ = finish_layer(
        fine, finishing, material=material, job=job.path, heights=heights, extent=extent, width=largest
    )
    points, normals = places_of(part.mesh)
    left = unreached(points, normals, chart=chart, ball=fine, heights=heights, extent=extent)
    return [*layers, layer], points[left]


STRATEGIES = {"iso-height": iso_height_layers, "rotary": rotary_layers}
"""What plans the layers of each strategy (`path.strategy`)."""
LEVEL = np.array([[1.0, 0.0, 0.0]])
"""A tool axis that is level, as those of both strategies are."""


def plan_layer_paths(
    levels: Sequence[Level], stock: Stock, job: Job, limits: MachineLimits, progress: Progress = silent
) -> tuple[ToolPath, ...]:
    """The paths of the layers of `job.path.strategy` in machining order, the last one numbered 0; `levels` begin at
    the part, `limits` are the machine's.

    OrientationError where the machine cannot lay its tool axis level, or no contact of a layer is reached.
    """
    if not limits.allow(LEVEL).all():
        raise OrientationError(
            f"path.strategy = {job.path.strategy!r} needs a tool axis at 90 deg to the table, which this machine "
            f"does not reach ({np.degrees(limits.largest):g} deg): take strategy = 'morph' or another machine"
        )
    report(progress, 0.0, "planning layers")
    distance = distance_to_part(levels, job.path.gouge_tolerance)
    post = post_below(distance.mesh, job.holding)
    roughing = Cutter.from_job(1, "roughing", job.tool("roughing"), limits.bodies.nose)
    finishing = Cutter.from_job(2, "finishing", job.tool("finishing"), limits.bodies.nose)
    layers_of = STRATEGIES[job.path.strategy]
    layers, unreached = layers_of(distance, stock, post, roughing=roughing, finishing=finishing, job=job)
    paths = list[ToolPath]()
    rays = uncut_rays(stock)
    for count, layer in enumerate(layers):
        report(progress, 0.3 + 0.7 * count / len(layers), f"path of layer {len(layers) - 1 - count}")
        standing = HeightMesh(layer.material.mesh(), rays=rays)
        scene = Scene(
            level=distance.mesh,
            material=standing.mesh,
            stock=enclosing_capsule(stock),
            post=post,
            material_deviation=standing.deviation,
            known_level_distance=distance,
            part_distance=None,
            clamping=clamping_of(job.holding, limits.bodies.table),
            tangent_slack=flute_slack(job.path.gouge_tolerance),
        )
        path = replace(layer.path, level=len(layers) - 1 - count)
        if not path.level:
            near = post.distance(unreached) < 2 * path.cutter.radius
            reasons = *path.reasons, *np.where(near, "post", "hidden").tolist()
            path = replace(path, uncut=np.vstack([path.uncut, unreached]), reasons=reasons)
        paths.append(orient(path, scene, limits, job.path, job.nc, fixed=layer.axes, material=standing))
        rays = rays.after(paths[-1])
    return *paths, *parting_paths(scene, job, limits)
