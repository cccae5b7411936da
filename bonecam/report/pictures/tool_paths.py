"""Picture: the tool path on some levels (Gan et al. 2014, Fig. 12)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bonecam.levels.measure.level import Level
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.report.pictures.level_sections import draw_post
from bonecam.report.pictures.panels import BELOW, Figure, Plot, lay_out, new_figure, save_figure
from bonecam.report.pictures.shading import draw_shaded
from bonecam.tool.path import MoveKind, ToolPath

CUT_COLOUR = "#0072b2"
LINK_COLOUR = "#e69f00"
AXIS_COLOUR = "#cc79a7"
"""Of Okabe & Ito (2008): colour-blind readers tell them apart."""
MAX_AXES = 60
"""Tool axes shown on a level at most."""
AXIS_LENGTH = 3.0
"""Length that tool axes are drawn with, mm."""
LEGEND = 0.4
"""Inches that the legend takes below the panels."""


def draw_toolpath(
    paths: Sequence[ToolPath], levels: Sequence[Level], path: str | Path, post: tuple[float, float] | None = None
) -> None:
    """Write the outermost, a middle and the innermost level from the front (-y) and from behind: contacts, some
    tool axes, links by their tips; the `post` (diameter, top z), mm.

    Rest paths are not drawn. Layers, which follow no level, are drawn on the part.
    """
    whole = [each for each in paths if not each.rest]
    shown = [(whole[k], side) for k in sorted({0, len(whole) // 2, len(whole) - 1}) for side in (1.0, -1.0)]
    figure, plots = new_figure(len(shown))
    for plot, (item, side) in zip(plots, shown):
        followed = levels[item.level] if paths[0].level == len(levels) - 2 else levels[0]
        show_path(plot, item, followed.mesh, side)
        if post:
            draw_post(plot, post, levels)
        cuts = int((item.kinds == MoveKind.CUT).sum())
        message = f"{item.cutter.end_name} R {item.cutter.radius:g} mm\n{cuts} cuts" if side > 0 else "from behind"
        title = f"level {item.level}\n{message}"
        plot.set_title(title, fontsize="medium")
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


def show_path(plot: Plot, item: ToolPath, level: TriangleMesh, side: float = 1.0) -> None:
    """Draw the moves on the side of a level that faces the viewer at -y (`side` = 1) or y (-1), by the surface
    normal at the contact, else by the tool axis."""
    from matplotlib.collections import LineCollection

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
        plot.add_collection(LineCollection(list(ends[:, :, [0, 2]] * seen), colors=colour, linewidths=0.35))

    some = np.flatnonzero(is_cut & front)
    some = some[:: max(1, len(some) // MAX_AXES)]
    ends = np.stack([item.contacts[some], item.contacts[some] + AXIS_LENGTH * item.axes[some]], axis=1)
    plot.add_collection(LineCollection(list(ends[:, :, [0, 2]] * seen), colors=AXIS_COLOUR, linewidths=0.6))
