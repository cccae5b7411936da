"""The layers that cut the stump of the post off a part that was parted and turned over.

The tool comes down on the stump along one direction: with the ball for roughing in layers of the roughing depth until
the finishing depth is left on the part, then with the one for finishing over all places that stayed at the post.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.arrays import perpendicular
from bonecam.job import Job
from bonecam.mesh.distance import MeshDistance
from bonecam.setup.holding import Post
from bonecam.toolpath.cutters.cutter import Cutter
from bonecam.toolpath.layers.chart import FlatChart
from bonecam.toolpath.layers.drop import Ball, drop
from bonecam.toolpath.layers.finishing import finish_layer
from bonecam.toolpath.layers.layer import Layer
from bonecam.toolpath.layers.material import CELL, HeightField
from bonecam.toolpath.layers.roughing import LEAD, Rough, rough_down
from bonecam.toolpath.layers.scan_lines import flat_step

OVERLAP = 0.5
"""The finishing passes run on over the finished surface round the stump by this, mm."""
OFF = 0.05
"""Material over the part is known to this, mm: half of the distance of the rays that it is known from."""


def stump_chart(axis: Float[ndarray, "3"], places: Float[ndarray, "n 3"], radius: float) -> FlatChart:
    """The lines along the unit `axis` on which a ball of `radius` (mm) finds all `places`, with its leads."""
    across = perpendicular(axis[None])[0]
    along = np.cross(axis, across)
    room = radius + LEAD + OVERLAP + CELL
    a, b = (
        np.arange((places @ side).min() - room, (places @ side).max() + room + CELL, CELL)
        for side in (across, along)
    )
    return FlatChart(axis, across, a, b, along)


def off_part(material: HeightField, around: MeshDistance) -> HeightField:
    """What lies over the solids `around` of a material that was found from above: the stump alone, off them by OFF."""
    chart = material.chart
    a, b = (each.ravel() for each in np.meshgrid(chart.a, chart.b, indexing="ij"))
    top, floor = float(material.tops.max()) + CELL, float(material.bottoms.min())
    rests = drop(chart.bases(a, b), chart.axes(a), around.unsigned, top, floor).reshape(material.tops.shape)
    bottoms = rests + OFF
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
    shell, `places` the part's that are
    to be cut free; `cutters` are those for roughing and for finishing."""
    chart, (roughing, finishing) = material.chart, cutters
    low = float((places @ chart.axes(chart.a[:1])[0]).min())
    top = float(material.tops.max()) + CELL
    tips = np.linspace(top, low, 1 + int(np.ceil((top - low) / job.levels.cuts[1])))
    count = 1 + int(np.ceil(np.ptp(chart.b) / flat_step(roughing.radius, roughing.scallop)))
    ends = chart.a[[0, -1]]
    sets = [
        [np.column_stack([ends[:: -1 if k % 2 else 1], [b, b]])]
        for k, b in enumerate(np.linspace(chart.b[0], chart.b[-1], count))
    ]
    ball = Ball(roughing.radius, job.levels.finishing_depth, around, post)
    rough = Rough(roughing, job.path.least_depth, job.path.chord_tolerance, 1.0)
    layers, material = rough_down(sets, tips.tolist(), ball, material, rough)

    tree = KDTree(places)

    def wanted(contacts: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        return np.asarray(tree.query(contacts)[0] <= OVERLAP)

    fine = Ball(finishing.radius, 0.0, around, post)
    heights = top + finishing.radius, low
    extent = float(chart.b[0]), float(chart.b[-1])
    layer, _ = finish_layer(fine, finishing, material, job.path, heights, extent, 1.0, wanted)
    return [*layers, layer]
