"""Picture: what each strategy leaves, coloured by its distance from the part (Gan et al. 2014, Fig. 17)."""

from collections.abc import Sequence
from pathlib import Path

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.report.pictures.colours import colour_scale, colours_of, value_range
from bonecam.report.pictures.panels import BAR_BELOW, bar_below, lay_out, new_figure, save_figure
from bonecam.report.pictures.shading import draw_shaded
from bonecam.verify.removal.normal_probes import NormalProbes

LARGEST = 0.3
"""The scale of what is left ends here, mm."""


def draw_compared_left(left: Sequence[tuple[str, NormalProbes]], path: str | Path) -> None:
    """Write what stands on the part, from the front (-y) and from behind, as it stands and in colour."""
    norm = value_range(0, LARGEST)
    figure, plots = new_figure(2 * len(left))
    for k, (name, probes) in enumerate(left):
        standing = TriangleMesh(probes.points + probes.heights[:, None] * probes.normals, probes.mesh.faces)
        colours = colours_of(norm, probes.heights[probes.mesh.faces].mean(axis=1))[:, :3]
        for side, plot in zip((1.0, -1.0), plots[2 * k : 2 * k + 2], strict=True):
            draw_shaded(plot, standing, side, colours)
            plot.set_title(name if side > 0 else "from behind", fontsize="medium")
    plots[0].set_ylabel("z (mm)")
    lay_out(figure, plots, below=BAR_BELOW)
    bar = {"label": "what stays on the part, mm", "orientation": "horizontal"}
    figure.colorbar(colour_scale(norm), cax=bar_below(figure), **bar)
    save_figure(figure, path)
