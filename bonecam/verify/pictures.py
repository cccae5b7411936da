"""Pictures of what was made: section through all levels (Gan et al. 2014, Fig. 10), depths (Fig. 11), the tool path (Fig. 12).

The only door to matplotlib; it loads when a picture is drawn and needs no display.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.level import Level
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tmesh_lines import TMeshLines, tmesh_lines
from bonecam.surface.tspline import TSpline
from bonecam.toolpath.path import Kind, ToolPath

CUT_COLOURS = "viridis"
CUT, LINK, AXIS = "#1f5fa8", "#e07b00", "#b03030"
CHORD = 0.01
"""Tolerance (mm) of a shaded T-spline."""
TALL = 9.0
"""Height of the picture of the sections, inches; its width follows the stock's."""
SHOWN, AXES_SHOWN, AXIS_LENGTH = 5, 60, 3.0
"""Levels in a row, axes a level and their length, mm."""


def section(mesh: TriangleMesh, origin: Float[ndarray, "3"], normal: Float[ndarray, "3"]) -> Float[ndarray, "k 2 3"]:
    """The segments in which the plane through `origin` cuts the triangles, mm."""
    height = (mesh.vertices - origin) @ normal
    height = np.where(height == 0, np.finfo(float).eps, height)
    sides = height[mesh.faces] > 0
    crossed = np.flatnonzero(sides.any(1) & ~sides.all(1))
    ends = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        first, second = mesh.faces[crossed, a], mesh.faces[crossed, b]
        with np.errstate(all="ignore"):
            ratio = height[first] / (height[first] - height[second])
            point = mesh.vertices[first] + ratio[:, None] * (mesh.vertices[second] - mesh.vertices[first])
        ends.append(np.where((sides[crossed, a] != sides[crossed, b])[:, None], point, np.nan))
    stacked = np.stack(ends, axis=1)
    return stacked[~np.isnan(stacked[:, :, 0])].reshape(-1, 2, 3)


def draw_levels(levels: Sequence[Level], post: tuple[float, float], path: str | Path) -> None:
    """Two sections through the axis, y = 0 and x = 0, of all levels; `post` is (diameter, top z) in mm."""
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    wide, _, high = np.ptp(levels[-1].mesh.bounds, axis=0)
    figure = Figure(figsize=(float(np.clip(2 * TALL * wide / high + 1.5, 5, 12)), TALL), dpi=120, layout="compressed")
    plots = figure.subplots(1, 2, sharey=True)
    for plot, across in zip(plots, (0, 1)):
        show_levels(plot, levels, post, across)
    plots[0].set_ylabel("z (mm)")
    figure.suptitle(f"Levels 0 (part) to {levels[-1].index} (stock); dashed: the post")
    figure.colorbar(_scale(Normalize(0, len(levels) - 1)), ax=plots, label="level", location="bottom", aspect=40, ticks=_whole())
    figure.savefig(path, metadata={"Software": None})


def show_levels(plot: "Axes", levels: Sequence[Level], post: tuple[float, float], across: int) -> None:  # type: ignore[name-defined]
    """The section of all levels by the plane of z and x (`across` = 0) or y (1)."""
    from matplotlib.collections import LineCollection

    colour = _colours(len(levels))
    for level in levels:
        flat = section(level.mesh, np.zeros(3), np.eye(3)[1 - across])[:, :, [across, 2]]
        width = 1.6 if level.index in (0, levels[-1].index) else 0.8
        plot.add_collection(LineCollection(list(flat), colors=[colour(level.index)], linewidths=width, capstyle="round"))
    diameter, top = post
    low = float(levels[-1].mesh.bounds[0, 2])
    plot.plot([-diameter / 2, -diameter / 2, np.nan, diameter / 2, diameter / 2], [low - 2, top, np.nan, low - 2, top], "k--", lw=0.8)
    plot.autoscale()
    plot.set_aspect("equal")
    plot.locator_params(axis="x", nbins=4)
    plot.set_xlabel(f"{'xy'[across]} (mm)")


