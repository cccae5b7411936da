"""Pictures of a study, strategies beside one another (Gan et al. 2014): the last path of each on the part (Fig. 16),
the stock that each leaves, coloured by its distance from the part (Fig. 17), and deviations along the line that was
probed with the paper's band (Fig. 18).
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bonecam_plugins.study.probing import BAND, Probed
from jaxtyping import Float
from numpy import ndarray

from bonecam import Result
from bonecam.material import Dexels
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.report import (
    add_legend,
    colours_of,
    lay_out,
    new_figure,
    save_figure,
    save_with_bar,
    show_path,
    value_range,
)
from bonecam.tool import MoveKind, ToolPath
from bonecam.verify import Removal

SCALLOPS = 3.0
"""The scale of what is left ends at so many scallops of the finishing cutter."""
PIXEL = 1.5
"""Size of a pixel in distances of the rays: no ray of a surface that faces the viewer falls between."""
BELOW_PART = 3.0
"""So much of the post is shown, mm."""
LIGHT = np.array([1.0, -2.0, 1.0]) / np.sqrt(6)
"""Direction to the light, seen from -y."""
AMBIENT, DIFFUSE = 0.55, 0.4
"""Brightness of a place that turns away from the light, and what is added where it faces the light."""
LABELS = 1.0
"""Inches below panels that their labels and a legend take."""
DPI = 120
"""Pixels per inch."""


def label_rows(plots: Any, rows: int) -> None:
    """Name z beside the first panel of each row, and leave x out above the last one."""
    columns = len(plots) // rows
    for plot in plots[::columns]:
        plot.set_ylabel("z (mm)")
    for plot in plots[:-columns]:
        plot.set_xlabel("")


def draw_compared_left(left: Sequence[tuple[str, Removal]], scallop: float, path: str | Path) -> None:
    """Write what stands, as its rays have it, from the front (-y) and from behind; `scallop`: that of the finishing
    cutter, mm."""
    norm = value_range(0, SCALLOPS * scallop)
    figure, plots = new_figure(len(left), 2)
    for k, (name, removal) in enumerate(left):
        stock = removal.remaining
        # Places of the surface of what stands, on all rays, and how far each is from the part, mm
        probes = stock.probes
        points = Dexels(tuple(stock.sets), stock.grid).ends
        points = points[points[:, 2] > probes.points[:, 2].min() - BELOW_PART]
        heights = MeshDistance(probes.mesh).unsigned(points)

        colours = colours_of(norm, heights)[:, :3]
        for side, plot in ((1.0, plots[k]), (-1.0, plots[len(left) + k])):
            index, covered, shades, extent = _seen(points * [side, side, 1.0], PIXEL * stock.grid.cell)
            shown = np.ones((*shades.shape, 4))
            shown[..., :3] = colours[index] * shades[..., None]
            shown[..., 3] = covered
            plot.imshow(shown, extent=extent, origin="lower", interpolation="nearest")
            plot.set_title(f"{name}\nfrom {'the front' if side > 0 else 'behind'}", fontsize="medium")
            plot.set_xlabel("across (mm)")
    label_rows(plots, 2)
    save_with_bar(figure, plots, norm, path, rows=2, label="distance from the part, mm", extend="max")


def _seen(
    points: Float[ndarray, "n 3"], pixel: float
) -> tuple[ndarray, ndarray, Float[ndarray, "r c"], tuple[float, float, float, float]]:
    """What of some places is seen from -y: of each pixel the place that is nearest to the viewer, whether there is one,
    and how light it is; and the extent (left, right, low, high), mm."""
    flat = points[:, [0, 2]]
    low = flat.min(axis=0)
    at = ((flat - low) / pixel).astype(np.int64)
    columns, rows = at.max(axis=0) + 1
    index = np.zeros((rows, columns), dtype=np.int64)
    covered = np.zeros((rows, columns), dtype=bool)
    far_first = np.argsort(-points[:, 1], kind="stable")
    index[at[far_first, 1], at[far_first, 0]] = far_first  # the last one that is written is the nearest
    covered[at[:, 1], at[:, 0]] = True
    depth = np.where(covered, points[index, 1], points[:, 1].max())
    up, across = np.gradient(depth, pixel)
    normals = np.stack([across, -np.ones_like(depth), up], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    right, high = low + np.array([columns, rows]) * pixel
    shades = AMBIENT + DIFFUSE * np.clip(normals @ LIGHT, 0, 1)
    return index, covered, shades, (float(low[0]), float(right), float(low[1]), float(high))


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
    lay_out(figure, plots, below=LABELS, rows=2)
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


COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
"""Of Okabe & Ito (2008): colour-blind readers tell them apart."""
SIZE = (8.0, 4.0)
"""Inches."""
RIGID_WIDTH = 0.9
"""Points that the curves without bending are wide."""
SHOWN = 0.9
"""Share of the points of each curve that the plot holds, if they are within LARGEST: an uncut end leaves it."""
LARGEST = 4 * BAND
"""What is farther off leaves the plot, mm."""


def draw_probed(curves: Sequence[tuple[str, Probed]], path: str | Path) -> None:
    """Write the deviation of each curve over the way along its line, as it comes out, and dotted as if nothing bent.
    The legend tells how far a curve goes that leaves the plot."""
    from matplotlib import figure

    drawing = figure.Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    plot = drawing.subplots()
    # The lowest and the highest deviation of the plot, mm: round the band and most points of each curve.
    values = [each for _, one in curves for each in (one.deviation, one.rigid)]
    low, high = -BAND, BAND
    for curve in values:
        known = curve[np.isfinite(curve)]
        if len(known):
            ends = np.clip(np.quantile(known, [1 - SHOWN, SHOWN]), -LARGEST, LARGEST)
            low, high = min(low, ends[0]), max(high, ends[1])
    low, high = low - BAND / 2, high + BAND / 2
    plot.axhspan(-BAND, BAND, color="0.9", zorder=0, label=f"\u00b1{BAND:g} mm")
    for (name, probed), colour in zip(curves, COLOURS):
        known = probed.deviation[np.isfinite(probed.deviation)]
        outside = known[(known < low) | (known > high)]
        label = f"{name}, to {outside[np.abs(outside).argmax()]:.2g} mm" if len(outside) else name
        plot.plot(probed.line.along, probed.deviation, color=colour, lw=1.2, label=label)
        plot.plot(probed.line.along, probed.rigid, color=colour, lw=RIGID_WIDTH, ls=":")
    plot.plot([], [], color="0.4", lw=RIGID_WIDTH, ls=":", label="as if nothing bent")
    plot.set(xlabel="along the line (mm)", ylabel="deviation (mm)", ylim=(low, high))
    drawing.legend(fontsize="small", ncols=3, loc="outside upper center")
    save_figure(drawing, path)
