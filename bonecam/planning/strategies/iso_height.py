"""Iso-height (Z-level) milling of a bone from both sides.

The part stands on its post along Z and is not clamped again: the tool is level, and the two sides are two indexed
positions of the rotary axes, C turned by 180 degrees between them (3+2 milling). The first side is the one towards
which the part is thinnest. From each side slices of one height go down by the depth of roughing cuts until the
outline of the part and its finishing cutter are passed; then each side is finished by parallel passes round the part.
What neither side sees stays.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import Job
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.layers.chart import FlatChart
from bonecam.planning.layers.drop import Ball, drop_balls
from bonecam.planning.layers.finishing_layers import finish_layer, places_of, unreached
from bonecam.planning.layers.height_field import CELL, HeightField, stock_field
from bonecam.planning.layers.layer import Layer
from bonecam.planning.layers.roughing_layers import Rough, rough_layer
from bonecam.planning.layers.scan_lines import flat_step
from bonecam.planning.strategies.slices import offset_curves
from bonecam.setup.stock import Stock
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import Post

EDGE = 0.05
"""Places whose normal is at right angles to the tool within this cosine are on the outline."""


@dataclass(frozen=True, eq=False)
class MillingSide:
    """One side: its lines, and the tip heights (mm) of its first and its last slice."""

    chart: FlatChart
    top: float
    floor: float


def iso_height_layers(
    part: MeshDistance, stock: Stock, post: Post, roughing: Cutter, finishing: Cutter, job: Job
) -> tuple[list[Layer], ndarray]:
    """The layers in machining order, and the places of the part that neither side reaches."""
    ball = Ball(roughing.radius, job.levels.finishing_depth, part, post)
    fine = Ball(finishing.radius, 0.0, part, post)
    sides = _sides(part.mesh, stock, roughing, finishing)
    material = stock_field(sides[0].chart, stock, sides[0].top + roughing.radius)
    layers: list[Layer] = []
    for side in sides:
        rough_layers, material = _rough_side(side, ball, material, roughing, job)
        layers += rough_layers
        material = material.turned_over()

    extent = float(sides[0].chart.b[0]), float(sides[0].chart.b[-1])
    points, normals = places_of(part.mesh)
    left = np.ones(len(points), dtype=bool)
    for side in sides:
        heights = side.top + finishing.radius, side.floor + finishing.radius
        layer, material = finish_layer(
            fine, finishing, material=material, job=job.path, heights=heights, extent=extent, width=1.0
        )
        layers.append(layer)
        left &= unreached(points, normals, chart=side.chart, ball=fine, heights=heights, extent=extent)
        material = material.turned_over()
    return layers, points[left]


def _sides(part: TriangleMesh, stock: Stock, roughing: Cutter, finishing: Cutter) -> tuple[MillingSide, MillingSide]:
    """The two sides, towards which the part is thinnest."""
    points, normals = places_of(part)
    axis = np.r_[np.linalg.eigh(np.cov(points[:, :2].T))[1][:, 0], 0.0]
    across = np.cross(np.array([0.0, 0.0, 1.0]), axis)
    outer = stock.mesh(CELL / 2).vertices
    room = roughing.radius + CELL
    a = np.arange((outer @ across).min() - room, (outer @ across).max() + room + CELL, CELL)
    b = np.arange(outer[:, 2].min() - room, outer[:, 2].max() + room + CELL, CELL)
    chart = FlatChart(axis, across, a, b)
    outline = (points @ axis)[np.abs(normals @ axis) < EDGE]
    heights = outer @ axis
    return (
        MillingSide(chart, float(heights.max()), float(outline.min()) - finishing.radius),
        MillingSide(chart.turned_over, float(-heights.min()), float(-outline.max()) - finishing.radius),
    )


def _rough_side(
    side: MillingSide, ball: Ball, material: HeightField, cutter: Cutter, job: Job
) -> tuple[list[Layer], HeightField]:
    """The slices of a side that find material, from the top down."""
    a, b = (each.ravel() for each in np.meshgrid(side.chart.a, side.chart.b, indexing="ij"))
    top = side.top + cutter.radius
    lowest = side.floor + cutter.radius
    rests = drop_balls(side.chart, a, b=b, ball=ball, top=top, floor=lowest - 1.0).reshape(material.tops.shape)
    count = int(np.ceil((side.top - side.floor) / job.levels.layer_depth))
    rough = Rough(cutter, ball.part, job.path, job.path.least_depth, 1.0)
    step = flat_step(cutter.radius, cutter.scallop)
    layers = []
    for height in np.linspace(top, lowest, count + 1)[1:]:

        def is_free(a: Float[ndarray, " n"], b: Float[ndarray, " n"], at: float = float(height)) -> ndarray:
            # most balls that are not free are not so in their place: that is asked first, the way down takes many steps
            free = ball.clearance(side.chart.bases(a, b) + at * side.chart.axes(a)) >= 0.0
            free[free] = drop_balls(side.chart, a[free], b=b[free], ball=ball, top=top, floor=at) <= at
            return free

        def height_of(a: Float[ndarray, " n"], b: Float[ndarray, " n"], at: float = float(height)) -> ndarray:
            return np.full(len(a), at)

        sets = offset_curves(side.chart, rests, float(height), step, is_free)
        layer, material = rough_layer(sets, height_of, material, rough)
        if len(layer.path.contacts):
            layers.append(layer)
    return layers, material
