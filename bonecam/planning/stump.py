"""The parting pass: a groove round the post below the finished part, down to a bridge that still holds the part.

The ball goes round the Z axis at one height, in steps: each begins a quarter of a turn earlier where the one before
ended, comes down to its depth on that ramp, and goes once round. What it removes is then no deeper than the step.

The layers that cut the stump of the post off a part that was parted and turned over.

The tool comes down on the stump along one direction: with the ball for roughing in layers of the roughing depth until
the finishing depth is left on the part; then the one for finishing takes what stands there in layers of the finishing
depth, the last one over all places that stayed at the post.

The tool paths of the second clamping: the stump of the post is cut off the part that stands turned over in a shell.

The tool keeps one direction, LEAN off the Z axis, so that the ball cuts beside its tip: of several round the axis the
one from which most of what stayed at the post is seen.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import KDTree

from bonecam.arrays import perpendicular
from bonecam.errors import OrientationError
from bonecam.job import HoldingJob, Job, field_error
from bonecam.machine.bodies import MachineBodies
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh, side_by_side
from bonecam.planning.contacts import POST_CLEARANCE, at_post, flute_slack
from bonecam.planning.layers import (
    CELL,
    DEVIATION,
    LEAD,
    Ball,
    FlatChart,
    HeightField,
    HeightMesh,
    Layer,
    Rough,
    depths_in,
    drop,
    drop_balls,
    finish_layer,
    flat_step,
    rough_down,
    rough_layer,
    scan_lines,
    unreached,
)
from bonecam.planning.oriented_path import orient
from bonecam.planning.scene import Scene
from bonecam.planning.spacing import MAX_STEP
from bonecam.progress import Progress, report, silent
from bonecam.setup.capsule import smallest_capsule
from bonecam.tool.cutter import MAX_DEPTH_RADII, Cutter
from bonecam.tool.path import PARTING, ContactPath, MoveKind, ToolPath
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import Post
from bonecam.workholding.shell import SecondClamping

RAMP = np.pi / 2
"""Each step comes down over this angle, radians."""
BESIDE = 0.5
"""Vertices of the material so far above and below the groove count as beside it, mm: as far apart as they are."""


@dataclass(frozen=True)
class Groove:
    """A groove that balls of `radius` cut round the Z axis with their centres at the height `middle`; it goes from the
    `outer` radius of what stands round the post to that of the `bridge`, mm."""

    middle: float
    radius: float
    bridge: float
    outer: float

    @property
    def bottom(self) -> float:
        """Height of the groove's lower edge, mm."""
        return self.middle - self.radius

    def outline(self, post: float, points: int = 24) -> Float[ndarray, "k 2"]:
        """Radii and heights (mm) of the groove's bottom in a post of this radius, from the lower edge up."""
        angle = np.linspace(-np.pi / 2, np.pi / 2, points)
        radii = self.bridge + self.radius * (1 - np.cos(angle))
        heights = self.middle + self.radius * np.sin(angle)
        inside = radii < post
        edge = np.array([[post, heights[inside][0]], [post, heights[inside][-1]]])
        return np.vstack([edge[:1], np.column_stack([radii, heights])[inside], edge[1:]])


def cut_groove(paths: Sequence[ToolPath]) -> Groove | None:
    """The groove that paths cut, if they part."""
    parting = [path for path in paths if path.level == PARTING]
    if not parting:
        return None
    radius = parting[0].cutter.radius
    contacts = np.vstack([path.contacts[path.kinds == MoveKind.CUT] for path in parting])
    radii = np.hypot(contacts[:, 0], contacts[:, 1])
    return Groove(float(contacts[0, 2]), radius, float(radii.min()), float(radii.max()))


