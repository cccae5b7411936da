"""The commands of the core. Each takes the options, prints its results to stdout, and returns the exit code."""

import argparse
import json
from contextlib import nullcontext
from functools import partial

import bonecam
from bonecam.cli.catalogues import CATALOGUES, run_catalogue
from bonecam.cli.command import (
    APT,
    HTML,
    JOB,
    KEPT,
    MECHANICS,
    PART,
    PROGRAM,
    PROOFS,
    REPORT,
    RESULTS,
    TSPLINES,
    UNPOSTED,
    VERBOSITY,
    Command,
    argument,
    call_with,
    input_files,
    job_of,
    kept_job,
    make,
    name_program,
    positive,
)
from bonecam.errors import JobError
from bonecam.files import check_files, write_whole
from bonecam.job import write_job, write_short_job
from bonecam.plugins import all_added


def run_convert(options: argparse.Namespace) -> int:
    """`bonecam convert`: the NC program of a part; with --whole that of its second clamping too."""
    return make(bonecam.convert, options)


def run_demo(options: argparse.Namespace) -> int:
    """`bonecam demo`: the NC program of the phalanx that is installed with bonecam, or what a plugin shows."""
    import bonecam_meshes

    if getattr(options, "demo", None) is not None:
        return int(DEMOS[options.demo].run(options))
    name_program(options, "phalanx")
    options.mesh = bonecam_meshes.path("phalanx")
    return run_convert(options)


def run_levels(options: argparse.Namespace) -> int:
    """`bonecam levels`: the levels of a part and their pictures."""
    return make(bonecam.morph_levels, options)


def run_finish(options: argparse.Namespace) -> int:
    """`bonecam finish`: the NC program of one surface."""
    return make(bonecam.finish, options, "program report html apt")


def run_view(options: argparse.Namespace) -> int:
    """`bonecam view`: the page of a run, from its kept files, and that of its second clamping."""
    from bonecam.report.kept import kept_pages

    bonecam.view(options.keep, options.output)
    print("\n".join(str(page) for page in kept_pages(options.keep, options.output)))
    return 0


def run_shell(options: argparse.Namespace) -> int:
    """`bonecam shell`: a shell for the second clamping."""
    job = bonecam.clamping_shell(options.mesh, job_of(options), output=options.output, covered=options.covered)
    holding = job.holding
    values = {"parting": "true", "second": holding.second, "second_flat": holding.second_flat}
    values["second_pin"] = f"{holding.second_pin:g}"
    print(" ".join(f"--set holding.{name}={value}" for name, value in values.items()))
    return 0


def run_simulate(options: argparse.Namespace) -> int:
    """`bonecam simulate`: what a program removes, from its text."""
    from bonecam.report.typed import report_text
    from bonecam.report.warnings import check_warnings, warnings_of
    from bonecam.simulation import simulation_report, simulation_text
    from bonecam.verify.removal import check_removal_of_job

    job = kept_job(options, options.program)
    if options.keep is None:
        raise JobError(f"{options.program}: no folder of its run is named: give the one of `convert --keep` (--keep)")
    wanted = [file for file in (options.report, options.html) if file is not None]
    check_files(wanted, [options.program, *input_files(options)])
    removal = call_with(bonecam.simulate, options, job=job)
    report = simulation_report(removal, job)
    if options.report is not None:
        write_whole(options.report, report_text(report))
    check_removal_of_job(removal, job)
    check_warnings(warnings_of(report, job), job, options.program)
    if not options.quiet:
        print(simulation_text(report))
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


def run_warm(options: argparse.Namespace) -> int:
    """`bonecam warm`: what a default run calls, compiled beforehand."""
    from bonecam.cli.stopping import shown_progress
    from bonecam.kernels import COMPILED_FOR
    from bonecam.kernels.warming import kept_in, warming

    with shown_progress(options) as progress, warming(progress):
        pass
    if not options.quiet:
        print(f"compiled for {COMPILED_FOR}, kept in {kept_in()}")
    return 0


def run_job(options: argparse.Namespace) -> int:
    """`bonecam job`: the job file of the options, or the schema of such files."""
    if options.schema:
        from bonecam.cli.schemas import job_schema

        print(json.dumps(job_schema(), indent=2))
    else:
        job = job_of(options)
        print(write_job(job) if options.all else write_short_job(job), end="")
    return 0


def share_of(text: str) -> tuple[int, int]:
    """argparse's type of a share K/N, K from 1 to N."""
    number, slash, count = text.partition("/")
    if not slash or not 1 <= int(number) <= int(count):
        raise argparse.ArgumentTypeError(f"{text!r}: give K/N, K from 1 to N, like 3/30")
    return int(number), int(count)


