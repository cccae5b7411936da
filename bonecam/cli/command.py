"""What a command of the command line is made of: its declaration, the arguments that commands share, the job of the
options, and the call of a function of bonecam with them.

    from bonecam.cli.command import PART, VERBOSITY, Command, argument

    def run(options): ...

    COMMAND = Command(run, "Tell the volume of a part.", [PART, *VERBOSITY], "  bonecam volume bone.stl")

The core's commands (`bonecam.cli.commands`) and those of plugins (entry points `bonecam.commands`) are declared alike.
What makes a command run is imported in its function, so that `bonecam --help` stays quick.
"""

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from inspect import signature
from typing import Any

from bonecam.cli.stopping import NOTHING, shown_progress
from bonecam.errors import JobError
from bonecam.files import check_files
from bonecam.job import Job, NcJob, read_job
from bonecam.job.files.job_file import job_files
from bonecam.job.sections import job_error, setting
from bonecam.job.tool_list import read_tool_list
from bonecam.machine.machine import machine_names
from bonecam.nc.dialect import dialect_names
from bonecam.plugins import reader_endings

Argument = tuple[tuple[str, ...], dict[str, Any]]


@dataclass(frozen=True)
class Command:
    """A command: `run` takes the options and returns the exit code. Options that a function of bonecam takes are named
    as its parameters are (`call_with`). `examples` are lines of calls; `stopped` says what a command that is stopped
    leaves, `stopped_late` the same where it has begun to put its files in place."""

    run: Callable[[argparse.Namespace], int]
    help: str
    arguments: Sequence[Argument] = ()
    examples: str = ""
    stopped: str = NOTHING
    stopped_late: str = "what it writes was written already"


def argument(*names: str, **settings: Any) -> Argument:
    """An argument as argparse's `add_argument` takes it."""
    return names, settings


def positive(most: float = math.inf) -> Callable[[str], float]:
    """argparse's type of a finite number above 0, at most `most`; its message has the name of the function."""

    def number(text: str) -> float:
        value = float(text)
        if not (0 < value <= most and math.isfinite(value)):
            raise ValueError(text)
        return value

    number.__name__ = f"number above 0{'' if most == math.inf else f', at most {most:,.0f},'}"
    return number


TSPLINES = ", ".join((".tspline", *reader_endings()))
"""Endings of files with a T-spline, those that plugins add included."""
PART = argument(
    "mesh",
    metavar="PART",
    help="STL, PLY, OBJ or OFF mesh; STEP, IGES, SAT or DXF part; point cloud; rows of points; saved .tspline",
)
PROGRAM = argument("-o", "--output", dest="program", metavar="PROGRAM", required=True, help="file for the NC program")
REPORT = argument("--report", metavar="FILE.json", help="file for the report")
HTML = argument("--html", metavar="FILE.html", help="file for a page to look at in a browser")
APT = argument("--apt", metavar="FILE.apt", help="file for the tool path as cutter location data in APT words")
MECHANICS = argument(
    "--no-mechanics",
    dest="mechanics",
    action="store_false",
    help="do not ask what force the cuts need and how far part and cutter bend",
)
PROOFS = [
    argument(
        "--no-simulation",
        dest="simulation",
        action="store_false",
        help="do not simulate the removal of material from the posted text",
    ),
    MECHANICS,
]
KEPT = [
    argument("--keep", metavar="DIR", help="folder for surface, levels, tool path and pictures"),
    argument(
        "--sheet",
        metavar="FILE.html",
        help="file for the setup sheet, one page to print: clamping, tools, axes, checks, warnings",
    ),
    APT,
    *PROOFS,
]
RESULTS = [
    argument("--report", metavar="FILE.json", help="file for the report of everything that was measured"),
    argument("--surface", metavar="FILE", help=f"file for the T-spline: {TSPLINES}, .step or .iges"),
    argument(
        "--html",
        metavar="FILE.html",
        help="file for a page to look at in a browser: levels, paths, the program played, what is left",
    ),
]
UNPOSTED = [
    argument(
        "--job",
        metavar="JOB.toml",
        help=f"job file, or {' or '.join(job_files())}; a value that it leaves out keeps its default",
    ),
    argument(
        "--units",
        choices=("mm", "cm", "m", "inch", "um"),
        help="unit of the part's coordinates (the one its file states, else mm)",
    ),
    argument(
        "--tools",
        metavar="FILE",
        help="list of the cutters that there are: a name, or a file of Fusion, FreeCAD, LinuxCNC, .csv or .toml",
    ),
    argument(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.NAME=VALUE",
        help="a parameter of the job, as `bonecam job` lists them (repeat for more)",
    ),
]
KNOWN = {"machine": (NcJob().machine, machine_names()), "controller": ("the machine's own", dialect_names())}
POSTED = [
    argument(
        f"--{name}",
        metavar="NAME",
        help=f"{usual} (default), {', '.join(other for other in names if other != usual)}, or a TOML file",
    )
    for name, (usual, names) in KNOWN.items()
]
JOB = [*UNPOSTED[:2], *POSTED, *UNPOSTED[2:]]
VERBOSITY = [
    argument("-q", "--quiet", action="store_true", help="print no progress and no summary"),
    argument(
        "-v", "--verbose", action="store_true", help="print progress as lines with the time, not on a terminal only"
    ),
]


