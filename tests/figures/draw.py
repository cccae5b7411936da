"""Draws the pictures of README and docs: `python tests/figures/draw.py` runs the chain on the shipped phalanx
with the default job."""

from pathlib import Path

from bonecam_meshes import path
from clamping import draw_clamping
from matplotlib.figure import Figure
from page_picture import picture_page

import bonecam
from bonecam.levels.measure.line_depths import line_depths
from bonecam.setup.holding import post_below
from bonecam.verify.pictures.depth_colours import draw_coloured
from bonecam.verify.pictures.depth_curves import draw_depths
from bonecam.verify.pictures.level_sections import show_levels
from bonecam.verify.pictures.panels import lay_out
from bonecam.verify.pictures.tmesh_lines import draw_tmesh, show_tmesh
from bonecam.verify.pictures.tool_paths import draw_toolpath, show_path

COARSE: dict[str, dict[str, float]] = {
    "levels": {"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.05},
    "roughing": {"scallop": 0.3},
    "finishing": {"scallop": 0.2},
}
"""Of the page that docs embed: coarse, so that it is small."""
FIGURES = Path(__file__).parents[2] / "docs/pages/figures"


def main() -> None:
    """Write chain.png, clamping.png, coloured.png, depths.png, toolpath.png, tmesh.png, iso-height.png, rotary.png,
    page.png and page.html for docs/pages."""
    job = bonecam.Job()
    result = bonecam.convert(path("phalanx"), job)
    levels = result.levels.levels
    top = post_below(result.part.mesh, job.holding).top
    post = job.holding.diameter, top
    draw_clamping(result.part.mesh, result.stock, job.holding, top, job.finishing, FIGURES / "clamping.png")
    draw_chain(result, post, FIGURES / "chain.png")
    draw_coloured(levels, FIGURES / "coloured.png")
    draw_depths(levels, line_depths(levels, result.stock), FIGURES / "depths.png")
    draw_toolpath(result.paths, levels, FIGURES / "toolpath.png", post)
    draw_tmesh(result.surface, FIGURES / "tmesh.png")
    for strategy in ("iso-height", "rotary"):
        layered = bonecam.convert(
            path("phalanx"), job.with_values(path={"strategy": strategy}), simulation=False
        )
        draw_toolpath(layered.paths, layered.levels.levels, FIGURES / f"{strategy}.png", post)
    picture_page(result.page, FIGURES / "page.png")
    bonecam.convert(path("phalanx"), job.with_values(**COARSE), html=FIGURES / "page.html")


def draw_chain(result: bonecam.Result, post: tuple[float, float], file: Path) -> None:
    """Surface, levels round the `post` (diameter, top z, mm) and the last level's path side by side, to one
    scale."""
    levels, paths = result.levels.levels, result.paths
    figure = Figure(dpi=120)
    plots = figure.subplots(1, 3, sharex=True, sharey=True)
    show_tmesh(plots[0], result.surface)
    show_levels(plots[1], levels, post, 0)
    show_path(plots[2], paths[-1], levels[0].mesh)
    plots[0].set_title(f"one T-spline,\n{len(result.surface.weights)} control points")
    plots[1].set_title(f"{result.levels.cuts} cuts\nfrom stock to part")
    plots[2].set_title("path and tool axes\nof the last level")
    plots[0].set_ylabel("z (mm)")
    lay_out(figure, plots)
    figure.savefig(file, metadata={"Software": None})


if __name__ == "__main__":
    main()
