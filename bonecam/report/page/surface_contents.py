"""All that a page shows of one surface machined alone."""

from typing import Any

from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.job_dialect import job_dialect
from bonecam.report.page.packing import Contents
from bonecam.report.page.program_contents import program_contents
from bonecam.report.page.shape_contents import bodies
from bonecam.report.summary import finished_summary
from bonecam.tool.path import ToolPath
from bonecam.verify.removal.result import Removal


def surface_contents(
    surface: TriangleMesh,
    solid: TriangleMesh,
    path: ToolPath,
    program: str,
    job: Job,
    report: dict[str, Any],
    version: str,
    removal: Removal | None = None,
) -> Contents:
    """The surface, the solid that is kept free of gouges, and the program's moves, with what they remove if that was
    simulated."""
    machine = read_machine(job.nc.machine)
    meshes = {0: surface, 1: solid}
    dialect = job_dialect(job.nc)
    shown = {0: surface}
    posted = program_contents(program, meshes, job, machine, dialect, paths=[path], removal=removal, surfaces=shown)
    posted.facts["program"]["time"] = report["nc"]["time_texts"][0]
    figures = report["surface"]
    facts = {
        "levels": [{"index": 0, "name": "the surface", "faces": "faces_0", "limit": 0.0}],
        "name": figures["file"] or "a surface",
        "stock": {"text": f"surface {figures['kind']}, {figures['area_mm2']:.0f} mm\u00b2"},
        "stock_bounds": surface.bounds.tolist(),
        "post": {"radius": job.holding.diameter / 2, "top": float(solid.bounds[0, 2])},
        **bodies(job, machine.table),
        "report": report,
        "summary": finished_summary(report),
        "version": version,
    }
    arrays = {
        "level_0": surface.vertices,
        "faces_0": surface.faces,
        "solid": solid.vertices,
        "solid_faces": solid.faces,
    }
    return Contents({**facts, **posted.facts}, {**arrays, **posted.arrays})
