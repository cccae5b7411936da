"""How the part is clamped: post, table, stock, program zero and cutter, each with the name of its size in a job."""

from pathlib import Path
from typing import Any

from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from bonecam.job import HoldingJob, ToolJob
from bonecam.mesh import TriangleMesh
from bonecam.setup import Stock

STOCK, PART, POST, TABLE, CUTTER = "#cfe3f5", "#8c8c8c", "#e69f00", "#444444", "#009e73"
"""Fill colours, of the palette of Okabe and Ito, which colour-blind readers can tell apart."""
SIZE = {"arrowstyle": "<->", "lw": 0.9, "shrinkA": 0, "shrinkB": 0}


def draw_clamping(
    part: TriangleMesh, stock: Stock, holding: HoldingJob, post_top: float, tool: ToolJob, file: Path
) -> None:
    """Left the part in its stock on the post, seen along Y; right the cutter. Both to one scale, in mm."""
    figure = Figure(figsize=(10.0, 8.4), dpi=110, layout="constrained")
    plots = figure.subplots(1, 2, sharey=True, width_ratios=(60, 56))
    _draw_holding(plots[0], part, stock, holding, post_top)
    _draw_cutter(plots[1], tool)
    for plot in plots:
        plot.set_aspect("equal")
        plot.set_ylim(-9, 86)
        plot.axis("off")
    figure.savefig(file, metadata={"Software": None})


def _draw_holding(plot: Any, part: TriangleMesh, stock: Stock, holding: HoldingJob, post_top: float) -> None:
    """Table, post, stock and part from below, with their sizes and the program's zero."""
    low, high = stock.bounds
    radius = holding.diameter / 2
    plot.add_patch(Rectangle((-24, -6), 48, 6, facecolor=TABLE))
    _silhouette(plot, stock.mesh(0.01), STOCK)
    _silhouette(plot, part, PART)
    plot.add_patch(Rectangle((-radius, 0), holding.diameter, post_top, facecolor=POST, alpha=0.85))
    plot.plot([0, 0], [-8, high[2] + 3], color="black", lw=0.8, ls=(0, (12, 3, 2, 3)))

    _height(plot, -17, 0.0, low[2], f"holding.length\n{holding.length:g} mm", -1.5)
    _height(plot, 15, low[2], high[2], f"stock.length\n{high[2] - low[2]:.2f} mm", 1.5)
    _width(plot, high[2] + 5, low[0], high[0], f"stock.diameter {high[0] - low[0]:.2f} mm")
    _width(plot, 20, -radius, radius, "")
    plot.text(radius + 1.5, 20, f"holding.diameter\n{holding.diameter:g} mm", va="center")
    for x, z in ((-18, low[2]), (16, low[2]), (16, high[2])):
        plot.plot([0, x], [z, z], color="black", lw=0.4)
    for x in (low[0], high[0]):
        plot.plot([x, x], [stock.middle[2], high[2] + 6], color="black", lw=0.4)

    for tip, name, place in (((0, 11), "Z", (-2.6, 8.5)), ((11, 0), "X", (11.5, 1))):
        plot.annotate("", tip, (0, 0), arrowprops={"arrowstyle": "-|>", "lw": 2, "shrinkA": 0, "shrinkB": 0})
        plot.text(*place, name, weight="bold", ha="right" if name == "Z" else "left")
    plot.plot(0, 0, "o", color="white", mec="black", ms=9, zorder=5)
    _point_at(plot, "program zero: on the table,\non the stock's axis", (0.6, 0.6), (5, 6), "left")
    plot.text(0, -3, "table (z = 0)", color="white", ha="center", va="center", weight="bold",
              bbox={"facecolor": TABLE, "edgecolor": "none", "pad": 1.5})  # fmt: skip
    plot.text(-radius - 1.5, 30, "post", ha="right", va="center")
    _point_at(plot, "stock", (low[0] + 0.5, low[2] + 24), (-14, low[2] + 24), "right")
    _point_at(plot, "part (level 0)", (-2, low[2] + 18), (-14, low[2] + 18), "right")
    _point_at(plot, "uncut stump\nof the post", (-radius, post_top - 2), (-14, post_top - 2), "right")
    plot.set_xlim(-31, 29)