def groove_below(
    lowest: float, post: Post, holding: HoldingJob, cutter: Cutter, standing: TriangleMesh | None = None
) -> Groove:
    """The groove of a cutter below a part whose `lowest` point is at this height, mm; it begins outside of the post
    and of what is `standing` round it."""
    middle = lowest - holding.stand_off - cutter.radius
    vertices = np.zeros((0, 3)) if standing is None else standing.vertices
    beside = vertices[np.abs(vertices[:, 2] - middle) < cutter.radius + BESIDE]
    widest = np.hypot(beside[:, 0], beside[:, 1]).max(initial=post.radius)
    return Groove(middle, cutter.radius, holding.bridge / 2, float(widest) + POST_CLEARANCE)


def parting_cutters(job: Job, bodies: MachineBodies) -> Iterator[Cutter]:
    """The cutters that may turn the groove, the stiffer one first."""
    for number, name in enumerate(("roughing", "finishing"), 1):
        yield Cutter.from_job(number, name, job.tool(name), bodies.nose)


def parting_contacts(groove: Groove, cutter: Cutter, job: Job) -> Iterator[ContactPath]:
    """The contacts of each step of the groove, a pass each, counter-clockwise; a step is no deeper than a roughing
    cut."""
    # Radii (mm) of the groove's bottom before and after each step; a step is no deeper than `limit` (mm) and than the
    # ball may sink.
    step = min(job.levels.layer_depth, MAX_DEPTH_RADII * groove.radius)
    count = int(np.ceil((groove.outer - groove.bridge) / step))
    for number, (before, floor) in enumerate(pairwise(np.linspace(groove.outer, groove.bridge, count + 1).tolist()), 1):
        farthest = before + cutter.radius
        half = np.arccos(1 - job.path.chord_tolerance / farthest)
        turn = min(2 * half, MAX_STEP / farthest)
        ramp = np.linspace(-RAMP, 0.0, int(np.ceil(RAMP / turn)) + 1)
        angle = np.r_[ramp[:-1], np.linspace(0.0, 2 * np.pi, int(np.ceil(2 * np.pi / turn)) + 1)]
        radii = np.asarray(np.interp(angle, [-RAMP, 0.0], [before, floor]))
        normals = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
        up = np.array([0.0, 0.0, groove.middle])
        yield ContactPath(
            level=PARTING,
            cutter=cutter,
            pass_index=np.zeros(len(angle), dtype=np.int64),
            parameters=np.full((len(angle), 2), np.nan),
            contacts=radii[:, None] * normals + up,
            normals=normals,
            feeds=np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(len(angle))]),
            centres=(radii + cutter.radius)[:, None] * normals + up,
            lifts=np.zeros(len(angle)),
            ramp=np.zeros(len(angle), dtype=bool),
            uncut=np.zeros((0, 3)),
            reasons=(),
            rest=number,
        )


def groove_core(contacts: ContactPath, post: Post) -> Post:
    """What stays of the post within a step of the groove, less POST_CLEARANCE."""
    floor = float(np.hypot(*contacts.contacts[-1, :2]))
    return Post(floor - POST_CLEARANCE, post.top)


OVERLAP = 0.5
"""The finishing passes run on over the finished surface round the stump by this, mm."""
OFF = 0.05
"""Material over the part is known to this, mm: half of the distance of the rays that it is known from."""
STEPS = 8
"""Allowances of finishing layers are found to so many parts of the finishing depth."""
FINEST = 0.01
"""Balls that sink deepest are looked for in steps down to this, mm: a tenth of the finishing depth by default."""
NEIGHBOURS = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
"""A line of a grid and its neighbours, in steps."""


def stump_chart(axis: Float[ndarray, "3"], places: Float[ndarray, "n 3"], radius: float) -> FlatChart:
    """The lines along the unit `axis` on which a ball of `radius` (mm) finds all `places`, with its leads."""
    across = perpendicular(axis[None])[0]
    along = np.cross(axis, across)
    room = radius + LEAD + OVERLAP + CELL
    a, b = (
        np.arange((places @ side).min() - room, (places @ side).max() + room + CELL, CELL) for side in (across, along)
    )
    return FlatChart(axis, across, a, b, along)


def known_off(depth: float) -> float:
    """Nearer to the part, mm, the material is not known: OFF, or half of the `depth` (mm) that roughing leaves, which
    has to be seen."""
    return min(OFF, depth / 2)


