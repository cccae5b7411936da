"""The commands `compare`, `probe` and `blades`, and the wheel of `demo --impeller`: their arguments, and what they
do."""

import argparse
from pathlib import Path
from typing import Any

import bonecam
from bonecam.cli.parser import PART, add_job_options, add_no_simulation, input_files, job_of, positive
from bonecam.cli.stopping import shown_progress
from bonecam.errors import JobError
from bonecam.files import check_files
from bonecam.job import Job


def add_compare(add_command: Any, parsers: Any) -> argparse.ArgumentParser:
    """The command `compare`."""
    text = (
        "Compare strategies on one part: morphing as published and as bonecam does it, iso-height, rotary, each "
        "planned, posted, read back, simulated and probed."
    )
    compare: argparse.ArgumentParser = add_command(parsers, "compare", text, run_compare)
    compare.add_argument("mesh", metavar="PART", help=PART)
    folder = "folder for table, claims, pictures and pages"
    compare.add_argument("-o", "--output", metavar="DIR", required=True, help=folder)
    names = "a strategy: published, bonecam, iso-height, rotary (repeat for more; all)"
    compare.add_argument("--strategy", metavar="NAME", action="append", help=names)
    _add_line(compare)
    add_job_options(compare)
    return compare


def add_probe(add_command: Any, parsers: Any) -> argparse.ArgumentParser:
    """The command `probe`."""
    text = (
        "Touch the surface that a program leaves, bent back, with a ruby ball along a line of the part, and write a "
        "measuring program for the machine's own probe."
    )
    probe: argparse.ArgumentParser = add_command(parsers, "probe", text, run_probe)
    probe.add_argument("keep", metavar="DIR", help="the folder that `convert --keep` wrote")
    probe.add_argument("-o", "--output", metavar="FILE.csv", required=True, help="file for the points")
    probe.add_argument("--picture", metavar="FILE.png", help="file for the curve")
    words = "file for a measuring program in the words of the kept job's controller (unproved)"
    probe.add_argument("--program", metavar="FILE", help=words)
    radius = "radius of the ball (0.5 mm)"
    probe.add_argument("--radius", metavar="MM", type=positive(3.0), default=0.5, help=radius)
    _add_line(probe)
    return probe


def _add_line(command: argparse.ArgumentParser) -> None:
    command.add_argument("--points", metavar="N", type=int, default=100, help="points of the line (100)")
    line = "parameter s of the line that is probed (the back of the part, its least hollow side)"
    command.add_argument("--line", metavar="S", type=float, help=line)


def run_compare(options: argparse.Namespace) -> int:
    """`bonecam compare`: strategies side by side."""
    from bonecam.study.comparison import claims_text, compare, table_text

    job = job_of(options)
    with shown_progress(options) as progress:
        comparison = compare(
            options.mesh,
            job,
            folder=options.output,
            strategies=options.strategy,
            points=options.points,
            line=options.line,
            progress=progress,
        )
    if not options.quiet:
        print(table_text(comparison.rows))
        print(claims_text(comparison.claims), end="")
    return 0


def run_probe(options: argparse.Namespace) -> int:
    """`bonecam probe`: the deviations along a line of a kept program."""
    from bonecam.study.comparison import probe

    with shown_progress(options) as progress:
        probed = probe(
            options.keep,
            points=options.points,
            line=options.line,
            radius=options.radius,
            csv=options.output,
            picture=options.picture,
            program=options.program,
            progress=progress,
        )
    if not options.quiet:
        print(probed)
    return 0


def add_blades(add_command: Any, parsers: Any) -> argparse.ArgumentParser:
    """The command `blades`."""
    text = "Make the verified NC program of a wheel of equal blades from a turned blank: channels, hub and blades."
    command: argparse.ArgumentParser = add_command(parsers, "blades", text, run_blades)
    kinds = "one blade, round both sides: table of sections (several files: one each), .step, .iges, .tsm, .tspline"
    command.add_argument("blade", metavar="BLADE", nargs="+", help=kinds)
    command.add_argument("--count", metavar="N", type=int, required=True, help="number of blades")
    hub = "the hub: a closed mesh of revolution about Z, or a table of its flow path"
    command.add_argument("--hub", metavar="FILE", required=True, help=hub)
    beside = "solids that repeat with the blades, such as splitters (repeat for more)"
    command.add_argument("--obstacle", metavar="MESH", action="append", default=[], help=beside)
    columns = '"x y z" or "x r*theta r": what the columns of sections are (x y z)'
    command.add_argument("--columns", metavar="NAMES", default="x y z", help=columns)
    axis = "the wheel's axis in the tables, with - before it where it points down (z)"
    command.add_argument("--axis", metavar="NAME", default="z", help=axis)
    flow = '"x r" or "x y z": what the columns of the flow path are (x r)'
    command.add_argument("--hub-columns", metavar="NAMES", default="x r", help=flow)
    command.add_argument("-o", "--output", metavar="PROGRAM", required=True, help="file for the NC program")
    command.add_argument("--keep", metavar="DIR", help="folder for blade, wheel, blank, tool paths and pictures")
    command.add_argument("--report", metavar="FILE.json", help="file for the report")
    command.add_argument("--html", metavar="FILE.html", help="file for a page to look at in a browser")
    command.add_argument("--sheet", metavar="FILE.html", help="file for the setup sheet, one page to print")
    apt = "file for the tool path as cutter location data in APT words"
    command.add_argument("--apt", metavar="FILE.apt", help=apt)
    add_no_simulation(command)
    add_job_options(command)
    return command


def run_blades(options: argparse.Namespace) -> int:
    """`bonecam blades`: the NC program of a wheel."""
    table = {"columns": options.columns, "axis": options.axis, "hub_columns": options.hub_columns}
    blade = options.blade[0] if len(options.blade) == 1 else options.blade
    return _make(
        options, job_of(options), blade=blade, hub=options.hub, count=options.count, obstacles=options.obstacle, **table
    )


def run_impeller(options: argparse.Namespace) -> int:
    """`bonecam demo --impeller`: the NC program of the wheel that is installed with bonecam, with its own job."""
    import bonecam_meshes
    from bonecam_meshes.impeller import BLADES

    from bonecam.nc.requirements import job_dialect

    if options.surface is not None:
        raise JobError("demo --impeller: the blade's surface is in the kept folder: give --keep, not --surface")
    options.job = options.job or str(bonecam_meshes.job("impeller"))
    job = job_of(options)
    if options.output is None:
        options.output = f"impeller{job_dialect(job.nc).extension}"
    blade, hub = (bonecam_meshes.path(f"impeller_{name}") for name in ("blade", "hub"))
    return _make(options, job, blade=blade, hub=hub, count=BLADES, obstacles=[])


def _make(
    options: argparse.Namespace, job: Job, blade: Any, hub: str | Path, count: int, obstacles: list[Any], **table: str
) -> int:
    """Call `blades` with the files to write, and print the summary of the result."""
    outputs = {name: getattr(options, name) for name in ("keep", "report", "html", "sheet", "apt")}
    files = [file for name, file in outputs.items() if file is not None and name != "keep"]
    check_files([options.output, *files], input_files(options))
    with shown_progress(options) as progress:
        bladed = bonecam.blades(
            blade,
            hub,
            count,
            obstacles,
            job,
            program=options.output,
            **outputs,
            **table,
            simulation=not options.no_simulation,
            mechanics=not options.no_mechanics,
            progress=progress,
        )
    if not options.quiet:
        print(bladed.summary)
    return 0
