"""One layer: its contacts, the tool axis of each, and the material that stands while it is cut."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.planning.layers.chart import Chart
from bonecam.planning.layers.drop import Ball
from bonecam.planning.layers.height_field import HeightField
from bonecam.planning.layers.layer_curves import LayerCurves
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath


@dataclass(frozen=True, eq=False)
class Layer:
    """`axes` (n, 3) of the contacts of `path`, which are not to be changed; `material` stands before it."""

    path: ContactPath
    axes: Float[ndarray, "n 3"]
    material: HeightField


def layer_of(
    curves: LayerCurves,
    kept: Bool[ndarray, " n"],
    chart: Chart,
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
