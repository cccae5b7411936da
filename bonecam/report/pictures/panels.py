"""Figures of panels side by side, with one scale and the same limits, and room for what belongs to them."""

from pathlib import Path
from typing import Any

import numpy as np

Plot = Any
"""A matplotlib.axes.Axes: matplotlib loads when a picture is drawn."""
Figure = Any
"""A matplotlib.figure.Figure."""

DPI = 120
"""Pixels per inch."""
MAX_HEIGHT = 7.5
"""Inches that a panel is high at most."""
MAX_WIDTH = 12.0
"""Inches that all panels are wide together at most."""
MIN_SIZE = (1.7, 1.5)
"""Inches that a panel is wide and high at least."""
LEFT = 0.8
GAP = 0.2
RIGHT = 0.2
ABOVE = 0.6
BELOW = 0.6
"""Inches left of, between, right of, above and below panels, without legends and colour bars."""
TICK_WIDTH = 0.45
"""Inches that a tick's label takes."""
TICK_MARGIN = 0.2
"""Inches that ticks keep off a panel's sides, so that labels of neighbours do not meet."""
MARGIN = 0.04
"""Margin round what panels show, as a share of it."""
BAR_BELOW = 1.3
"""Inches below panels that their labels and a colour bar take."""


def new_figure(columns: int, rows: int = 1) -> tuple[Figure, Any]:
    """A figure of panels side by side, row after row; `lay_out` sets their sizes."""
    from matplotlib import figure

    drawing = figure.Figure(dpi=DPI)
    return drawing, drawing.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write the figure as an image without the date, so that equal pictures are equal files."""
    figure.savefig(path, metadata={"Software": None})


def lay_out(figure: Figure, plots: Any, below: float = BELOW, above: float = ABOVE, rows: int = 1) -> None:
    """Give panels side by side, in so many rows, the same limits, round all that was drawn in any, and one scale, in a
    figure as large as that takes.

    `below` and `above` are the inches that a colour bar or a legend, the axis' label included, or titles need
    there.
    """
    boxes = np.array([plot.dataLim.get_points() for plot in plots])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    size = (1 + 2 * MARGIN) * (high - low)
    columns = len(plots) // rows
    scale = min((MAX_WIDTH / columns) / size[0], MAX_HEIGHT / rows / size[1])
    width, height = np.maximum(size * scale, MIN_SIZE)
    x, z = (low + high) / 2
    half_x, half_z = np.array([width, height]) / scale / 2
    for plot in plots:
        plot.set(xlim=(x - half_x, x + half_x), ylim=(z - half_z, z + half_z), aspect="equal")
        plot.locator_params(axis="x", nbins=int(np.clip(width / TICK_WIDTH, 2, 5)))
        inner = half_x - TICK_MARGIN / scale
        ticks = plot.xaxis.get_major_locator().tick_values(x - inner, x + inner)
        plot.set_xticks(ticks[np.abs(ticks - x) < inner])

    all_width = LEFT + columns * width + (columns - 1) * GAP + RIGHT
    whole = np.array([all_width, rows * (above + height) + below])
    figure.set_size_inches(*whole)
    start, bottom = np.array([LEFT, below]) / whole
    end, top = 1 - np.array([RIGHT, above]) / whole
    figure.subplots_adjust(left=start, bottom=bottom, right=end, top=top, wspace=GAP / width, hspace=above / height)


def label_rows(plots: Any, rows: int) -> None:
    """Name z beside the first panel of each row, and leave x out above the last one."""
    columns = len(plots) // rows
    for plot in plots[::columns]:
        plot.set_ylabel("z (mm)")
    for plot in plots[:-columns]:
        plot.set_xlabel("")


def bar_below(figure: Figure) -> Plot:
    """Axes of a colour bar under the panels."""
    width, height = figure.get_size_inches()
    return figure.add_axes((LEFT / width, 0.5 / height, 1 - (LEFT + RIGHT) / width, 0.15 / height))
