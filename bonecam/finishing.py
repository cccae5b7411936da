"""One surface machined alone, such as a blade between its neighbours: read, planned, posted, read back."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from bonecam.errors import BonecamError, JobError, SurfaceError, knowing
from bonecam.files import check_files
from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.machining import check_one_feed, post_and_prove, refuse_bar
from bonecam.mechanics.loads import mechanics_of_job
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.solids import solid_union
from bonecam.mesh.triangle_mesh import MeshLike, TriangleMesh
from bonecam.nc.path_words import machine_limits
from bonecam.nc.program import program_name
from bonecam.nc.requirements import machine_and_dialect
from bonecam.pipeline import check_job
from bonecam.planning.contacts import MESH_SHARE, planned_tolerance
from bonecam.planning.post_length import surface_holding
from bonecam.planning.surface_paths import Workpiece, plan_surface, stand_workpiece
from bonecam.progress import Progress, silent
from bonecam.progress import part as part_of
from bonecam.progress import report as report_progress
from bonecam.report.outputs import File, Finished, Outputs, refusing, report_refused, with_removal, write_run
from bonecam.report.stage_reports import uncut_areas
from bonecam.report.summary import NOT_SIMULATED
from bonecam.report.typed import report_to_program
from bonecam.report.warnings import NOT_ASKED, NOT_KNOWN, header_texts, with_warnings
from bonecam.runtime.timing import StageTimes
from bonecam.surface.files.surface_input import (
    check_on_solids,
    check_outward,
    check_surface_size,
    closed_mesh,
    machined_surface,
    mesh_of_surface,
    read_solid,
    refuse_changes,
)
from bonecam.surface.skinning import blade_solid, has_blunt_edge
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import ToolPath
from bonecam.verify.proof import CHORD, prove_surface_removal
from bonecam.workholding.clamping import clamping_of

OWN_CHORD = 0.002
"""Largest chord tolerance (mm) of the solid that the surface bounds: MESH_SHARE of the gouge allowed by default."""

Solid = str | Path | MeshLike
"""A closed mesh in a file, or in memory."""


def finish(
    surface: "str | Path | MeshLike | TSpline",  # texts, as help() would write the unions out
    part: "Solid | None" = None,
    obstacles: "Sequence[Solid]" = (),
    job: Job | None = None,
    *,
    program: File = None,
    keep: File = None,
    report: File = None,
    html: File = None,
    apt: File = None,
    simulation: bool = True,
    mechanics: bool = True,
    progress: Progress = silent,
) -> Finished:
    """The verified program that machines one surface, open or closed, with the job's finishing cutter in one level.

    `surface` is a file (rows of points, STEP, IGES, `.tspline`, one that a plugin reads, an open mesh with four
    corners), such a mesh in memory, or a TSpline; its normals face outward. `part` and `obstacles` (hub, shroud,
    fixtures) are closed solids that nothing may gouge, in one frame with it and the unit `job.mesh.units`, Z the
    table's axis. One closed round s, or up to a blunt edge, bounds a solid itself; others need the part. All stands on
    the post of [holding]. The text's removal is simulated (`simulation`) from what stands before: the solids, and
    `levels.finishing_depth` of material on the surface; force and bending are asked (`mechanics`). Raises a
    BonecamError.
    """
    job = job or Job()
    machine, dialect = machine_and_dialect(job.nc)
    check_job(job, machine, dialect)
    check_one_feed(job, "a surface that is finished alone has one feed")
    refuse_bar(job, "a surface that is finished alone stands in no bar")
    if simulation and mechanics:
        mechanics_of_job(job)
    source = Path(surface) if isinstance(surface, str | Path) else None
    wanted = Outputs(program, keep, report, html=html, apt=apt, split=job.nc.is_split)
    wanted.check(source, dialect)
    solids = [solid for solid in (part, *obstacles) if solid is not None]
    check_files([program, report, html, apt], solids)
    name = str(surface) if source else "the surface"
    with report_refused(report) as times:
        shape, solid = _read(surface, name, solids, job, times, has_part=part is not None)
        with naming(name):
            workpiece, job, path = _planned(shape, solid, job, machine, times, progress=progress)
            figures = _figures(workpiece, path, job, source, len(solids))
            proved = post_and_prove(
                [path],
                machine,
                dialect,
                job,
                MeshDistance(workpiece.solid),
                name=program_name(program or source or "", dialect),
                comments=[*header_texts(figures, job), *([f"surface: {source.name}"] if source else [])],
                times=times,
                progress=part_of(progress, 0.8, 0.9),
            )
        figures |= report_to_program(program, *proved, job=job.path, part=workpiece.solid)
        figures = with_warnings({**figures, "removal": NOT_SIMULATED}, job)
        finished = Finished(workpiece, proved.program, figures, job, proved.paths[0])
        if simulation:
            finished = _simulated(finished, name, times, part_of(progress, 0.9, 1.0), mechanics=mechanics)
        finished = replace(finished, report={**finished.report, "seconds": times.seconds})
    write_run(finished, wanted)
    return finished


def _simulated(finished: Finished, name: str, times: StageTimes, progress: Progress, *, mechanics: bool) -> Finished:
    """The result with what its posted text removes from the stock before it, and what bends if `mechanics` are asked;
    VerifyError where that is not what a program may do."""
    machine, dialect = machine_and_dialect(finished.job.nc)
    text, workpiece = finished.program.text, finished.workpiece
    bodies = finished.job, workpiece.surface, workpiece.solid
    with times.stage("simulation"), refusing(finished.program, [finished.path]), knowing(finished.report), naming(name):
        removal, unknown = prove_surface_removal(text, machine, dialect, *bodies, progress, mechanics=mechanics)
        return with_removal(finished, removal, skipped={"skipped": unknown} if unknown else NOT_ASKED)


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Errors of path and program name the surface that they are about; those of the job say so themselves."""
    try:
        yield
    except JobError:
        raise
    except BonecamError as error:
        raise type(error)(f"{name}: {error}", **{"file": name, **error.evidence}) from error


