"""The commands of the command line with their arguments and help texts, and one call of it: parse, run, and turn errors
into one line on stderr and an exit code.

Exit codes: 0 done; 1 some part of a batch failed; 2 wrong input, job or call; 129, 130, 143 stopped by SIGHUP,
SIGINT (Ctrl-C), SIGTERM.
"""

import argparse
import math
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import bonecam
from bonecam.cli import commands
from bonecam.cli.catalogues import CATALOGUES, run_catalogue
from bonecam.cli.parser import EXAMPLES, EXIT_CODES, Parser
from bonecam.cli.stopping import NOTHING, arrived, tell
from bonecam.errors import BonecamError
from bonecam.filters.scripting import MEMORY, MOST_MEMORY, MOST_SECONDS, SECONDS
from bonecam.job import NcJob, job_files
from bonecam.machine.machine import machine_names
from bonecam.nc.dialect import dialect_names
from bonecam.runtime.staging import placed
from bonecam.text.numbers import in_one_line

Argument = tuple[tuple[str, ...], dict[str, Any]]


def make_parser() -> Parser:
    """The parser of all commands; each sets `run`, which takes the options and returns the exit code."""
    text = "From a bone mesh to a verified five-axis NC program."
    parser = Parser(prog="bonecam", description=text, epilog=EXIT_CODES)
    parser.add_argument("-V", "--version", action="version", version=f"bonecam {bonecam.__version__}")
    parser.set_defaults(run=None, refuse_unknown=parser.refuse_unknown)
    parsers = parser.add_subparsers(metavar="COMMAND", parser_class=Parser)
    for name, (run, text, arguments) in _commands(parser).items():
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
        for names, settings in arguments:
            command.add_argument(*names, **settings)
    kept = "finished programs are kept, --resume continues from there"
    parsers.choices["batch"].set_defaults(stopped=kept, stopped_late=kept)
    return parser


def _argument(*names: str, **settings: Any) -> Argument:
    """An argument as `add_argument` takes it."""
    return names, settings