def draw_depths(levels: Sequence[Level], line: Float[ndarray, "k n"], path: str | Path) -> None:
    """Above: the depth of each cut along one parameter line (`line`). Below: the share of each level's area by depth."""
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 9), dpi=120, layout="constrained")
    above, below = figure.subplots(2, 1)
    colour = _colours(len(line) + 1)
    for k, depths in enumerate(line, start=1):
        above.plot(np.arange(line.shape[1]), depths, lw=0.9, color=colour(k))
    above.set_xlim(0, line.shape[1] - 1)
    above.set_ylim(0, 1.05 * max(level.limit for level in levels))
    above.set_xlabel("point on the line, from the lower to the upper pole")
    above.set_ylabel("distance between levels (mm)")
    figure.colorbar(_scale(Normalize(1, len(line))), ax=above, label="cut", ticks=_whole())
    shares = np.array([level.histogram for level in levels[1:]])
    image = below.imshow(
        100 * shares, aspect="auto", origin="lower", cmap="magma_r", extent=(0, 100, 0.5, len(shares) + 0.5), interpolation="nearest"
    )
    below.set_xlabel("depth, % of the cut's limit")
    below.set_ylabel("cut")
    below.yaxis.set_major_locator(_whole())
    figure.colorbar(image, ax=below, label="% of the level's area")
    figure.suptitle("Depths of the cuts")
    figure.savefig(path, metadata={"Software": None})


def draw_tmesh(surface: TSpline, path: str | Path, chord_tolerance: float = CHORD) -> None:
    """The T-mesh on the surface, seen from the front (-y) and from behind; `chord_tolerance` (mm) of the shaded surface."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 8), dpi=120, layout="constrained")
    for plot, across in zip(figure.subplots(1, 2, sharey=True), (1.0, -1.0)):
        show_tmesh(plot, surface, across, chord_tolerance)
    figure.suptitle(f"{len(surface.weights)} control points")
    figure.savefig(path, metadata={"Software": None})


def show_tmesh(
    plot: "Axes",  # type: ignore[name-defined]
    surface: TSpline,
    across: float = 1.0,
    chord_tolerance: float = CHORD,
) -> None:
    """The shaded surface with the lines of its T-mesh, from -y (`across` = 1) or from y (-1)."""
    _draw_shaded(plot, surface.tessellate(chord_tolerance), across)
    _draw_lines(plot, surface, tmesh_lines(surface), across)


def _draw_shaded(plot: "Axes", mesh: TriangleMesh, across: float, colours: ndarray | None = None) -> None:  # type: ignore[name-defined]
    """Triangles that face the viewer, the far ones first; grey, or one `colours` row (RGB) a vertex."""
    from matplotlib.collections import PolyCollection

    normals = np.zeros((len(mesh.vertices), 3))
    for corner in mesh.faces.T:
        np.add.at(normals, corner, mesh.face_vectors)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    light = 0.55 + 0.4 * np.clip(normals @ (np.array([across, -2 * across, 1.0]) / np.sqrt(6)), 0, 1)
    shade = light[:, None] * (np.ones(3) if colours is None else colours)
    facing = mesh.faces[across * mesh.face_vectors[:, 1] < 0]
    facing = facing[np.argsort(-across * mesh.vertices[facing][:, :, 1].mean(axis=1), kind="stable")]
    corners, faces = mesh.vertices[facing][:, :, [0, 2]] * [across, 1], shade[facing].mean(axis=1)
    plot.add_collection(PolyCollection(corners, facecolors=faces, edgecolors=faces, linewidths=0.8))
    plot.autoscale()
    plot.set_aspect("equal")
    plot.set_xlabel("x (mm)" if across > 0 else "-x (mm)")


def _draw_lines(plot: "Axes", surface: TSpline, lines: TMeshLines, across: float) -> None:  # type: ignore[name-defined]
    """Edges and vertices on the side that faces the viewer."""
    from matplotlib.collections import LineCollection

    share = np.linspace(0, 1, 9)[:, None]
    places = lines.pieces[:, :1] * (1 - share) + lines.pieces[:, 1:] * share
    low, high = surface.domain.T
    s, t = np.clip(places[..., 0].ravel(), low[0], None), np.clip(places[..., 1].ravel(), low[1], high[1])
    points, normals = surface.positions(s, t), surface.normals(s, t)
    flat = np.where((across * normals[:, 1] < 0)[:, None], points[:, [0, 2]] * [across, 1], np.nan).reshape(-1, 9, 2)
    plot.add_collection(LineCollection(list(flat), colors="#1f4e8c", linewidths=0.8))
    s, t = lines.vertices.T
    points, normals = surface.positions(s, t), surface.normals(s, t)
    seen = points[across * normals[:, 1] < 0]
    plot.plot(across * seen[:, 0], seen[:, 2], ".", color="#b03020", markersize=2.5)


def draw_coloured(levels: Sequence[Level], depths: Sequence[ndarray], path: str | Path) -> None:
    """Some levels of the morph seen from the front (-y), coloured by the depth (mm) of their cut, `depths` at each level's vertices."""
    from matplotlib import colormaps
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    last = next((level.index for level in levels if level.within is not None), len(levels) - 1)
    some = np.unique(np.linspace(1, last, min(last, SHOWN)).round().astype(int))
    norm = Normalize(0, max(level.limit for level in levels))
    figure = Figure(figsize=(10, 5), dpi=120, layout="constrained")
    plots = figure.subplots(1, len(some), sharex=True, sharey=True, squeeze=False)[0]
    for plot, k in zip(plots, some):
        _draw_shaded(plot, levels[k].mesh, 1.0, colormaps[CUT_COLOURS](norm(depths[k]))[:, :3])
        plot.set_title(f"level {k}")
    plots[0].set_ylabel("z (mm)")
    figure.colorbar(_scale(norm), ax=plots, label="distance to the level before (mm)", shrink=0.8)
    figure.savefig(path, metadata={"Software": None})


