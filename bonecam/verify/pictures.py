"""Pictures of what was made: section through all levels (Gan et al. 2014, Fig. 10), depths (Fig. 11), the
tool path (Fig. 12).

The only door to matplotlib; it loads when a picture is drawn and needs no display.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.measure.level import Level, rounding_cuts
from bonecam.levels.measure.line_depths import LINE, depths_from, line_lengths
from bonecam.mesh.remeshing import split_edges
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tmesh.lines import TMeshLines, tmesh_lines
from bonecam.surface.tspline import TSpline
from bonecam.toolpath.path import Kind, ToolPath
from bonecam.verify.panels import BELOW, bar_below, lay_out
from bonecam.verify.views import corner_normals, section, view

CUT_COLOURS = "viridis"
CUT, LINK, AXIS = "#1f5fa8", "#e07b00", "#b03030"
CHORD = 0.01
"""Tolerance (mm) of a shaded T-spline."""
SHOWN, AXES_SHOWN, AXIS_LENGTH = 5, 60, 3.0
"""Levels in a row, axes a level and their length, mm."""
POST_SHOWN = 2.0
"""How much of the post is drawn below the stock, mm; it goes on down to the table."""
LABELS = 10
"""The most lines that carry their cut's number."""
BAR_BELOW = 1.3
"""Inches below panels for their labels and a colour bar."""
SPLIT = 40
"""Edges of a level that is coloured are at most this part of its diagonal: its flat faces are few and
large."""


def draw_levels(levels: Sequence[Level], post: tuple[float, float] | None, path: str | Path) -> None:
    """Two sections of all levels across y and x, to one scale, through the axis of the `post` (diameter, top
    z), mm.

    Without a post they go through the middle of the last level.
    """
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    figure = Figure(dpi=120)
    plots = figure.subplots(1, 2, sharex=True, sharey=True)
    middle = np.zeros(3) if post else levels[-1].mesh.bounds.mean(axis=0).round(2) + 0.0
    for plot, across in zip(plots, (0, 1)):
        show_levels(plot, levels, post, across, middle[1 - across])
        plot.set_title(f"section {'yx'[across]} = {middle[1 - across]:g}", fontsize="medium")
    plots[0].set_ylabel("z (mm)")
    figure.suptitle(f"Levels 0 (part) to {levels[-1].index} (stock){'; dashed: the post' if post else ''}")
    lay_out(figure, plots, below=BAR_BELOW, above=0.8)
    bar = {"label": "level", "orientation": "horizontal", "ticks": _whole()}
    figure.colorbar(_scale(Normalize(0, len(levels) - 1)), cax=bar_below(figure), **bar)
    figure.savefig(path, metadata={"Software": None})


def show_levels(
    plot: "Axes",  # type: ignore[name-defined]
    levels: Sequence[Level],
    post: tuple[float, float] | None,
    across: int,
    at: float = 0.0,
) -> None:
    """The section of all levels by the plane of z and x (`across` = 0) or y (1), which lies `at` so many mm
    along the third axis."""
    from matplotlib.collections import LineCollection

    colour = _colours(len(levels))
    for level in levels:
        flat = section(level.mesh, at * np.eye(3)[1 - across], np.eye(3)[1 - across])[:, :, [across, 2]]
        width = 1.6 if level.index in (0, levels[-1].index) else 0.8
        plot.add_collection(
            LineCollection(
                list(flat), colors=[colour(level.index)], linewidths=width, capstyle="butt", snap=False
            )
        )
    if post:
        _draw_post(plot, post, levels)
    plot.set_xlabel(f"{'xy'[across]} (mm)")


def _draw_post(plot: "Axes", post: tuple[float, float], levels: Sequence[Level]) -> None:  # type: ignore[name-defined]
    """The sides of the post (diameter, top z), mm, from a little below the levels."""
    (diameter, top), low = post, float(levels[-1].mesh.bounds[0, 2])
    sides = np.array([-1, -1, np.nan, 1, 1]) * diameter / 2
    plot.plot(sides, [low - POST_SHOWN, top, np.nan, low - POST_SHOWN, top], "k--", lw=0.8)


