"""`bonecam script` and `bonecam filters`."""

import argparse
import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from bonecam_plugins.meshlab import scripting
from bonecam_plugins.meshlab.scripting import MEMORY, MOST_MEMORY, MOST_SECONDS, SECONDS

from bonecam.cli.command import VERBOSITY, Command, argument, call_with, positive

STDOUT, STDERR = 1, 2
"""Numbers of the process's streams."""


def run_script(options: argparse.Namespace) -> int:
    """`bonecam script`: a MeshLab filter script on meshes; prints the files of the resulting layers."""
    with native_output_to_stderr():
        written = call_with(scripting.run_script, options)
    if not options.quiet:
        print("".join(f"{path}\n" for path in written), end="")
    return 0


@contextmanager
def native_output_to_stderr() -> Iterator[None]:
    """What libraries write to the process's stdout (MeshLab's filters do) goes to its stderr."""
    sys.stdout.flush()
    stdout = os.dup(STDOUT)
    os.dup2(STDERR, STDOUT)
    try:
        yield
    finally:
        ctypes.CDLL(None).fflush(None)  # what C keeps for stdout
        os.dup2(stdout, STDOUT)
        os.close(stdout)


def run_filters(options: argparse.Namespace) -> int:
    """`bonecam filters`: the list of filters, or the description of one."""
    from bonecam_plugins.meshlab.filter import catalogue

    print(catalogue(options.name))
    return 0


LIMITS = [
    argument(name, dest=dest, metavar=unit, type=positive(most), default=limit, help=f"{what} ({limit:g})")
    for name, dest, unit, limit, most, what in (
        ("--time-limit", "seconds", "S", SECONDS, MOST_SECONDS, "seconds that the script may take"),
        ("--memory-limit", "memory", "GB", MEMORY, MOST_MEMORY, "memory that its data may take"),
    )
]

SCRIPT = Command(
    run_script,
    "Run a MeshLab filter script (.mlx) with the filters of MeshLab and bonecam.",
    [
        argument(
            "script", metavar="SCRIPT.mlx", help="filter script; it is checked as a whole before its first filter runs"
        ),
        argument(
            "-i",
            "--input",
            dest="inputs",
            action="append",
            default=[],
            metavar="MESH",
            help="mesh to load as a layer (repeat for more; none where the script makes its meshes)",
        ),
        argument(
            "-o", "--output", dest="output_dir", metavar="DIR", required=True, help="folder for the resulting layers"
        ),
        argument(
            "--allow-outside",
            action="store_true",
            help="let the script write outside DIR, and read what is not beside it or an input",
        ),
        argument("--force", action="store_true", help="write over files that no earlier run wrote"),
        *LIMITS,
        *VERBOSITY,
    ],
    examples="""
  bonecam script levels.mlx -i bone.stl -o layers""",
)

FILTERS = Command(
    run_filters,
    "List the filters of bonecam, or describe one with its parameters, units and ranges.",
    [argument("name", metavar="NAME", nargs="?", help="name of a filter")],
    examples="""
  bonecam filters generate_morph_levels""",
)
