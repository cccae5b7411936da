"""The flow: mesh -> setup -> surface -> levels -> planning -> nc -> verify -> report.

All stages work in one frame, mm: the part's long axis is +Z, the table is z = 0 and is the program's zero,
the post stands on it.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path

from bonecam.errors import knowing
from bonecam.job import Job
from bonecam.job.tool_list import read_tool_list
from bonecam.machine.machine import Machine
from bonecam.machining import Posting, check_force_asked, machine_levels, morph_standing, post_by_force, stand_part
from bonecam.mechanics.loads import mechanics_of_job
from bonecam.mesh.triangle_mesh import MeshLike, TriangleMesh, mesh_from
from bonecam.nc.dialect import Dialect
from bonecam.nc.requirements import check_reach, check_table, check_tools, job_dialect, machine_and_dialect, second_job
from bonecam.plugins import added_figures, check_added
from bonecam.progress import Progress, part, silent
from bonecam.report import warnings
from bonecam.report.kept import Morphed, Result
from bonecam.report.outputs import File, Outputs, keep_refused, refusing, report_refused, with_removal
from bonecam.second_clamping import check_shell_files, check_simulated, second_program, whole_job, with_second
from bonecam.setup.placement import with_stock
from bonecam.setup.stock import Stock, check_sizes
from bonecam.tool.cutter import check_depths
from bonecam.verify.control import check_posting
from bonecam.verify.findings import given_surface
from bonecam.verify.removal import prove_removal


def convert(
    mesh: "str | Path | MeshLike",  # a text, as help() would write the union out
    job: Job | None = None,
    *,
    stock: "Stock | MeshLike | None" = None,
    program: File = None,
    keep: File = None,
    report: File = None,
    surface: File = None,
    html: File = None,
    sheet: File = None,
    apt: File = None,
    whole: bool = False,
    simulation: bool = True,
    mechanics: bool = True,
    progress: Progress = silent,
) -> Result:
    """The verified NC program of a part: all stages from the mesh to the proof.

    `mesh` is a file, or a mesh in memory in the unit `job.mesh.units`: (vertices, faces), a TriangleMesh, or a
    mesh of open3d, trimesh or pymeshlab. The `stock` of the job may be given as an object: a Capsule, Cylinder, Box or
    ConvexStock of `bonecam.setup`, or a closed convex mesh in mm, upright along Z wherever it lies. The files
    `program`, `report` and `surface` (its ending says its kind), the page `html`, the setup `sheet`, the path `apt` and
    the folder `keep` are written at the end, together; a second clamping has a program, page and path of its own
    (bone.second.h). A run that is refused writes its `report` as far as it came, with `refused`, and to `keep` only a
    level that fails its check, or the program that its proof refuses. A part that is made `whole` is parted, and a
    second program cuts the stump off it in a shell, which is made, searched for its height, and written beside the
    program before anything is planned: bone.shell.stl where it stands, in frame and unit of the part's file, and
    bone.shell.print.stl and .3mf to print, mm. Without `simulation` the
    removal of material is not simulated from the posted text, without `mechanics` force and bending are not asked.
    Raises a BonecamError that names the trouble and the remedy.
    """
    job, body = with_stock(_require_job(job), stock)
    job = whole_job(job, program) if whole else job
    machine, dialect = machine_and_dialect(job.nc)
    check_job(job, machine, dialect)
    check_reach(job, machine)
    check_simulated(job, simulation=simulation)
    if simulation and mechanics:
        mechanics_of_job(job)
    check_force_asked(job, asked=simulation and mechanics)
    outputs = Outputs(
        program,
        keep,
        report=report,
        surface=surface,
        html=html,
        sheet=sheet,
        apt=apt,
        second=bool(job.holding.second),
        split=job.nc.is_split,
        probe=job.nc.probe,
    )
    given, source = _given(mesh)
    outputs.check(source, dialect)
    if whole:
        check_shell_files(Path(job.holding.second), [source, program])
    with report_refused(report) as times:
        stand = partial(stand_part, given, machine=machine, times=times, progress=part(progress, 0.0, 0.03), body=body)
        share = part(progress, 0.03, 0.1)
        standing = with_second(stand, job, machine, times, share, whole=whole, mechanics=mechanics)
        morphed = morph_standing(standing, keep, times, part(progress, 0.1, 0.3))
        with keep_refused(morphed, keep, times):
            posting = Posting(machine, dialect, source, program, times)
            result = _program_of(morphed, posting, part(progress, 0.3, 0.97), simulation, mechanics=mechanics)
    with times.stage("files"):
        outputs.write(result, part(progress, 0.97, 1.0))
    return result


def morph_levels(
    mesh: "str | Path | MeshLike",  # a text, as help() would write the union out
    job: Job | None = None,
    *,
    stock: "Stock | MeshLike | None" = None,
    keep: File = None,
    report: File = None,
    surface: File = None,
    html: File = None,
    progress: Progress = silent,
) -> Morphed:
    """The measured levels of a part: the stages of `convert` from the mesh to the levels, for any machine.

    `mesh`, `job`, `stock`, `keep`, `report`, `surface` and `html` are those of `convert`.
    """
    job, body = with_stock(_require_job(job), stock)
    job = job.with_values(path={"strategy": "morph"})
    check_parts(job)
    outputs = Outputs(keep=keep, report=report, surface=surface, html=html)
    given, source = _given(mesh)
    outputs.check(source)

    with report_refused(report) as times:
        standing = stand_part(given, job, machine=None, times=times, progress=part(progress, 0.0, 0.1), body=body)
        morphed = morph_standing(standing, keep, times, part(progress, 0.1, 0.95))
    with times.stage("files"):
        outputs.write(morphed, part(progress, 0.95, 1.0))
    return morphed


def check_job(job: Job, machine: Machine, dialect: Dialect) -> None:
    """JobError where sizes, cutters and depths do not fit one another or the machine, or the list of cutters or what
    was added cannot be read; MachineError where no program can be written for the machine in the dialect."""
    read_tool_list(job.nc.tools)
    check_sizes(job.stock)
    check_parts(job)
    check_tools(job, machine)
    check_table(job, machine)
    check_depths(job)
    check_posting(job, machine, dialect)
    if job.holding.second:
        second_job(job)
    warnings.check_warnings(warnings.spindle_warnings(job, machine), job)


def check_parts(job: Job) -> None:
    """JobError where a part of the flow that a job chooses was added and cannot be loaded."""
    path, levels = job.path, job.levels
    check_added("strategies", path.strategy)
    check_added("patterns", path.pattern)
    check_added("orientations", path.orientation)
    check_added("methods", levels.method)
    check_added("solvers", levels.solver)


def _program_of(morphed: Morphed, posting: Posting, progress: Progress, simulation: bool, *, mechanics: bool) -> Result:
    """The program of the levels and its proof, its simulation if that is wanted, and the second clamping's program, if
    the job has one."""
    job, times = morphed.job, posting.times
    constant = replace(morphed, job=replace(job, path=replace(job.path, feed="constant")))
    result = machine_levels(constant, posting, part(progress, 0.0, 0.75))
    feed = None
    if job.path.feed == "force":
        result, feed = post_by_force(result, posting, part(progress, 0.75, 0.82))
    if simulation:
        share = part(progress, 0.82, 0.9)
        with times.stage("simulation"), refusing(result.program, result.paths), knowing(result.report):
            given = given_surface(result.part, result.job, result.report)
            stands = result.job, result.stock, result.levels.levels
            cut = result.program.text, posting.machine, posting.dialect, *stands
            removal = prove_removal(*cut, share, given, mechanics=mechanics)
            reported = {"feed": feed(removal, result.program.time_min)} if feed else {}
            result = with_removal(result, removal, reported)
    if job.holding.second:
        share = part(progress, 0.9, 1.0)
        with times.stage("second"), knowing(result.report, part="second"):
            dialect = job_dialect(second_job(job).nc)
            second = second_program(result, posting.machine, dialect, posting.file, share, mechanics=mechanics)
            result = replace(result, second=second, report={**result.report, "second": second.report})
    added = added_figures(result)
    return replace(result, report={**result.report, "added": added}) if added else result


def _require_job(job: Job | None) -> Job:
    if not isinstance(job, Job | None):
        raise TypeError(f"job {job!r}: give a bonecam.Job, such as bonecam.read_job(file)")
    return job or Job()


def _given(mesh: str | Path | MeshLike) -> tuple[str | Path | TriangleMesh, File]:
    """The part as a file or a TriangleMesh, and the file if it is one."""
    return (mesh, mesh) if isinstance(mesh, str | Path) else (mesh_from(mesh), None)
