"""Filters of the toolpath and orientation stages: five-axis paths on the levels. Stages are imported when a
filter runs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bonecam.filters.filter import Filter
from bonecam.filters.layers import Layers
from bonecam.filters.parameter import parameters_of, section_of
from bonecam.job import FINISHING, ROUGHING, MaterialJob, NcJob, PathJob
from bonecam.progress import Progress
from bonecam.toolpath.path import Kind as MoveKind
from bonecam.toolpath.path import ToolPath

CATEGORY = "Bonecam: Tool Paths"


def plan_toolpath(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `generate_toolpath`: a polyline layer of the tip for each level."""
    from bonecam.levels.closed_morph import Morph
    from bonecam.nc.kinematics import axis_limits
    from bonecam.nc.machine import read_machine
    from bonecam.nc.requirements import check_tools
    from bonecam.orientation.level_paths import plan_paths
    from bonecam.setup.stock import Stock

    morph = layers.kept("morph", Morph, "generate_morph_levels")
    stock = layers.kept("stock", Stock, "generate_stock")  # type: ignore[type-abstract]
    job = replace(
        layers.job(),
        path=section_of(PathJob(), values),
        material=section_of(MaterialJob(), values, prefix="material_"),
        roughing=section_of(ROUGHING, values, prefix="roughing_"),
        finishing=section_of(FINISHING, values, prefix="finishing_"),
        nc=replace(layers.job().nc, machine=values["machine"]),
    )
    machine = read_machine(job.nc.machine)
    check_tools(job, machine)
    paths = plan_paths(morph.levels, stock, job, axis_limits(machine), machine.bodies, progress)
    source = layers.meshset.current_mesh_id()
    for path in paths:
        layers.select(source)
        add_path(layers, path)
    layers.select(source)
    layers.keep(toolpath=paths, job=job)
    return {
        "levels": np.array([path.level for path in paths]),
        "moves": np.array([len(path.tips) for path in paths]),
        "uncut_contacts": np.array([len(path.uncut) for path in paths]),
    }


def add_path(layers: Layers, path: ToolPath) -> None:
    """The way of the cutter's tip on one level as a polyline layer; quality 0 cut, 1 link, 2 rapid."""
    count = len(path.tips)
    edges = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    layers.add_polyline(
        np.asarray(path.tips), edges, f"toolpath_{path.level:02d}", np.asarray(path.kinds, dtype=np.float64)
    )


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
            *parameters_of(ROUGHING, prefix="roughing_"),
            *parameters_of(FINISHING, prefix="finishing_"),
            *parameters_of(NcJob(), only=("machine",)),
        ),
        plan_toolpath,
        after=("generate_stock", "compute_tspline_surface", "generate_morph_levels"),
        references=(
            "Gan, Fu, Shen, Lin: A morphing machining strategy for artificial bone. JZUS-A 2014, "
            "doi:10.1631/jzus.A1300274, section 4.3",
        ),
    ),
)
