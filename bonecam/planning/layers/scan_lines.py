"""Finishing by parallel passes b = const of a ball that touches the part, limited in scallop.

Passes begin a flat side step apart. Between two passes whose centres are D apart across the feed, the cusp is

    h = R - sqrt(R^2 - D^2 / 4) + q,

q being how far the centre of a ball half-way lies below the line between the two (negative on a bulge). Where
h is above the limit a pass is put half-way, only as long as it is needed, and so on.
"""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import dots, unit
from bonecam.planning.layers.chart import Chart
from bonecam.planning.layers.drop import Ball
from bonecam.planning.layers.layer_curves import Heights

HALVINGS = 6
"""Times that the distance of passes is halved at most: on a wall they never come near enough."""
SPARE = 0.4
"""Passes between others are longer than needed by this at each end, mm."""
SPACING = 0.12
"""Distance of the places on a pass where cusps are computed, mm."""


def flat_step(radius: float, scallop: float) -> float:
    """Distance (mm) of passes of a ball on a plane that leave cusps of `scallop` mm."""
    return float(2 * np.sqrt(scallop * (2 * radius - scallop)))


def scan_lines(
    chart: Chart, ball: Ball, scallop: float, height_of: Heights, extent: tuple[float, float], width: float
) -> list[Float[ndarray, "2 2"]]:
    """Straight lines (a, b) in the order from the highest b down, run to and fro; `extent` is that of b, `width` the
    length (mm) of a unit of a where it is largest."""
    low, high = chart.a[0], chart.a[-1] + (chart.a[1] - chart.a[0] if chart.closed else 0.0)
    a = np.linspace(low, high, max(int(np.ceil((high - low) * width / SPACING)), 2) + 1)
    count = max(int(np.ceil((extent[1] - extent[0]) / flat_step(ball.radius, scallop))), 1)
    rows = {float(b): np.ones(len(a), dtype=bool) for b in np.linspace(*extent, count + 1)}

    def heights_on(passes: list[float]) -> dict[float, Float[ndarray, " n"]]:
        heights = height_of(np.tile(a, len(passes)), np.repeat(passes, len(a)))
        return dict(zip(passes, heights.reshape(-1, len(a)), strict=True))

    heights = heights_on(list(rows))
    gaps = [(one, other, np.ones(len(a), dtype=bool)) for one, other in zip(list(rows), list(rows)[1:])]
    margin = max(int(np.ceil(SPARE / SPACING)), 1)
    for _ in range(HALVINGS):
        halves = []
        heights |= heights_on([(one + other) / 2 for one, other, _ in gaps])
        for one, other, asked in gaps:
            b = (one + other) / 2
            high_cusps = asked & _too_high(chart, ball, scallop=scallop, a=a, passes=(one, b, other), heights=heights)
            if high_cusps.any():
                # The mask and `margin` places on both sides of it
                rows[b] = np.convolve(high_cusps, np.ones(2 * margin + 1), mode="same")[: len(high_cusps)] > 0.5
                halves += [(one, b, rows[b]), (b, other, rows[b])]
        gaps = halves

    # The stretches of all rows from the highest down, every other row backwards
    lines: list[Float[ndarray, "2 2"]] = []
    for number, b in enumerate(sorted(rows, reverse=True)):
        edges = np.flatnonzero(np.diff(np.r_[False, rows[b], False].astype(np.int8)))
        segments = [np.array([[a[i], b], [a[j - 1], b]]) for i, j in edges.reshape(-1, 2) if j - i > 1]
        lines += [line[::-1] for line in reversed(segments)] if number % 2 else segments
    return lines


def _too_high(
    chart: Chart,
    ball: Ball,
    scallop: float,
    a: Float[ndarray, " n"],
    passes: tuple[float, float, float],
    heights: dict[float, Float[ndarray, " n"]],
) -> Bool[ndarray, " n"]:
    """Where the cusp between the first and the last of three passes exceeds the limit."""
    axes = chart.axes(a)
    one, half, other = (chart.bases(a, np.full(len(a), b)) + heights[b][:, None] * axes for b in passes)
    on_part = ball.touches(half)
    normals = unit(half - ball.part.closest(half)[0])
    feeds = unit(np.gradient(half, axis=0) + np.finfo(float).tiny)
    between = other - one
    across = between - dots(between, feeds)[:, None] * feeds
    square = (across**2).sum(axis=1) / 4
    radius = ball.radius
    cusp = radius - np.sqrt(np.maximum(radius**2 - square, 0.0))
    return on_part & (cusp + dots((one + other) / 2 - half, normals) > scallop)
