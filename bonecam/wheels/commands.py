"""`bonecam blades` and `bonecam demo --impeller`."""

import argparse

from bonecam.cli.command import (
    APT,
    HTML,
    JOB,
    PROGRAM,
    PROOFS,
    REPORT,
    VERBOSITY,
    Command,
    argument,
    make,
    name_program,
)
from bonecam.errors import JobError

FILES = "program report html sheet apt"
"""Options of the files of a wheel."""


def run_blades(options: argparse.Namespace) -> int:
    """`bonecam blades`: the NC program of a wheel."""
    from bonecam.wheels.blading import blades

    options.blade = options.blade[0] if len(options.blade) == 1 else options.blade
    return make(blades, options, FILES)


def run_demo(options: argparse.Namespace) -> int:
    """`bonecam demo --impeller`: the NC program of the impeller with its own job, installed with bonecam."""
    import bonecam_meshes
    from bonecam_meshes.impeller import BLADES

    if options.surface is not None:
        raise JobError("demo --impeller: the blade's surface is in the kept folder: give --keep, not --surface")
    options.job = options.job or str(bonecam_meshes.job("impeller"))
    name_program(options, "impeller")
    options.blade, options.hub = [bonecam_meshes.path("impeller_blade")], bonecam_meshes.path("impeller_hub")
    options.count = BLADES
    return run_blades(options)


DEMO = Command(
    run_demo,
    "the impeller instead, a wheel of 11 blades from a turned blank, with a job of its own",
    examples="\n  bonecam demo --impeller --keep wheel --html wheel.html --sheet sheet.html",
)

COMMAND = Command(
    run_blades,
    "Make the verified NC program of a wheel of equal blades from a turned blank: channels, hub and blades.",
    [
        argument(
            "blade",
            metavar="BLADE",
            nargs="+",
            help="one blade, round both sides: table of sections (several files: one each), .step, .iges, "
            ".tsm, .tspline",
        ),
        argument("--count", metavar="N", type=int, required=True, help="number of blades"),
        argument(
            "--hub",
            metavar="FILE",
            required=True,
            help="the hub: a closed mesh of revolution about Z, or a table of its flow path",
        ),
        argument(
            "--obstacle",
            dest="obstacles",
            metavar="MESH",
            action="append",
            default=[],
            help="solids that repeat with the blades, such as splitters (repeat for more)",
        ),
        argument(
            "--columns",
            metavar="NAMES",
            default="x y z",
            help='"x y z" or "x r*theta r": what the columns of sections are (x y z)',
        ),
        argument(
            "--axis",
            metavar="NAME",
            default="z",
            help="the wheel's axis in the tables, with - before it where it points down (z)",
        ),
        argument(
            "--hub-columns",
            metavar="NAMES",
            default="x r",
            help='"x r" or "x y z": what the columns of the flow path are (x r)',
        ),
        PROGRAM,
        argument("--keep", metavar="DIR", help="folder for blade, wheel, blank, tool paths and pictures"),
        REPORT,
        HTML,
        argument("--sheet", metavar="FILE.html", help="file for the setup sheet, one page to print"),
        APT,
        *PROOFS,
        *JOB,
        *VERBOSITY,
    ],
    examples="""
  bonecam blades blade.txt --count 11 --hub hub.stl -o wheel.h --keep look --job wheel.toml
  bonecam blades section_*.txt --columns "x r*theta r" --axis=-x --count 15 --hub flow.txt -o wheel.h""",
)