FURTHER = {
    "tools": [
        argument(
            "--tools",
            metavar="LIST",
            help="list of cutters: a name, or a file of Fusion, FreeCAD, LinuxCNC, .csv or .toml (catalogue)",
        )
    ],
    "machines": [argument("--picture", metavar="PNG", help="draw the machine of NAME, or of the file")],
}
CATALOGUE_EXAMPLES = {
    "machines": """
  bonecam machines
  bonecam machines check my-mill.toml""",
    "dialects": """
  bonecam dialects heidenhain
  bonecam dialects check my-control.toml""",
    "materials": """
  bonecam materials titanium""",
    "tools": """
  bonecam tools
  bonecam tools --tools shop.json
  bonecam convert bone.stl -o bone.h --tools shop.json --set finishing.preset=3""",
}

BATCH_KEPT = "finished programs are kept, --resume continues from there"
"""What a batch leaves that is stopped."""
DEMOS: dict[str, Command] = all_added("demos", Command)
"""What plugins show."""

COMMANDS: dict[str, Command] = {
    "convert": Command(
        run_convert,
        "Make the verified NC program of a part.",
        [
            PART,
            PROGRAM,
            argument(
                "--whole",
                action="store_true",
                help="cut the stump of the post off too: writes a shell that holds the parted part (bone.shell.stl; to "
                "print: bone.shell.print.3mf and .stl), and a second program (bone.second.h)",
            ),
            *KEPT,
            *RESULTS,
            *JOB,
            *VERBOSITY,
        ],
        examples="""
  bonecam convert bone.stl --units m -o bone.h
  bonecam convert bone.stl --units m -o bone.h --whole
  bonecam convert bone.stl -o bone.h --set stock.diameter=15 --set stock.length=37 --keep look --report bone.json
  bonecam convert bone.stl -o bone.ngc --machine linuxcnc-xyzbc""",
    ),
    "demo": Command(
        run_demo,
        "Make the NC program of the phalanx that is installed with bonecam, or show what a plugin does.",
        [
            argument(
                "-o",
                "--output",
                dest="program",
                metavar="PROGRAM",
                help="file for the NC program (phalanx.h, or with the controller's own ending)",
            ),
            *(
                argument(f"--{name}", dest="demo", action="store_const", const=name, help=demo.help)
                for name, demo in DEMOS.items()
            ),
            *KEPT,
            *RESULTS,
            *JOB,
            *VERBOSITY,
        ],
        examples="""
  bonecam demo -o phalanx.h --keep look"""
        + "".join(demo.examples for demo in DEMOS.values()),
    ),
    "levels": Command(
        run_levels,
        "Make the measured morph levels of a part and their pictures, without tool paths and program.",
        [
            PART,
            argument(
                "-o",
                "--output",
                dest="keep",
                metavar="DIR",
                required=True,
                help="folder for surface, levels and pictures",
            ),
            *RESULTS,
            *UNPOSTED,
            *VERBOSITY,
        ],
        examples="""
  bonecam levels bone.stl --units m -o look --set stock.kind=cylinder --set levels.roughing_depth=1""",
    ),
    "finish": Command(
        run_finish,
        "Make the verified NC program that machines one surface alone, open or closed, beside obstacles.",
        [
            argument(
                "surface",
                metavar="SURFACE",
                help=f"rows of points, .step, .iges, {TSPLINES} or an open mesh; normals outward, the table's axis Z",
            ),
            argument("--part", metavar="MESH", help="solid that is not gouged; open surfaces need it"),
            argument(
                "--obstacle",
                dest="obstacles",
                metavar="MESH",
                action="append",
                default=[],
                help="solid to keep clear of: hub, shroud, neighbour, fixture (repeat for more)",
            ),
            PROGRAM,
            argument("--keep", metavar="DIR", help="folder for surface, solid, tool path and its picture"),
            REPORT,
            HTML,
            APT,
            *PROOFS,
            *JOB,
            *VERBOSITY,
        ],
        examples="""
  bonecam finish blade.txt --part hub.stl --obstacle blades.stl -o blade.h --set finishing.overhang=45""",
    ),
    "shell": Command(
        run_shell,
        "Make a shell round the finished end of a part, for its second clamping (holding.second).",
        [
            PART,
            argument("-o", "--output", metavar="MESH", required=True, help="file for the shell: .stl or .ply"),
            argument(
                "--covered",
                metavar="SHARE",
                type=positive(),
                default=0.5,
                help="share of the part's height that it covers (0.5)",
            ),
            *JOB,
        ],
        examples="""
  bonecam shell bone.stl --units m -o shell.stl --covered 0.6""",
    ),
    "simulate": Command(
        run_simulate,
        "Simulate from its text what an NC program removes, and refuse rapids and links that cut, collisions, "
        "gouges and cuts too deep.",
        [
            argument("program", metavar="PROGRAM", help="the NC program"),
            argument(
                "--keep",
                metavar="DIR",
                help="the folder that `convert --keep` wrote: its part, stock and, without --job, job (that of "
                "PROGRAM)",
            ),
            argument("--cell", metavar="MM", type=positive(), default=0.1, help="distance of the rays (0.1 mm)"),
            argument("--report", metavar="FILE.json", help="file for the figures"),
            argument("--html", metavar="FILE.html", help="file for a page that plays the program"),
            MECHANICS,
            *JOB,
            *VERBOSITY,
        ],
        examples="""
  bonecam simulate bone.h --keep look
  bonecam simulate look/program.h""",
    ),
    "view": Command(
        run_view,
        "Make one HTML file that shows a run in a browser, from the files that --keep kept of it.",
        [
            argument("keep", metavar="DIR", help="the folder of `convert --keep` or `levels -o`"),
            argument("-o", "--output", metavar="FILE.html", required=True, help="file for the page"),
        ],
        examples="""
  bonecam view look -o bone.html""",
    ),
    "batch": Command(
        run_batch,
        "Make the NC programs of several parts, each in a process of its own.",
        [
            argument(
                "parts",
                metavar="PART",
                nargs="+",
                help="parts as for `convert`, folders of parts, or a table of parts (parts.csv: file, job, units, "
                "stock, output)",
            ),
            argument("-o", "--output", metavar="DIR", required=True, help="folder for programs, reports and batch.csv"),
            argument("--jobs", metavar="N", type=int, default=2, help="number of parts at a time (2)"),
            argument(
                "--resume",
                action="store_true",
                help="skip parts that an earlier run finished with the same mesh, job, files of the job, and package",
            ),
            argument("--html", action="store_true", help="write a page of each part, NAME.html"),
            argument("--sheet", action="store_true", help="write a setup sheet of each part, NAME.sheet.html"),
            argument(
                "--keep",
                action="store_true",
                help="write a folder of each part, NAME: surface, levels, tool path and pictures",
            ),
            argument(
                "--scheduler",
                metavar="ADDRESS",
                help="run on the workers of a Dask scheduler (tcp://HOST:8786), or of one started here (local)",
            ),
            argument(
                "--share",
                metavar="K/N",
                type=share_of,
                default=(1, 1),
                help="do the Kth of N shares of the parts alone, as a task of an array of jobs does",
            ),
            *JOB,
            argument("-q", "--quiet", action="store_true", help="print no line for each part"),
            argument("-v", "--verbose", action="store_true", help="print the steps of each part as lines"),
        ],
        examples="""
  bonecam batch scans/*.stl -o programs --job job.toml --jobs 4 --resume""",
        stopped=BATCH_KEPT,
        stopped_late=BATCH_KEPT,
    ),
    "warm": Command(
        run_warm,
        "Compile what a default run needs, on all cores, and keep it: for an image, a CI, or the nodes of a cluster.",
        VERBOSITY,
        examples="""
  bonecam warm
  NUMBA_CACHE_DIR=/opt/kernels bonecam warm""",
    ),
    "job": Command(
        run_job,
        "Print a job file: the parameters that are set often or not at their default, with value and meaning.",
        [
            argument("--all", action="store_true", help="print every parameter, those that are set seldom too"),
            argument("--schema", action="store_true", help="print the JSON schema of job files, for editors"),
            *JOB,
        ],
        examples="""
  bonecam job --set levels.roughing_depth=1 > job.toml
  bonecam job --all
  bonecam job --schema > job.schema.json""",
    ),
    **{
        kind: Command(
            partial(run_catalogue, kind),
            f"List the {kind} that are known by name, show one, or check a file.",
            [
                argument("what", metavar="NAME|check", nargs="?", help=f"a {one} to show, or check"),
                argument("file", metavar="FILE", nargs="?", help="the .toml file to check"),
                *FURTHER.get(kind, ()),
                argument("--schema", action="store_true", help="print the JSON schema of such files"),
            ],
            CATALOGUE_EXAMPLES[kind],
        )
        for kind, (_, _, one) in CATALOGUES.items()
    },
}
"""The commands of the core; `completion`, which needs the parser of all, is declared beside that."""
