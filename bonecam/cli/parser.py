"""The parser of the command line: a wrong call is one line, with the nearest word that is known; examples of every
command; and the job that the options --job, --tools, --units, --machine, --controller and --set make."""

import argparse
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from bonecam.errors import JobError, did_you_mean
from bonecam.job import Job, read_job
from bonecam.job.sections import job_error, setting
from bonecam.job.tool_list import read_tool_list
from bonecam.text.numbers import in_one_line

EXIT_CODES = """Exit codes: 0 done; 1 a part of a batch failed; 2 wrong input, job or call (one line on stderr);
129, 130, 143 stopped by SIGHUP, Ctrl-C, SIGTERM."""
EXAMPLES = {
    "convert": """
  bonecam convert bone.stl --units m -o bone.h
  bonecam convert bone.stl -o bone.h --set stock.diameter=15 --set stock.length=37 --keep look --report bone.json
  bonecam convert bone.stl -o bone.ngc --machine linuxcnc-xyzbc""",
    "demo": """
  bonecam demo -o phalanx.h --keep look
  bonecam demo --impeller --keep wheel --html wheel.html --sheet sheet.html""",
    "levels": """
  bonecam levels bone.stl --units m -o look --set stock.kind=cylinder --set levels.roughing_depth=1""",
    "finish": """
  bonecam finish blade.txt --part hub.stl --obstacle blades.stl -o blade.h --set finishing.overhang=45""",
    "blades": """
  bonecam blades blade.txt --count 11 --hub hub.stl -o wheel.h --keep look --job wheel.toml
  bonecam blades section_*.txt --columns "x r*theta r" --axis=-x --count 15 --hub flow.txt -o wheel.h""",
    "shell": """
  bonecam shell bone.stl --units m -o shell.stl --covered 0.6""",
    "simulate": """
  bonecam simulate bone.h --keep look
  bonecam simulate look/program.h""",
    "probe": """
  bonecam probe look -o probe.csv --picture probe.png --program probe.h""",
    "compare": """
  bonecam compare bone.stl --units m -o study --job job.toml --set mechanics.refuse=false""",
    "post": """
  bonecam post look/toolpath.apt -o bone.mpf --machine hermle-c600u --controller siemens-840d
  bonecam post bone.apt --part bone.ply -o bone.mpf --machine hermle-c600u --controller siemens-840d
  bonecam post bone.h --part bone.ply -o bone.ngc --from-machine mikron-ucp600 --from-controller heidenhain \\
      --machine linuxcnc-xyzac --controller linuxcnc""",
    "view": """
  bonecam view look -o bone.html""",
    "batch": """
  bonecam batch scans/*.stl -o programs --job job.toml --jobs 4 --resume""",
    "script": """
  bonecam script levels.mlx -i bone.stl -o layers""",
    "filters": """
  bonecam filters generate_morph_levels""",
    "job": """
  bonecam job --set levels.roughing_depth=1 > job.toml
  bonecam job --schema > job.schema.json""",
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
    "completion": """
  bonecam completion bash > ~/.local/share/bash-completion/completions/bonecam""",
}


class Parser(argparse.ArgumentParser):
    """A parser that answers a wrong call with one line and exit code 2."""

    def error(self, message: str) -> NoReturn:
        """End with one line on stderr and exit code 2."""
        self.exit(2, f"{self.prog}: {in_one_line(message)}: see {self.prog} --help\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        """argparse's printing of helps and versions, but with an OSError where standard output takes nothing."""
        if file is not sys.stdout:
            return super()._print_message(message, file)
        file.write(message)
        file.flush()

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """argparse's check of a choice, with the nearest one in the message."""
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            close = did_you_mean(str(value), known)
            raise argparse.ArgumentError(action, f"{value!r} is unknown{close}: use one of {', '.join(known)}")

    def refuse_unknown(self, arguments: Sequence[str]) -> NoReturn:
        """End with one line that names the arguments that this command does not know."""
        close = did_you_mean(arguments[0].partition("=")[0], self._option_string_actions)
        self.error(f"unrecognized arguments: {' '.join(arguments)}{close}")


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
    settings = [*given]
    faults = []
    for text in texts:
        key, equals, word = text.partition("=")
        parsed = setting(key, word) if equals else None
        if parsed is None:
            faults.append(("", "", f"--set {text}: write SECTION.NAME=VALUE, like stock.diameter=15"))
        else:
            settings.append(parsed)
    changes: dict[str, dict[str, Any]] = {}
    for section, name, value in settings:
        changes.setdefault(section, {})[name] = value
    try:
        changed = job.with_values(**changes)
    except JobError as error:
        faults += error.evidence["faults"]
    if faults:
        raise job_error(faults)
    return changed
