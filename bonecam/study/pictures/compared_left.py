"""Picture: the stock that each strategy leaves, coloured by its distance from the part (Gan et al. 2014, Fig. 17)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.material.dexels import Dexels
from bonecam.mesh.distance import MeshDistance
from bonecam.report.pictures.colours import colour_scale, colours_of, value_range
from bonecam.report.pictures.panels import BAR_BELOW, bar_below, label_rows, lay_out, new_figure, save_figure
from bonecam.report.pictures.shading import AMBIENT, DIFFUSE, LIGHT
from bonecam.verify.removal.sweeping import SimulatedStock

SCALLOPS = 3.0
"""The scale of what is left ends at so many scallops of the finishing cutter."""
PIXEL = 1.5
"""Size of a pixel in distances of the rays: no ray of a surface that faces the viewer falls between."""
BELOW_PART = 3.0
"""So much of the post is shown, mm."""


def draw_compared_left(left: Sequence[tuple[str, SimulatedStock]], scallop: float, path: str | Path) -> None:
    """Write what stands, as its rays have it, from the front (-y) and from behind; `scallop`: that of the finishing
    cutter, mm."""
    norm = value_range(0, SCALLOPS * scallop)
    figure, plots = new_figure(len(left), 2)
    for k, (name, stock) in enumerate(left):
        # Places of the surface of what stands, on all rays, and how far each is from the part, mm
        probes = stock.normal_probes
        assert probes is not None
        points = Dexels(tuple(stock.sets), stock.grid).ends
        points = points[points[:, 2] > probes.points[:, 2].min() - BELOW_PART]
        heights = MeshDistance(probes.mesh).unsigned(points)

        colours = colours_of(norm, heights)[:, :3]
        for side, plot in ((1.0, plots[k]), (-1.0, plots[len(left) + k])):
            view = _seen(points * [side, side, 1.0], PIXEL * stock.grid.cell)
            shown = np.ones((*view.shades.shape, 4))
            shown[..., :3] = colours[view.index] * view.shades[..., None]
            shown[..., 3] = view.covered
            plot.imshow(shown, extent=view.extent, origin="lower", interpolation="nearest")
            plot.set_title(f"{name}\nfrom {'the front' if side > 0 else 'behind'}", fontsize="medium")
            plot.set_xlabel("across (mm)")
    label_rows(plots, 2)
    lay_out(figure, plots, below=BAR_BELOW, rows=2)
    bar = {"label": "distance from the part, mm", "orientation": "horizontal", "extend": "max"}
    figure.colorbar(colour_scale(norm), cax=bar_below(figure), **bar)
    save_figure(figure, path)


@dataclass(frozen=True, eq=False)
class _View:
    """A picture of places seen along y: of each pixel the place that is nearest to the viewer (`index`), whether there
    is one, and how light it is; the `extent` (left, right, low, high), mm."""

    index: ndarray
    covered: ndarray
    shades: Float[ndarray, "r c"]
    extent: tuple[float, float, float, float]


def _seen(points: Float[ndarray, "n 3"], pixel: float) -> _View:
    """What of some places is seen from -y."""
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
    return _View(index, covered, shades, (float(low[0]), float(right), float(low[1]), float(high)))
