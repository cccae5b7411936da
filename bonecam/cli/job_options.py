"""The options of the command line that make the job: --job, --units, --machine, --controller and --set; and those that
leave out what is asked of its program: --no-simulation and --no-mechanics."""

import argparse
from collections.abc import Sequence
from typing import Any

from bonecam.errors import JobError
from bonecam.job import Job, NcJob, job_files, read_job
from bonecam.job.sections import job_error, setting
from bonecam.job.tool_list import read_tool_list
from bonecam.machine.machine import machine_names
from bonecam.nc.dialect import dialect_names


def add_job_options(command: argparse.ArgumentParser, *, posted: bool = True) -> None:
    """Add the options of the job to a command; those of machine and controller where a program is `posted`."""
    file = f"job file, or {' or '.join(job_files())}; a value that it leaves out keeps its default"
    command.add_argument("--job", metavar="JOB.toml", help=file)
    unit = "unit of the part's coordinates (the one its file states, else mm)"
    command.add_argument("--units", choices=("mm", "cm", "m", "inch", "um"), help=unit)
    if posted:
        default = NcJob()
        machine = _choice(machine_names(), default.machine)
        command.add_argument("--machine", metavar="NAME", help=machine)
        controller = _choice(dialect_names(), "the machine's own")
        command.add_argument("--controller", metavar="NAME", help=controller)
    tools = "list of the cutters that there are: a name, or a file of Fusion, FreeCAD, LinuxCNC, .csv or .toml"
    command.add_argument("--tools", metavar="FILE", help=tools)
    setting = "a parameter of the job, as `bonecam job` lists them (repeat for more)"
    command.add_argument("--set", action="append", default=[], metavar="SECTION.NAME=VALUE", help=setting)


def add_no_simulation(command: argparse.ArgumentParser) -> None:
    """Add --no-simulation and --no-mechanics to a command."""
    without = "do not simulate the removal of material from the posted text"
    command.add_argument("--no-simulation", action="store_true", help=without)
    add_no_mechanics(command)


def add_no_mechanics(command: argparse.ArgumentParser) -> None:
    """Add --no-mechanics to a command."""
    without = "do not ask what force the cuts need and how far part and cutter bend"
    command.add_argument("--no-mechanics", action="store_true", help=without)


def _choice(names: Sequence[str], default: str) -> str:
    """The help of an option that takes one of the `names`, or a file."""
    return f"{default} (default), {', '.join(name for name in names if name != default)}, or a TOML file"


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
    changes: dict[str, dict[str, Any]] = {}
    settings = [(text, _setting(text)) for text in texts]
    remedy = "write SECTION.NAME=VALUE, like stock.diameter=15"
    faults = [("", "", f"--set {text}: {remedy}") for text, parsed in settings if parsed is None]
    for section, name, value in [*given] + [parsed for _, parsed in settings if parsed is not None]:
        changes.setdefault(section, {})[name] = value
    try:
        changed = job.with_values(**changes)
    except JobError as error:
        faults += error.evidence["faults"]
    if faults:
        raise job_error(faults)
    return changed


def _setting(text: str) -> tuple[str, str, Any] | None:
    """Section, name and value of SECTION.NAME=VALUE, None where that is not its form."""
    key, equals, value = text.partition("=")
    return setting(key, value) if equals else None
