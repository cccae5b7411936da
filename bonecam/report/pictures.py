"""Pictures of what was made, each drawn by one function. The door to matplotlib, which loads when a picture is drawn
and needs no display.

Panels stand side by side with one scale and the same limits; meshes are shaded triangles, seen along y. After Gan et
al. (2014) are sections of all levels (Fig. 10), depths of the cuts along a line (Fig. 11), and paths on some levels,
also coloured by engagement (Fig. 12); after Xu et al. (2013) tool axes on a surface, before and after smoothing (Fig.
10).
"""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.levels.measure import LINE, Level, depths_from, line_lengths, morph_surfaces, rounding_cuts
from bonecam.mechanics.result import ErrorKept
from bonecam.mesh.meshlab import split_edges
from bonecam.mesh.solids import edges_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.stump import Groove
from bonecam.report.summary import AxisComparison
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import BLANK, MoveKind, ToolPath
from bonecam.workholding.shell import SecondClamping

COLOUR_MAP = "viridis"
"""The colour map of levels, cuts and depths."""

Norm = Any
"""A matplotlib.colors.Normalize: it takes a range of values to 0 .. 1."""


def value_range(low: int, high: int | float) -> Norm:
    """The values that the colour map covers."""
    from matplotlib.colors import Normalize

    return Normalize(low, high)


def colours_of(norm: Norm, values: Any) -> Any:
    """The colours (RGBA) of values."""
    from matplotlib import colormaps

    return colormaps[COLOUR_MAP](norm(values))


def whole_ticks() -> Any:
    """Ticks at whole numbers."""
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(integer=True)


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


def save_with_bar(
    figure: Figure, plots: Any, norm: Norm, path: str | Path, above: float = ABOVE, rows: int = 1, **bar: Any
) -> None:
    """Lay out panels, as `lay_out` does, with a colour bar under them, and write the figure."""
    lay_out(figure, plots, below=BAR_BELOW, above=above, rows=rows)
    width, height = figure.get_size_inches()
    place = figure.add_axes((LEFT / width, 0.5 / height, 1 - (LEFT + RIGHT) / width, 0.15 / height))
    figure.colorbar(_colour_scale(norm), cax=place, orientation="horizontal", **bar)
    save_figure(figure, path)


def _colour_scale(norm: Norm) -> Any:
    from matplotlib.cm import ScalarMappable

    return ScalarMappable(norm=norm, cmap=COLOUR_MAP)


def legend_below(figure: Figure, colours: Mapping[str, str], fontsize: str | None = None, **style: Any) -> None:
    """Tell below the panels what each colour is."""
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], color=colour, label=name, **style) for name, colour in colours.items()]
    figure.legend(handles=lines, loc="lower center", ncols=len(lines), fontsize=fontsize)


SHARP_ANGLE = np.radians(25.0)
"""Where a face turns by more (radians) from the mean normal at a vertex, faces meet sharply there and are
shaded by their own normals."""


def section(mesh: TriangleMesh, origin: Float[ndarray, "3"], normal: Float[ndarray, "3"]) -> Float[ndarray, "k 2 3"]:
    """The segments in which the plane through `origin` cuts the triangles, mm."""
    height = (mesh.vertices - origin) @ normal
    height = np.where(height == 0, np.finfo(float).eps, height)
    above = height[mesh.faces] > 0
    crossed = np.flatnonzero(above.any(1) & ~above.all(1))
    ends = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        first, second = mesh.faces[crossed, a], mesh.faces[crossed, b]
        with np.errstate(all="ignore"):
            ratio = height[first] / (height[first] - height[second])
            point = mesh.vertices[first] + ratio[:, None] * (mesh.vertices[second] - mesh.vertices[first])
        crosses = above[crossed, a] != above[crossed, b]
        ends.append(np.where(crosses[:, None], point, np.nan))
    stacked = np.stack(ends, axis=1)
    return stacked[~np.isnan(stacked[:, :, 0])].reshape(-1, 2, 3)


