"""`bonecam compare` and `bonecam probe`."""

import argparse

from bonecam.cli.command import JOB, PART, VERBOSITY, Command, argument, call_with, job_of, positive


def run_compare(options: argparse.Namespace) -> int:
    """`bonecam compare`: strategies side by side."""
    from bonecam_plugins.study.comparison import claims_text, compare, table_text

    comparison = call_with(compare, options, job=job_of(options))
    if not options.quiet:
        print(table_text(comparison.rows))
        print(claims_text(comparison.claims), end="")
    return 0


def run_probe(options: argparse.Namespace) -> int:
    """`bonecam probe`: the deviations along a line of a kept program."""
    from bonecam_plugins.study.comparison import probe

    probed = call_with(probe, options)
    if not options.quiet:
        print(probed)
    return 0


LINE = [
    argument("--points", metavar="N", type=int, default=100, help="points of the line (100)"),
    argument(
        "--line",
        metavar="S",
        type=float,
        help="parameter s of the line that is probed (the back of the part, its least hollow side)",
    ),
]

COMPARE = Command(
    run_compare,
    "Compare strategies on one part: morphing as published and as bonecam does it, iso-height, rotary, each "
    "planned, posted, read back, simulated and probed.",
    [
        PART,
        argument(
            "-o",
            "--output",
            dest="folder",
            metavar="DIR",
            required=True,
            help="folder for table, claims, pictures and pages",
        ),
        argument(
            "--strategy",
            dest="strategies",
            metavar="NAME",
            action="append",
            help="a strategy: published, bonecam, iso-height, rotary (repeat for more; all)",
        ),
        *LINE,
        *JOB,
        *VERBOSITY,
    ],
    examples="""
  bonecam compare bone.stl --units m -o study --job job.toml --set mechanics.refuse=false""",
)

PROBE = Command(
    run_probe,
    "Touch the surface that a program leaves, bent back, with a ruby ball along a line of the part, and write "
    "a measuring program for the machine's own probe.",
    [
        argument("keep", metavar="DIR", help="the folder that `convert --keep` wrote"),
        argument("-o", "--output", dest="csv", metavar="FILE.csv", required=True, help="file for the points"),
        argument("--picture", metavar="FILE.png", help="file for the curve"),
        argument(
            "--program",
            metavar="FILE",
            help="file for a measuring program in the words of the kept job's controller (unproved)",
        ),
        argument("--radius", metavar="MM", type=positive(3.0), default=0.5, help="radius of the ball (0.5 mm)"),
        *LINE,
        *VERBOSITY,
    ],
    examples="""
  bonecam probe look -o probe.csv --picture probe.png --program probe.h""",
)