def _draw_cutter(plot: Any, tool: ToolJob) -> None:
    """One ball-end cutter in its holder from the tip up, with the sizes of section `finishing`."""
    radius = tool.radius
    shank = tool.shank_diameter / 2
    holder = tool.holder_diameter / 2
    neck = tool.overhang - tool.flute_length
    top = tool.overhang + tool.holder_length
    plot.add_patch(Rectangle((-shank, tool.flute_length), 2 * shank, neck, facecolor="#b8b8b8"))
    plot.add_patch(Rectangle((-radius, radius), 2 * radius, tool.flute_length - radius, facecolor=CUTTER))
    plot.add_patch(Circle((0, radius), radius, facecolor=CUTTER))
    plot.add_patch(Rectangle((-holder, tool.overhang), 2 * holder, tool.holder_length, facecolor="#8c8c8c"))
    plot.plot([0, 0], [-4, top + 3], color="black", lw=0.8, ls=(0, (12, 3, 2, 3)))

    _height(plot, -6, 0.0, tool.overhang, f"overhang\n{tool.overhang:g} mm", -1.5)
    _height(plot, 6, 0.0, tool.flute_length, f"flute_length\n{tool.flute_length:g} mm", 1.5)
    _height(plot, 13, tool.overhang, top, f"holder_length\n{tool.holder_length:g} mm", 1.5)
    _width(plot, top + 5, -holder, holder, f"holder_diameter {tool.holder_diameter:g} mm")
    _width(plot, 16, -shank, shank, "")
    plot.text(shank + 1.5, 16, f"shank_diameter\n{tool.shank_diameter:g} mm", va="center")
    for x, z in ((-7, 0), (7, 0), (7, tool.flute_length), (14, tool.overhang), (14, top)):
        plot.plot([0, x], [z, z], color="black", lw=0.4)
    plot.plot(0, 0, "o", color="white", mec="black", ms=7, zorder=5)
    _point_at(plot, "programmed point: the tip", (0.3, -0.5), (-4, -6), "right")
    plot.text(0, 50, f"finishing cutter\nradius {radius:g} mm", ha="center", color="white", weight="bold",
              bbox={"facecolor": "#6f6f6f", "edgecolor": "none", "pad": 3})  # fmt: skip
    plot.set_xlim(-28, 28)


def _silhouette(plot: Any, mesh: TriangleMesh, colour: str) -> None:
    """All triangles of a mesh projected along Y."""
    flat = mesh.vertices[mesh.faces][:, :, [0, 2]]
    plot.add_collection(PolyCollection(list(flat), facecolors=colour, edgecolors=colour, linewidths=0.3))


def _height(plot: Any, x: float, low: float, high: float, text: str, aside: float) -> None:
    """A size along Z at x, its text beside it."""
    plot.annotate("", (x, low), (x, high), arrowprops=SIZE)
    plot.text(x + aside, (low + high) / 2, text, ha="left" if aside > 0 else "right", va="center")


def _width(plot: Any, z: float, left: float, right: float, text: str) -> None:
    """A size along X at height z, its text above it."""
    plot.annotate("", (left, z), (right, z), arrowprops=SIZE)
    plot.text((left + right) / 2, z + 1.2, text, ha="center", va="bottom")


def _point_at(plot: Any, text: str, place: tuple[float, float], at: tuple[float, float], side: str) -> None:
    """A name at `at` with a thin line to the place that it names."""
    line = {"arrowstyle": "-", "lw": 0.6}
    plot.annotate(text, place, at, ha=side, va="center", fontsize="small", arrowprops=line)
