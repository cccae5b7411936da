"""Picture of a machine file, all axes at zero: table, spindle nose, the rotary axes and the frame of the part."""

from pathlib import Path

import numpy as np

from bonecam.machine.frustum import stack_length
from bonecam.machine.machine import Machine
from bonecam.report.pictures.machine.bodies import bar, draw_bodies, link_meshes, table_bodies
from bonecam.report.pictures.panels import Plot, lay_out, new_figure, save_figure

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
    tool = [("shank", bar(-TOOL, 0.0, SHAFT, SHAFT))]
    height = 0.0
    for piece in machine.nose:
        tool.append(("spindle", bar(height, height + piece.length, piece.diameter / 2, piece.top_diameter / 2)))
        height += piece.length
    bodies = [*fixed, *((name, mesh.move(stand)) for name, mesh in tool)]
    figure, plots = new_figure(2)
    for plot, side in zip(plots, (1.0, -1.0)):
        draw_bodies(plot, bodies, side)
        _draw_axes(plot, machine, side, nose)
    plots[0].set_title(f"{machine.title}, all axes at zero", fontsize="small")
    plots[1].set_title("from behind", fontsize="small")
    plots[0].set_ylabel("z (mm)")
    top = nose[2] + stack_length(machine.nose)
    plots[0].update_datalim([[zero[0], zero[2]], [zero[0], top]])
    lay_out(figure, plots)
    save_figure(figure, file)


def _draw_axes(plot: Plot, machine: Machine, side: float, nose: np.ndarray) -> None:
    """The rotary axes with their letters, and X and Z of the part."""
    for axis in machine.own_rotary:
        middle = np.array(axis.pivot) + (nose if axis in machine.tool_axes else 0.0)
        ends = middle + REACH * np.outer([-1.0, 1.0], axis.direction)
        plot.plot(side * ends[:, 0], ends[:, 2], "k-.", lw=1)
        plot.annotate(axis.letter, (side * ends[1, 0], ends[1, 2]))
    zero = np.array(machine.part_zero)
    for name, row in zip(("x", "z"), machine.in_machine(np.eye(3)[[0, 2]])):
        end = zero + FRAME * row
        plot.annotate(
            f"part {name}",
            (side * zero[0], zero[2]),
            (side * end[0], end[2]),
            arrowprops={"arrowstyle": "<-", "color": "#d55e00"},
            color="#d55e00",
            fontsize="small",
        )