def _commands(parser: Parser) -> dict[str, tuple[Callable[[argparse.Namespace], int], str, list[Argument]]]:
    """What runs, the help and the arguments of each command. Options that a function of bonecam takes are named as its
    parameters are (`commands.call_with`)."""
    part = _argument(
        "mesh",
        metavar="PART",
        help="STL, PLY, OBJ or OFF mesh; STEP, IGES, SAT or DXF part; point cloud; rows of points; saved .tspline",
    )
    program = _argument(
        "-o", "--output", dest="program", metavar="PROGRAM", required=True, help="file for the NC program"
    )
    report = _argument("--report", metavar="FILE.json", help="file for the report")
    html = _argument("--html", metavar="FILE.html", help="file for a page to look at in a browser")
    apt = _argument("--apt", metavar="FILE.apt", help="file for the tool path as cutter location data in APT words")
    mechanics = _argument(
        "--no-mechanics",
        dest="mechanics",
        action="store_false",
        help="do not ask what force the cuts need and how far part and cutter bend",
    )
    proofs = [
        _argument(
            "--no-simulation",
            dest="simulation",
            action="store_false",
            help="do not simulate the removal of material from the posted text",
        ),
        mechanics,
    ]
    kept = [
        _argument("--keep", metavar="DIR", help="folder for surface, levels, tool path and pictures"),
        _argument(
            "--sheet",
            metavar="FILE.html",
            help="file for the setup sheet, one page to print: clamping, tools, axes, checks, warnings",
        ),
        apt,
        *proofs,
    ]
    results = [
        _argument("--report", metavar="FILE.json", help="file for the report of everything that was measured"),
        _argument("--surface", metavar="FILE", help="file for the T-spline: .tspline, .iga, .step or .iges"),
        _argument(
            "--html",
            metavar="FILE.html",
            help="file for a page to look at in a browser: levels, paths, the program played, what is left",
        ),
    ]
    unposted = [
        _argument(
            "--job",
            metavar="JOB.toml",
            help=f"job file, or {' or '.join(job_files())}; a value that it leaves out keeps its default",
        ),
        _argument(
            "--units",
            choices=("mm", "cm", "m", "inch", "um"),
            help="unit of the part's coordinates (the one its file states, else mm)",
        ),
        _argument(
            "--tools",
            metavar="FILE",
            help="list of the cutters that there are: a name, or a file of Fusion, FreeCAD, LinuxCNC, .csv or .toml",
        ),
        _argument(
            "--set",
            action="append",
            default=[],
            metavar="SECTION.NAME=VALUE",
            help="a parameter of the job, as `bonecam job` lists them (repeat for more)",
        ),
    ]
    known = {"machine": (NcJob().machine, machine_names()), "controller": ("the machine's own", dialect_names())}
    posted = [
        _argument(
            f"--{name}",
            metavar="NAME",
            help=f"{usual} (default), {', '.join(other for other in names if other != usual)}, or a TOML file",
        )
        for name, (usual, names) in known.items()
    ]
    job = [*unposted[:2], *posted, *unposted[2:]]
    verbosity = [
        _argument("-q", "--quiet", action="store_true", help="print no progress and no summary"),
        _argument(
            "-v", "--verbose", action="store_true", help="print progress as lines with the time, not on a terminal only"
        ),
    ]
    line = [
        _argument("--points", metavar="N", type=int, default=100, help="points of the line (100)"),
        _argument(
            "--line",
            metavar="S",
            type=float,
            help="parameter s of the line that is probed (the back of the part, its least hollow side)",
        ),
    ]
    limits = [
        _argument(name, dest=dest, metavar=unit, type=_positive(most), default=limit, help=f"{what} ({limit:g})")
        for name, dest, unit, limit, most, what in (
            ("--time-limit", "seconds", "S", SECONDS, MOST_SECONDS, "seconds that the script may take"),
            ("--memory-limit", "memory", "GB", MEMORY, MOST_MEMORY, "memory that its data may take"),
        )
    ]
    further = {
        "tools": [
            _argument(
                "--tools",
                metavar="LIST",
                help="list of cutters: a name, or a file of Fusion, FreeCAD, LinuxCNC, .csv or .toml (catalogue)",
            )
        ],
        "machines": [_argument("--picture", metavar="PNG", help="draw the machine of NAME, or of the file")],
    }
    return {
        "convert": (
            commands.run_convert,
            "Make the verified NC program of a part.",
            [part, program, *kept, *results, *job, *verbosity],
        ),
        "demo": (
            commands.run_demo,
            "Make the NC program of the phalanx, or of the impeller, that is installed with bonecam.",
            [
                _argument(
                    "-o",
                    "--output",
                    dest="program",
                    metavar="PROGRAM",
                    help="file for the NC program (phalanx.h, or with the controller's own ending)",
                ),
                _argument(
                    "--impeller",
                    action="store_true",
                    help="the impeller instead, a wheel of 11 blades from a turned blank, with a job of its own",
                ),
                *kept,
                *results,
                *job,
                *verbosity,
            ],
        ),
        "levels": (
            commands.run_levels,
            "Make the measured morph levels of a part and their pictures, without tool paths and program.",
            [
                part,
                _argument(
                    "-o",
                    "--output",
                    dest="keep",
                    metavar="DIR",
                    required=True,
                    help="folder for surface, levels and pictures",
                ),
                *results,
                *unposted,
                *verbosity,
            ],
        ),
        "finish": (
            commands.run_finish,
            "Make the verified NC program that machines one surface alone, open or closed, beside obstacles.",
            [
                _argument(
                    "surface",
                    metavar="SURFACE",
                    help="rows of points, .step, .iges, .tsm, .tspline or an open mesh; normals outward, the table's "
                    "axis Z",
                ),
                _argument("--part", metavar="MESH", help="solid that is not gouged; open surfaces need it"),
                _argument(
                    "--obstacle",
                    dest="obstacles",
                    metavar="MESH",
                    action="append",
                    default=[],
                    help="solid to keep clear of: hub, shroud, neighbour, fixture (repeat for more)",
                ),
                program,
                _argument("--keep", metavar="DIR", help="folder for surface, solid, tool path and its picture"),
                report,
                html,
                apt,
                *proofs,
                *job,
                *verbosity,
            ],
        ),
        "blades": (
            commands.run_blades,
            "Make the verified NC program of a wheel of equal blades from a turned blank: channels, hub and blades.",
            [
                _argument(
                    "blade",
                    metavar="BLADE",
                    nargs="+",
                    help="one blade, round both sides: table of sections (several files: one each), .step, .iges, "
                    ".tsm, .tspline",
                ),
                _argument("--count", metavar="N", type=int, required=True, help="number of blades"),
                _argument(
                    "--hub",
                    metavar="FILE",
                    required=True,
                    help="the hub: a closed mesh of revolution about Z, or a table of its flow path",
                ),
                _argument(
                    "--obstacle",
                    dest="obstacles",
                    metavar="MESH",
                    action="append",
                    default=[],
                    help="solids that repeat with the blades, such as splitters (repeat for more)",
                ),
                _argument(
                    "--columns",
                    metavar="NAMES",
                    default="x y z",
                    help='"x y z" or "x r*theta r": what the columns of sections are (x y z)',
                ),
                _argument(
                    "--axis",
                    metavar="NAME",
                    default="z",
                    help="the wheel's axis in the tables, with - before it where it points down (z)",
                ),
                _argument(
                    "--hub-columns",
                    metavar="NAMES",
                    default="x r",
                    help='"x r" or "x y z": what the columns of the flow path are (x r)',
                ),
                program,
                _argument("--keep", metavar="DIR", help="folder for blade, wheel, blank, tool paths and pictures"),
                report,
                html,
                _argument("--sheet", metavar="FILE.html", help="file for the setup sheet, one page to print"),
                apt,
                *proofs,
                *job,
                *verbosity,
            ],
        ),
        "shell": (
            commands.run_shell,
            "Make a shell round the finished end of a part, for its second clamping (holding.second).",
            [
                part,
                _argument("-o", "--output", metavar="MESH", required=True, help="file for the shell: .stl or .ply"),
                _argument(
                    "--covered",
                    metavar="SHARE",
                    type=_positive(),
                    default=0.5,
                    help="share of the part's height that it covers (0.5)",
                ),
                *job,
            ],
        ),
        "simulate": (
            commands.run_simulate,
            "Simulate from its text what an NC program removes, and refuse rapids and links that cut, collisions, "
            "gouges and cuts too deep.",
            [
                _argument("program", metavar="PROGRAM", help="the NC program"),
                _argument(
                    "--keep",
                    metavar="DIR",
                    help="the folder that `convert --keep` wrote: its part, stock and, without --job, job (that of "
                    "PROGRAM)",
                ),
                _argument("--cell", metavar="MM", type=_positive(), default=0.1, help="distance of the rays (0.1 mm)"),
                _argument("--report", metavar="FILE.json", help="file for the figures"),
                _argument("--html", metavar="FILE.html", help="file for a page that plays the program"),
                mechanics,
                *job,
                *verbosity,
            ],
        ),
        "probe": (
            commands.run_probe,
            "Touch the surface that a program leaves, bent back, with a ruby ball along a line of the part, and write "
            "a measuring program for the machine's own probe.",
            [
                _argument("keep", metavar="DIR", help="the folder that `convert --keep` wrote"),
                _argument("-o", "--output", dest="csv", metavar="FILE.csv", required=True, help="file for the points"),
                _argument("--picture", metavar="FILE.png", help="file for the curve"),
                _argument(
                    "--program",
                    metavar="FILE",
                    help="file for a measuring program in the words of the kept job's controller (unproved)",
                ),
                _argument(
                    "--radius", metavar="MM", type=_positive(3.0), default=0.5, help="radius of the ball (0.5 mm)"
                ),
                *line,
                *verbosity,
            ],
        ),
        "compare": (
            commands.run_compare,
            "Compare strategies on one part: morphing as published and as bonecam does it, iso-height, rotary, each "
            "planned, posted, read back, simulated and probed.",
            [
                part,
                _argument(
                    "-o",
                    "--output",
                    dest="folder",
                    metavar="DIR",
                    required=True,
                    help="folder for table, claims, pictures and pages",
                ),
                _argument(
                    "--strategy",
                    dest="strategies",
                    metavar="NAME",
                    action="append",
                    help="a strategy: published, bonecam, iso-height, rotary (repeat for more; all)",
                ),
                *line,
                *job,
                *verbosity,
            ],
        ),
        "post": (
            commands.run_post,
            "Post, prove and simulate cutter location data (APT) of another system, or a program of another control.",
            [
                _argument("paths", metavar="PATHS", help="APT statements, or with --from-machine an NC program"),
                program,
                _argument(
                    "--part",
                    dest="part_file",
                    metavar="MESH",
                    help="solid that is not gouged, in the paths' frame: a mesh, or a kept folder or surface (that of "
                    "--keep)",
                ),
                _argument(
                    "--keep",
                    metavar="DIR",
                    help="a folder that `convert --keep` wrote: its stock is cut, without --job by its job (that of "
                    "PATHS)",
                ),
                _argument("--from-machine", metavar="NAME", help="machine that the program PATHS is for"),
                _argument("--from-controller", metavar="NAME", help="controller that the program PATHS is for"),
                *job,
                *verbosity,
            ],
        ),
        "view": (
            commands.run_view,
            "Make one HTML file that shows a run in a browser, from the files that --keep kept of it.",
            [
                _argument("keep", metavar="DIR", help="the folder of `convert --keep` or `levels -o`"),
                _argument("-o", "--output", metavar="FILE.html", required=True, help="file for the page"),
            ],
        ),
        "batch": (
            commands.run_batch,
            "Make the NC programs of several parts, each in a process of its own.",
            [
                _argument(
                    "parts",
                    metavar="PART",
                    nargs="+",
                    help="parts as for `convert`, folders of parts, or a table of parts (parts.csv: file, job, units, "
                    "stock, output)",
                ),
                _argument(
                    "-o", "--output", metavar="DIR", required=True, help="folder for programs, reports and batch.csv"
                ),
                _argument("--jobs", metavar="N", type=int, default=2, help="number of parts at a time (2)"),
                _argument(
                    "--resume",
                    action="store_true",
                    help="skip parts that an earlier run finished with the same mesh, job, files of the job, and "
                    "package",
                ),
                _argument("--html", action="store_true", help="write a page of each part, NAME.html"),
                _argument("--sheet", action="store_true", help="write a setup sheet of each part, NAME.sheet.html"),
                _argument(
                    "--keep",
                    action="store_true",
                    help="write a folder of each part, NAME: surface, levels, tool path and pictures",
                ),
                _argument(
                    "--scheduler",
                    metavar="ADDRESS",
                    help="run on the workers of a Dask scheduler (tcp://HOST:8786), or of one started here (local)",
                ),
                _argument(
                    "--share",
                    metavar="K/N",
                    type=share_of,
                    default=(1, 1),
                    help="do the Kth of N shares of the parts alone, as a task of an array of jobs does",
                ),
                *job,
                _argument("-q", "--quiet", action="store_true", help="print no line for each part"),
                _argument("-v", "--verbose", action="store_true", help="print the steps of each part as lines"),
            ],
        ),
        "script": (
            commands.run_script,
            "Run a MeshLab filter script (.mlx) with the filters of MeshLab and bonecam.",
            [
                _argument(
                    "script",
                    metavar="SCRIPT.mlx",
                    help="filter script; it is checked as a whole before its first filter runs",
                ),
                _argument(
                    "-i",
                    "--input",
                    dest="inputs",
                    action="append",
                    default=[],
                    metavar="MESH",
                    help="mesh to load as a layer (repeat for more; none where the script makes its meshes)",
                ),
                _argument(
                    "-o",
                    "--output",
                    dest="output_dir",
                    metavar="DIR",
                    required=True,
                    help="folder for the resulting layers",
                ),
                _argument(
                    "--allow-outside",
                    action="store_true",
                    help="let the script write outside DIR, and read what is not beside it or an input",
                ),
                _argument("--force", action="store_true", help="write over files that no earlier run wrote"),
                *limits,
                *verbosity,
            ],
        ),
        "filters": (
            commands.run_filters,
            "List the filters of bonecam, or describe one with its parameters, units and ranges.",
            [_argument("name", metavar="NAME", nargs="?", help="name of a filter")],
        ),
        "job": (
            commands.run_job,
            "Print a job file: every parameter with its value and meaning.",
            [_argument("--schema", action="store_true", help="print the JSON schema of job files, for editors"), *job],
        ),
        **{
            kind: (
                partial(run_catalogue, kind),
                f"List the {kind} that are known by name, show one, or check a file.",
                [
                    _argument("what", metavar="NAME|check", nargs="?", help=f"a {one} to show, or check"),
                    _argument("file", metavar="FILE", nargs="?", help="the .toml file to check"),
                    *further.get(kind, ()),
                    _argument("--schema", action="store_true", help="print the JSON schema of such files"),
                ],
            )
            for kind, (_, _, one) in CATALOGUES.items()
        },
        "completion": (
            partial(commands.run_completion, parser),
            "Print the completion of bonecam for a shell.",
            [_argument("shell", choices=("bash", "zsh", "tcsh"), help="the shell")],
        ),
    }


def _positive(most: float = math.inf) -> Callable[[str], float]:
    """argparse's type of a finite number above 0, at most `most`; its message has the name of the function."""

    def number(text: str) -> float:
        value = float(text)
        if not (0 < value <= most and math.isfinite(value)):
            raise ValueError(text)
        return value

    number.__name__ = f"number above 0{'' if most == math.inf else f', at most {most:,.0f},'}"
    return number


def share_of(text: str) -> tuple[int, int]:
    """argparse's type of a share K/N, K from 1 to N."""
    number, slash, count = text.partition("/")
    if not slash or not 1 <= int(number) <= int(count):
        raise argparse.ArgumentTypeError(f"{text!r}: give K/N, K from 1 to N, like 3/30")
    return int(number), int(count)


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
        try:
            print(flush=True)  # which fails where standard output takes nothing: a full disk for instance
        except OSError as error:
            trouble = error.strerror or str(error)
        else:
            raise
        _mute()
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


def _mute() -> None:
    """What is printed from now on, and what waits to be, goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
