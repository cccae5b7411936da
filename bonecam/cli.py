"""The command line: `bonecam convert | demo | levels | batch | script | filters | job`.

Exit codes: 0 done, 1 some mesh of a batch failed, 2 the input, the job or the call is wrong (one line on
stderr).
"""

import argparse
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import bonecam
from bonecam.errors import BonecamError, JobError
from bonecam.files import check_files
from bonecam.job import Job, read_job, write_job
from bonecam.job.parameter import KINDS
from bonecam.progress import Progress, silent

if TYPE_CHECKING:
    from bonecam.outputs.result import Morphed

EXIT_CODES = "Exit codes: 0 done; 1 some mesh of a batch failed; 2 wrong input, job or call (one line on stderr); 130 stopped."
PART = "STL, PLY, OBJ or OFF mesh; STEP, IGES, SAT or DXF part; point cloud; rows of points; saved .tspline"
EXAMPLES = {
    "convert": """
  bonecam convert bone.stl --units m -o bone.h
  bonecam convert bone.stl -o bone.h --set stock.diameter=15 --set stock.length=37 --keep look --report bone.json
  bonecam convert bone.stl -o bone.ngc --machine linuxcnc-xyzbc --controller linuxcnc""",
    "demo": """
  bonecam demo -o phalanx.h --keep look""",
    "levels": """
  bonecam levels bone.stl --units m -o look --set stock.kind=cylinder --set levels.roughing_depth=1""",
    "batch": """
  bonecam batch scans/*.stl -o programs --job job.toml --jobs 4 --resume""",
    "script": """
  bonecam script levels.mlx -i bone.stl -o layers""",
    "filters": """
  bonecam filters generate_morph_levels""",
    "job": """
  bonecam job --set levels.roughing_depth=1 > job.toml""",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    options, unknown = _parser().parse_known_args(arguments)
    if unknown:
        options.refuse(f"unrecognized arguments: {' '.join(unknown)}")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # a polite kill cleans up like Ctrl-C
    try:
        code = int(options.run(options))
        sys.stdout.flush()
        return code
    except BonecamError as error:
        print(f"bonecam: {' '.join(str(error).splitlines())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"bonecam: stopped; {options.stopped}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # who reads our output has read enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


class _Parser(argparse.ArgumentParser):
    """Wrong calls in one line, exit code 2."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}: see {self.prog} --help\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="bonecam", description="From a bone mesh to a verified five-axis NC program.", epilog=EXIT_CODES
    )
    parser.add_argument("--version", action="version", version=f"bonecam {bonecam.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)
    _add_convert(commands)
    _add_levels(commands)
    _add_batch(commands)
    _add_script(commands)
    filters = _command(
        commands,
        "filters",
        "List bonecam's filters, or one with its parameters, units and ranges.",
        run_filters,
    )
    filters.add_argument("name", metavar="NAME", nargs="?", help="one filter's name")
    job = _command(commands, "job", "Print a job file: every parameter with its value and meaning.", run_job)
    _add_job_options(job)
    return parser


def _command(commands: Any, name: str, text: str, run: Any) -> argparse.ArgumentParser:
    layout = argparse.RawDescriptionHelpFormatter
    command: argparse.ArgumentParser = commands.add_parser(
        name, help=text, description=text, epilog=f"examples:{EXAMPLES[name]}", formatter_class=layout
    )
    command.set_defaults(
        run=run,
        refuse=command.error,
        stopped="nothing was written",
        quiet=False,
        verbose=False,
        machine=None,
        controller=None,
    )
    return command


def _add_talk(command: argparse.ArgumentParser) -> None:
    command.add_argument("-q", "--quiet", action="store_true", help="no progress, no summary")
    command.add_argument(
        "-v", "--verbose", action="store_true", help="progress as lines with their time, on a terminal or not"
    )


def _add_convert(commands: Any) -> None:
    convert = _command(commands, "convert", "Mesh in, verified NC program out.", run_convert)
    convert.add_argument("mesh", metavar="PART", help=PART)
    demo = _command(commands, "demo", "The whole chain on the phalanx that ships with bonecam.", run_demo)
    for command, default in ((convert, ""), (demo, " (phalanx.h, or as the controller's programs end)")):
        command.add_argument(
            "-o",
            "--output",
            metavar="PROGRAM",
            required=not default,
            help=f"the NC program to write{default}",
        )
        command.add_argument(
            "--keep", metavar="DIR", help="write surface, levels, tool path and pictures there"
        )
        _add_figures(command)


def _add_levels(commands: Any) -> None:
    levels = _command(
        commands,
        "levels",
        "Mesh in, measured morph levels and their pictures out: no paths, no program.",
        run_levels,
    )
    levels.add_argument("mesh", metavar="PART", help=PART)
    levels.add_argument(
        "-o", "--output", metavar="DIR", required=True, help="folder for surface, levels and pictures"
    )
    _add_figures(levels, posted=False)


def _add_figures(command: argparse.ArgumentParser, *, posted: bool = True) -> None:
    command.add_argument("--report", metavar="FILE.json", help="write every figure that was measured there")
    command.add_argument(
        "--surface", metavar="FILE", help="write the T-spline there: .tspline, .iga, .step or .iges"
    )
    _add_job_options(command, posted=posted)
    _add_talk(command)


def _add_batch(commands: Any) -> None:
    batch = _command(commands, "batch", "Many meshes, each in a process of its own.", run_batch)
    batch.set_defaults(stopped="what is finished is kept, --resume goes on from there")
    batch.add_argument(
        "meshes", metavar="PART", nargs="+", help="files as `convert` reads them, all with the same job"
    )
    batch.add_argument(
        "-o", "--output", metavar="DIR", required=True, help="folder for programs, reports and batch.csv"
    )
    batch.add_argument("--jobs", metavar="N", type=int, default=2, help="parts at a time (2)")
    batch.add_argument(
        "--resume",
        action="store_true",
        help="skip what an earlier run finished with the same mesh, job and version",
    )
    _add_job_options(batch)
    batch.add_argument("-q", "--quiet", action="store_true", help="no line for each part")


def _add_script(commands: Any) -> None:
    script = _command(
        commands, "script", "Run a MeshLab filter script (.mlx) with MeshLab's filters and ours.", run_script
    )
    script.add_argument(
        "script", metavar="SCRIPT.mlx", help="the script; all of it is checked before anything runs"
    )
    script.add_argument(
        "-i",
        "--input",
        action="append",
        required=True,
        metavar="MESH",
        help="a mesh to load as a layer (repeat for more)",
    )
    script.add_argument(
        "-o", "--output", metavar="DIR", required=True, help="folder for the resulting layers"
    )
    _add_talk(script)


def _add_job_options(command: argparse.ArgumentParser, *, posted: bool = True) -> None:
    command.add_argument("--job", metavar="JOB.toml", help="job file; what it leaves out keeps its default")
    command.add_argument("--units", choices=("mm", "m", "inch"), help="unit of the file's coordinates (mm)")
    if posted:
        command.add_argument(
            "--machine",
            metavar="NAME",
            help="mikron-ucp600 (default), linuxcnc-xyzbc, or a TOML file of your own",
        )
        command.add_argument(
            "--controller", metavar="NAME", help="heidenhain (default), linuxcnc, or a TOML file of your own"
        )
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.NAME=VALUE",
        help="one parameter of the job, as `bonecam job` lists them (repeat for more)",
    )


def job_of(options: argparse.Namespace) -> Job:
    """The job of the options: the file first, then --units, --machine, --controller, then each --set."""
    job = read_job(options.job) if options.job else Job()
    changes: dict[str, dict[str, Any]] = {}
    for section, name, value in (
        ("mesh", "units", options.units),
        ("nc", "machine", options.machine),
        ("nc", "controller", options.controller),
    ):
        if value is not None:
            changes.setdefault(section, {})[name] = value
    for setting in options.set:
        section, name, value = _setting(setting, job)
        changes.setdefault(section, {})[name] = value
    return job.with_values(**changes)


def _setting(text: str, job: Job) -> tuple[str, str, Any]:
    """Section, name and typed value of one SECTION.NAME=VALUE."""
    key, equals, value = text.partition("=")
    section, dot, name = key.strip().partition(".")
    if not (equals and dot):
        raise JobError(f"--set {text}: write SECTION.NAME=VALUE, like stock.diameter=15")
    sections = {item.name: getattr(job, item.name) for item in fields(job)}
    kinds: dict[str, Any] = (
        {item.name: type(item.default) for item in fields(sections[section])} if section in sections else {}
    )
    kind = kinds.get(name, str)
    try:
        if kind is bool:
            return section, name, {"true": True, "false": False}[value.strip().lower()]
        return section, name, kind(value.strip())
    except (ValueError, KeyError) as error:
        raise JobError(f"--set {text}: give {KINDS[kind]}") from error


class _Terminal:
    """A progress line on stderr, where stderr is a terminal."""

    def __init__(self) -> None:
        self.began, self.width = time.perf_counter(), 0

    def __call__(self, fraction: float, message: str) -> None:
        line = f"{fraction:4.0%} {time.perf_counter() - self.began:5.0f} s  {message}"[:100]
        print(f"\r{line.ljust(self.width)}", end="", file=sys.stderr, flush=True)
        self.width = len(line)

    def close(self) -> None:
        print(f"\r{' ' * self.width}\r", end="", file=sys.stderr, flush=True)


class _Lines:
    """Each new message of the progress as a line on stderr."""

    def __init__(self) -> None:
        self.began, self.message = time.perf_counter(), ""

    def __call__(self, fraction: float, message: str) -> None:
        if message != self.message:
            print(
                f"{time.perf_counter() - self.began:7.1f} s {fraction:4.0%}  {message}",
                file=sys.stderr,
                flush=True,
            )
        self.message = message

    def close(self) -> None:
        """Nothing stays open."""


def _progress(options: argparse.Namespace) -> _Terminal | _Lines | None:
    if options.verbose:
        return _Lines()
    return _Terminal() if sys.stderr.isatty() and not options.quiet else None


def run_convert(options: argparse.Namespace) -> int:
    """`bonecam convert`."""
    return _convert(options.mesh, options)


def run_demo(options: argparse.Namespace) -> int:
    """`bonecam demo`."""
    from bonecam_meshes import path

    from bonecam.nc.dialect import read_dialect

    if options.output is None:
        options.output = f"phalanx{read_dialect(job_of(options).nc.controller).extension}"
    return _convert(path("phalanx"), options)


def run_levels(options: argparse.Namespace) -> int:
    """`bonecam levels`."""
    return _made(bonecam.morph_levels, options.mesh, options, keep=options.output)


def _convert(mesh: str | Path, options: argparse.Namespace) -> int:
    return _made(bonecam.convert, mesh, options, program=options.output, keep=options.keep)


def _made(
    make: Callable[..., "Morphed"], mesh: str | Path, options: argparse.Namespace, **outputs: str | None
) -> int:
    """Make it of the mesh, write report, surface and the other outputs, and print the summary."""
    job, outputs = job_of(options), {**outputs, "report": options.report, "surface": options.surface}
    files = (file for name, file in outputs.items() if file is not None and name != "keep")
    check_files(files, filter(None, (options.job, options.machine, options.controller)))
    terminal = _progress(options)
    progress: Progress = terminal or silent
    try:
        made = make(mesh, job, **outputs, progress=progress)
    finally:
        if terminal:
            terminal.close()
    if not options.quiet:
        print(made.summary)
    return 0


def run_batch(options: argparse.Namespace) -> int:
    """`bonecam batch`."""
    from bonecam.batch import Outcome, convert_many

    def told(outcome: Outcome, left: int) -> None:
        if not options.quiet:
            what = outcome.message.removeprefix(f"{outcome.mesh}: ") or outcome.program
            print(f"{outcome.state:6} {outcome.mesh}  {what}  ({left} left)", flush=True)

    outcomes = convert_many(
        options.meshes, options.output, job_of(options), jobs=options.jobs, resume=options.resume, told=told
    )
    return int(any(outcome.state == "failed" for outcome in outcomes))


def run_script(options: argparse.Namespace) -> int:
    """`bonecam script`."""
    from bonecam.filters.script import run_script as run

    terminal = _progress(options)
    try:
        written = run(options.script, options.input, options.output, progress=terminal or silent)
    finally:
        if terminal:
            terminal.close()
    if not options.quiet:
        print("\n".join(str(path) for path in written))
    return 0


def run_filters(options: argparse.Namespace) -> int:
    """`bonecam filters`."""
    from bonecam.filters.catalogue import catalogue

    print(catalogue(options.name))
    return 0


def run_job(options: argparse.Namespace) -> int:
    """`bonecam job`."""
    print(write_job(job_of(options)), end="")
    return 0
