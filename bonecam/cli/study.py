"""The commands `compare` and `probe`: their arguments, and what they do."""

import argparse
from typing import Any

from bonecam.cli.help_texts import PART
from bonecam.cli.job_options import add_job_options, job_of
from bonecam.cli.parser import positive
from bonecam.cli.progress_display import shown_progress


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
    from bonecam.study.comparison import compare
    from bonecam.study.table import claims_text, table_text

    job = job_of(options)
    with shown_progress(options) as progress:
        made = compare(
            options.mesh,
            job,
            folder=options.output,
            strategies=options.strategy,
            points=options.points,
            line=options.line,
            progress=progress,
        )
    if not options.quiet:
        print(table_text(made.rows))
        print(claims_text(made.claims), end="")
    return 0


def run_probe(options: argparse.Namespace) -> int:
    """`bonecam probe`: the deviations along a line of a kept program."""
    from bonecam.study.probed_folder import probe

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
