"""The commands. Each takes the options, prints its results to stdout, and returns the exit code."""

import argparse
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import bonecam
from bonecam.cli.parser import input_files, job_of
from bonecam.cli.stopping import native_output_to_stderr, shown_progress
from bonecam.cli.study import run_impeller
from bonecam.errors import JobError
from bonecam.files import check_files, write_whole
from bonecam.filters import scripting
from bonecam.job import Job, write_job


def run_convert(options: argparse.Namespace) -> int:
    """`bonecam convert`: the NC program of a part."""
    return _convert(options.mesh, options)


def run_demo(options: argparse.Namespace) -> int:
    """`bonecam demo`: the NC program of the phalanx, or of the impeller, that is installed with bonecam."""
    from bonecam_meshes import path

    from bonecam.nc.requirements import job_dialect

    if options.impeller:
        return run_impeller(options)
    if options.output is None:
        dialect = job_dialect(job_of(options).nc)
        options.output = f"phalanx{dialect.extension}"
    return _convert(path("phalanx"), options)


def run_levels(options: argparse.Namespace) -> int:
    """`bonecam levels`: the levels of a part and their pictures."""
    return _run(bonecam.morph_levels, options.mesh, options, keep=options.output)


def _convert(mesh: str | Path, options: argparse.Namespace) -> int:
    make = partial(bonecam.convert, simulation=not options.no_simulation, mechanics=not options.no_mechanics)
    outputs = {"program": options.output, "keep": options.keep, "sheet": options.sheet, "apt": options.apt}
    return _run(make, mesh, options, **outputs)


def _run(
    make: Callable[..., "bonecam.Morphed"], mesh: str | Path, options: argparse.Namespace, **outputs: str | None
) -> int:
    """Call `make` with the part, the job and the files to write, and print the summary of the result."""
    job = job_of(options)
    outputs |= {"report": options.report, "surface": options.surface, "html": options.html}
    files = [file for name, file in outputs.items() if file is not None and name != "keep"]
    check_files(files, input_files(options))

    with shown_progress(options) as progress:
        result = make(mesh, job, **outputs, progress=progress)
    if not options.quiet:
        print(result.summary)
    return 0


def run_view(options: argparse.Namespace) -> int:
    """`bonecam view`: the page of a run, from its kept files, and that of its second clamping."""
    from bonecam.report.kept import kept_pages

    bonecam.view(options.keep, options.output)
    print("\n".join(str(page) for page in kept_pages(options.keep, options.output)))
    return 0


def run_finish(options: argparse.Namespace) -> int:
    """`bonecam finish`: the NC program of one surface."""
    job = job_of(options)
    files = [file for file in (options.output, options.report, options.html, options.apt) if file is not None]
    check_files(files, input_files(options))
    with shown_progress(options) as progress:
        finished = bonecam.finish(
            options.surface,
            options.part,
            options.obstacle,
            job,
            program=options.output,
            keep=options.keep,
            report=options.report,
            html=options.html,
            apt=options.apt,
            simulation=not options.no_simulation,
            mechanics=not options.no_mechanics,
            progress=progress,
        )
    if not options.quiet:
        print(finished.summary)
    return 0


def run_shell(options: argparse.Namespace) -> int:
    """`bonecam shell`: a shell for the second clamping."""
    job = job_of(options)
    bonecam.clamping_shell(options.mesh, job, output=options.output, covered=options.covered)
    return 0


def _kept_job(options: argparse.Namespace, program: str) -> Job:
    """The job of the options of a command on a `program` or its paths: without --keep their own folder is taken, where
    a run kept it, without --job the job.toml of the folder, which is told in a line."""
    from bonecam.report.kept import folder_of, job_file_of

    options.keep = options.keep or folder_of(program)
    kept = job_file_of(options.keep)
    if options.job is None and kept is not None:
        options.job = str(kept)
        if not options.quiet:
            print(f"job       {kept}")
    return job_of(options)


def run_simulate(options: argparse.Namespace) -> int:
    """`bonecam simulate`: what a program removes, from its text."""
    from bonecam.report.typed import report_text
    from bonecam.report.warnings import check_warnings, warnings_of
    from bonecam.simulation import simulation_report, simulation_text
    from bonecam.verify.removal import check_removal_of_job

    job = _kept_job(options, options.program)
    if options.keep is None:
        raise JobError(f"{options.program}: no folder of its run is named: give the one of `convert --keep` (--keep)")
    wanted = [file for file in (options.report, options.html) if file is not None]
    check_files(wanted, [options.program, *input_files(options)])
    with shown_progress(options) as progress:
        removal = bonecam.simulate(
            options.program,
            options.keep,
            job,
            cell=options.cell,
            html=options.html,
            mechanics=not options.no_mechanics,
            progress=progress,
        )
    report = simulation_report(removal, job)
    if options.report is not None:
        write_whole(options.report, report_text(report))
    check_removal_of_job(removal, job)
    check_warnings(warnings_of(report, job), job, options.program)
    if not options.quiet:
        print(simulation_text(report))
    return 0


def run_post(options: argparse.Namespace) -> int:
    """`bonecam post`: the program of paths that were made elsewhere."""
    names = options.from_machine, options.from_controller
    if names[0] is None and names[1] is not None:
        raise JobError("--from-controller needs the machine of the program too: give --from-machine")
    origin = None if names[0] is None else names
    job = _kept_job(options, options.paths)
    with shown_progress(options) as progress:
        posted = bonecam.post(
            options.paths,
            options.part,
            job,
            program=options.output,
            origin=origin,
            keep=options.keep,
            progress=progress,
        )
    if not options.quiet:
        print(posted.summary)
    return 0


def run_script(options: argparse.Namespace) -> int:
    """`bonecam script`: a MeshLab filter script on meshes; prints the files of the resulting layers."""
    with shown_progress(options) as progress, native_output_to_stderr():
        written = scripting.run_script(
            options.script,
            options.input,
            options.output,
            progress=progress,
            allow_outside=options.allow_outside,
            force=options.force,
            seconds=options.time_limit,
            memory=options.memory_limit,
        )
    if not options.quiet:
        print("".join(f"{path}\n" for path in written), end="")
    return 0


def run_filters(options: argparse.Namespace) -> int:
    """`bonecam filters`: the list of filters, or the description of one."""
    from bonecam.filters.filter import catalogue

    print(catalogue(options.name))
    return 0


def run_job(options: argparse.Namespace) -> int:
    """`bonecam job`: the job file of the options, or the schema of such files."""
    if options.schema:
        from bonecam.cli.schemas import job_schema

        print(json.dumps(job_schema(), indent=2))
    else:
        print(write_job(job_of(options)), end="")
    return 0


def run_completion(options: argparse.Namespace) -> int:
    """`bonecam completion`: the script that a shell reads."""
    import shtab

    print(shtab.complete(options.whole, shell=options.shell), end="")
    return 0