def outline(mesh: TriangleMesh, across: int = 0, at: float = 0.0) -> Float[ndarray, "k 2 2"]:
    """The segments in which the plane of z and x (`across` = 0) or y (1), which lies `at` so many mm along the third
    axis, cuts the triangles, in that plane."""
    normal = np.eye(3)[1 - across]
    return section(mesh, at * normal, normal)[:, :, [across, 2]]


def is_closed(mesh: TriangleMesh) -> bool:
    """Whether every edge has a second face."""
    return not (edges_of(mesh)[1] == 1).any()


def view(mesh: TriangleMesh) -> Float[ndarray, "3 3"]:
    """Axes (rows: to the right, away from the viewer, up) to look along: y at a closed mesh, at an open one
    the direction that shows most area."""
    directions = np.vstack([np.eye(3)[1], -np.eye(3), np.eye(3)])
    shown_area = np.maximum(-mesh.face_vectors @ directions.T, 0).sum(axis=0)
    away = directions[0 if is_closed(mesh) else shown_area.argmax()]
    up = np.eye(3)[1 if away[2] else 2]
    return np.array([np.cross(away, up), away, up])


def corner_normals(mesh: TriangleMesh) -> Float[ndarray, "f 3 3"]:
    """A unit normal at each corner of each face: the area-weighted mean of the faces round the vertex, or
    where they meet sharply the face's own."""
    tiny = np.finfo(float).tiny
    area = np.linalg.norm(mesh.face_vectors, axis=1)
    own = mesh.face_vectors / np.maximum(area, tiny)[:, None]
    mean = np.zeros((len(mesh.vertices), 3))
    for corner in mesh.faces.T:
        np.add.at(mean, corner, mesh.face_vectors)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), tiny)

    least_cosine = np.ones(len(mesh.vertices))
    for corner in mesh.faces[area > 0].T:
        np.minimum.at(least_cosine, corner, (mean[corner] * own[area > 0]).sum(axis=1))
    sharp = (least_cosine < np.cos(SHARP_ANGLE))[mesh.faces]
    return np.where(sharp[:, :, None], own[:, None], mean[mesh.faces])


LIGHT = np.array([1.0, -2.0, 1.0]) / np.sqrt(6)
"""Direction to the light, seen from -y."""
AMBIENT = 0.55
DIFFUSE = 0.4
"""Brightness of a face that turns away from the light, and what is added where it faces the light."""


def draw_lines(plot: Plot, lines: Float[ndarray, "k 2 2"], colours: Any, **style: Any) -> None:
    """Lines between pairs of places."""
    from matplotlib.collections import LineCollection

    plot.add_collection(LineCollection(list(lines), colors=colours, **style))


def draw_shaded(plot: Plot, mesh: TriangleMesh, side: float, colours: Float[ndarray, "f 3"] | None = None) -> None:
    """Triangles that face the viewer at -y (`side` = 1) or y (-1), the far ones first; grey, or of one colour
    (RGB) a face."""
    from matplotlib.collections import PolyCollection

    facing = np.flatnonzero(side * mesh.face_vectors[:, 1] < 0)
    distance = -side * mesh.vertices[mesh.faces[facing]][:, :, 1].mean(axis=1)
    facing = facing[np.argsort(distance, kind="stable")]
    cosine = np.clip(corner_normals(mesh)[facing] @ (LIGHT * [side, side, 1.0]), 0, 1)
    light = AMBIENT + DIFFUSE * cosine
    corners = mesh.vertices[mesh.faces[facing]][:, :, [0, 2]] * [side, 1]
    shades = light.mean(axis=1, keepdims=True) * (np.ones(3) if colours is None else colours[facing])
    plot.add_collection(PolyCollection(corners, facecolors=shades, edgecolors=shades, linewidths=0.8))
    plot.set_xlabel("x (mm)" if side > 0 else "-x (mm)")


