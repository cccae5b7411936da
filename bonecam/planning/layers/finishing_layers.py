"""Finishing from one direction: parallel passes of a ball that touches the part."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.job import PathJob
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.layers.chart import Chart
from bonecam.planning.layers.drop import Ball, drop_balls
from bonecam.planning.layers.gouge_free import gouge_free
from bonecam.planning.layers.height_field import HeightField
from bonecam.planning.layers.layer import Layer, layer_of
from bonecam.planning.layers.layer_curves import LayerCurves, join, sample
from bonecam.planning.layers.roughing_layers import swept
from bonecam.planning.layers.scan_lines import scan_lines
from bonecam.tool.ball_depth import MAX_DEPTH_RADII
from bonecam.tool.cutter import Cutter

Wanted = Callable[[Float[ndarray, "n 3"]], Bool[ndarray, " n"]]
"""Which contacts are wanted."""
FACING = 0.02
"""Places whose normal turns away from the tool by more (its cosine) are on its other side."""
HIDDEN = 0.02
"""A ball that rests higher than this above a place does not reach it, mm."""
PLACES = 8000
"""About so many places of the part are asked whether a strategy reaches them."""


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
    steps, cut, left = _in_steps(raised, kept, material, ball.radius, width)
    layer = layer_of(steps, cut, chart=chart, cutter=cutter, material=material, ball=ball)
    covered = kept & ~cut[-len(kept) :]
    uncut = ball.part.closest(centres[covered])[0]
    path = replace(layer.path, uncut=uncut, reasons=("covered",) * len(uncut))
    return replace(layer, path=path), left


def _in_steps(
    curves: LayerCurves, kept: Bool[ndarray, " n"], material: HeightField, radius: float, width: float
) -> tuple[LayerCurves, Bool[ndarray, " m"], HeightField]:
    """The curves, those raised by MAX_DEPTH_RADII of the ball once or more before them, where the ball would sink
    deeper into the material; which of their points are kept, not those that are still too deep; and the material
    behind them."""
    deepest = MAX_DEPTH_RADII * radius
    count = int(np.ceil(_sunk(curves, radius, material)[kept].max(initial=0.0) / deepest))
    pieces, used = list[LayerCurves](), list[ndarray]()
    for step in range(max(count, 1) - 1, -1, -1):
        raised = replace(curves, heights=curves.heights + step * deepest)
        sunk = _sunk(raised, radius, material)
        cut = kept & (sunk <= deepest) & ((sunk > 0) | (step == 0))
        # The first point of each line but the first
        pieces += [raised.take(run) for run in np.split(np.arange(len(cut)), np.flatnonzero(np.diff(raised.line)) + 1)]
        used.append(cut)
        if cut.any():
            material = material.lowered(*swept(raised, cut, width), radius)
    return join(pieces), np.concatenate(used), material


def _sunk(curves: LayerCurves, radius: float, material: HeightField) -> Float[ndarray, " n"]:
    """How deep each ball sinks into the material, mm."""
    return depths_in(material, curves.centres(material.chart), radius)


def depths_in(material: HeightField, centres: Float[ndarray, "n 3"], radius: float) -> Float[ndarray, " n"]:
    """How deep balls of `radius` sink into the material, mm; negative where they keep off it."""
    return radius - MeshDistance(material.mesh()).signed(centres, radius)


def unreached(
    points: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    chart: Chart,
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


def places_of(part: TriangleMesh) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """About PLACES places all over the part, and their unit normals."""
    vectors = part.face_vectors
    lengths = np.linalg.norm(vectors, axis=1)
    some = np.flatnonzero(lengths > 0)[:: max(len(lengths) // PLACES, 1)]
    return part.vertices[part.faces[some]].mean(axis=1), vectors[some] / lengths[some, None]