def draw_depths(
    levels: Sequence[Level],
    line: Float[ndarray, "k n"],
    path: str | Path,
    s: float = LINE,
) -> None:
    """Above: the depth of each cut of the morph along the line s (`line`). Below: the share of each level's
    area by depth."""
    part = levels[0].surface
    assert part is not None
    from matplotlib import colormaps
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 9.6), dpi=120, layout="constrained")
    above, below = figure.subplots(2, 1)
    norm, rounding = Normalize(1, len(line)), rounding_cuts(levels)
    along = line_lengths(part, s, line.shape[1])
    for k, depths in enumerate(line, start=1):
        above.plot(along, depths, lw=0.9, color=colormaps[CUT_COLOURS](norm(k)))
    for k, place in labelled(line):
        box = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none"}
        above.text(
            along[place], line[k - 1, place], str(k), fontsize="small", ha="center", va="center", bbox=box
        )
    for limit in {level.limit for level in levels[1:]}:
        above.axhline(limit, color="0.5", lw=0.8, ls="--", zorder=0)
    above.set_xlim(0, along[-1])
    above.set_ylim(bottom=0)
    above.set_xlabel("way on the line, along the part (mm)")
    above.set_ylabel("distance between levels (mm)")
    rest = f" ({_cuts(rounding)}, which only round the stock, not shown)" if rounding else ""
    above.set_title(
        f"Depth of {_cuts(range(1, len(line) + 1))} along the line s = {s:g}{rest}; dashed: the limits",
        fontsize="medium",
    )
    figure.colorbar(_scale(norm), ax=above, label="cut", ticks=_whole())
    shares = np.array([level.histogram for level in levels[1:]])
    image = below.imshow(
        100 * shares,
        aspect="auto",
        origin="lower",
        cmap="magma_r",
        vmin=0,
        vmax=100,
        extent=(0, 100, 0.5, len(shares) + 0.5),
        interpolation="nearest",
    )
    below.set_xlabel("depth, % of the cut's limit")
    below.set_ylabel("cut")
    below.yaxis.set_major_locator(_whole())
    below.set_title(f"Share of the level's area by depth, {_cuts(range(1, len(levels)))}", fontsize="medium")
    figure.colorbar(image, ax=below, label="% of the level's area")
    figure.savefig(path, metadata={"Software": None})