def off_part(material: HeightField, around: MeshDistance, depth: float) -> HeightField:
    """What lies over the solids `around` of a material that was found from above: the stump alone, as far as it is
    known where roughing leaves `depth` (mm)."""
    chart = material.chart
    a, b = (each.ravel() for each in np.meshgrid(chart.a, chart.b, indexing="ij"))
    top = float(material.tops.max()) + CELL
    floor = float(material.bottoms.min())
    rests = drop(chart.bases(a, b), chart.axes(a), around.unsigned, top, floor).reshape(material.tops.shape)
    bottoms = rests + known_off(depth)
    return replace(material, tops=np.maximum(material.tops, bottoms), bottoms=bottoms)


def stump_layers(
    material: HeightField,
    around: MeshDistance,
    post: Post,
    places: Float[ndarray, "n 3"],
    cutters: tuple[Cutter, Cutter],
    job: Job,
) -> list[Layer]:
    """The layers in machining order that take the `material`, a stump. `around` is what must not be gouged, part and
    shell, `places` the part's that are to be cut free; `cutters` are those for roughing and for finishing."""
    chart = material.chart
    (roughing, finishing) = cutters
    low = float((places @ chart.axes(chart.a[:1])[0]).min())
    top = float(material.tops.max()) + CELL
    tips = np.linspace(top, low, 1 + int(np.ceil((top - low) / job.levels.layer_depth)))
    count = 1 + int(np.ceil(np.ptp(chart.b) / flat_step(roughing.radius, roughing.scallop)))
    ends = chart.a[[0, -1]]
    sets = [
        [np.column_stack([ends[:: -1 if k % 2 else 1], [b, b]])]
        for k, b in enumerate(np.linspace(chart.b[0], chart.b[-1], count))
    ]
    ball = Ball(roughing.radius, job.levels.finishing_depth, around, post)
    rough = Rough(roughing, around, job.path, job.path.least_depth, 1.0)
    layers, material = rough_down(sets, tips.tolist(), ball, material, rough)

    heights = top + finishing.radius, low
    fine = Ball(finishing.radius, 0.0, around, post)
    before, material = _fine_layers(fine, finishing, material, heights, job)
    tree = KDTree(places)

    def wanted(contacts: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        return np.asarray(tree.query(contacts)[0] <= OVERLAP)

    layer, _ = finish_layer(
        fine,
        finishing,
        material=material,
        job=job.path,
        heights=heights,
        extent=_extent(chart),
        width=1.0,
        wanted=wanted,
    )
    return [*layers, *before, layer]


def _fine_layers(
    ball: Ball, cutter: Cutter, material: HeightField, heights: tuple[float, float], job: Job
) -> tuple[list[Layer], HeightField]:
    """The layers that leave so much over the solids that the `ball` sinks by the finishing depth at most, until it may
    come down on them; and the material behind them. `heights` are the highest and the lowest of its centre, mm."""
    chart = material.chart
    depth = job.levels.finishing_depth
    least = min(job.path.least_depth, cutter.scallop)
    rough = Rough(cutter, ball.part, job.path, least, 1.0)
    layers = []
    deepest = np.inf
    while True:
        allowance = _allowance(ball, material, heights, depth)
        if not 0 < allowance < deepest:
            break
        deepest = allowance
        raised = replace(ball, allowance=allowance)

        def height_of(a: Float[ndarray, " n"], b: Float[ndarray, " n"], ball: Ball = raised) -> ndarray:
            return drop_balls(chart, a, b, ball, *heights)

        lines = scan_lines(chart, raised, scallop=cutter.scallop, height_of=height_of, extent=_extent(chart), width=1.0)
        layer, material = rough_layer([[line] for line in lines], height_of, material, rough)
        if len(layer.path.contacts):
            layers.append(layer)
    return layers, material


def _allowance(ball: Ball, material: HeightField, heights: tuple[float, float], depth: float) -> float:
    """What the `ball` must leave over the solids to sink into the material by `depth` at most, mm, but enough that
    known material is left; 0 where it may come down on them. In a hollow it rises by more than it leaves, so that
    equal allowances are no equal depths."""
    low, high = 0.0, _thickness(ball, material, heights) - depth
    if high < depth / STEPS:
        return 0.0
    while high - low >= depth / STEPS:
        middle = (low + high) / 2
        deep = _thickness(replace(ball, allowance=middle), material, heights) > depth
        low, high = (middle, high) if deep else (low, middle)
    return max(high, 1.5 * known_off(depth))


def _thickness(ball: Ball, material: HeightField, heights: tuple[float, float]) -> float:
    """How deep the ball sinks into the material at most where it touches the solids, mm: on the lines of the material,
    and between them round those where it sinks deepest, in steps halved down to FINEST."""
    chart = material.chart

    def sunk(lines: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
        a, b = lines.T
        centres = chart.bases(a, b) + drop_balls(chart, a, b, ball, *heights)[:, None] * chart.axes(a)
        return depths_in(material, centres, ball.radius)

    near = distance_transform_edt(~material.solid, sampling=CELL) < ball.radius  # no other ball meets the material
    lines = np.stack(np.meshgrid(chart.a, chart.b, indexing="ij"), axis=2)[near]
    depths = sunk(lines)
    step = CELL / 2
    while step > FINEST:
        deepest = lines[depths > depths.max() - 2 * step]  # on a wall a ball moves by twice the step at most
        lines = np.unique((deepest[:, None] + step * NEIGHBOURS).reshape(-1, 2).round(6), axis=0)
        depths = sunk(lines)
        step /= 2
    return float(depths.max())


def _extent(chart: FlatChart) -> tuple[float, float]:
    return float(chart.b[0]), float(chart.b[-1])


LEAN = np.radians(15.0)
"""Angle of the tool from the Z axis, radians: on a level place the ball cuts a quarter of its radius off its tip."""
DIRECTIONS = 12
"""So many directions round the axis are tried."""
ALLOWANCE = 0.5
"""The capsule that links keep out of is so much larger than part and shell, mm."""

STEP = 0.2
"""Places along a stump at the free end are so far apart, mm."""

Fields = Callable[[FlatChart, float, float], HeightField]
"""The material on the lines of a chart between two heights, the upper one first, mm."""


@dataclass(frozen=True, eq=False)
class StumpPlaces:
    """Places of the part that stayed at the post, and their unit normals."""

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]


def stump_balls(part: TriangleMesh, post: Post, job: Job) -> Float[ndarray, "n 3"]:
    """Centres of the finishing ball on the vertices of a standing part that it leaves at the post, not at what holds
    the free end; mm."""
    radius = job.tool("finishing").radius
    normals = vertex_normals(part)
    held = at_post(part.vertices, normals, post.alone, radius)
    return part.vertices[held] + radius * normals[held]


def check_second(shell: TriangleMesh, part: TriangleMesh, post: Post, job: Job) -> None:
    """JobError where a shell leaves no room for a ball on the places of a standing part that stay at the post, or for
    what stays at the tailstock."""
    radius = job.tool("finishing").radius
    centres = stump_balls(part, post, job)
    around = MeshDistance(shell)
    least = float((around.signed(centres) - radius).min())
    if least < job.path.clearance:
        what = f"it comes within {least:.2f} mm of the ball that cuts the stump off"
        remedy = f"end it farther up the part, {job.path.clearance:g} mm (path.clearance) off that ball"
        raise field_error("holding", "second", job.holding.second, f"{what}: {remedy}")
    if post.pin is not None:
        # JobError where what stays uncut at the free end enters the shell: the fillet that a ball of `radius` (mm)
        # leaves round pin or upper neck, and the stump of this, which is sawn off a diameter above the part
        wide = post.pin.radius + radius
        heights = np.arange(post.pin.bottom, min(post.pin.bottom + 2 * post.pin.radius + radius, post.pin.top), STEP)
        along = np.column_stack([np.full(len(heights), post.pin.x), np.full(len(heights), post.pin.y), heights])
        least = float(around.signed(along).min()) - wide
        if least < 0:
            what = f"what stays at the tailstock, up to {heights[-1]:.2f} mm, enters it by {-least:.2f} mm"
            raise field_error("holding", "second", job.holding.second, f"{what}: leave a hole there of {2 * wide:g} mm")


def second_paths(
    clamping: SecondClamping,
    places: StumpPlaces,
    top: float,
    fields: Fields,
    job: Job,
    limits: MachineLimits,
    progress: Progress = silent,
) -> list[ToolPath]:
    """The paths in machining order, the last one numbered 0. `top` (mm) is the highest that material stands on the Z
    axis, `places` and `fields` tell what is to be cut, after the turn-over; the job's [holding] is that of the shell.

    OrientationError where the machine cannot lean its tool so, or no contact is reached.
    """
    report(progress, 0.0, "planning the second clamping")
    around = MeshDistance(clamping.solids)
    post = Post(job.holding.diameter / 2, float(clamping.part.bounds[0, 2]))
    roughing = Cutter.from_job(1, "roughing", job.tool("roughing"), limits.bodies.nose)
    finishing = Cutter.from_job(2, "finishing", job.tool("finishing"), limits.bodies.nose)
    fine = Ball(finishing.radius, 0.0, around, post)
    # The direction of the tool from which fewest of the places are hidden, and which are.
    turns = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    tried = np.column_stack(
        [np.sin(LEAN) * np.cos(turns), np.sin(LEAN) * np.sin(turns), np.full(DIRECTIONS, np.cos(LEAN))]
    )
    tried = tried[limits.allow(tried)]
    if not len(tried):
        raise OrientationError(
            f"the second clamping needs a tool axis {np.degrees(LEAN):g} deg off the Z axis, which this machine does "
            "not reach: take another machine, or leave out holding.second"
        )
    hidden_from = []
    for axis in tried:
        chart = stump_chart(axis, places.points, roughing.radius)
        heights = _heights(axis, places, top, 2 * roughing.radius)
        hidden_from.append(unreached(places.points, places.normals, chart, fine, heights, _extent(chart)))
    best = int(np.argmin([hidden.sum() for hidden in hidden_from]))
    axis, missed = tried[best], hidden_from[best]
    chart = stump_chart(axis, places.points, roughing.radius)
    heights = _heights(axis, places, top, job.holding.diameter)
    stump = off_part(fields(chart, *heights), around, job.levels.finishing_depth)
    layers = stump_layers(stump, around, post=post, places=places.points, cutters=(roughing, finishing), job=job)
    stands = clamping_of(job.holding, limits.bodies.table)
    paths = []
    capsule = smallest_capsule(np.vstack([clamping.solids.vertices, stump.mesh().vertices]), ALLOWANCE)
    for count, layer in enumerate(layers):
        level = len(layers) - 1 - count
        report(progress, (count + 1) / (len(layers) + 1), f"second clamping: path of layer {level}")
        path = replace(layer.path, level=level)
        if not level:
            reasons = *path.reasons, *("hidden",) * int(missed.sum())
            path = replace(path, uncut=np.vstack([path.uncut, places.points[missed]]), reasons=reasons)
        standing = HeightMesh(layer.material.mesh())
        material = side_by_side([clamping.solids, standing.mesh])
        scene = Scene(
            level=around.mesh,
            material=material,
            stock=capsule,
            post=post,
            material_deviation=DEVIATION,
            known_level_distance=around,
            clamping=stands,
            tangent_slack=flute_slack(job.path.gouge_tolerance),
        )
        paths.append(orient(path, scene, limits, job.path, job.nc, fixed=layer.axes, material=standing))
    return paths


def _heights(axis: Float[ndarray, "3"], places: StumpPlaces, top: float, width: float) -> tuple[float, float]:
    """Heights (mm) along a direction above all of a stump that is `width` wide, and below all of its places."""
    along = places.points @ axis
    return float(max(top * axis[2] + width, along.max() + 1.0)), float(along.min() - 1.0)
