"""Sectional rotary milling of a bone: "the part keeps turning around its pivot while the tool feeds from the radial
direction" (Gan et al. 2014, section 5.3).

The tool axis is level and points at the Z axis, about which the part turns. A layer is a row of sections z = const,
from the free end down to the post; the tool feeds in by the depth of roughing cuts from layer to layer, and out where
the part is in its way. A last layer finishes with sections as close as the scallop asks for. The tool stays beside the
part: beyond its ends, and nearer to the axis than CORE, nothing is cut, so that the ends stay.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import Job
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.layers.chart import RoundChart
from bonecam.planning.layers.drop import Ball
from bonecam.planning.layers.finishing_layers import finish_layer, places_of, unreached
from bonecam.planning.layers.height_field import CELL, stock_field
from bonecam.planning.layers.layer import Layer
from bonecam.planning.layers.roughing_layers import Rough, rough_down
from bonecam.planning.layers.scan_lines import flat_step
from bonecam.setup.stock import Stock
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import Post

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
    chart = RoundChart(angles, np.arange(outer[:, 2].min() - room, outer[:, 2].max() + room + CELL, CELL))
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
