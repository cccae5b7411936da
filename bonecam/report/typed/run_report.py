"""The report of a run, section by section, as --report writes it."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bonecam.job import HoldingJob, Job, PathJob
from bonecam.levels.sequences.begun_morph import Morph
from bonecam.mesh.part import Part
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.program import Program
from bonecam.report.stage_reports import levels_report, nc_report, parting_report, surface_report, toolpath_report
from bonecam.setup.stock import Stock, stock_figures
from bonecam.surface.fitting.deviation import distance_both_ways
from bonecam.surface.fitting.fit import Fit
from bonecam.tool.path import PARTING, ToolPath
from bonecam.verify.proof import Verification
from bonecam.workholding.clamping import holding_columns
from bonecam.workholding.post import Post, footprint


def report_text(report: Mapping[str, Any]) -> str:
    """The text of a report's file."""
    return json.dumps(report, indent=2) + "\n"


def input_report(part: Part) -> dict[str, Any]:
    """The section `input`: the part's mesh, and what was changed of it."""
    return {
        "file": part.file,
        "faces": part.faces,
        "units": part.units,
        "notes": list(part.notes),
        "repairs": [str(each) for each in part.repairs],
        "repair_steps": [each.report for each in part.repairs],
        "facets": part.coarseness.report if part.coarseness else None,
        "smoothed": part.smoothing.report if part.smoothing else None,
        "filled": part.fill.report if part.fill else None,
        "area_mm2": round(part.mesh.area, 3),
        "hole_max_mm": round(part.widest_hole, 6),
        "guessed_share": round(part.guessed_share, 6),
        "repair_taken_off_max_mm": round(part.taken_off.depth if part.taken_off else 0.0, 6),
        "repair_deviation_max_mm": round(part.repair_deviation, 6),
    }


def report_to_levels(part: Part, fitted: Fit, stock: Stock, morph: Morph, job: Job) -> dict[str, Any]:
    """The sections of input, surface, stock and levels."""
    why = job.surface.tolerance_why(part.sagitta, fitted.tolerance)
    return {
        "input": input_report(part),
        "surface": {**surface_report(fitted), "tolerance_why": why, **_given_report(part, fitted)},
        "stock": stock_figures(stock),
        "levels": levels_report(morph.levels),
        "levels_lower_bound": morph.lower_bound,
        "levels_break_mm": round(morph.breaks, 6),
        "levels_method": job.levels.method,
    }


def _given_report(part: Part, fitted: Fit) -> dict[str, float]:
    """How far the surface and the mesh as given are from each other; where nothing was repaired or filled that
    is the deviation of the fit."""
    deviation = fitted.deviation
    surface_to_given = deviation.surface_to_mesh_max
    given_to_surface = deviation.mesh_to_surface_max
    if part.repairs:
        surface_to_given, given_to_surface = distance_both_ways(fitted.surface, part.placed_given)
    return {
        "given_deviation_max_mm": round(max(surface_to_given, given_to_surface), 6),
        "surface_to_given_max_mm": round(surface_to_given, 6),
        "given_to_surface_max_mm": round(given_to_surface, 6),
    }


def post_report(post: Post, part: TriangleMesh, job: HoldingJob) -> dict[str, Any]:
    """`post` of the report: its sizes, `length_mm` from the table and `neck_mm` above what holds it, the columns below
    it, and the area of the part that stays under it; `tailstock` likewise, if there is one."""
    sizes: dict[str, Any] = {"diameter_mm": job.diameter, "length_mm": job.length}
    held = {
        name: {"diameter_mm": 2 * column.radius, "from_mm": column.bottom, "to_mm": column.top}
        for name, column in holding_columns(job).items()
    }
    if held:
        sizes |= {"neck_mm": job.length - job.support_height, "held_by": held}
    if post.pin is not None:
        # Pin or upper neck: `at_mm` from the axis of the post, between two heights, and the area of the part that
        # stays under it; and the bracket's column and arm
        sizes["tailstock"] = {
            "kind": job.tailstock,
            "diameter_mm": 2 * post.pin.radius,
            "at_mm": [round(post.pin.x, 3), round(post.pin.y, 3)],
            "from_mm": round(post.pin.bottom, 3),
            "to_mm": round(post.pin.top, 3),
            "footprint_mm2": round(footprint(post.pin, part), 2),
            "reach_mm": job.tailstock_reach,
            "azimuth_deg": job.tailstock_azimuth_deg,
            "column_mm": job.tailstock_column,
            "arm_mm": job.tailstock_arm,
        }
    return {**sizes, "footprint_mm2": round(footprint(post.column, part), 2)}


def report_to_program(
    file: str, paths: Sequence[ToolPath], program: Program, proof: Verification, job: PathJob, part: TriangleMesh
) -> dict[str, Any]:
    """The sections of tool paths, of the parting groove of the `part` if there is one, and of the program; `file` is
    the program's, empty where none is written."""
    on_levels = [path for path in paths if path.level != PARTING]
    reported = toolpath_report(on_levels, float(np.radians(job.least_lead_deg)))
    posted = {"file": file, **nc_report(program, proof)}
    return {"toolpath": reported, **parting_report(paths, part), "nc": posted}
