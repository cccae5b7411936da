"""Filters of the levels stage: stock and morph levels. Stages are imported when a filter runs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from bonecam_plugins.meshlab.filter import Filter, FilterParameter, Kind, parameters_of, section_of
from bonecam_plugins.meshlab.layers import Layers

from bonecam.errors import LevelError, StockError, ToolPathError
from bonecam.job import HoldingJob, LevelsJob, StockJob
from bonecam.levels.measure import Level
from bonecam.levels.problem import DEPTH_TOLERANCE, NESTING_TOLERANCE
from bonecam.progress import Progress
from bonecam.surface.tspline import TSpline

CATEGORY = "Bonecam: Stock and Levels"
POST = HoldingJob(diameter=4.0)
"""Defaults of the post's parameters, as published: scripts that do not name it stand on the table with it."""

STANDING = (*parameters_of(POST, prefix="post_"), *parameters_of(LevelsJob(), only=("chord_tolerance",)))
"""The parameters of what stands on its post."""


def generate_stock(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filters `generate_stock` and `generate_stock_capsule`: layers of the stock and of the part on its
    post."""
    from bonecam.machine.machine import read_machine
    from bonecam.mesh.part import Part
    from bonecam.nc.path_words import machine_limits
    from bonecam.planning.neck import find_standing
    from bonecam.setup.placement import place
    from bonecam.setup.stock import stock_figures

    job = replace(layers.job(), stock=section_of(StockJob(), values), holding=section_of(POST, values, prefix="post_"))
    mesh = layers.bone()
    try:
        placed = place(Part(mesh, layers.name, len(mesh.faces), "mm", (), np.eye(4), mesh), job)
    except (StockError, ToolPathError) as error:
        raise type(error)(
            f"{error} (stock and post stand on the Z axis: was apply_upright_pose applied?)", **error.evidence
        ) from error
    setup, job, _ = find_standing(placed, job, machine_limits(read_machine(job.nc.machine)))
    kept = {"stock": setup.stock, "job": job}
    layers.add(setup.stock.mesh(values["chord_tolerance"]), "stock", keep=kept)
    layers.add(setup.part.mesh, "part on post", keep=kept)
    return {**stock_figures(setup.stock), "transform": np.asarray(setup.part.transform)}


def morph_levels(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `generate_morph_levels`: a layer for each level, coloured by the depth of its cut."""
    from bonecam.levels.job_levels import make_levels
    from bonecam.levels.measure import step_depths
    from bonecam.setup.stock import Stock

    surface = layers.kept("surface", TSpline, "compute_tspline_surface")
    stock = layers.kept("stock", Stock, "generate_stock")  # type: ignore[type-abstract]
    job = replace(layers.job(), levels=section_of(LevelsJob(), values))
    morph = make_levels(surface, stock, job, progress)
    source = layers.meshset.current_mesh_id()
    kept = {"morph": morph, "job": job}
    part = source
    deepest = max(level.limit for level in morph.levels)
    for level, depth in zip(morph.levels, step_depths(morph.levels), strict=True):
        layers.select(source)
        own = {"level": level} if level.surface is None else {"level": level, "surface": level.surface}
        key = layers.add(level.mesh, f"level_{level.index:02d}", quality=depth, keep={**kept, **own}, largest=deepest)
        part = key if level.index == 0 else part
    layers.select(part)
    whole = {
        "cuts": morph.cuts,
        "levels_lower_bound": morph.lower_bound,
        "depth_used": morph.depth_used,
        "levels_break_mm": morph.breaks,
    }
    return {**whole, **figures(morph.levels)}


def level_check(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `compute_level_check`: LevelError where a level exceeds a tolerance, else what was measured."""
    from bonecam.levels.sequences import Morph

    levels = layers.kept("morph", Morph, "generate_morph_levels").levels
    for level in levels[1:]:
        deep = level.deepest <= level.limit + values["depth_tolerance"]
        nested = level.nesting_min >= -values["nesting_tolerance"]
        if not (deep and nested and level.measures.self_intersections == 0):
            raise LevelError(
                f"level {level.index}: depth {level.deepest:.4f} of {level.limit:g} mm, nesting "
                f"{level.nesting_min:.4f} mm, "
                f"{level.measures.self_intersections} self-intersections: lower the stiffness or the depth",
                level=level.index,
            )
    return figures(levels)


def figures(levels: Sequence[Level]) -> dict[str, Any]:
    """The measures of the report as arrays over the levels, NaN where a level has none."""
    from bonecam.report.stage_reports import levels_report

    rows = levels_report(levels)
    columns = {
        name: [row[name] for row in rows] for name in rows[0] if name not in ("index", "depth_shares", "not_certified")
    }
    return {name: np.array(values, dtype=np.float64 if None in values else None) for name, values in columns.items()}


FILTERS = (
    Filter(
        "generate_stock_capsule",
        "Generate Stock Capsule",
        "The capsule the part is cut from, given or found round it (of those little larger than the "
        "smallest the one with the fewest "
        "cuts), standing on its post: adds the stock and the part moved onto the post (program zero is "
        "the table, z = 0) as layers. "
        "The part's layer becomes the current one and keeps the stock.",
        CATEGORY,
        (*parameters_of(StockJob(), only=("diameter", "length", "allowance", "spare_volume")), *STANDING),
        generate_stock,
    ),
    Filter(
        "generate_stock",
        "Generate Stock",
        "What the part is cut from: a capsule, a cylinder or box bar, or any closed convex mesh, given "
        "or found round the "
        "part, which may lie anywhere in it. Adds the stock and the part moved onto its post (program "
        "zero is the table, z = 0) as "
        "layers. The part's layer becomes the current one and keeps the stock.",
        CATEGORY,
        (*parameters_of(StockJob()), *STANDING),
        generate_stock,
    ),
    Filter(
        "generate_morph_levels",
        "Generate Morph Levels",
        "Morphs the T-spline into the stock in levels that keep their cutting depth, lie inside the "
        "stock and enclose one another; adds "
        "them as layers level_00 (the part) ... level_K (the stock), coloured by depth on one scale. "
        "Layer level_00 becomes the "
        "current one. The stock is that of generate_stock or generate_stock_capsule. By default their "
        "quadratic programs "
        "are solved by ADMM.",
        CATEGORY,
        parameters_of(LevelsJob()),
        morph_levels,
        after=("generate_stock", "compute_tspline_surface"),
        references=(
            "Gan, Fu, Shen, Lin: A morphing machining strategy for artificial bone. JZUS-A 2014, "
            "doi:10.1631/jzus.A1300274, section 4.2",
            "Boyd et al.: Distributed optimization and statistical learning via ADMM. Found. Trends "
            "Mach. Learn. 3 (2011).",
        ),
    ),
    Filter(
        "compute_level_check",
        "Compute Level Check",
        "Depth, nesting and self-intersections of every level as measured on its tessellation; a level "
        "beyond the tolerance is an error.",
        CATEGORY,
        (
            FilterParameter(
                "depth_tolerance",
                Kind.LENGTH,
                DEPTH_TOLERANCE,
                "Depth",
                "Allowed beyond the depth.",
                "mm",
                low=0.0,
                high=1.0,
            ),
            FilterParameter(
                "nesting_tolerance",
                Kind.LENGTH,
                NESTING_TOLERANCE,
                "Nesting",
                "Allowed overlap of levels.",
                "mm",
                low=0.0,
                high=1.0,
            ),
        ),
        level_check,
        after=("generate_stock", "compute_tspline_surface", "generate_morph_levels"),
    ),
)