def _read(
    surface: str | Path | MeshLike | TSpline,
    name: str,
    solids: Sequence[Solid],
    job: Job,
    times: StageTimes,
    *,
    has_part: bool,
) -> tuple[TSpline, TriangleMesh]:
    """The surface to machine, and the solid that must not be gouged, mm."""
    with times.stage("surface"):
        refuse_changes(job.mesh, name)
        if not isinstance(surface, TSpline):
            surface = machined_surface(surface, job.mesh.units, job.surface.tolerance_for())
        check_surface_size(surface, name)
        if not all(surface.poles):
            mesh_of_surface(surface, name)  # one that takes minutes is refused
        solid = _solid(surface, name, solids, job, has_part=has_part)
        check_on_solids(surface, solid, name)
        return surface, solid


def _solid(surface: TSpline, name: str, solids: Sequence[Solid], job: Job, *, has_part: bool) -> TriangleMesh:
    """Everything that must not be gouged: the solids, and what the surface bounds. SurfaceError where an open surface
    comes without its part, or faces inward; MeshError where a closed one cuts itself."""
    chord = min(OWN_CHORD, MESH_SHARE * planned_tolerance(job.path.gouge_tolerance))
    if all(surface.poles):
        check_outward(surface, name)
        closed_mesh(surface, name)
        own = [surface.tessellate(chord)]
    elif surface.closed_in_s or has_blunt_edge(surface):
        own = [blade_solid(surface, chord)]
    elif has_part:
        own = []
    else:
        raise SurfaceError(f"{name}: an open surface bounds no solid: give the part that it belongs to (--part)")
    names = ["the surface"] * len(own) + [_name_of(solid, number) for number, solid in enumerate(solids)]
    return solid_union([*own, *(read_solid(solid, job.mesh.units) for solid in solids)], names)


def _name_of(solid: Solid, number: int) -> str:
    """How messages name a solid: by its file, or by its place among the part and the obstacles."""
    return str(solid) if isinstance(solid, str | Path) else f"solid {number} of part and obstacles"


def _planned(
    surface: TSpline, solid: TriangleMesh, job: Job, machine: Machine, times: StageTimes, *, progress: Progress
) -> tuple[Workpiece, Job, ToolPath]:
    """The surface on its post, the job with the post's length, and the path."""
    report_progress(progress, 0.2, "planning the path")
    limits = machine_limits(machine)
    with times.stage("toolpath"):
        job = replace(job, holding=surface_holding(job.holding, surface, solid))
        workpiece = stand_workpiece(surface, solid, job, limits)
        job = replace(job, holding=replace(job.holding, length=workpiece.length))
        scene = workpiece.scene(job, clamping_of(job.holding, limits.bodies.table))
        return workpiece, job, plan_surface(workpiece, scene, job, limits)


def _figures(workpiece: Workpiece, path: ToolPath, job: Job, source: File, solids: int) -> dict[str, Any]:
    """`surface`, `post`, `mechanics` and `uncut_mm2` of the report."""
    surface = workpiece.surface
    kind = "closed" if all(surface.poles) else "closed round s" if surface.closed_in_s else "open"
    shape = {
        "file": Path(source).name if source else "",
        "control_points": len(surface.control_points),
        "kind": kind,
        "area_mm2": round(surface.area, 3),
        "solids": solids,
    }
    post = {"diameter_mm": job.holding.diameter, "length_mm": workpiece.length}
    uncut = uncut_areas([path], surface.tessellate(CHORD))
    return {"surface": shape, "post": post, "uncut_mm2": uncut, "mechanics": NOT_KNOWN}
