"""Picture: the cuts on some levels coloured by engagement, after Fig. 12 of Gan et al. (2014)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.levels.measure.level import Level
from bonecam.report.pictures.colours import Norm, colour_scale, colours_of, logarithmic_range
from bonecam.report.pictures.panels import BAR_BELOW, Plot, bar_below, lay_out, new_figure, save_figure
from bonecam.report.pictures.shading import draw_shaded

MOST = 99.0
"""The colours end at the engagement that this percentage of the shown cuts stays below."""
AIR = 1e-3
"""Cuts of less engagement are drawn as air, mm^2: a tenth of a scallop of 0.01 mm and 0.3 mm of step."""
AIR_COLOUR = (0.0, 0.0, 0.0, 0.25)


def draw_engagement(
    levels: Sequence[Level],
    level_of: Int[ndarray, " n"],
    contacts: Float[ndarray, "n 3"],
    outward: Float[ndarray, "n 3"],
    sections: Float[ndarray, " n"],
    cuts: Bool[ndarray, " n"],
    path: str | Path,
) -> None:
    """Write the outermost, a middle and the innermost level from the front (-y) and from behind, with the moves that
    are `cuts`, each to its contact, coloured by the material that it removes a length (`sections`, mm^2). `outward` is
    any vector along the normal at each contact.

    Layers, which follow no level, are drawn on the part.
    """
    numbers = np.unique(level_of[cuts])[::-1]
    chosen = [int(numbers[k]) for k in sorted({0, len(numbers) // 2, len(numbers) - 1})]
    shown = cuts & np.isin(level_of, chosen)
    norm = logarithmic_range(AIR, max(float(np.percentile(sections[shown], MOST)), 2 * AIR))
    figure, plots = new_figure(2 * len(chosen))
    panels = [(number, side) for number in chosen for side in (1.0, -1.0)]
    for plot, (number, side) in zip(plots, panels, strict=True):
        draw_shaded(plot, levels[number if numbers[0] == len(levels) - 2 else 0].mesh, side)
        here = np.flatnonzero(shown[1:] & shown[:-1] & (level_of[1:] == number) & (level_of[:-1] == number)) + 1
        here = here[side * outward[here, 1] < 0]
        ends = np.stack([contacts[here - 1], contacts[here]], axis=1)[:, :, [0, 2]] * np.array([side, 1.0])
        _draw(plot, ends, sections[here], norm)
        in_air = float((sections[here] < AIR).mean()) if len(here) else 0.0
        message = f"{in_air:.0%} in air" if side > 0 else "from behind"
        plot.set_title(f"level {number}\n{message}", fontsize="medium")
    plots[0].set_ylabel("z (mm)")

    lay_out(figure, plots, below=BAR_BELOW)
    bar = {"label": "engagement: material removed a length, mm²; grey: air", "orientation": "horizontal"}
    figure.colorbar(colour_scale(norm), cax=bar_below(figure), **bar)
    save_figure(figure, path)


def _draw(plot: Plot, ends: Float[ndarray, "m 2 2"], sections: Float[ndarray, " m"], norm: Norm) -> None:
    """Draw moves in the colour of their engagement."""
    from matplotlib.collections import LineCollection

    colours = np.where((sections < AIR)[:, None], AIR_COLOUR, colours_of(norm, np.maximum(sections, AIR)))
    plot.add_collection(LineCollection(list(ends), colors=colours, linewidths=0.5))
