"""Draws the pictures of README and docs: `python tests/figures/draw.py [GROUP ...]` runs the chain on the shipped
phalanx with the default job."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bonecam_meshes import path
from clamping import draw_clamping
from matplotlib.figure import Figure
from page_picture import picture_page
from palette import shrink
from tmesh_picture import draw_tmesh, show_tmesh

import bonecam
from bonecam.levels.measure import line_depths
from bonecam.machine import read_machine
from bonecam.mesh import TriangleMesh
from bonecam.report import AxisComparison, draw_machine
from bonecam.report.pictures import (
    draw_coloured,
    draw_compared_axes,
    draw_depths,
    draw_toolpath,
    lay_out,
    show_levels,
    show_path,
)
from bonecam.setup import place
from bonecam.surface.files.surface_input import read_part
from bonecam.workholding import post_below

COARSE: dict[str, dict[str, Any]] = {
    "levels": {"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.05},
    "roughing": {"preset": "ball-4", "scallop": 0.3},
    "finishing": {"preset": "ball-2", "scallop": 0.2},
}
"""Of the page that docs embed: coarse, so that it is small."""
BLADE: dict[str, dict[str, float]] = {
    "holding": {"diameter": 20.0},
    "finishing": {
        **{"radius": 1.5, "flute_length": 4.0, "shank_diameter": 2.4, "overhang": 42.0},
        **{"holder_diameter": 16.0, "scallop": 0.02, "feed": 1200.0},
    },
    "path": {"max_tilt_deg": 85.0},
}
"""The job of the impeller's blade, as in the tutorial."""
FIGURES = Path(__file__).parents[2] / "docs/pages/figures"


def main(wanted: Sequence[str]) -> None:
    """Write the pictures of docs/pages: all, or those of the `wanted` groups `clamping`, `chain`, `strategies`, `page`,
    `blade`."""
    if not wanted or "clamping" in wanted:
        # short and plain, to show all sizes
        cutter = {"radius": 1.0, "flute_length": 4.0, "shank_diameter": 2.0, "overhang": 25.0}
        job = bonecam.Job().with_values(
            holding={"diameter": 4.0, "length": 40.0}, finishing={**cutter, "holder_diameter": 20.0}
        )
        setup = place(read_part(path("phalanx"), job)[0], job)
        top = post_below(setup.part.mesh, job.holding).top
        draw_clamping(setup.part.mesh, setup.stock, job.holding, top, job.finishing, FIGURES / "clamping.png")
    if not wanted or "chain" in wanted:
        draw_run(bonecam.convert(path("phalanx")))
    if not wanted or "strategies" in wanted:
        for strategy in ("iso-height", "rotary"):
            job = bonecam.Job().with_values(path={"strategy": strategy})
            layered = bonecam.convert(path("phalanx"), job, simulation=False)
            draw_toolpath(layered.paths, layered.levels.levels, FIGURES / f"{strategy}.png", post_of(layered))
    if not wanted or "page" in wanted:
        bonecam.convert(path("phalanx"), bonecam.Job().with_values(**COARSE), html=FIGURES / "page.html")
    if not wanted or "blade" in wanted:
        job = bonecam.Job().with_values(**BLADE)
        blade = bonecam.finish(path("impeller_blade"), path("impeller_hub"), [path("impeller_blades")], job)
        draw_before_and_after(blade.compare_axes(), blade.workpiece.surface.tessellate(0.02), "blade")
    for picture in FIGURES.glob("*.png"):
        shrink(picture)


def draw_run(result: bonecam.Result) -> None:
    """Write chain.png, coloured.png, depths.png, toolpath.png, machine.png, tmesh.png, axes-bone.png and
    page.png."""
    job, levels, post = result.job, result.levels.levels, post_of(result)
    draw_chain(result, post, FIGURES / "chain.png")
    draw_coloured(levels, FIGURES / "coloured.png")
    draw_depths(levels, line_depths(levels, result.stock), FIGURES / "depths.png")
    draw_toolpath(result.paths, levels, FIGURES / "toolpath.png", post)
    machine = read_machine(job.nc.machine)
    draw_machine(result.paths, levels[0].mesh, job.holding, machine, FIGURES / "machine.png")
    draw_tmesh(result.surface, FIGURES / "tmesh.png")
    draw_before_and_after(result.compare_axes(), levels[0].mesh, "bone")
    picture_page(result.page, FIGURES / "page.png")


def draw_before_and_after(compared: AxisComparison, surface: TriangleMesh, name: str) -> None:
    """Write axes-NAME.png, and print the table that stands beside it."""
    draw_compared_axes(compared, surface, FIGURES / f"axes-{name}.png")
    print(f"{name}\n{compared.table}")


def post_of(result: bonecam.Result) -> tuple[float, float]:
    """Diameter of the post and height of its top, mm."""
    holding = result.job.holding
    return holding.diameter, post_below(result.part.mesh, holding).top


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
    main(sys.argv[1:])
