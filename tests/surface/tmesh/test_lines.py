"""The T-mesh as lines: every edge once, on the surface, with every vertex; and the picture of it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from bonecam.report.pictures.tmesh_lines import draw_tmesh
from bonecam.surface.tmesh.lines import tmesh_lines
from bonecam.surface.tspline import TSpline


def test_edges_of_a_general_tmesh_are_drawn_once(random_tspline: Callable[..., TSpline]) -> None:
    surface = random_tspline(4, closed=True)
    lines = tmesh_lines(surface.tmesh)
    straight = (lines.pieces[:, 0] == lines.pieces[:, 1]).sum(axis=1)
    assert (straight == 1).all()
    assert len(np.unique(lines.pieces.reshape(-1, 4), axis=0)) == len(lines.pieces) - repeated_border(surface)
    assert len(lines.vertices) == surface.tmesh.size


def repeated_border(surface) -> int:  # type: ignore[no-untyped-def]
    """Edges on the second line of the clamped borders lie on those of the first."""
    mesh = surface.tmesh
    return int(
        min(mesh.along_s[:, 0].sum(), mesh.along_s[:, 1].sum())
        + min(mesh.along_s[:, -1].sum(), mesh.along_s[:, -2].sum())
    )


def test_rows_are_drawn_with_their_knots(bone_like: Callable[..., TSpline], tmp_path: Path) -> None:
    surface = bone_like(8, 6, 1)
    lines = tmesh_lines(surface.tmesh)
    assert len(lines.vertices) == surface.tmesh.size
    assert len(lines.pieces) == 2 * (surface.tmesh.size - 2)
    draw_tmesh(surface, tmp_path / "a.png", 0.1)
    draw_tmesh(surface, tmp_path / "b.png", 0.1)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