def labelled(line: Float[ndarray, "k n"]) -> list[tuple[int, int]]:
    """Some cuts, evenly chosen, and for each the place of its label: in a stretch of its own, where its line
    is farthest from others."""
    cuts = range(0, len(line), -(-len(line) // LABELS))
    found = []
    for i, k in enumerate(cuts):
        low, high = (int(line.shape[1] * (i + share) / len(cuts)) for share in (0.2, 0.8))
        stretch = np.delete(line, k, axis=0)[:, low : high + 1] - line[k, low : high + 1]
        found.append((k + 1, low + int(np.abs(stretch).min(axis=0, initial=np.inf).argmax())))
    return found


def _cuts(cuts: range) -> str:
    """Cuts as a title names them, like `cuts 1 to 17`."""
    return f"cuts {cuts[0]} to {cuts[-1]}" if len(cuts) > 1 else f"cut {cuts[0]}"


def draw_tmesh(surface: TSpline, path: str | Path, chord_tolerance: float = CHORD) -> None:
    """The T-mesh on the surface, seen from the front (-y) and from behind; `chord_tolerance` (mm) of the
    shaded surface."""
    from matplotlib.figure import Figure

    figure = Figure(dpi=120)
    plots = figure.subplots(1, 2, sharey=True)
    for plot, across in zip(plots, (1.0, -1.0)):
        show_tmesh(plot, surface, across, chord_tolerance)
    plots[0].set_ylabel("z (mm)")
    figure.suptitle(f"{len(surface.weights)} control points")
    lay_out(figure, plots)
    figure.savefig(path, metadata={"Software": None})


def show_tmesh(
    plot: "Axes",  # type: ignore[name-defined]
    surface: TSpline,
    across: float = 1.0,
    chord_tolerance: float = CHORD,
) -> None:
    """The shaded surface with the lines of its T-mesh, from -y (`across` = 1) or from y (-1)."""
    _draw_shaded(plot, surface.tessellate(chord_tolerance), across)
    _draw_lines(plot, surface, tmesh_lines(surface.tmesh), across)


def _draw_shaded(plot: "Axes", mesh: TriangleMesh, across: float, colours: ndarray | None = None) -> None:  # type: ignore[name-defined]
    """Triangles that face the viewer, the far ones first; grey, or one `colours` row (RGB) a face."""
    from matplotlib.collections import PolyCollection

    facing = np.flatnonzero(across * mesh.face_vectors[:, 1] < 0)
    facing = facing[
        np.argsort(-across * mesh.vertices[mesh.faces[facing]][:, :, 1].mean(axis=1), kind="stable")
    ]
    light = 0.55 + 0.4 * np.clip(
        corner_normals(mesh)[facing] @ (np.array([across, -2 * across, 1.0]) / np.sqrt(6)), 0, 1
    )
    corners = mesh.vertices[mesh.faces[facing]][:, :, [0, 2]] * [across, 1]
    faces = light.mean(axis=1, keepdims=True) * (np.ones(3) if colours is None else colours[facing])
    plot.add_collection(PolyCollection(corners, facecolors=faces, edgecolors=faces, linewidths=0.8))
    plot.set_xlabel("x (mm)" if across > 0 else "-x (mm)")


def _draw_lines(plot: "Axes", surface: TSpline, lines: TMeshLines, across: float) -> None:  # type: ignore[name-defined]
    """Edges and vertices on the side that faces the viewer."""
    from matplotlib.collections import LineCollection

    share = np.linspace(0, 1, 9)[:, None]
    places = lines.pieces[:, :1] * (1 - share) + lines.pieces[:, 1:] * share
    low, high = surface.domain.T
    s, t = np.clip(places[..., 0].ravel(), low[0], None), np.clip(places[..., 1].ravel(), low[1], high[1])
    points, normals = surface.positions(s, t), surface.normals(s, t)
    flat = np.where((across * normals[:, 1] < 0)[:, None], points[:, [0, 2]] * [across, 1], np.nan).reshape(
        -1, 9, 2
    )
    plot.add_collection(LineCollection(list(flat), colors="#1f4e8c", linewidths=0.8))
    s, t = lines.vertices.T
    points, normals = surface.positions(s, t), surface.normals(s, t)
    seen = points[across * normals[:, 1] < 0]
    plot.plot(across * seen[:, 0], seen[:, 2], ".", color="#b03020", markersize=2.5)


def draw_coloured(levels: Sequence[Level], path: str | Path) -> None:
    """Some levels, the first and the stock among them, coloured by the depth of their cut in % of its limit.

    Closed ones are seen from the front (-y), open ones along the axis from which most of the part is seen.
    """
    from matplotlib import colormaps
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    last = len(levels) - 1
    some = np.unique(np.linspace(1, last, min(last, SHOWN)).round().astype(int))
    norm, rounding = Normalize(0, 100), rounding_cuts(levels)
    figure = Figure(dpi=120)
    plots = figure.subplots(1, len(some), sharex=True, sharey=True, squeeze=False)[0]
    frame = view(levels[0].mesh)
    names = [f"{'-' if row.sum() < 0 else ''}{'xyz'[np.abs(row).argmax()]} (mm)" for row in frame[[0, 2]]]
    for plot, k in zip(plots, some):
        mesh = split_edges(levels[k].mesh, levels[k].mesh.diagonal / SPLIT)
        depths = depths_from(levels[k - 1], mesh.vertices[mesh.faces].mean(axis=1))
        seen = TriangleMesh(mesh.vertices @ frame.T, mesh.faces)
        _draw_shaded(plot, seen, 1.0, colormaps[CUT_COLOURS](norm(100 * depths / levels[k].limit))[:, :3])
        plot.set_xlabel(names[0])
        kind = ", the stock" if k == last else ", rounding" if k in rounding else ""
        plot.set_title(f"level {k}{kind}", fontsize="medium")
    plots[0].set_ylabel(names[1])
    lay_out(figure, plots, below=BAR_BELOW)
    figure.colorbar(
        _scale(norm), cax=bar_below(figure), label="depth, % of the cut's limit", orientation="horizontal"
    )
    figure.savefig(path, metadata={"Software": None})


def draw_toolpath(
    paths: Sequence[ToolPath],
    levels: Sequence[Level],
    path: str | Path,
    post: tuple[float, float] | None = None,
) -> None:
    """The outermost, a middle and the innermost level from the front (-y): contacts, some tool axes, links by
    their tips; the `post`."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    shown = [paths[k] for k in sorted({0, len(paths) // 2, len(paths) - 1})]
    figure = Figure(dpi=120)
    plots = figure.subplots(1, len(shown), sharex=True, sharey=True, squeeze=False)[0]
    for plot, item in zip(plots, shown):
        show_path(plot, item, levels[item.level].mesh)
        if post:
            _draw_post(plot, post, levels)
        cuts = int((item.kinds == Kind.CUT).sum())
        plot.set_title(
            f"level {item.level}, ball R {item.cutter.radius:g} mm\n{cuts} cutting moves", fontsize="medium"
        )
    plots[0].set_ylabel("z (mm)")
    keys = {"cut (contact)": CUT, "link (tip)": LINK, "tool axis": AXIS}
    lines = [Line2D([], [], color=colour, label=name) for name, colour in keys.items()]
    lines += [Line2D([], [], color="k", ls="--", lw=0.8, label="post")] if post else []
    figure.legend(handles=lines, loc="lower center", ncols=len(lines))
    lay_out(figure, plots, below=BELOW + 0.4)
    figure.savefig(path, metadata={"Software": None})


def show_path(plot: "Axes", item: ToolPath, level: TriangleMesh) -> None:  # type: ignore[name-defined]
    """The moves on the side of a level that faces the viewer, by the surface's normal at the contact, else by
    the tool axis."""
    from matplotlib.collections import LineCollection

    _draw_shaded(plot, level, 1.0)
    cut = item.kinds == Kind.CUT
    outward = np.where(cut[:, None], item.tips + item.cutter.radius * item.axes - item.contacts, item.axes)
    front = outward[:, 1] < 0
    for kind, points, colour in ((Kind.CUT, item.contacts, CUT), (Kind.LINK, item.tips, LINK)):
        arrives = (
            np.flatnonzero((item.kinds[1:] == kind) & front[1:] & front[:-1] & np.isfinite(points[:-1, 0]))
            + 1
        )
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
