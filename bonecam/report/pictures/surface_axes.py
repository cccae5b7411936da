"""Picture: tool axes on one surface (Xu et al. 2013, Fig. 10)."""

from pathlib import Path

import numpy as np

from bonecam.report.pictures.panels import DPI, save_figure
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import MoveKind, ToolPath

CHORD = 0.05
"""Chord tolerance of the surface drawn, mm."""
MAX_AXES = 500
"""Tool axes shown at most."""
AXIS_SHARE = 0.25
"""Length that axes are drawn with, as a share of the surface's size."""
VIEWS = ((25, -60), (25, 120))
"""Elevation and azimuth of the two views, degrees."""


def draw_axes(path: ToolPath, surface: TSpline, file: str | Path) -> None:
    """Write the surface from two sides, with its contacts and some of their tool axes, blue at the first pass and red
    at the last."""
    from matplotlib import colormaps, figure
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    mesh = surface.tessellate(CHORD)
    cuts = np.flatnonzero(path.kinds == MoveKind.CUT)
    some = cuts[:: max(1, len(cuts) // MAX_AXES)]
    feet = path.contacts[some]
    ends = np.stack([feet, feet + AXIS_SHARE * mesh.diagonal * path.axes[some]], axis=1)
    colours = colormaps["coolwarm"](path.pass_index[some] / max(1, path.pass_index.max()))
    middle = mesh.bounds.mean(axis=0)
    half = 0.6 * np.ptp(mesh.bounds, axis=0).max()
    made = figure.Figure(figsize=(12, 6), dpi=DPI)
    for number, (elevation, azimuth) in enumerate(VIEWS, 1):
        plot = made.add_subplot(1, 2, number, projection="3d")
        plot.plot_trisurf(*mesh.vertices.T, triangles=mesh.faces, color="0.8", linewidth=0)
        plot.add_collection3d(Line3DCollection(list(ends), colors=colours, linewidths=0.6))
        plot.set(xlim=middle[0] + half * np.array([-1, 1]), ylim=middle[1] + half * np.array([-1, 1]))
        plot.set(zlim=middle[2] + half * np.array([-1, 1]), xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")
        plot.view_init(elevation, azimuth)
    save_figure(made, file)
