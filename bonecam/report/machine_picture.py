"""Pictures of a machine: its bodies round the part where the tool comes nearest to the table; and of a machine file,
all axes at zero, table, spindle nose, the rotary axes and the frame of the part.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import rotations_of
from bonecam.job import HoldingJob
from bonecam.machine.bodies import Frustum, Table, stack_length
from bonecam.machine.kinematics import inverse_linear, inverse_rotary, link_poses, within_limits
from bonecam.machine.machine import Machine
from bonecam.mesh.solids import revolve
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.report.pictures import BELOW, Figure, draw_shaded, lay_out, legend_below, new_figure, save_figure
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.workholding.clamping import body_meshes, holding_columns
from bonecam.workholding.post import tailstock_bodies

COLOURS = {
    "part": "#d9cfb8",
    "post": "#7f7f7f",
    "chuck": "#009e73",
    "table": "#cc79a7",
    "cutter": "#d55e00",
    "shank": "#f0e442",
    "holder": "#0072b2",
    "spindle": "#56b4e9",
    "machine": "#b0b7bd",
}
"""Of Okabe & Ito (2008), which colour-blind readers tell apart; part and post in bone and grey, meshes of the
machine's links in light grey."""
SIDES = 32
"""Of bodies of revolution."""
RING = 3.0
"""Rings of their meshes are about so far apart, mm: what lies behind is sorted by triangles."""
TABLE_SHOWN = 150.0
"""A table without an edge is drawn so far from its middle, mm."""
SIDES_SEEN = (1.0, -1.0)
"""From the front (-y) and from behind (y)."""
LEGEND = 0.45
"""Inches that the legend takes below the panels."""


def draw_machine(
    paths: Sequence[ToolPath], part: TriangleMesh, holding: HoldingJob, machine: Machine, file: str | Path
) -> None:
    """Write table, chuck, post, part, the whole tool and the bodies of the machine's links, from the front (-y) and
    from behind, at the cut in which holder or spindle are nearest to the table's plane."""
    heights = [_lowest(path) for path in paths]
    path = paths[int(np.argmin([np.min(each, initial=np.inf) for each in heights]))]
    row = int(np.argmin(_lowest(path)))

    # Part, post, what holds it, and table with what stands on it
    radius = holding.diameter / 2
    bodies = [("part", part), ("post", bar(holding.support_height, float(part.bounds[0, 2]), radius, radius))]
    for name, column in holding_columns(holding).items():
        held = bar(column.bottom, column.top, column.radius, column.radius)
        bodies.append(("post" if name == "stub" else "chuck", held))
    tailstock = tailstock_bodies(holding)
    if tailstock:
        radius = holding.tailstock_diameter / 2
        pin = bar(float(part.bounds[1, 2]), holding.tailstock_height, radius, radius)
        bodies.append(("post", _shifted(pin, holding.tailstock_x, holding.tailstock_y)))
    for column in tailstock:
        held = bar(column.bottom, column.top, column.radius, column.radius)
        bodies.append(("chuck", _shifted(held, column.x, column.y)))
    bodies += [*table_bodies(machine.table), *_tool(path.cutter, path.tips[row], path.axes[row])]

    # Joints (mm, rad) in which the machine, within its limits, holds a cutter in a pose
    tips = path.tips[[row]]
    axes = path.axes[[row]]
    solutions, _ = inverse_rotary(machine, axes)
    usable = within_limits(machine, solutions)[0]
    joints = inverse_linear(machine, tips, solutions[:, int(np.argmax(usable))], path.cutter.length)

    bodies += link_meshes(machine, joints, path.cutter.length)
    lowest = f"{_lowest(path)[row]:.0f} mm above the table"
    figure, plots = _drawn(bodies, f"{path.title}, where holder or spindle are lowest: {lowest}")
    drawn = {name for name, _ in bodies}
    used = {name: colour for name, colour in COLOURS.items() if name in drawn}
    legend_below(figure, used, "small", lw=6)
    lay_out(figure, plots, below=BELOW + LEGEND)
    save_figure(figure, file)


def _lowest(path: ToolPath) -> Float[ndarray, " n"]:
    """Height (mm) of the lowest point of holder and spindle over z = 0 in each cut; infinite elsewhere."""
    up = path.axes[:, 2]
    across = np.sqrt(np.maximum(1 - up**2, 0))
    rims = [
        (height, radius)
        for section in path.cutter.profile
        if section.name in ("holder", "spindle")
        for height, radius in ((section.start, section.radius), (section.end, section.end_radius))
    ]
    heights = [path.tips[:, 2] + height * up - radius * across for height, radius in rims]
    return np.where(path.kinds == MoveKind.CUT, np.min(heights, axis=0), np.inf)


def _shifted(mesh: TriangleMesh, x: float, y: float) -> TriangleMesh:
    """The mesh moved across, mm."""
    return TriangleMesh(mesh.vertices + np.array([x, y, 0.0]), mesh.faces)


def table_bodies(table: Table) -> list[tuple[str, TriangleMesh]]:
    """The table as wide as it is, a plate by the disc inside it, and what stands on it."""
    half = min(table.radius, table.half_width, table.half_depth)
    half = half if np.isfinite(half) else TABLE_SHOWN
    return [("table", bar(-half / 10, 0.0, half, half)), *_stacked("table", table.standing)]


def _stacked(name: str, pieces: Sequence[Frustum]) -> list[tuple[str, TriangleMesh]]:
    """Pieces one on the other, from z = 0 up."""
    bodies = []
    height = 0.0
    for piece in pieces:
        bodies.append((name, bar(height, height + piece.length, piece.diameter / 2, piece.top_diameter / 2)))
        height += piece.length
    return bodies


