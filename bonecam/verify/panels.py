"""Panels of a picture side by side, of one scale and the same limits, with room for what belongs to them."""

from typing import Any

import numpy as np

TALL, WIDE, LEAST = 7.5, 9.5, (1.7, 3.0)
"""The most inches that panels side by side are high and wide together, and the least that one is wide and high."""
LEFT, GAP, RIGHT, ABOVE, BELOW = 0.8, 0.2, 0.2, 0.6, 0.6
"""Inches left of, between, right of, above and below panels, without legends and colour bars."""
MARGIN = 0.04
"""Round what panels show, as a share of it."""


def lay_out(figure: Any, plots: Any, right: float = RIGHT, below: float = BELOW) -> None:
    """Give panels side by side the same limits, round all that was drawn in any, and one scale, in a figure as large as that takes.

    `right` and `below` are the inches that a colour bar or a legend, the axis' label included, needs there.
    """
    boxes = np.array([plot.dataLim.get_points() for plot in plots])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    size = (1 + 2 * MARGIN) * (high - low)
    scale = min((WIDE / len(plots)) / size[0], TALL / size[1])
    wide, tall = np.maximum(size * scale, LEAST)
    (x, z), (across, up) = (low + high) / 2, np.array([wide, tall]) / scale / 2
    for plot in plots:
        plot.set(xlim=(x - across, x + across), ylim=(z - up, z + up), aspect="equal")
        plot.locator_params(axis="x", nbins=4)
    whole = np.array([LEFT + len(plots) * wide + (len(plots) - 1) * GAP + right, ABOVE + tall + below])
    figure.set_size_inches(*whole)
    (start, bottom), (end, top) = np.array([LEFT, below]) / whole, 1 - np.array([right, ABOVE]) / whole
    figure.subplots_adjust(left=start, bottom=bottom, right=end, top=top, wspace=GAP / wide)


def bar_below(figure: Any) -> Any:
    """Axes of a colour bar under the panels."""
    wide, high = figure.get_size_inches()
    return figure.add_axes((LEFT / wide, 0.5 / high, 1 - (LEFT + RIGHT) / wide, 0.15 / high))


def bar_right(figure: Any) -> Any:
    """Axes of a colour bar beside the panels."""
    wide, high = figure.get_size_inches()
    return figure.add_axes((1 - 1.0 / wide, BELOW / high, 0.2 / wide, 1 - (ABOVE + BELOW) / high))
