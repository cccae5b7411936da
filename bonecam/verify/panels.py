"""Panels of a picture side by side, of one scale and the same limits, with room for what belongs to them."""

from typing import Any

import numpy as np

TALL, WIDE, LEAST = 7.5, 12.0, (1.7, 1.5)
"""The most inches that panels side by side are high and wide together, and the least that one is wide and
high."""
LEFT, GAP, RIGHT, ABOVE, BELOW = 0.8, 0.2, 0.2, 0.6, 0.6
"""Inches left of, between, right of, above and below panels, without legends and colour bars."""
TICK, EDGE = 0.45, 0.2
"""Inches that a tick's label takes, and that ticks keep off a panel's sides, so that labels of neighbours do
not meet."""
MARGIN = 0.04
"""Round what panels show, as a share of it."""


def lay_out(figure: Any, plots: Any, below: float = BELOW, above: float = ABOVE) -> None:
    """Give panels side by side the same limits, round all that was drawn in any, and one scale, in a figure
    as large as that takes.

    `below` and `above` are the inches that a colour bar or a legend, the axis' label included, or titles need
    there.
    """
    boxes = np.array([plot.dataLim.get_points() for plot in plots])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    size = (1 + 2 * MARGIN) * (high - low)
    scale = min((WIDE / len(plots)) / size[0], TALL / size[1])
    wide, tall = np.maximum(size * scale, LEAST)
    (x, z), (across, up) = (low + high) / 2, np.array([wide, tall]) / scale / 2
    for plot in plots:
        plot.set(xlim=(x - across, x + across), ylim=(z - up, z + up), aspect="equal")
        plot.locator_params(axis="x", nbins=int(np.clip(wide / TICK, 2, 5)))
        plot.set_xticks([tick for tick in plot.get_xticks() if abs(tick - x) < across - EDGE / scale])
    whole = np.array([LEFT + len(plots) * wide + (len(plots) - 1) * GAP + RIGHT, above + tall + below])
    figure.set_size_inches(*whole)
    (start, bottom), (end, top) = np.array([LEFT, below]) / whole, 1 - np.array([RIGHT, above]) / whole
    figure.subplots_adjust(left=start, bottom=bottom, right=end, top=top, wspace=GAP / wide)


def bar_below(figure: Any) -> Any:
    """Axes of a colour bar under the panels."""
    wide, high = figure.get_size_inches()
    return figure.add_axes((LEFT / wide, 0.5 / high, 1 - (LEFT + RIGHT) / wide, 0.15 / high))
