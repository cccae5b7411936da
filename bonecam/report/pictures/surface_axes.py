"""Pictures: tool axes on one surface (Xu et al. 2013, Fig. 10); and the paths of a channel and a blade of a wheel."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.report.pictures.panels import DPI, save_figure
from bonecam.setup.turned_blank import TurnedBlank
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
    drawing = figure.Figure(figsize=(12, 6), dpi=DPI)
    for number, (elevation, azimuth) in enumerate(VIEWS, 1):
        plot = drawing.add_subplot(1, 2, number, projection="3d")
        plot.plot_trisurf(*mesh.vertices.T, triangles=mesh.faces, color="0.8", linewidth=0)
        plot.add_collection3d(Line3DCollection(list(ends), colors=colours, linewidths=0.6))
        plot.set(xlim=middle[0] + half * np.array([-1, 1]), ylim=middle[1] + half * np.array([-1, 1]))
        plot.set(zlim=middle[2] + half * np.array([-1, 1]), xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")
        plot.view_init(elevation, azimuth)
    save_figure(drawing, file)


MOST_FACES = 40_000
"""Faces of the wheel that are drawn at most: every so many of more."""
WHEEL_VIEW = (50, -20)
"""Elevation and azimuth, degrees."""


def draw_wheel(
    solid: TriangleMesh, blank: TurnedBlank, paths: Sequence[ToolPath], count: int, file: str | Path
) -> None:
    """Write the wheel with the cuts of its first channel (from red at the blank to blue at the hub) and of its first
    blade (black) beside the blank's profile with the levels' contacts; each path is repeated `count` times."""
    from matplotlib import colormaps, figure
    from matplotlib.tri import Triangulation

    drawing = figure.Figure(figsize=(14, 7), dpi=DPI)
    plot = drawing.add_subplot(1, 2, 1, projection="3d")
    faces = solid.faces[:: max(1, len(solid.faces) // MOST_FACES)]
    plot.plot_trisurf(
        Triangulation(solid.vertices[:, 0], solid.vertices[:, 1], faces),
        solid.vertices[:, 2],
        color="0.8",
        linewidth=0,
        alpha=0.4,
    )
    flat = drawing.add_subplot(1, 2, 2)
    flat.fill(*np.vstack([blank.profile]).T, color="0.9", label="blank")
    colours = colormaps["coolwarm"](np.linspace(1, 0, max(len(paths) - 1, 1)))
    for path, colour in zip(paths, [*colours, "black"]):
        one = slice(0, len(path.tips) // count)
        cuts = path.kinds[one] == MoveKind.CUT
        contacts = np.where(cuts[:, None], path.contacts[one], np.nan)
        plot.plot(*contacts.T, color=colour, linewidth=0.4)
        flat.plot(np.hypot(*contacts[:, :2].T), contacts[:, 2], color=colour, linewidth=0.3)
    plot.set(xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")
    plot.set_aspect("equal")
    plot.view_init(*WHEEL_VIEW)
    flat.set(xlabel="radius (mm)", ylabel="z (mm)", aspect="equal")
    flat.legend(loc="upper right")
    save_figure(drawing, file)
