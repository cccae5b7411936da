"""Picture: the last path of each strategy on the part (Gan et al. 2014, Fig. 16)."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.report.files.result import Result
from bonecam.report.pictures.panels import BELOW, label_rows, lay_out, new_figure, save_figure
from bonecam.report.pictures.tool_paths import LEGEND, add_legend, show_path
from bonecam.tool.path import MoveKind, ToolPath

ONE_SIDED = 0.3
"""The tool stays on one side of the part where its mean axis is longer, seen along Z."""


def draw_compared_paths(results: Sequence[tuple[str, Result]], path: str | Path) -> None:
    """Write for each strategy the middle path and the last one, from the front (-y), or turned about Z to where the
    tool stands of a path that stays on one side."""
    figure, plots = new_figure(len(results), 2)
    for k, (name, result) in enumerate(results):
        whole = [one for one in result.paths if not one.rest and one.level >= 0]
        levels = result.levels.levels
        followed = whole[0].level == len(levels) - 2
        for plot, item in zip(plots[k :: len(results)], (whole[len(whole) // 2], whole[-1]), strict=True):
            mesh = levels[item.level].mesh if followed else levels[0].mesh
            show_path(plot, *_faced(item, mesh))
            plot.set_title(f"{name}\n{'level' if followed else 'layer'} {item.level}", fontsize="medium")
    label_rows(plots, 2)
    add_legend(figure)
    lay_out(figure, plots, below=BELOW + LEGEND, rows=2)
    save_figure(figure, path)


def _faced(item: ToolPath, mesh: TriangleMesh) -> tuple[ToolPath, TriangleMesh]:
    """A path and what it cuts, turned about Z so that a tool that stays on one side stands at -y."""
    x, y, _ = item.axes[item.kinds == MoveKind.CUT].mean(axis=0)
    if np.hypot(x, y) < ONE_SIDED:
        return item, mesh
    angle = -np.pi / 2 - np.arctan2(y, x)
    turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    turned = replace(item, tips=item.tips @ turn, axes=item.axes @ turn, contacts=item.contacts @ turn)
    return turned, TriangleMesh(mesh.vertices @ turn, mesh.faces)
