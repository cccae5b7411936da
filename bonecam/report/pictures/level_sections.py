"""Pictures: two sections of all levels (Gan et al. 2014, Fig. 10), also through a place that refused a program, of what
stays of the post below the part, and of the part in its second clamping."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.measure.level import Level
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.passes.parting import Groove
from bonecam.report.pictures.colours import colour_scale, colours_of, value_range, whole_ticks
from bonecam.report.pictures.panels import BAR_BELOW, Plot, bar_below, lay_out, new_figure, save_figure
from bonecam.report.pictures.views import section
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.workholding.shell import SecondClamping

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

    lay_out(figure, plots, below=BAR_BELOW, above=TITLE_ABOVE)
    scale = colour_scale(value_range(0, len(levels) - 1))
    bar = {"label": "level", "orientation": "horizontal", "ticks": whole_ticks()}
    figure.colorbar(scale, cax=bar_below(figure), **bar)
    save_figure(figure, path)


def show_levels(
    plot: Plot, levels: Sequence[Level], post: tuple[float, float] | None, across: int, at: float = 0.0
) -> None:
    """Draw the section of all levels by the plane of z and x (`across` = 0) or y (1), which lies `at` so many
    mm along the third axis."""
    from matplotlib.collections import LineCollection

    norm = value_range(0, max(len(levels) - 1, 1))
    for level in levels:
        lines = section(level.mesh, at * np.eye(3)[1 - across], np.eye(3)[1 - across])[:, :, [across, 2]]
        width = 1.6 if level.index in (0, levels[-1].index) else 0.8
        style: dict[str, Any] = {"linewidths": width, "capstyle": "butt", "snap": False}
        plot.add_collection(LineCollection(list(lines), colors=[colours_of(norm, level.index)], **style))
    if post:
        draw_post(plot, post, levels)
    plot.set_xlabel(f"{'xy'[across]} (mm)")


def draw_stump(part: TriangleMesh, post: tuple[float, float], groove: Groove | None, path: str | Path) -> None:
    """Write sections of the part's lower end with what stays of the `post` (diameter, top z), mm: down to the parting
    `groove`, or all of it."""
    from matplotlib.collections import LineCollection

    diameter, top = post
    bottom = groove.bottom if groove else float(part.bounds[0, 2])
    low, high = bottom - POST_SHOWN / 2, max(top, float(part.bounds[0, 2])) + diameter
    figure, plots = new_figure(2)
    for plot, across in zip(plots, (0, 1)):
        side = np.array([[diameter / 2, low], [diameter / 2, top]])
        if groove:
            side = np.vstack([side[:1], groove.outline(diameter / 2), side[1:]])
        plot.fill(*np.vstack([side, (side * [-1.0, 1.0])[::-1]]).T, color=POST_COLOUR)
        lines = section(part, np.zeros(3), np.eye(3)[1 - across])[:, :, [across, 2]]
        plot.add_collection(LineCollection(list(lines[lines[:, :, 1].max(axis=1) < high]), colors="k"))
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
    from matplotlib.collections import LineCollection

    figure, plots = new_figure(2)
    axis = np.array([0.0, 0.0, clamping.part.bounds[1, 2]])
    for plot, across in zip(plots, (0, 1)):
        for solid, colour in ((clamping.shell, "tab:brown"), (clamping.part, "k")):
            lines = section(solid, axis, np.eye(3)[1 - across])[:, :, [across, 2]]
            plot.add_collection(LineCollection(list(lines), colors=colour))
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
