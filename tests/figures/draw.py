"""Draws the README's pictures: `python tests/figures/draw.py` runs the chain on the shipped phalanx with the default job."""

from pathlib import Path

from bonecam_meshes import path

import bonecam
from bonecam.verify.pictures import draw_levels, draw_tmesh, draw_toolpath

HERE = Path(__file__).parent


def main() -> None:
    """Write levels.png, toolpath.png and tmesh.png beside this file."""
    result = bonecam.convert(path("phalanx"))
    job = bonecam.Job()
    draw_levels(result.levels.levels, (job.holding.diameter, float(result.part.mesh.bounds[0, 2])), HERE / "levels.png")
    draw_toolpath(result.paths, HERE / "toolpath.png")
    draw_tmesh(result.surface, HERE / "tmesh.png")


if __name__ == "__main__":
    main()
