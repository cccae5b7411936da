"""Filters of the toolpath and orientation stages: five-axis paths on the levels. Stages are imported when a
filter runs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from bonecam_plugins.meshlab.filter import Filter, FilterParameter, Kind, parameters_of, section_of
from bonecam_plugins.meshlab.layers import Layers

from bonecam.errors import FilterError
from bonecam.job import MaterialJob, NcJob, PathJob, ToolJob
from bonecam.progress import Progress
from bonecam.tool.path import MoveKind

CATEGORY = "Bonecam: Tool Paths"
ROUGH = ToolJob()
FINISH = ToolJob(radius=1.0, flute_length=4.0, shank_diameter=2.0, overhang=25.0, scallop=0.01)
"""Defaults of the cutters' parameters, as published: scripts that name some of them mean the others so."""


def plan_toolpath(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `generate_toolpath`: a polyline layer of the tip for each level."""
    from bonecam.levels.sequences import Morph
    from bonecam.machine.machine import read_machine
    from bonecam.nc.path_words import machine_limits
    from bonecam.nc.requirements import check_tools
    from bonecam.planning.levels import plan_paths
    from bonecam.setup.stock import Stock

    morph = layers.kept("morph", Morph, "generate_morph_levels")
    stock = layers.kept("stock", Stock, "generate_stock")  # type: ignore[type-abstract]
    job = replace(
        layers.job(),
        path=section_of(PathJob(), values),
        material=section_of(MaterialJob(), values, prefix="material_"),
        roughing=section_of(ROUGH, values, prefix="roughing_"),
        finishing=section_of(FINISH, values, prefix="finishing_"),
        nc=replace(layers.job().nc, machine=values["machine"]),
    )
    machine = read_machine(job.nc.machine)
    check_tools(job, machine)
    paths = plan_paths(morph.levels, stock, job, machine_limits(machine), progress)
    source = layers.meshset.current_mesh_id()
    for path in paths:
        layers.select(source)
        # the way of the tip as a polyline; quality 0 cut, 1 link, 2 rapid
        count = len(path.tips)
        edges = np.column_stack([np.arange(count - 1), np.arange(1, count)])
        kinds = np.asarray(path.kinds, dtype=np.float64)
        layers.add_polyline(np.asarray(path.tips), edges, f"toolpath_{path.level:02d}", kinds)
    layers.select(source)
    layers.keep(toolpath=paths, job=job)
    return {
        "levels": np.array([path.level for path in paths]),
        "moves": np.array([len(path.tips) for path in paths]),
        "uncut_contacts": np.array([len(path.uncut) for path in paths]),
    }


def draw_cones(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `generate_axis_cones`: a layer of the cones of some contacts of a level."""
    from bonecam.planning.axes.cones import cones_mesh

    paths = layers.kept("toolpath", tuple, "generate_toolpath")
    found = [path for path in paths if path.level == values["level"] and not path.rest]
    if not found:
        last = max(path.level for path in paths)
        raise FilterError(f"level = {values['level']} has no path: give 0 to {last}", level=values["level"])
    mesh = cones_mesh(found[0], values["count"], values["length"])
    layers.add(mesh, f"cones_{values['level']:02d}")
    return {"half_angles_deg": np.degrees(found[0].cones.shapes.angles)}


MOVES = ", ".join(f"{kind.value} {kind.name.lower()}" for kind in MoveKind)

FILTERS = (
    Filter(
        "generate_toolpath",
        "Generate Tool Path",
        "Five-axis paths on every level from the stock inwards: passes with the exact side step for the "
        "scallop limit, smooth tool axes "
        "inside collision-free cones and the machine's limits, links clear of the stock. Adds the path "
        "of the tip on each level as a "
        f"polyline layer toolpath_NN with the kind of each move as quality ({MOVES}). What stays "
        "unreachable is left uncut and counted.",
        CATEGORY,
        (
            *parameters_of(PathJob()),
            *parameters_of(MaterialJob(), prefix="material_"),
            *parameters_of(ROUGH, prefix="roughing_", without=("preset",)),
            *parameters_of(FINISH, prefix="finishing_", without=("preset",)),
            *parameters_of(NcJob(), only=("machine",)),
        ),
        plan_toolpath,
        after=("generate_stock", "compute_tspline_surface", "generate_morph_levels"),
        references=(
            "Gan, Fu, Shen, Lin: A morphing machining strategy for artificial bone. JZUS-A 2014, "
            "doi:10.1631/jzus.A1300274, section 4.3",
        ),
    ),
    Filter(
        "generate_axis_cones",
        "Generate Axis Cones",
        "The cones of free tool axes of some contacts of a level as a layer cones_NN: within each the tool is proven "
        "free of part, standing stock, post, chuck and table. The apex is the ball's centre. half_angles_deg are those "
        "of all cones of the level.",
        CATEGORY,
        (
            FilterParameter("level", Kind.INT, 0, "Level", "The level; 0 is the part.", low=0, high=999),
            FilterParameter("count", Kind.INT, 100, "Cones", "Cones drawn at most.", low=1, high=20000),
            FilterParameter("length", Kind.LENGTH, 3.0, "Length", "Length along the axis.", "mm", 0.1, 50.0),
        ),
        draw_cones,
        after=("generate_stock", "compute_tspline_surface", "generate_morph_levels", "generate_toolpath"),
        references=(
            "Xu, Zhang, Tan, Liu: Collisionless tool orientation smoothing above blade stream surface using NURBS "
            "envelope. JZUS-A 2013, doi:10.1631/jzus.A1200160, section 3",
        ),
    ),
)