def job_of(options: argparse.Namespace) -> Job:
    """The job file, then --tools, --units, --machine and --controller, then each --set; later values win.

    JobError tells all that is wrong in the file, or else in the options.
    """
    job = read_job(options.job, tools=options.tools) if options.job else Job()
    named = [
        ("nc", "tools", options.tools),
        ("mesh", "units", options.units),
        ("nc", "machine", options.machine),
        ("nc", "controller", options.controller),
    ]
    job = job_with(job, options.set, [item for item in named if item[2] is not None])
    read_tool_list(job.nc.tools)
    return job


def input_files(options: argparse.Namespace) -> list[str]:
    """The files that the options of the job name, which no output may overwrite."""
    return [file for file in (options.job, options.machine, options.controller, options.tools) if file]


def job_with(job: Job, texts: Sequence[str], given: Sequence[tuple[str, str, Any]] = ()) -> Job:
    """The job with what is `given` as section, name and value, then with each SECTION.NAME=VALUE of the `texts`."""
    settings = [*given]
    faults = []
    for text in texts:
        key, equals, word = text.partition("=")
        parsed = setting(key, word) if equals else None
        if parsed is None:
            faults.append(("", "", f"--set {text}: write SECTION.NAME=VALUE, like stock.diameter=15"))
        else:
            settings.append(parsed)
    changes: dict[str, dict[str, Any]] = {}
    for section, name, value in settings:
        changes.setdefault(section, {})[name] = value
    try:
        changed = job.with_values(**changes)
    except JobError as error:
        faults += error.evidence["faults"]
    if faults:
        raise job_error(faults)
    return changed


def make(
    function: Callable[..., Any], options: argparse.Namespace, files: str = "program sheet apt report surface html"
) -> int:
    """Call what makes a program, or levels, with the options, and print the summary of the result. The options that
    name `files` to write are checked in this order."""
    job = job_of(options)
    outputs = [getattr(options, name, None) for name in files.split()]
    check_files([file for file in outputs if file is not None], input_files(options))
    made = call_with(function, options, job=job)
    if not options.quiet:
        print(made.summary)
    return 0


def name_program(options: argparse.Namespace, name: str) -> None:
    """Call the program of a demonstration `name`, with the ending of the job's controller, where it has no name."""
    if options.program is None:
        from bonecam.nc.requirements import job_dialect

        options.program = f"{name}{job_dialect(job_of(options).nc).extension}"


def call_with(function: Callable[..., Any], options: argparse.Namespace, **more: Any) -> Any:
    """Call a function with the options that are named as its parameters are, with `more`, and a progress that is shown
    as the options ask for."""
    parameters = signature(function).parameters
    given = {name: value for name, value in vars(options).items() if name in parameters}
    with shown_progress(options) as progress:
        return function(**{**given, **more, "progress": progress})


def kept_job(options: argparse.Namespace, program: str) -> Job:
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