FREE_COLOUR = "#0072b2"
BLOCKED_COLOUR = "#d55e00"
"""Of Okabe & Ito (2008): colour-blind readers tell them apart."""
MAX_AXES = 900
"""Axes drawn of each choice at most, on both sides together."""
AXIS_SHARE = 0.2
"""Length that axes are drawn with, as a share of the surface's size."""
SEEN_FROM = 24
"""Azimuths tried: the surface is seen from that which shows most of it."""
LEGEND = 0.4
"""Inches that the legend takes below the panels."""


def draw_compared_axes(compared: AxisComparison, surface: TriangleMesh, file: str | Path) -> None:
    """Write the axes of each choice on the side of the surface that shows most of it: those that collide, or that the
    machine cannot take, in another colour and in front."""
    # The turn about Z after which the side that shows most of a surface faces the viewer at -y
    angles = 2 * np.pi * np.arange(SEEN_FROM) / SEEN_FROM
    towards = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    shown = np.maximum(surface.face_vectors @ towards.T, 0).sum(axis=0)
    best = angles[shown.argmax()]
    turn = -np.pi / 2 - best
    turned = np.eye(4)
    turned[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]

    figure, plots = new_figure(len(compared.choices))
    mesh = surface.move(turned)
    for plot, choice in zip(plots, compared.choices):
        draw_shaded(plot, mesh, 1.0)

        # Axes at contacts that face the viewer at -y once they are turned
        some = np.arange(0, len(choice.axes), max(1, len(choice.axes) // MAX_AXES))
        outward = (compared.balls - compared.contacts)[some] @ turned[:3, :3].T
        some = some[outward[:, 1] < 0]
        starts = compared.contacts[some] @ turned[:3, :3].T
        ends = starts + AXIS_SHARE * surface.diagonal * choice.axes[some] @ turned[:3, :3].T
        blocked = ~(choice.free & choice.reached)[some]
        for which, colour, width in ((~blocked, FREE_COLOUR, 0.5), (blocked, BLOCKED_COLOUR, 0.7)):
            draw_lines(plot, np.stack([starts[which], ends[which]], axis=1)[:, :, [0, 2]], colour, linewidths=width)

        row = compared.figures(choice)
        message = f"{row['collide']} of {len(choice.axes)} collide\n{row['seconds']:.0f} s of cutting"
        plot.set_title(f"{choice.name}\n{message}", fontsize="medium")
        plot.set_xlabel("across (mm)")
    plots[0].set_ylabel("z (mm)")
    legend_below(figure, {"free": FREE_COLOUR, "collides, or beyond the machine's limits": BLOCKED_COLOUR})
    lay_out(figure, plots, below=BELOW + LEGEND, above=0.9)
    save_figure(figure, file)


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

    save_with_bar(figure, plots, norm, path, label="depth, % of the cut's limit")


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
    save_with_bar(figure, plots, norm, path, label="error that bending keeps, \u00b5m")


MAX_LABELS = 10
"""The most lines that carry their cut's number."""


def draw_depths(levels: Sequence[Level], line: Float[ndarray, "k n"], path: str | Path, s: float = LINE) -> None:
    """Write, above, the depth of each cut of the morph along the line s (`line`, mm); below, the share of
    each level's area by depth."""
    from matplotlib import figure

    drawing = figure.Figure(figsize=(10, 9.6), dpi=DPI, layout="constrained")
    above, below = drawing.subplots(2, 1)

    # A coloured line a cut, its number on some, and dashed lines at the limits
    along = line_lengths(morph_surfaces(levels)[0], s, line.shape[1])
    norm = value_range(1, len(line))
    for k, depths in enumerate(line, start=1):
        above.plot(along, depths, lw=0.9, color=colours_of(norm, k))
    box = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none"}
    text = {"fontsize": "small", "ha": "center", "va": "center", "bbox": box}
    for k, place in label_places(line):
        above.text(along[place], line[k - 1, place], str(k), **text)
    for limit in {level.limit for level in levels[1:]}:
        above.axhline(limit, color="0.5", lw=0.8, ls="--", zorder=0)

    above.set_xlim(0, along[-1])
    above.set_ylim(bottom=0)
    above.set_xlabel("length along the line on the part (mm)")
    above.set_ylabel("distance between levels (mm)")
    rounding = rounding_cuts(levels)
    rest = f" ({_cuts(rounding)}, which only round the stock, not shown)" if rounding else ""
    drawn = _cuts(range(1, len(line) + 1))
    title = f"Depth of {drawn} along the line s = {s:g}{rest}; dashed: the limits"
    above.set_title(title, fontsize="medium")
    drawing.colorbar(_colour_scale(norm), ax=above, label="cut", ticks=whole_ticks())

    # A row a cut: the share of the level's area in each bin of depth
    shares = np.array([level.measures.depth_shares for level in levels[1:]])
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
    below.yaxis.set_major_locator(whole_ticks())
    below.set_title(f"Share of the level's area by depth, {_cuts(range(1, len(levels)))}", fontsize="medium")
    drawing.colorbar(image, ax=below, label="% of the level's area")
    save_figure(drawing, path)


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
    from matplotlib.colors import LogNorm

    numbers = np.unique(level_of[cuts])[::-1]
    chosen = [int(numbers[k]) for k in sorted({0, len(numbers) // 2, len(numbers) - 1})]
    shown = cuts & np.isin(level_of, chosen)
    norm = LogNorm(AIR, max(float(np.percentile(sections[shown], MOST)), 2 * AIR), clip=True)
    figure, plots = new_figure(2 * len(chosen))
    panels = [(number, side) for number in chosen for side in (1.0, -1.0)]
    for plot, (number, side) in zip(plots, panels, strict=True):
        draw_shaded(plot, levels[number if numbers[0] == len(levels) - 2 else 0].mesh, side)
        here = np.flatnonzero(shown[1:] & shown[:-1] & (level_of[1:] == number) & (level_of[:-1] == number)) + 1
        here = here[side * outward[here, 1] < 0]
        ends = np.stack([contacts[here - 1], contacts[here]], axis=1)[:, :, [0, 2]] * np.array([side, 1.0])
        in_colour = colours_of(norm, np.maximum(sections[here], AIR))
        colours = np.where((sections[here] < AIR)[:, None], AIR_COLOUR, in_colour)
        draw_lines(plot, ends, colours, linewidths=0.5)
        in_air = float((sections[here] < AIR).mean()) if len(here) else 0.0
        message = f"{in_air:.0%} in air" if side > 0 else "from behind"
        plot.set_title(f"level {number}\n{message}", fontsize="medium")
    plots[0].set_ylabel("z (mm)")

    save_with_bar(figure, plots, norm, path, label="engagement: material removed a length, mm²; grey: air")


POST_SHOWN = 2.0
"""How much of the post is drawn below the stock, mm; it goes on down to the table."""
TITLE_ABOVE = 0.8
"""Inches above panels that the figure's title and theirs take."""
BESIDE = 0.5
"""Balls whose centres are so far beside a section are drawn in it, mm."""
AROUND = 4.0
"""Ball centres within so many mm of a place that refused a program are drawn."""
POST_COLOUR = "#b0b0b0"


def draw_levels(levels: Sequence[Level], post: tuple[float, float] | None, path: str | Path) -> None:
    """Write sections of all levels across y and across x, to one scale, through the axis of the `post`
    (diameter, top z), mm.

    Without a post they go through the middle of the last level.
    """
    figure, plots = new_figure(2)
    middle = np.zeros(3) if post else levels[-1].mesh.bounds.mean(axis=0).round(2) + 0.0
    for plot, across in zip(plots, (0, 1)):
        show_levels(plot, levels, post, across, middle[1 - across])
        plot.set_title(f"section {'yx'[across]} = {middle[1 - across]:g}", fontsize="medium")
    plots[0].set_ylabel("z (mm)")
    figure.suptitle(f"Levels 0 (part) to {levels[-1].index} (stock){'; dashed: the post' if post else ''}")

    norm = value_range(0, len(levels) - 1)
    save_with_bar(figure, plots, norm, path, above=TITLE_ABOVE, label="level", ticks=whole_ticks())


def show_levels(
    plot: Plot, levels: Sequence[Level], post: tuple[float, float] | None, across: int, at: float = 0.0
) -> None:
    """Draw the section of all levels by the plane of z and x (`across` = 0) or y (1), which lies `at` so many
    mm along the third axis."""
    norm = value_range(0, max(len(levels) - 1, 1))
    for level in levels:
        width = 1.6 if level.index in (0, levels[-1].index) else 0.8
        style: dict[str, Any] = {"linewidths": width, "capstyle": "butt", "snap": False}
        draw_lines(plot, outline(level.mesh, across, at), [colours_of(norm, level.index)], **style)
    if post:
        draw_post(plot, post, levels)
    plot.set_xlabel(f"{'xy'[across]} (mm)")


def draw_stump(part: TriangleMesh, post: tuple[float, float], groove: Groove | None, path: str | Path) -> None:
    """Write sections of the part's lower end with what stays of the `post` (diameter, top z), mm: down to the parting
    `groove`, or all of it."""
    diameter, top = post
    bottom = groove.bottom if groove else float(part.bounds[0, 2])
    low, high = bottom - POST_SHOWN / 2, max(top, float(part.bounds[0, 2])) + diameter
    figure, plots = new_figure(2)
    for plot, across in zip(plots, (0, 1)):
        side = np.array([[diameter / 2, low], [diameter / 2, top]])
        if groove:
            side = np.vstack([side[:1], groove.outline(diameter / 2), side[1:]])
        plot.fill(*np.vstack([side, (side * [-1.0, 1.0])[::-1]]).T, color=POST_COLOUR)
        lines = outline(part, across)
        draw_lines(plot, lines[lines[:, :, 1].max(axis=1) < high], "k")
        plot.set_xlabel(f"{'xy'[across]} (mm)")
        plot.set_title(f"section {'yx'[across]} = 0", fontsize="medium")
    plots[0].set_ylabel("z (mm)")
    message = f"parting groove at z {groove.middle:.2f}, bridge {2 * groove.bridge:.2f} mm" if groove else "not parted"
    figure.suptitle(f"The post below the part: {diameter:g} mm, {message}", fontsize="medium")
    lay_out(figure, plots, above=TITLE_ABOVE)
    save_figure(figure, path)


def draw_refused(
    place: Float[ndarray, "3"] | Sequence[float], levels: Sequence[Level], paths: Sequence[ToolPath], path: str | Path
) -> None:
    """Write sections of all levels through the `place` (mm), across y and across x, with the centres of the balls that
    cut near it."""
    at = np.asarray(place, dtype=np.float64)
    figure, plots = new_figure(2)
    for plot, across in zip(plots, (0, 1)):
        show_levels(plot, levels, None, across, float(at[1 - across]))
        for each in paths:
            balls = each.balls[each.kinds == MoveKind.CUT]
            near = np.linalg.norm(balls - at, axis=1) < AROUND
            balls = balls[near & (np.abs(balls[:, 1 - across] - at[1 - across]) < BESIDE)]
            plot.plot(balls[:, across], balls[:, 2], ".", ms=3, color=f"C{each.level % 10}")
        plot.plot(at[across], at[2], "r+", ms=14, mew=1.5)
        plot.set_title(f"section {'yx'[across]} = {at[1 - across]:.2f}", fontsize="medium")
    plots[0].set_ylabel("z (mm)")
    figure.suptitle("Red cross: the place that refused the program;\ndots: centres of the balls beside it")
    lay_out(figure, plots, above=TITLE_ABOVE)
    save_figure(figure, path)


def draw_second(clamping: SecondClamping, paths: Sequence[ToolPath], path: str | Path) -> None:
    """Write sections of part and shell in the second clamping, with the balls' centres near them as they cut."""
    figure, plots = new_figure(2)
    for plot, across in zip(plots, (0, 1)):
        for solid, colour in ((clamping.shell, "tab:brown"), (clamping.part, "k")):
            draw_lines(plot, outline(solid, across), colour)
        for number, each in enumerate(paths):
            balls = each.balls[(each.kinds == MoveKind.CUT) & (np.abs(each.balls[:, 1 - across]) < BESIDE)]
            plot.plot(balls[:, across], balls[:, 2], ".", ms=2, color=f"C{number % 10}")
        plot.set_xlabel(f"{'xy'[across]} (mm)")
        plot.set_title(f"section {'yx'[across]} = 0", fontsize="medium")
        plot.autoscale_view()
    plots[0].set_ylabel("z (mm)")
    figure.suptitle("The second clamping: part, shell, and centres of the balls that cut", fontsize="medium")
    lay_out(figure, plots, above=TITLE_ABOVE)
    save_figure(figure, path)


def draw_post(plot: Plot, post: tuple[float, float], levels: Sequence[Level]) -> None:
    """The sides of the post (diameter, top z), mm, from a little below the levels."""
    diameter, top = post
    low = float(levels[-1].mesh.bounds[0, 2])
    sides = np.array([-1, -1, np.nan, 1, 1]) * diameter / 2
    plot.plot(sides, [low - POST_SHOWN, top, np.nan, low - POST_SHOWN, top], "k--", lw=0.8)


SURFACE_CHORD = 0.05
"""Chord tolerance of the surface drawn, mm."""
SURFACE_AXES = 500
"""Tool axes shown at most."""
SURFACE_AXIS_SHARE = 0.25
"""Length that axes are drawn with, as a share of the surface's size."""
VIEWS = ((25, -60), (25, 120))
"""Elevation and azimuth of the two views, degrees."""


def draw_axes(path: ToolPath, surface: TSpline, file: str | Path) -> None:
    """Write the surface from two sides, with its contacts and some of their tool axes, blue at the first pass and red
    at the last."""
    from matplotlib import colormaps, figure
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    mesh = surface.tessellate(SURFACE_CHORD)
    cuts = np.flatnonzero(path.kinds == MoveKind.CUT)
    some = cuts[:: max(1, len(cuts) // SURFACE_AXES)]
    feet = path.contacts[some]
    ends = np.stack([feet, feet + SURFACE_AXIS_SHARE * mesh.diagonal * path.axes[some]], axis=1)
    colours = colormaps["coolwarm"](path.pass_index[some] / max(1, path.pass_index.max()))
    middle = mesh.bounds.mean(axis=0)
    half = 0.6 * np.ptp(mesh.bounds, axis=0).max()
    drawing = figure.Figure(figsize=(12, 6), dpi=DPI)
    for number, (elevation, azimuth) in enumerate(VIEWS, 1):
        plot = drawing.add_subplot(1, 2, number, projection="3d")
        plot.plot_trisurf(*mesh.vertices.T, triangles=mesh.faces, color="0.8", linewidth=0)
        plot.add_collection3d(Line3DCollection(list(ends), colors=colours, linewidths=0.6))
        plot.set(xlim=middle[0] + half * np.array([-1, 1]), ylim=middle[1] + half * np.array([-1, 1]))
        plot.set(zlim=middle[2] + half * np.array([-1, 1]), xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")
        plot.view_init(elevation, azimuth)
    save_figure(drawing, file)


CUT_COLOUR = "#0072b2"
LINK_COLOUR = "#e69f00"
AXIS_COLOUR = "#cc79a7"
"""Of Okabe & Ito (2008): colour-blind readers tell them apart."""
PATH_AXES = 60
"""Tool axes shown on a level at most."""
AXIS_LENGTH = 3.0
"""Length that tool axes are drawn with, mm."""


def draw_toolpath(
    paths: Sequence[ToolPath], levels: Sequence[Level], path: str | Path, post: tuple[float, float] | None = None
) -> None:
    """Write the outermost, a middle and the innermost level from the front (-y) and from behind, before them what mills
    the stock from the bar: contacts, some tool axes, links by their tips; the `post` (diameter, top z), mm.

    Rest paths are not drawn. Layers, which follow no level, are drawn on the part.
    """
    whole = [each for each in paths if each.level >= 0 and not each.rest]
    blank = [each for each in paths if each.level == BLANK]
    shown = [blank] if blank else []
    shown += [[whole[k]] for k in sorted({0, len(whole) // 2, len(whole) - 1})]
    figure, plots = new_figure(2 * len(shown))
    for plot, (items, side) in zip(plots, product(shown, (1.0, -1.0))):
        level = items[0].level
        radii = " and ".join(dict.fromkeys(f"{each.cutter.radius:g}" for each in items))
        followed = levels[0] if whole[0].level != len(levels) - 2 else levels[level if level >= 0 else -1]
        for item in items:
            show_path(plot, item, followed.mesh if item is items[0] else None, side)
        if post:
            draw_post(plot, post, levels)
        cuts = sum(int((item.kinds == MoveKind.CUT).sum()) for item in items)
        message = f"ball R {radii} mm\n{cuts} cuts" if side > 0 else "from behind"
        plot.set_title(f"{'blank' if level == BLANK else f'level {level}'}\n{message}", fontsize="medium")
    plots[0].set_ylabel("z (mm)")

    add_legend(figure, post is not None)
    lay_out(figure, plots, below=BELOW + LEGEND)
    save_figure(figure, path)


def add_legend(figure: Figure, post: bool = False) -> None:
    """Tell below the panels what the colours of `show_path` are, and the line of a post."""
    from matplotlib.lines import Line2D

    keys = {"cut (contact)": CUT_COLOUR, "link (tip)": LINK_COLOUR, "tool axis": AXIS_COLOUR}
    lines = [Line2D([], [], color=colour, label=name) for name, colour in keys.items()]
    lines += [Line2D([], [], color="k", ls="--", lw=0.8, label="post")] if post else []
    figure.legend(handles=lines, loc="lower center", ncols=len(lines))


def show_path(plot: Plot, item: ToolPath, level: TriangleMesh | None, side: float = 1.0) -> None:
    """Draw a level, if one is given, and the moves on the side that faces the viewer at -y (`side` = 1) or y (-1), by
    the surface normal at the contact, else by the tool axis."""
    if level is not None:
        draw_shaded(plot, level, side)
    seen = np.array([side, 1.0])
    is_cut = item.kinds == MoveKind.CUT
    normals = item.balls - item.contacts
    outward = np.where(is_cut[:, None], normals, item.axes)
    front = side * outward[:, 1] < 0
    shown = ((MoveKind.CUT, item.contacts, CUT_COLOUR), (MoveKind.LINK, item.tips, LINK_COLOUR))
    for kind, points, colour in shown:
        from_front = front[1:] & front[:-1] & np.isfinite(points[:-1, 0])
        move = np.flatnonzero((item.kinds[1:] == kind) & from_front) + 1
        ends = np.stack([points[move - 1], points[move]], axis=1)
        draw_lines(plot, ends[:, :, [0, 2]] * seen, colour, linewidths=0.35)

    some = np.flatnonzero(is_cut & front)
    some = some[:: max(1, len(some) // PATH_AXES)]
    ends = np.stack([item.contacts[some], item.contacts[some] + AXIS_LENGTH * item.axes[some]], axis=1)
    draw_lines(plot, ends[:, :, [0, 2]] * seen, AXIS_COLOUR, linewidths=0.6)
