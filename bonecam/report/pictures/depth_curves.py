"""Picture: the depth of the cuts along a line of the part (Gan et al. 2014, Fig. 11), and shares of the area
by depth."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.measure.level import Level, morph_surfaces, rounding_cuts
from bonecam.levels.measure.line_depths import LINE, line_lengths
from bonecam.report.pictures.colours import colour_scale, colours_of, value_range, whole_ticks
from bonecam.report.pictures.panels import DPI, Figure, Plot, save_figure

MAX_LABELS = 10
"""The most lines that carry their cut's number."""


def draw_depths(levels: Sequence[Level], line: Float[ndarray, "k n"], path: str | Path, s: float = LINE) -> None:
    """Write, above, the depth of each cut of the morph along the line s (`line`, mm); below, the share of
    each level's area by depth."""
    from matplotlib import figure

    drawing = figure.Figure(figsize=(10, 9.6), dpi=DPI, layout="constrained")
    above, below = drawing.subplots(2, 1)
    _draw_lines(drawing, above, levels, line, s)
    _draw_shares(drawing, below, levels)
    save_figure(drawing, path)


def _draw_lines(figure: Figure, plot: Plot, levels: Sequence[Level], line: Float[ndarray, "k n"], s: float) -> None:
    """A coloured line a cut, its number on some, and dashed lines at the limits."""
    design = morph_surfaces(levels)[0]
    along = line_lengths(design, s, line.shape[1])
    norm = value_range(1, len(line))
    for k, depths in enumerate(line, start=1):
        plot.plot(along, depths, lw=0.9, color=colours_of(norm, k))
    box = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none"}
    text = {"fontsize": "small", "ha": "center", "va": "center", "bbox": box}
    for k, place in label_places(line):
        plot.text(along[place], line[k - 1, place], str(k), **text)
    for limit in {level.limit for level in levels[1:]}:
        plot.axhline(limit, color="0.5", lw=0.8, ls="--", zorder=0)

    plot.set_xlim(0, along[-1])
    plot.set_ylim(bottom=0)
    plot.set_xlabel("length along the line on the part (mm)")
    plot.set_ylabel("distance between levels (mm)")
    rounding = rounding_cuts(levels)
    rest = f" ({_cuts(rounding)}, which only round the stock, not shown)" if rounding else ""
    drawn = _cuts(range(1, len(line) + 1))
    title = f"Depth of {drawn} along the line s = {s:g}{rest}; dashed: the limits"
    plot.set_title(title, fontsize="medium")
    figure.colorbar(colour_scale(norm), ax=plot, label="cut", ticks=whole_ticks())


def _draw_shares(figure: Figure, plot: Plot, levels: Sequence[Level]) -> None:
    """A row a cut: the share of the level's area in each bin of depth."""
    shares = np.array([level.measures.depth_shares for level in levels[1:]])
    image = plot.imshow(
        100 * shares,
        aspect="auto",
        origin="lower",
        cmap="magma_r",
        vmin=0,
        vmax=100,
        extent=(0, 100, 0.5, len(shares) + 0.5),
        interpolation="nearest",
    )
    plot.set_xlabel("depth, % of the cut's limit")
    plot.set_ylabel("cut")
    plot.yaxis.set_major_locator(whole_ticks())
    plot.set_title(f"Share of the level's area by depth, {_cuts(range(1, len(levels)))}", fontsize="medium")
    figure.colorbar(image, ax=plot, label="% of the level's area")


def label_places(line: Float[ndarray, "k n"]) -> list[tuple[int, int]]:
    """Some cuts, evenly chosen, and for each the place of its label: in a stretch of its own, where its line
    is farthest from others."""
    cuts = range(0, len(line), -(-len(line) // MAX_LABELS))
    labels = []
    for i, k in enumerate(cuts):
        low, high = (int(line.shape[1] * (i + share) / len(cuts)) for share in (0.2, 0.8))
        stretch = np.delete(line, k, axis=0)[:, low : high + 1] - line[k, low : high + 1]
        labels.append((k + 1, low + int(np.abs(stretch).min(axis=0, initial=np.inf).argmax())))
    return labels


def _cuts(cuts: range) -> str:
    """Cuts as a title names them, like `cuts 1 to 17`."""
    return f"cuts {cuts[0]} to {cuts[-1]}" if len(cuts) > 1 else f"cut {cuts[0]}"