def link_meshes(machine: Machine, joints: Float[ndarray, "1 5"], tool_length: float) -> list[tuple[str, TriangleMesh]]:
    """The bodies of the machine's links in the part's frame at the joints (mm, rad)."""
    meshes = []
    for body, mesh in body_meshes(machine).items():
        pose = np.eye(4)
        turned, at = link_poses(machine, body.link, joints, tool_length)
        pose[:3, :3], pose[:3, 3] = turned[0], at[0]
        meshes.append(("machine", mesh.move(pose)))
    return meshes


def _tool(cutter: Cutter, tip: Float[ndarray, "3"], axis: Float[ndarray, "3"]) -> list[tuple[str, TriangleMesh]]:
    """The sections of a tool in a pose."""
    pose = np.eye(4)
    pose[:3, :3] = rotations_of(axis[None])[0]
    pose[:3, 3] = tip
    angle = np.linspace(0, np.pi / 2, 6)[1:]
    ball = revolve(cutter.radius * np.sin(angle), cutter.radius * (1 - np.cos(angle)), (0.0, cutter.radius), SIDES)
    sections = [
        (section.name, bar(section.start, section.end, section.radius, section.end_radius))
        for section in cutter.profile
    ]
    return [(name, mesh.move(pose)) for name, mesh in [("cutter", ball), *sections]]


def bar(start: float, end: float, radius: float, end_radius: float) -> TriangleMesh:
    """A body of revolution about Z in short pieces, its ends too."""
    count = max(2, int((end - start) / RING) + 1)
    flat = np.linspace(0.1, 0.9, 8)
    radii = np.concatenate([radius * flat, np.linspace(radius, end_radius, count), end_radius * flat[::-1]])
    heights = np.concatenate([np.full(8, start), np.linspace(start, end, count), np.full(8, end)])
    return revolve(radii, heights, (start, end), SIDES)


def _drawn(bodies: Sequence[tuple[str, TriangleMesh]], title: str) -> tuple[Figure, Any]:
    """A figure of all bodies from the front and from behind, and its panels. They are drawn as one mesh, so that what
    lies before is drawn over what lies behind."""
    from matplotlib.colors import to_rgb

    starts = np.cumsum([0, *(len(mesh.vertices) for _, mesh in bodies[:-1])])
    vertices = np.vstack([mesh.vertices for _, mesh in bodies])
    faces = np.vstack([mesh.faces + start for (_, mesh), start in zip(bodies, starts)]).astype(np.int32)
    colours = np.repeat([to_rgb(COLOURS[name]) for name, _ in bodies], [len(mesh.faces) for _, mesh in bodies], axis=0)
    figure, plots = new_figure(2)
    for plot, side in zip(plots, SIDES_SEEN):
        draw_shaded(plot, TriangleMesh(vertices, faces), side, colours)
    plots[0].set_title(title, fontsize="small")
    plots[1].set_title("from behind", fontsize="small")
    plots[0].set_ylabel("z (mm)")
    return figure, plots


TOOL = 100.0
"""Length of the tool that is drawn, its tip so far above the program's zero, mm."""
SHAFT = 5.0
"""Radius of that tool, mm."""
REACH = 150.0
"""The rotary axes are drawn so far to both sides of their pivots, mm."""
FRAME = 60.0
"""Length of the arrows of the part's X and Z, mm."""


def draw_machine_file(machine: Machine, file: str | Path) -> None:
    """Write the machine as seen from the front (-y) and from behind (y): what a wrong direction, pivot or part frame
    looks like. Axes of the table go through their pivots, those of a head through theirs below the nose."""
    zero = np.array(machine.part_zero)
    pose = np.eye(4)
    pose[:3, :3] = machine.in_machine(np.eye(3)).T
    pose[:3, 3] = zero
    fixed = [(name, mesh.move(pose)) for name, mesh in table_bodies(machine.table)]
    standing = np.array([[zero[0], zero[1], zero[2] + TOOL, 0.0, 0.0]])
    fixed += [(name, mesh.move(pose)) for name, mesh in link_meshes(machine, standing, TOOL)]
    nose = zero + np.array([0.0, 0.0, 2 * TOOL])
    stand = np.eye(4)
    stand[:3, 3] = nose
    tool = [("shank", bar(-TOOL, 0.0, SHAFT, SHAFT)), *_stacked("spindle", machine.nose)]
    bodies = [*fixed, *((name, mesh.move(stand)) for name, mesh in tool)]
    figure, plots = _drawn(bodies, f"{machine.title}, all axes at zero")
    for plot, side in zip(plots, SIDES_SEEN):
        # the rotary axes with their letters, and X and Z of the part
        for axis in machine.own_rotary:
            middle = np.array(axis.pivot) + (nose if axis in machine.tool_axes else 0.0)
            ends = middle + REACH * np.outer([-1.0, 1.0], axis.direction)
            plot.plot(side * ends[:, 0], ends[:, 2], "k-.", lw=1)
            plot.annotate(axis.letter, (side * ends[1, 0], ends[1, 2]))
        for letter, row in zip(("x", "z"), machine.in_machine(np.eye(3)[[0, 2]])):
            end = zero + FRAME * row
            plot.annotate(
                f"part {letter}",
                (side * zero[0], zero[2]),
                (side * end[0], end[2]),
                arrowprops={"arrowstyle": "<-", "color": "#d55e00"},
                color="#d55e00",
                fontsize="small",
            )
    top = nose[2] + stack_length(machine.nose)
    plots[0].update_datalim([[zero[0], zero[2]], [zero[0], top]])
    lay_out(figure, plots)
    save_figure(figure, file)
