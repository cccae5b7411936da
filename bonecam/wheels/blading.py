"""A wheel machined from its turned blank: the channels between its blades level by level, the hub, and the blades."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bonecam.errors import knowing
from bonecam.files import check_files
from bonecam.finishing import Solid, naming
from bonecam.job import Job
from bonecam.levels import morph_open
from bonecam.machine import Machine
from bonecam.machining import check_one_feed, post_and_prove, refuse_bar
from bonecam.mechanics.loads import mechanics_of_job
from bonecam.mesh import MeshDistance
from bonecam.nc import Dialect, machine_limits
from bonecam.nc.program import program_name
from bonecam.nc.requirements import machine_and_dialect
from bonecam.pipeline import check_job
from bonecam.planning.contacts import MESH_SHARE, planned_tolerance
from bonecam.planning.post_length import surface_holding
from bonecam.planning.surface_paths import plan_surface, stand_workpiece
from bonecam.progress import Progress, silent
from bonecam.progress import part as part_of
from bonecam.progress import report as report_progress
from bonecam.report.outputs import File, Outputs, refusing, report_refused, with_removal, write_run
from bonecam.report.summary import NOT_SIMULATED
from bonecam.report.typed import report_to_program
from bonecam.report.warnings import NOT_KNOWN, header_texts, with_warnings
from bonecam.runtime.timing import StageTimes
from bonecam.setup import schedule_of, smallest_capsule
from bonecam.surface import TSpline
from bonecam.surface.files.surface_input import check_surface_size, read_solid, refuse_changes
from bonecam.wheels.channels import ChannelPlanner, indexed, require_room, require_upright
from bonecam.wheels.proof import RepeatedDistance, prove_removal_of_wheel, wheel_surfaces
from bonecam.wheels.results import Bladed, edge_warnings, wheel_figures
from bonecam.wheels.tables import CARTESIAN, MERIDIONAL, BladeFile, read_blade, read_hub
from bonecam.wheels.wheel import TurnedBlank, Wheel, channel_of, wheel_of
from bonecam.workholding import Post, clamping_of

LEVEL_CHORD = 0.05
"""Chord tolerance of the channel's levels, mm."""
BEYOND = 0.2
"""A ball passes a blade's edge with so much room beside its allowance, mm."""
CAPSULE = 0.5
"""The capsule that links keep out of is so much larger than the blank, mm."""


def blades(
    blade: "BladeFile",  # a text, as help() would write the union out
    hub: "Solid",
    count: int,
    obstacles: "Sequence[Solid]" = (),
    job: Job | None = None,
    *,
    columns: str = CARTESIAN,
    axis: str = "z",
    hub_columns: str = MERIDIONAL,
    program: File = None,
    keep: File = None,
    report: File = None,
    html: File = None,
    sheet: File = None,
    apt: File = None,
    simulation: bool = True,
    mechanics: bool = True,
    progress: Progress = silent,
) -> Bladed:
    """The verified program of a wheel of `count` equal blades, from a blank that is turned to the blades' tips.

    `blade` runs round both sides of one blade, from the hub out: a table of sections or several (`columns`, `axis` as
    in `read_sections`), STEP, IGES, `.tsm`, `.tspline`, or a TSpline. `hub` is a closed mesh of
    revolution or the table of its flow path (`hub_columns`); `obstacles` are closed solids that repeat with the blades,
    such as splitters or the other blades. All in the unit `job.mesh.units` and one frame, Z the wheel's axis. The
    channels are roughed level by level, all of them to one level before the next, then hub and blades are finished.
    The text's removal is simulated (`simulation`) from the blank; force and bending are asked (`mechanics`). Raises a
    BonecamError.
    """
    job = job or Job()
    machine, dialect = machine_and_dialect(job.nc)
    check_job(job, machine, dialect)
    check_one_feed(job, "a wheel has one feed a cutter")
    refuse_bar(job, "a wheel stands in no bar")
    require_upright(machine)
    if simulation and mechanics:
        mechanics_of_job(job)
    several = [blade] if isinstance(blade, str | Path | TSpline) else blade
    inputs = [file for file in (*several, hub, *obstacles) if isinstance(file, str | Path)]
    wanted = Outputs(program, keep, report, html=html, sheet=sheet, apt=apt, split=job.nc.is_split)
    wanted.check(None, dialect)
    check_files([program, report, html, sheet, apt], inputs)
    name = str(inputs[0]) if inputs else "the blade"
    with report_refused(report) as times, naming(name):
        with times.stage("surface"):
            refuse_changes(job.mesh, name)
            units, tolerance = job.mesh.units, job.surface.tolerance_for()
            surface, edge = read_blade(blade, units, tolerance, columns=columns, axis=axis)
            check_surface_size(surface, name)
            profile = read_hub(hub, surface, units, columns=hub_columns, axis=axis)
            others = [read_solid(solid, units) for solid in obstacles]
            wheel = wheel_of(surface, profile, count, others, edge)
            require_room(wheel, job)
        bladed = _programmed(wheel, job, machine, dialect, name, program, times=times, progress=progress)
        if simulation:
            bladed = _simulated(bladed, times, part_of(progress, 0.8, 1.0), mechanics=mechanics)
        figures = {**bladed.report, "seconds": times.seconds}
        bladed = replace(bladed, report=with_warnings(figures, bladed.job, edge_warnings(wheel)))
    write_run(bladed, wanted, [(sheet, lambda: bladed.sheet)])
    return bladed


