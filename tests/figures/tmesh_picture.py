"""Picture: the T-mesh on the shaded surface, its edges as runs of parameters, its vertices as places.

The rows of a row-structured surface are joined by no edges; each of their knots is drawn half-way to the rows
beside it.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from bonecam_plugins.tsplines.tmesh import TMesh, knots_of_lines
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.report.pictures import Plot, draw_shaded, lay_out, new_figure, save_figure
from bonecam.surface import RowTMesh, TSpline

CHORD = 0.01
"""Chord tolerance of the shaded surface, mm."""
EDGE_POINTS = 9
"""Points on each edge of the T-mesh."""
EDGE_COLOUR = "#0072b2"
VERTEX_COLOUR = "#d55e00"


@dataclass(frozen=True, eq=False)
class TMeshLines:
    """Parameters (s, t) of the ends of straight pieces (n, 2, 2) and of the vertices (m, 2)."""

    pieces: Float[ndarray, "n 2 2"]
    vertices: Float[ndarray, "m 2"]


def tmesh_lines(tmesh: Any) -> TMeshLines:
    """The T-mesh of a closed row-structured or a general surface; pieces end at index lines, so they are
    short."""
    if isinstance(tmesh, RowTMesh):
        return _of_rows(tmesh)
    if isinstance(tmesh, TMesh):
        return _of_grid(tmesh)
    raise SurfaceError("only closed rows and general T-meshes are drawn as lines")


def _of_rows(tmesh: RowTMesh) -> TMeshLines:
    t = tmesh.t_knots[2:-2]
    middle = np.concatenate([t[:1], (t[1:] + t[:-1]) / 2, t[-1:]])
    pieces = []
    vertices = []
    for j, knots in enumerate(tmesh.s_knots):
        if len(knots) > 1:
            ends = np.append(knots, knots[0] + 1)
            pieces.append(np.stack([_places(ends[:-1], t[j]), _places(ends[1:], t[j])], axis=1))
            pieces.append(np.stack([_places(knots, middle[j]), _places(knots, middle[j + 1])], axis=1))
        vertices.append(_places(knots, t[j]))
    return TMeshLines(np.concatenate(pieces), np.concatenate(vertices))


def _places(s: ndarray, t: float) -> ndarray:
    return np.column_stack([s, np.full(len(s), t)])


def _of_grid(tmesh: TMesh) -> TMeshLines:
    pieces = []
    for axis, edges in enumerate((tmesh.along_s, tmesh.along_t)):
        index = np.argwhere(edges)
        ends = []
        for step in (0, 1):
            lines = index.copy()
            lines[:, axis] += step
            s, t = (
                knots_of_lines(lines[:, [d]], (tmesh.s_lines, tmesh.t_lines)[d], tmesh.period[d])[:, 0] for d in (0, 1)
            )
            ends.append(np.column_stack([s, t]))
        pieces.append(np.stack(ends, axis=1))
    segments = np.concatenate(pieces)
    long = (segments[:, 0] != segments[:, 1]).any(axis=1)
    vertices = np.column_stack([tmesh.s_lines[tmesh.vertices[:, 0]], tmesh.t_lines[tmesh.vertices[:, 1]]])
    return TMeshLines(segments[long], vertices)


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

    # Vertices that face the viewer
    s, t = lines.vertices.T
    points, normals = surface.positions(s, t), surface.normals(s, t)
    seen = points[side * normals[:, 1] < 0]
    plot.plot(side * seen[:, 0], seen[:, 2], ".", color=VERTEX_COLOUR, markersize=2.5)


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
