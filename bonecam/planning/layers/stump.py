"""The layers that cut the stump of the post off a part that was parted and turned over.

The tool comes down on the stump along one direction: with the ball for roughing in layers of the roughing depth until
the finishing depth is left on the part; then the one for finishing takes what stands there in layers of the finishing
depth, the last one over all places that stayed at the post.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import KDTree

from bonecam.arrays import perpendicular
from bonecam.job import Job
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.layers.chart import Chart, FlatChart
from bonecam.planning.layers.drop import Ball, drop, drop_balls
from bonecam.planning.layers.finishing_layers import depths_in, finish_layer
from bonecam.planning.layers.height_field import CELL, HeightField
from bonecam.planning.layers.layer import Layer
from bonecam.planning.layers.roughing_layers import LEAD, Rough, rough_down, rough_layer
from bonecam.planning.layers.scan_lines import flat_step, scan_lines
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import Post

OVERLAP = 0.5
"""The finishing passes run on over the finished surface round the stump by this, mm."""
OFF = 0.05
"""Material over the part is known to this, mm: half of the distance of the rays that it is known from."""
STEPS = 8
"""Allowances of finishing layers are found to so many parts of the finishing depth."""
FINEST = 0.01
"""Balls that sink deepest are looked for in steps down to this, mm: a tenth of the finishing depth by default."""
AROUND = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
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
        lines = np.unique((deepest[:, None] + step * AROUND).reshape(-1, 2).round(6), axis=0)
        depths = sunk(lines)
        step /= 2
    return float(depths.max())


def _extent(chart: Chart) -> tuple[float, float]:
    return float(chart.b[0]), float(chart.b[-1])