def _programmed(
    wheel: Wheel,
    job: Job,
    machine: Machine,
    dialect: Dialect,
    name: str,
    file: File,
    times: StageTimes,
    progress: Progress,
) -> Bladed:
    """The wheel on its post, its blank, the levels of its channels, all paths, and their program, proved against hub
    and every blade."""
    limits = machine_limits(machine)
    with times.stage("setup"):
        report_progress(progress, 0.0, "the wheel as one solid")
        solid = wheel.solid(_chord(job))
        job = replace(job, holding=surface_holding(job.holding, wheel.blade, solid))
        workpiece = stand_workpiece(wheel.blade, solid, job, limits)
        job = replace(job, holding=replace(job.holding, length=workpiece.length))
        wheel = wheel.lift(workpiece.length - float(wheel.profile[:, 1].min()))
        # passes go on beyond the blades' edges until a ball is past the allowance there
        widest = max(job.tool(name).radius for name in ("roughing", "finishing"))
        channel = channel_of(wheel, widest + job.levels.finishing_depth + BEYOND)
        blank = TurnedBlank(channel.blank)
    with times.stage("levels"):
        report_progress(progress, 0.1, "levels from the hub to the blank")
        morph = morph_open(channel.floor, channel.roof, schedule_of(job.levels), chord_tolerance=LEVEL_CHORD)
    with times.stage("toolpath"):
        # in machining order; the hub, level 0 of the channel, is a rest path before the blades: both are the part
        report_progress(progress, 0.2, "paths of the channel")
        post = Post(job.holding.diameter / 2, workpiece.length)
        capsule = smallest_capsule(blank.mesh.vertices, CAPSULE)
        channel_paths, standing = ChannelPlanner(channel, job, limits, post, capsule).paths(morph.levels)
        channel_paths[-1] = replace(channel_paths[-1], rest=1)
        scene = replace(
            workpiece.scene(job, clamping_of(job.holding, limits.bodies.table)),
            stock=capsule,
            material=standing.mesh,
            material_deviation=standing.deviation,
        )
        blade = plan_surface(workpiece, scene, job, limits, standing)
        paths = tuple(indexed(path, wheel.count) for path in (*channel_paths, blade))
    figures = wheel_figures(Path(name).name, wheel, blank, morph, job, paths=paths)
    warned = header_texts(figures, job, edge_warnings(wheel))
    proved = post_and_prove(
        paths,
        machine,
        dialect,
        job,
        RepeatedDistance(MeshDistance(wheel.with_one_blade(_chord(job))), wheel.count),
        name=program_name(file or Path(name).name, dialect),
        comments=[*warned, f"wheel of {wheel.count} blades: {Path(name).name}", blank.text],
        times=times,
        progress=part_of(progress, 0.6, 0.8),
    )
    reported = report_to_program(file, *proved, job=job.path, part=workpiece.solid)
    figures = {**figures, **reported, "removal": NOT_SIMULATED, "mechanics": NOT_KNOWN}
    return Bladed(workpiece, proved.program, figures, job, wheel, blank, morph, proved.paths)


def _chord(job: Job) -> float:
    """Chord tolerance (mm) of what must not be gouged, as fine as the gouge tolerance asks for."""
    return MESH_SHARE * planned_tolerance(job.path.gouge_tolerance)


def _simulated(bladed: Bladed, times: StageTimes, progress: Progress, *, mechanics: bool) -> Bladed:
    """The result with what its posted text removes of the blank, and what bends if `mechanics` are asked; VerifyError
    where that is not what it may do."""
    machine, dialect = machine_and_dialect(bladed.job.nc)
    with times.stage("simulation"), refusing(bladed.program, bladed.paths), knowing(bladed.report):
        levels = bladed.levels.levels
        surfaces = wheel_surfaces(bladed.wheel, bladed.workpiece.solid, levels[:-1])
        cut = bladed.program.text, machine, dialect, bladed.job, bladed.blank, bladed.wheel, levels
        removal = prove_removal_of_wheel(*cut, progress, surfaces, mechanics=mechanics)
    return with_removal(bladed, removal, more=edge_warnings(bladed.wheel))
