"""Pictures: some levels coloured by the depth of their cut, the part by the error that bending keeps."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bonecam.levels.measure.level import Level, rounding_cuts
from bonecam.levels.measure.line_depths import depths_from
from bonecam.mechanics.result import ErrorKept
from bonecam.mesh.remeshing import split_edges
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.report.pictures.colours import colour_scale, colours_of, value_range
from bonecam.report.pictures.panels import BAR_BELOW, bar_below, lay_out, new_figure, save_figure
from bonecam.report.pictures.shading import draw_shaded
from bonecam.report.pictures.views import is_closed, view

MAX_LEVELS = 3
"""Closed levels shown at most, each from the front and from behind."""
MAX_OPEN = 5
"""Open levels shown at most."""
EDGES_PER_DIAGONAL = 40
"""An edge of a level goes into its diagonal at least this often: its flat faces are few and large, and each
has one colour."""

LEAST_ERROR = 0.1
"""The scale of errors ends here at least, um."""


def draw_coloured(levels: Sequence[Level], path: str | Path) -> None:
    """Write some levels, the first and the stock among them, coloured by the depth of their cut in % of its
    limit.

    Closed ones are seen from the front (-y) and from behind, open ones along the axis from which most of the
    part is seen.
    """
    last = len(levels) - 1
    frame, closed = view(levels[0].mesh), is_closed(levels[0].mesh)
    count = min(last, MAX_LEVELS if closed else MAX_OPEN)
    shown = np.unique(np.linspace(1, last, count).round().astype(int))
    sides = (1.0, -1.0) if closed else (1.0,)
    rounding = rounding_cuts(levels)
    norm = value_range(0, 100)
    figure, plots = new_figure(len(shown) * len(sides))
    names = [f"{'-' if row.sum() < 0 else ''}{'xyz'[np.abs(row).argmax()]} (mm)" for row in frame[[0, 2]]]
    for place, k in enumerate(shown):
        mesh = split_edges(levels[k].mesh, levels[k].mesh.diagonal / EDGES_PER_DIAGONAL)
        depths = depths_from(levels[k - 1], mesh.vertices[mesh.faces].mean(axis=1))
        colours = colours_of(norm, 100 * depths / levels[k].limit)[:, :3]
        seen = TriangleMesh(mesh.vertices @ frame.T, mesh.faces)
        kind = ", the stock" if k == last else ", rounding" if k in rounding else ""
        for side, plot in zip(sides, plots[place * len(sides) :]):
            draw_shaded(plot, seen, side, colours)
            plot.set_title(f"level {k}{kind}" if side > 0 else "from behind", fontsize="medium")
            if not closed:
                plot.set_xlabel(names[0])
    plots[0].set_ylabel(names[1])

    lay_out(figure, plots, below=BAR_BELOW)
    bar = {"label": "depth, % of the cut's limit", "orientation": "horizontal"}
    figure.colorbar(colour_scale(norm), cax=bar_below(figure), **bar)
    save_figure(figure, path)


def draw_error(error: ErrorKept, path: str | Path) -> None:
    """Write the part from the front (-y) and from behind, coloured by the size of the error that bending keeps, up to
    what 99 % of the surface stay below."""
    norm = value_range(0, max(1000 * error.p99, LEAST_ERROR))
    colours = colours_of(norm, 1000 * error.sizes[error.mesh.faces].mean(axis=1))[:, :3]
    figure, plots = new_figure(2)
    for side, title, plot in zip((1.0, -1.0), ("from the front", "from behind"), plots, strict=True):
        draw_shaded(plot, error.mesh, side, colours)
        plot.set_title(title, fontsize="medium")
    plots[0].set_ylabel("z (mm)")
    lay_out(figure, plots, below=BAR_BELOW)
    bar = {"label": "error that bending keeps, \u00b5m", "orientation": "horizontal"}
    figure.colorbar(colour_scale(norm), cax=bar_below(figure), **bar)
    save_figure(figure, path)