def draw_toolpath(paths: Sequence[ToolPath], levels: Sequence[Level], path: str | Path) -> None:
    """The outermost, a middle and the innermost level from the front (-y): contacts, some tool axes, links by their tips."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    shown = [paths[k] for k in sorted({0, len(paths) // 2, len(paths) - 1})]
    figure = Figure(figsize=(10, 7.2), dpi=120, layout="constrained")
    plots = figure.subplots(1, len(shown), sharex=True, sharey=True, squeeze=False)[0]
    for plot, item in zip(plots, shown):
        show_path(plot, item, levels[item.level].mesh)
        plot.set_title(f"level {item.level}, ball R {item.cutter.radius:g} mm\n{int((item.kinds == Kind.CUT).sum())} cutting moves")
    plots[0].set_ylabel("z (mm)")
    keys = {"cut (contact)": CUT, "link (tip)": LINK, "tool axis": AXIS}
    figure.legend([Line2D([], [], color=colour) for colour in keys.values()], list(keys), loc="outside lower center", ncols=3)
    figure.savefig(path, metadata={"Software": None})


def show_path(plot: "Axes", item: ToolPath, level: TriangleMesh) -> None:  # type: ignore[name-defined]
    """The moves on the side of a level that faces the viewer, by the surface's normal at the contact, else by the tool axis."""
    from matplotlib.collections import LineCollection

    _draw_shaded(plot, level, 1.0)
    cut = item.kinds == Kind.CUT
    outward = np.where(cut[:, None], item.tips + item.cutter.radius * item.axes - item.contacts, item.axes)
    front = outward[:, 1] < 0
    for kind, points, colour in ((Kind.CUT, item.contacts, CUT), (Kind.LINK, item.tips, LINK)):
        arrives = np.flatnonzero((item.kinds[1:] == kind) & front[1:] & front[:-1] & np.isfinite(points[:-1, 0])) + 1
        ends = np.stack([points[arrives - 1], points[arrives]], axis=1)
        plot.add_collection(LineCollection(list(ends[:, :, [0, 2]]), colors=colour, linewidths=0.35))
    some = np.flatnonzero(cut & front)
    some = some[:: max(1, len(some) // AXES_SHOWN)]
    ends = np.stack([item.contacts[some], item.contacts[some] + AXIS_LENGTH * item.axes[some]], axis=1)
    plot.add_collection(LineCollection(list(ends[:, :, [0, 2]]), colors=AXIS, linewidths=0.6))


def _colours(count: int):  # type: ignore[no-untyped-def]
    from matplotlib import colormaps

    table = colormaps[CUT_COLOURS]
    return lambda index: table(index / max(count - 1, 1))


def _whole() -> Any:
    """Ticks at whole numbers."""
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(integer=True)


def _scale(norm: object):  # type: ignore[no-untyped-def]
    from matplotlib.cm import ScalarMappable

    return ScalarMappable(norm=norm, cmap=CUT_COLOURS)  # type: ignore[arg-type]
