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
    """Two sections through the axis, x = 0 and y = 0, of all levels; `post` is (diameter, top z) in mm."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 9), dpi=120, layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    colour = _colours(len(levels))
    for plot, across, name in ((axes[0], 0, "x"), (axes[1], 1, "y")):
        normal = np.eye(3)[1 - across]
        for level in levels:
            flat = section(level.mesh, np.zeros(3), normal)[:, :, [across, 2]]
            width = 1.6 if level.index in (0, levels[-1].index) else 0.8
            plot.add_collection(LineCollection(list(flat), colors=[colour(level.index)], linewidths=width, capstyle="round"))
        diameter, top = post
        low = float(levels[-1].mesh.bounds[0, 2])
        plot.plot([-diameter / 2, -diameter / 2, np.nan, diameter / 2, diameter / 2], [low - 2, top, np.nan, low - 2, top], "k--", lw=0.8)
        plot.autoscale()
        plot.set_aspect("equal")
        plot.set_xlabel(f"{name} (mm)")
    axes[0].set_ylabel("z (mm)")
    figure.suptitle(f"Levels 0 (part) to {levels[-1].index} (stock); dashed: the post")
    figure.colorbar(_scale(Normalize(0, len(levels) - 1)), ax=axes, label="level", shrink=0.6, ticks=_whole())
    figure.savefig(path, metadata={"Software": None})


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


def draw_tmesh(surface: TSpline, path: str | Path, chord_tolerance: float = 0.01) -> None:
    """The T-mesh on the surface, seen from the front (-y) and from behind; `chord_tolerance` (mm) of the shaded surface."""
    from matplotlib.figure import Figure

    mesh, lines = surface.tessellate(chord_tolerance), tmesh_lines(surface)
    figure = Figure(figsize=(7, 8), dpi=120, layout="constrained")
    for plot, across in zip(figure.subplots(1, 2, sharey=True), (1.0, -1.0)):
        _draw_shaded(plot, mesh, across)
        _draw_lines(plot, surface, lines, across)
        plot.autoscale()
        plot.set_aspect("equal")
        plot.set_xlabel("x (mm)" if across > 0 else "-x (mm)")
    figure.suptitle(f"{len(surface.weights)} control points")
    figure.savefig(path, metadata={"Software": None})


def _draw_shaded(plot: "Axes", mesh: TriangleMesh, across: float) -> None:  # type: ignore[name-defined]
    """Triangles that face the viewer, the far ones first."""
    from matplotlib.collections import PolyCollection

    normals = mesh.face_vectors / np.linalg.norm(mesh.face_vectors, axis=1, keepdims=True)
    facing = np.flatnonzero(across * normals[:, 1] < 0)
    corners = mesh.vertices[mesh.faces[facing]]
    order = np.argsort(-across * corners[:, :, 1].mean(axis=1), kind="stable")
    light = 0.55 + 0.4 * np.clip(normals[facing] @ (np.array([across, -2 * across, 1.0]) / np.sqrt(6)), 0, 1)
    colours = np.repeat(light[:, None], 3, axis=1)[order]
    plot.add_collection(PolyCollection(corners[order][:, :, [0, 2]] * [across, 1], facecolors=colours, edgecolors=colours, linewidths=0.3))


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


def draw_toolpath(paths: Sequence[ToolPath], path: str | Path) -> None:
    """The outermost and the innermost level's moves in space, cutting moves with some of their axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 8), dpi=120, layout="constrained")
    for place, item in enumerate([paths[0], paths[-1]]):
        plot = figure.add_subplot(1, 2, place + 1, projection="3d")
        _draw_level(plot, item)
    figure.savefig(path, metadata={"Software": None})


def _draw_level(plot: "Axes3D", item: ToolPath) -> None:  # type: ignore[name-defined]
    cut, link = (np.where((item.kinds == kind)[:, None], item.tips, np.nan) for kind in (Kind.CUT, Kind.LINK))
    plot.plot(*cut.T, lw=0.35, color="#1f5fa8")
    plot.plot(*link.T, lw=0.5, color="#d08020")
    cuts = np.flatnonzero(item.kinds == Kind.CUT)
    some = cuts[:: max(1, len(cuts) // 150)]
    span = np.ptp(item.tips[cuts], axis=0).max() if len(cuts) else 1.0
    ends = item.tips[some] + 0.12 * span * item.axes[some]
    for tip, end in zip(item.tips[some], ends):
        plot.plot(*np.array([tip, end]).T, lw=0.4, color="#b03030", alpha=0.6)
    plot.set_box_aspect(np.maximum(np.ptp(np.vstack([item.tips[cuts], ends]), axis=0), 1e-3) if len(cuts) else None)
    if len(cuts):
        both = np.vstack([item.tips[cuts], ends])
        for setter, low, high in zip((plot.set_xlim, plot.set_ylim, plot.set_zlim), both.min(0), both.max(0)):
            setter(low, high)
    plot.set_title(f"level {item.level}: ball R {item.cutter.radius:g} mm, {len(cuts)} cutting moves")
    plot.set_xlabel("x")
    plot.set_ylabel("y")
    plot.set_zlabel("z (mm)")


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
