"""Picture: tool axes on one surface before and after smoothing (Xu et al. 2013, Fig. 10)."""

from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.report.axis_comparison import AxisChoice, AxisComparison
from bonecam.report.pictures.panels import BELOW, Plot, lay_out, new_figure, save_figure
from bonecam.report.pictures.shading import draw_shaded

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
    from matplotlib.lines import Line2D

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
        _draw_axes(plot, compared, choice, turned[:3, :3], AXIS_SHARE * surface.diagonal)
        row = compared.figures(choice)
        message = f"{row['collide']} of {len(choice.axes)} collide\n{row['seconds']:.0f} s of cutting"
        plot.set_title(f"{choice.name}\n{message}", fontsize="medium")
        plot.set_xlabel("across (mm)")
    plots[0].set_ylabel("z (mm)")
    keys = {"free": FREE_COLOUR, "collides, or beyond the machine's limits": BLOCKED_COLOUR}
    lines = [Line2D([], [], color=colour, label=name) for name, colour in keys.items()]
    figure.legend(handles=lines, loc="lower center", ncols=len(lines))
    lay_out(figure, plots, below=BELOW + LEGEND, above=0.9)
    save_figure(figure, file)


def _draw_axes(
    plot: Plot, compared: AxisComparison, choice: AxisChoice, turn: Float[ndarray, "3 3"], length: float
) -> None:
    """Axes at contacts that face the viewer at -y once they are turned."""
    from matplotlib.collections import LineCollection

    some = np.arange(0, len(choice.axes), max(1, len(choice.axes) // MAX_AXES))
    outward = (compared.balls - compared.contacts)[some] @ turn.T
    some = some[outward[:, 1] < 0]
    starts = compared.contacts[some] @ turn.T
    ends = starts + length * choice.axes[some] @ turn.T
    blocked = ~(choice.free & choice.reached)[some]
    for which, colour, width in ((~blocked, FREE_COLOUR, 0.5), (blocked, BLOCKED_COLOUR, 0.7)):
        lines = np.stack([starts[which], ends[which]], axis=1)[:, :, [0, 2]]
        plot.add_collection(LineCollection(list(lines), colors=colour, linewidths=width))
