"""The commands. Each takes the options, prints its results to stdout, and returns the exit code."""

import argparse
import json
from collections.abc import Callable
from contextlib import nullcontext
from inspect import signature
from typing import Any

import bonecam
from bonecam.cli.parser import input_files, job_of
from bonecam.cli.stopping import native_output_to_stderr, shown_progress
from bonecam.errors import JobError
from bonecam.files import check_files, write_whole
from bonecam.filters import scripting
from bonecam.job import Job, write_job


def run_convert(options: argparse.Namespace) -> int:
    """`bonecam convert`: the NC program of a part."""
    return _make(bonecam.convert, options)


def run_demo(options: argparse.Namespace) -> int:
    """`bonecam demo`: the NC program of the phalanx, or of the impeller with its own job, installed with bonecam."""
    import bonecam_meshes
    from bonecam_meshes.impeller import BLADES

    from bonecam.nc.requirements import job_dialect

    if options.impeller:
        if options.surface is not None:
            raise JobError("demo --impeller: the blade's surface is in the kept folder: give --keep, not --surface")
        options.job = options.job or str(bonecam_meshes.job("impeller"))
    if options.program is None:
        name = "impeller" if options.impeller else "phalanx"
        options.program = f"{name}{job_dialect(job_of(options).nc).extension}"
    if not options.impeller:
        options.mesh = bonecam_meshes.path("phalanx")
        return run_convert(options)
    options.blade, options.hub = (bonecam_meshes.path(f"impeller_{name}") for name in ("blade", "hub"))
    options.count = BLADES
    return _make(bonecam.blades, options, BLADES_FILES)


def run_levels(options: argparse.Namespace) -> int:
    """`bonecam levels`: the levels of a part and their pictures."""
    return _make(bonecam.morph_levels, options)


def run_finish(options: argparse.Namespace) -> int:
    """`bonecam finish`: the NC program of one surface."""
    return _make(bonecam.finish, options, "program report html apt")


BLADES_FILES = "program report html sheet apt"
"""Options of the files of a wheel."""


def run_blades(options: argparse.Namespace) -> int:
    """`bonecam blades`: the NC program of a wheel."""
    options.blade = options.blade[0] if len(options.blade) == 1 else options.blade
    return _make(bonecam.blades, options, BLADES_FILES)


def _make(
    function: Callable[..., Any], options: argparse.Namespace, files: str = "program sheet apt report surface html"
) -> int:
    """Call what makes a program, or levels, with the options, and print the summary of the result. The options that
    name `files` to write are checked in this order."""
    job = job_of(options)
    outputs = [getattr(options, name, None) for name in files.split()]
    check_files([file for file in outputs if file is not None], input_files(options))
    made = _call_with(function, options, job=job)
    if not options.quiet:
        print(made.summary)
    return 0


def _call_with(function: Callable[..., Any], options: argparse.Namespace, **more: Any) -> Any:
    """Call a function with the options that are named as its parameters are, with `more`, and a progress that is shown
    as the options ask for."""
    parameters = signature(function).parameters
    given = {name: value for name, value in vars(options).items() if name in parameters}
    with shown_progress(options) as progress:
        return function(**{**given, **more, "progress": progress})


def run_view(options: argparse.Namespace) -> int:
    """`bonecam view`: the page of a run, from its kept files, and that of its second clamping."""
    from bonecam.report.kept import kept_pages

    bonecam.view(options.keep, options.output)
    print("\n".join(str(page) for page in kept_pages(options.keep, options.output)))
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
    removal = _call_with(bonecam.simulate, options, job=job)
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
    origin = options.from_machine, options.from_controller
    if origin[0] is None and origin[1] is not None:
        raise JobError("--from-controller needs the machine of the program too: give --from-machine")
    job = _kept_job(options, options.paths)
    posted = _call_with(bonecam.post, options, job=job, origin=None if origin[0] is None else origin)
    if not options.quiet:
        print(posted.summary)
    return 0


def run_compare(options: argparse.Namespace) -> int:
    """`bonecam compare`: strategies side by side."""
    from bonecam.study.comparison import claims_text, compare, table_text

    comparison = _call_with(compare, options, job=job_of(options))
    if not options.quiet:
        print(table_text(comparison.rows))
        print(claims_text(comparison.claims), end="")
    return 0


def run_probe(options: argparse.Namespace) -> int:
    """`bonecam probe`: the deviations along a line of a kept program."""
    probed = _call_with(bonecam.probe, options)
    if not options.quiet:
        print(probed)
    return 0


def run_batch(options: argparse.Namespace) -> int:
    """`bonecam batch`: the NC programs of several parts."""
    from bonecam.batch import Wanted, cluster_executor
    from bonecam.cli.batch_display import BatchDisplay

    address = options.scheduler
    cluster = cluster_executor(address, options.jobs) if address else nullcontext()
    with cluster as executor, BatchDisplay(options) as shown:
        outcomes = bonecam.convert_many(
            options.parts,
            options.output,
            job_of(options),
            jobs=options.jobs,
            executor=executor,
            resume=options.resume,
            share=options.share,
            wanted=Wanted(html=options.html, sheet=options.sheet, keep=options.keep),
            told=shown.told,
            progress=shown.progress,
        )
    return int(any(outcome.state == "failed" for outcome in outcomes))


def run_script(options: argparse.Namespace) -> int:
    """`bonecam script`: a MeshLab filter script on meshes; prints the files of the resulting layers."""
    with native_output_to_stderr():
        written = _call_with(scripting.run_script, options)
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


def run_completion(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """`bonecam completion`: the script that a shell reads."""
    import shtab

    print(shtab.complete(parser, shell=options.shell), end="")
    return 0
