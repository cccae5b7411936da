"""The commands of the command line with their arguments and help texts.

One call of the command line: parse, run, and turn errors into one line on stderr and an exit code.

Exit codes: 0 done; 1 some part of a batch failed; 2 wrong input, job or call; 129, 130, 143 stopped by SIGHUP,
SIGINT (Ctrl-C), SIGTERM.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from typing import Any

import bonecam
from bonecam.cli import commands
from bonecam.cli.batch import add_batch
from bonecam.cli.catalogues import CATALOGUES, add_catalogue
from bonecam.cli.parser import (
    EXAMPLES,
    EXIT_CODES,
    PART,
    Parser,
    add_job_options,
    add_no_mechanics,
    add_no_simulation,
    positive,
)
from bonecam.cli.stopping import NOTHING, arrived, tell
from bonecam.cli.study import add_blades, add_compare, add_probe
from bonecam.errors import BonecamError
from bonecam.filters.scripting import MEMORY, MOST_MEMORY, MOST_SECONDS, SECONDS
from bonecam.runtime.staging import placed
from bonecam.text.numbers import in_one_line


def make_parser() -> Parser:
    """The parser of all commands; each sets `run`, which takes the options and returns the exit code."""
    text = "From a bone mesh to a verified five-axis NC program."
    parser = Parser(prog="bonecam", description=text, epilog=EXIT_CODES)
    parser.add_argument("-V", "--version", action="version", version=f"bonecam {bonecam.__version__}")
    parser.set_defaults(run=None, refuse_unknown=parser.refuse_unknown)
    parsers = parser.add_subparsers(metavar="COMMAND", parser_class=Parser)
    _add_convert(parsers)
    _add_demo(parsers)
    _add_levels(parsers)
    _add_finish(parsers)
    _add_verbosity(add_blades(_add_command, parsers))
    _add_shell(parsers)
    _add_simulate(parsers)
    _add_verbosity(add_probe(_add_command, parsers))
    _add_verbosity(add_compare(_add_command, parsers))
    _add_post(parsers)
    _add_view(parsers)
    add_batch(_add_command, parsers)
    _add_script(parsers)
    _add_filters(parsers)
    _add_job(parsers)
    for kind in CATALOGUES:
        add_catalogue(_add_command, parsers, kind)
    _add_completion(parsers, parser)
    return parser


def _add_convert(parsers: Any) -> None:
    text = "Make the verified NC program of a part."
    convert = _add_command(parsers, "convert", text, commands.run_convert)
    convert.add_argument("mesh", metavar="PART", help=PART)
    convert.add_argument("-o", "--output", metavar="PROGRAM", required=True, help="file for the NC program")
    _add_keep(convert)
    _add_results(convert)
    add_job_options(convert)
    _add_verbosity(convert)


def _add_demo(parsers: Any) -> None:
    text = "Make the NC program of the phalanx, or of the impeller, that is installed with bonecam."
    demo = _add_command(parsers, "demo", text, commands.run_demo)
    name = "file for the NC program (phalanx.h, or with the controller's own ending)"
    demo.add_argument("-o", "--output", metavar="PROGRAM", help=name)
    wheel = "the impeller instead, a wheel of 11 blades from a turned blank, with a job of its own"
    demo.add_argument("--impeller", action="store_true", help=wheel)
    _add_keep(demo)
    _add_results(demo)
    add_job_options(demo)
    _add_verbosity(demo)


def _add_levels(parsers: Any) -> None:
    text = "Make the measured morph levels of a part and their pictures, without tool paths and program."
    levels = _add_command(parsers, "levels", text, commands.run_levels)
    levels.add_argument("mesh", metavar="PART", help=PART)
    folder = "folder for surface, levels and pictures"
    levels.add_argument("-o", "--output", metavar="DIR", required=True, help=folder)
    _add_results(levels)
    add_job_options(levels, posted=False)
    _add_verbosity(levels)


def _add_finish(parsers: Any) -> None:
    text = "Make the verified NC program that machines one surface alone, open or closed, beside obstacles."
    finish = _add_command(parsers, "finish", text, commands.run_finish)
    kinds = "rows of points, .step, .iges, .tsm, .tspline or an open mesh; normals outward, the table's axis Z"
    finish.add_argument("surface", metavar="SURFACE", help=kinds)
    finish.add_argument("--part", metavar="MESH", help="solid that is not gouged; open surfaces need it")
    beside = "solid to keep clear of: hub, shroud, neighbour, fixture (repeat for more)"
    finish.add_argument("--obstacle", metavar="MESH", action="append", default=[], help=beside)
    finish.add_argument("-o", "--output", metavar="PROGRAM", required=True, help="file for the NC program")
    finish.add_argument("--keep", metavar="DIR", help="folder for surface, solid, tool path and its picture")
    finish.add_argument("--report", metavar="FILE.json", help="file for the report")
    finish.add_argument("--html", metavar="FILE.html", help="file for a page to look at in a browser")
    _add_apt(finish)
    add_no_simulation(finish)
    add_job_options(finish)
    _add_verbosity(finish)


def _add_shell(parsers: Any) -> None:
    text = "Make a shell round the finished end of a part, for its second clamping (holding.second)."
    shell = _add_command(parsers, "shell", text, commands.run_shell)
    shell.add_argument("mesh", metavar="PART", help=PART)
    shell.add_argument("-o", "--output", metavar="MESH", required=True, help="file for the shell: .stl or .ply")
    covered = "share of the part's height that it covers (0.5)"
    shell.add_argument("--covered", metavar="SHARE", type=positive(), default=0.5, help=covered)
    add_job_options(shell)


def _add_simulate(parsers: Any) -> None:
    text = (
        "Simulate from its text what an NC program removes, and refuse rapids and links that cut, collisions, gouges "
        "and cuts too deep."
    )
    simulate = _add_command(parsers, "simulate", text, commands.run_simulate)
    simulate.add_argument("program", metavar="PROGRAM", help="the NC program")
    kept = "the folder that `convert --keep` wrote: its part, stock and, without --job, job (that of PROGRAM)"
    simulate.add_argument("--keep", metavar="DIR", help=kept)
    rays = "distance of the rays (0.1 mm)"
    simulate.add_argument("--cell", metavar="MM", type=positive(), default=0.1, help=rays)
    simulate.add_argument("--report", metavar="FILE.json", help="file for the figures")
    simulate.add_argument("--html", metavar="FILE.html", help="file for a page that plays the program")
    add_no_mechanics(simulate)
    add_job_options(simulate)
    _add_verbosity(simulate)


def _add_post(parsers: Any) -> None:
    text = "Post, prove and simulate cutter location data (APT) of another system, or a program of another control."
    post = _add_command(parsers, "post", text, commands.run_post)
    post.add_argument("paths", metavar="PATHS", help="APT statements, or with --from-machine an NC program")
    post.add_argument("-o", "--output", metavar="PROGRAM", required=True, help="file for the NC program")
    solid = "solid that is not gouged, in the paths' frame: a mesh, or a kept folder or surface (that of --keep)"
    post.add_argument("--part", metavar="MESH", help=solid)
    kept = "a folder that `convert --keep` wrote: its stock is cut, without --job by its job (that of PATHS)"
    post.add_argument("--keep", metavar="DIR", help=kept)
    post.add_argument("--from-machine", metavar="NAME", help="machine that the program PATHS is for")
    post.add_argument("--from-controller", metavar="NAME", help="controller that the program PATHS is for")
    add_job_options(post)
    _add_verbosity(post)


def _add_view(parsers: Any) -> None:
    text = "Make one HTML file that shows a run in a browser, from the files that --keep kept of it."
    view = _add_command(parsers, "view", text, commands.run_view)
    view.add_argument("keep", metavar="DIR", help="the folder of `convert --keep` or `levels -o`")
    view.add_argument("-o", "--output", metavar="FILE.html", required=True, help="file for the page")


def _add_script(parsers: Any) -> None:
    text = "Run a MeshLab filter script (.mlx) with the filters of MeshLab and bonecam."
    script = _add_command(parsers, "script", text, commands.run_script)
    file = "filter script; it is checked as a whole before its first filter runs"
    script.add_argument("script", metavar="SCRIPT.mlx", help=file)
    mesh = "mesh to load as a layer (repeat for more; none where the script makes its meshes)"
    script.add_argument("-i", "--input", action="append", default=[], metavar="MESH", help=mesh)
    script.add_argument("-o", "--output", metavar="DIR", required=True, help="folder for the resulting layers")
    outside = "let the script write outside DIR, and read what is not beside it or an input"
    script.add_argument("--allow-outside", action="store_true", help=outside)
    script.add_argument("--force", action="store_true", help="write over files that no earlier run wrote")
    for name, unit, limit, most, what in (
        ("--time-limit", "S", SECONDS, MOST_SECONDS, "seconds that the script may take"),
        ("--memory-limit", "GB", MEMORY, MOST_MEMORY, "memory that its data may take"),
    ):
        script.add_argument(name, metavar=unit, type=positive(most), default=limit, help=f"{what} ({limit:g})")
    _add_verbosity(script)


def _add_filters(parsers: Any) -> None:
    text = "List the filters of bonecam, or describe one with its parameters, units and ranges."
    filters = _add_command(parsers, "filters", text, commands.run_filters)
    filters.add_argument("name", metavar="NAME", nargs="?", help="name of a filter")


def _add_job(parsers: Any) -> None:
    text = "Print a job file: every parameter with its value and meaning."
    job = _add_command(parsers, "job", text, commands.run_job)
    job.add_argument("--schema", action="store_true", help="print the JSON schema of job files, for editors")
    add_job_options(job)


def _add_completion(parsers: Any, whole: Parser) -> None:
    text = "Print the completion of bonecam for a shell."
    completion = _add_command(parsers, "completion", text, commands.run_completion)
    completion.set_defaults(whole=whole)
    completion.add_argument("shell", choices=("bash", "zsh", "tcsh"), help="the shell")


def _add_command(parsers: Any, name: str, text: str, run: Any) -> argparse.ArgumentParser:
    """A command with defaults for the options that not every command has."""
    command: Parser = parsers.add_parser(
        name,
        help=text,
        description=text,
        epilog=f"examples:{EXAMPLES[name]}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.set_defaults(run=run, refuse_unknown=command.refuse_unknown, stopped=NOTHING)
    command.set_defaults(stopped_late="what it writes was written already")
    command.set_defaults(quiet=False, verbose=False, machine=None, controller=None)
    return command


def _add_keep(command: argparse.ArgumentParser) -> None:
    folder = "folder for surface, levels, tool path and pictures"
    command.add_argument("--keep", metavar="DIR", help=folder)
    sheet = "file for the setup sheet, one page to print: clamping, tools, axes, checks, warnings"
    command.add_argument("--sheet", metavar="FILE.html", help=sheet)
    _add_apt(command)
    add_no_simulation(command)


def _add_apt(command: argparse.ArgumentParser) -> None:
    apt = "file for the tool path as cutter location data in APT words"
    command.add_argument("--apt", metavar="FILE.apt", help=apt)


def _add_results(command: argparse.ArgumentParser) -> None:
    command.add_argument("--report", metavar="FILE.json", help="file for the report of everything that was measured")
    surface = "file for the T-spline: .tspline, .iga, .step or .iges"
    command.add_argument("--surface", metavar="FILE", help=surface)
    page = "file for a page to look at in a browser: levels, paths, the program played, what is left"
    command.add_argument("--html", metavar="FILE.html", help=page)


def _add_verbosity(command: argparse.ArgumentParser) -> None:
    command.add_argument("-q", "--quiet", action="store_true", help="print no progress and no summary")
    verbose = "print progress as lines with the time, not on a terminal only"
    command.add_argument("-v", "--verbose", action="store_true", help=verbose)


STOPPED = 130
"""Exit code after Ctrl-C: 128 and the number of the signal, as shells have it."""


def call(arguments: Sequence[str]) -> int:
    """Run the command with these arguments; its exit code. `help COMMAND` is `COMMAND --help`."""
    try:
        return _run(arguments)
    except BrokenPipeError:  # the reader of the output has closed it, as `head` does
        _mute()
        return 0
    except OSError:
        trouble = _trouble_of_stdout()
        if trouble is None:
            raise
        print(f"bonecam: standard output: {trouble}: write it elsewhere", file=sys.stderr)
        return 2


def _run(arguments: Sequence[str]) -> int:
    """Parse and run; OSError where standard output takes nothing."""
    parser = make_parser()
    if arguments and arguments[0] == "help":
        arguments = [*arguments[1:], "--help"]
    options, unknown = parser.parse_known_args(arguments)
    if unknown:
        options.refuse_unknown(unknown)
    if options.run is None:
        parser.print_help()
        return 0
    before = len(placed)
    try:
        code = int(options.run(options))
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, KeyboardInterrupt) or arrived:
            tell(options.stopped if len(placed) == before else options.stopped_late)
            return STOPPED
        if not isinstance(error, BonecamError):
            raise
        print(f"bonecam: {in_one_line(str(error))}", file=sys.stderr)
        return 2
    if arrived:
        tell(options.stopped_late)
    return code


def _trouble_of_stdout() -> str | None:
    """Why nothing can be printed, if so: a full disk for instance. What is printed later goes nowhere then."""
    try:
        print(flush=True)
    except OSError as error:
        _mute()
        return error.strerror or str(error)
    return None


def _mute() -> None:
    """What is printed from now on, and what waits to be, goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
