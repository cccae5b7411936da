"""Curves of a ball raised along its axes, so that no straight move between two of their points gouges the part.

Where a curve was sampled its ball is free; the moves between are as good as the sampling, which knows nothing of the
gouge tolerance.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance
from bonecam.planning.layers.chart import Chart
from bonecam.planning.layers.layer_curves import LayerCurves
from bonecam.planning.passes.gouge_lifts import gouge_free_lifts, planned_tolerance

MAX_LIFT_RADII = 0.5
"""A ball is raised by no more of its radii: the place is left out instead."""


def gouge_free(
    curves: LayerCurves,
    kept: Bool[ndarray, " n"],
    chart: Chart,
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
