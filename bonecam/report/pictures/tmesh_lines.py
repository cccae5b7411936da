"""Picture: the T-mesh on the shaded surface."""

from pathlib import Path

import numpy as np

from bonecam.report.pictures.panels import Plot, lay_out, new_figure, save_figure
from bonecam.report.pictures.shading import draw_shaded
from bonecam.surface.tmesh.lines import TMeshLines, tmesh_lines
from bonecam.surface.tspline import TSpline

CHORD = 0.01
"""Chord tolerance of the shaded surface, mm."""
EDGE_POINTS = 9
"""Points on each edge of the T-mesh."""
EDGE_COLOUR = "#0072b2"
VERTEX_COLOUR = "#d55e00"


def draw_tmesh(surface: TSpline, path: str | Path, chord_tolerance: float = CHORD) -> None:
    """Write the T-mesh on the surface, seen from the front (-y) and from behind; `chord_tolerance` (mm) of
    the shaded surface."""
    figure, plots = new_figure(2)
    for plot, side in zip(plots, (1.0, -1.0)):
        show_tmesh(plot, surface, side, chord_tolerance)
    plots[0].set_ylabel("z (mm)")
    figure.suptitle(f"{len(surface.weights)} control points")
    lay_out(figure, plots)
    save_figure(figure, path)


def show_tmesh(plot: Plot, surface: TSpline, side: float = 1.0, chord_tolerance: float = CHORD) -> None:
    """Draw the shaded surface with the edges and vertices of its T-mesh, from -y (`side` = 1) or from y
    (-1)."""
    draw_shaded(plot, surface.tessellate(chord_tolerance), side)
    lines = tmesh_lines(surface.tmesh)
    _draw_edges(plot, surface, lines, side)
    _draw_vertices(plot, surface, lines, side)


def _draw_edges(plot: Plot, surface: TSpline, lines: TMeshLines, side: float) -> None:
    """Edges where they face the viewer."""
    from matplotlib.collections import LineCollection

    share = np.linspace(0, 1, EDGE_POINTS)[:, None]
    parameters = lines.pieces[:, :1] * (1 - share) + lines.pieces[:, 1:] * share
    low, high = surface.domain.T
    s = np.clip(parameters[..., 0].ravel(), low[0], None)
    t = np.clip(parameters[..., 1].ravel(), low[1], high[1])
    points, normals = surface.positions(s, t), surface.normals(s, t)
    facing = (side * normals[:, 1] < 0)[:, None]
    shown = np.where(facing, points[:, [0, 2]] * [side, 1], np.nan).reshape(-1, EDGE_POINTS, 2)
    plot.add_collection(LineCollection(list(shown), colors=EDGE_COLOUR, linewidths=0.8))


def _draw_vertices(plot: Plot, surface: TSpline, lines: TMeshLines, side: float) -> None:
    """Vertices that face the viewer."""
    s, t = lines.vertices.T
    points, normals = surface.positions(s, t), surface.normals(s, t)
    seen = points[side * normals[:, 1] < 0]
    plot.plot(side * seen[:, 0], seen[:, 2], ".", color=VERTEX_COLOUR, markersize=2.5)
