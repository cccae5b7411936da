"""A wheel for people: the sections of its report, the whole in a few lines, and all that a page shows of it."""

from collections.abc import Mapping, Sequence
from typing import Any

from bonecam.errors import counted
from bonecam.job import Job
from bonecam.levels.sequences.begun_morph import Morph
from bonecam.machine.machine import read_machine
from bonecam.mesh.triangle_mesh import TriangleMesh, side_by_side
from bonecam.nc.job_dialect import job_dialect
from bonecam.report.mechanics_lines import mechanics_lines, post_lines
from bonecam.report.page.packing import Contents
from bonecam.report.page.program_contents import program_contents
from bonecam.report.page.shape_contents import bodies
from bonecam.report.stage_reports import levels_report, uncut_areas
from bonecam.report.summary import program_lines, removal_lines
from bonecam.report.warnings import warning_lines
from bonecam.setup.turned_blank import TurnedBlank
from bonecam.surface.blades.wheel import Wheel, repeated
from bonecam.tool.path import ToolPath
from bonecam.verify.removal.proofs.of_wheel import wheel_surfaces
from bonecam.verify.removal.result import Removal

CHORD = 0.01
"""Chord tolerance of the blade on which uncut areas are told, mm."""


def bladed_summary(report: Mapping[str, Any]) -> str:
    """Wheel, blank, channels, program and removal."""
    wheel = report["wheel"]
    seconds = sum(report["seconds"].values())
    area = report["surface"]["area_mm2"]
    levels = report["levels"]
    deepest = max(row[depth] for row in levels for depth in ("depth_max_mm", "depth_back_max_mm"))
    bound = f"no schedule needs fewer than {report['levels_lower_bound']}"
    lines = [
        *warning_lines(report["warnings"]),
        f"wheel     {wheel['blades']} blades, {wheel['gap_mm']:.2f} mm apart; {area:.0f} mm2 with the hub",
        f"blank     turned to the blades' tips, diameter {wheel['blank_diameter_mm']:.2f} mm",
        *post_lines(report["post"]),
        f"channels  {counted(len(levels) - 1, 'cut')}, {bound}; depth max {deepest:.4f} mm",
        *program_lines(report),
        *removal_lines(report["removal"]),
        *mechanics_lines(report.get("mechanics")),
        f"time      {seconds:.1f} s",
    ]
    return "\n".join(lines)


def wheel_figures(
    name: str, wheel: Wheel, blank: TurnedBlank, morph: Morph, job: Job, paths: Sequence[ToolPath]
) -> dict[str, Any]:
    """`surface` (blades and the hub between them), `wheel`, `levels`, `post` and `uncut_mm2` of the report."""
    blade = wheel.blade
    gap, place = wheel.gap()
    blade_mesh = blade.tessellate(CHORD)
    whole = repeated(side_by_side([blade_mesh, morph.levels[0].mesh]), wheel.count)
    shape = {
        "file": name,
        "control_points": len(blade.control_points),
        "kind": "closed round s",
        "area_mm2": round(whole.area, 3),
        "solids": len(wheel.others),
    }
    about = {
        "blades": wheel.count,
        "gap_mm": round(gap, 3),
        "blunt_edge_mm": round(wheel.edge, 3),
        "gap_place": [round(float(x), 3) for x in place],
        "blank_diameter_mm": round(blank.diameter, 3),
        "blank_profile_mm": blank.profile.round(4).tolist(),
    }
    return {
        "surface": shape,
        "wheel": about,
        "levels": levels_report(morph.levels),
        "levels_lower_bound": morph.lower_bound,
        "post": {"diameter_mm": job.holding.diameter, "length_mm": job.holding.length},
        "uncut_mm2": uncut_areas(paths, whole),
    }


def wheel_contents(
    solid: TriangleMesh,
    blank: TurnedBlank,
    morph: Morph,
    wheel: Wheel,
    paths: Sequence[ToolPath],
    program: str,
    job: Job,
    report: dict[str, Any],
    removal: Removal | None,
    version: str,
) -> Contents:
    """The wheel as level 0, the levels of all its channels, and the program's moves."""
    machine = read_machine(job.nc.machine)
    meshes = wheel_surfaces(wheel, solid, morph.levels)
    followed = {index: mesh for index, mesh in meshes.items() if index < max(meshes)}
    posted = program_contents(
        program, meshes, job, machine, job_dialect(job.nc), paths=paths, removal=removal, surfaces=followed
    )
    posted.facts["program"]["time"] = report["nc"]["time_texts"][0]
    levels = [
        {"index": level.index, "name": _name(level.index), "faces": f"faces_{level.index}", "limit": level.limit}
        for level in morph.levels
    ]
    facts = {
        "levels": levels,
        "name": report["surface"]["file"],
        "stock": {"text": blank.text},
        "stock_bounds": blank.mesh.bounds.tolist(),
        "post": {"radius": job.holding.diameter / 2, "top": float(solid.bounds[0, 2])},
        **bodies(job, machine.table),
        "report": report,
        "summary": bladed_summary(report),
        "version": version,
    }
    arrays = {"solid": solid.vertices, "solid_faces": solid.faces}
    for index, mesh in meshes.items():
        arrays |= {f"level_{index}": mesh.vertices, f"faces_{index}": mesh.faces}
    return Contents({**facts, **posted.facts}, {**arrays, **posted.arrays})


def _name(index: int) -> str:
    return "channel" if index else "the wheel"
