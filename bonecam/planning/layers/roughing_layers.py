"""Roughing a layer: curves one after the other, each only where its ball still finds material."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import PathJob
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.layers.drop import Ball, drop_balls
from bonecam.planning.layers.gouge_free import gouge_free
from bonecam.planning.layers.height_field import CELL, HeightField
from bonecam.planning.layers.layer import Layer, layer_of, nearest_order, split
from bonecam.planning.layers.layer_curves import Heights, LayerCurves, join, sample
from bonecam.tool.cutter import Cutter

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
        runs = split(curves, free[points] & _with_leads(curves, centres, cut > rough.least))
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


def _with_leads(curves: LayerCurves, centres: Float[ndarray, "n 3"], needed: ndarray) -> ndarray:
    """The needed points and those within LEAD of them along their line."""
    kept = np.zeros(len(needed), dtype=bool)
    for line in np.unique(curves.line[needed]):
        rows = np.flatnonzero(curves.line == line)
        along = np.r_[0.0, np.linalg.norm(np.diff(centres[rows], axis=0), axis=1).cumsum()]
        at = along[needed[rows]]
        place = np.searchsorted(at, along)
        before = np.abs(along - at[np.maximum(place - 1, 0)])
        behind = np.abs(at[np.minimum(place, len(at) - 1)] - along)
        kept[rows] = np.minimum(before, behind) <= LEAD
    return kept


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


def swept(layer_curves: LayerCurves, kept: ndarray, width: float) -> tuple[ndarray, ndarray, ndarray]:
    """a, b and heights on the moves of the kept stretches of curves."""
    return _swept([layer_curves.take(run) for run in split(layer_curves, kept)], width)
