"""The tool paths on the levels of a part, their program and its proof; and the program once more with feeds by the
force."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

from bonecam.errors import knowing
from bonecam.levels.measure.level import morph_surfaces
from bonecam.machine.machine import Machine
from bonecam.machining.force_feed import BeforeForce, paths_by_force
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.rotary.machine_limits import machine_limits
from bonecam.nc.program import program_name
from bonecam.planning.estimate import estimate
from bonecam.planning.levels import plan_paths
from bonecam.planning.strategies.layer_paths import plan_layer_paths
from bonecam.post_and_prove import post_and_prove
from bonecam.progress import Progress, part, report
from bonecam.report import warnings
from bonecam.report.files.output_files import File
from bonecam.report.files.result import Morphed, Result
from bonecam.report.mechanics_lines import NOT_KNOWN
from bonecam.report.stage_reports import uncut_areas
from bonecam.report.summary import NOT_SIMULATED
from bonecam.report.typed.report import Report
from bonecam.report.typed.run_report import report_to_program
from bonecam.runtime.timing import StageTimes
from bonecam.tool.path import ToolPath
from bonecam.verify.removal.given import given_surface
from bonecam.verify.removal.of_job import removal_of_job


@dataclass(frozen=True, eq=False)
class Posting:
    """The machine and the language that programs are posted for, the files of the part (`source`) and of the program
    (`file`) that name them, and the `times` that take the seconds of each stage."""

    machine: Machine
    dialect: Dialect
    source: File = None
    file: File = None
    times: StageTimes = field(default_factory=StageTimes)


def machine_levels(made: Morphed, posting: Posting, progress: Progress) -> Result:
    """Tool paths on the levels, their program, and its proof; nothing is simulated."""
    job, machine = made.job, posting.machine
    levels = made.levels.levels
    foretold: dict[str, Any] = {}
    with posting.times.stage("toolpath"):
        share = part(progress, 0.0, 0.82)
        if job.path.strategy == "morph":
            expected = estimate(levels, job, machine.bodies)
            report(share, 0.0, f"expected: {expected}")
            foretold["estimate"] = expected.report
            planned = plan_paths(levels, made.stock, job, machine_limits(machine), share)
        else:
            planned = plan_layer_paths(levels, made.stock, job, machine_limits(machine), share)
        foretold["uncut_mm2"] = uncut_areas(planned, levels[0].mesh) if job.path.strategy == "morph" else {}
    known = {**made.report, **foretold}
    with knowing(known):
        return _posted(made, planned, known, posting, part(progress, 0.82, 1.0))


def _posted(
    morphed: Morphed, planned: Sequence[ToolPath], foretold: Mapping[str, Any], posting: Posting, progress: Progress
) -> Result:
    """The planned paths as a proved program, as in `machine_levels`; `foretold` is the report so far."""
    job = morphed.job
    levels = morphed.levels.levels
    source = posting.source
    warning_texts = warnings.header_texts(foretold, job)
    proved = post_and_prove(
        planned,
        posting.machine,
        posting.dialect,
        job,
        morph_surfaces(levels)[0],
        given=given_surface(morphed.part, job, morphed.report),
        name=program_name(posting.file or source or "", posting.dialect),
        comments=[*warning_texts, *([f"part: {Path(source).name}"] if source else []), *morphed.part.header_texts],
        stock=morphed.stock,
        times=posting.times,
        progress=progress,
    )
    paths, program = proved.paths, proved.program
    reported = report_to_program(
        Path(posting.file or "").name, paths, program, proved.proof, job=job.path, part=levels[0].mesh
    )
    figures = {**foretold, **reported, "removal": NOT_SIMULATED, "mechanics": NOT_KNOWN}
    checked = cast(Report, warnings.with_warnings(figures, job))
    return Result(
        part=morphed.part,
        surface=morphed.surface,
        stock=morphed.stock,
        levels=morphed.levels,
        report=checked,
        job=job,
        paths=paths,
        program=program,
    )


def post_by_force(result: Result, posting: Posting, progress: Progress) -> tuple[Result, BeforeForce]:
    """The result with feeds by the force that the simulation of its text finds, posted and proved again; and what that
    text had."""
    job = replace(result.job, path=replace(result.job.path, feed="force"))
    machine, dialect = posting.machine, posting.dialect
    with posting.times.stage("simulation"):
        cut = result.program.text, machine, dialect, result.job, result.stock, result.levels.levels
        removal = removal_of_job(*cut, part(progress, 0.0, 0.6))
    scheduled = paths_by_force(
        result.paths, result.program.text, removal=removal, machine=machine, dialect=dialect, job=job
    )
    before = BeforeForce(scheduled.schedule, removal, result.program.time_min)
    share = part(progress, 0.6, 1.0)
    by_force = replace(result, job=job)
    return _posted(by_force, scheduled.paths, result.report, posting, share), before
