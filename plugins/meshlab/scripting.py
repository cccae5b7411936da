"""Run a filter script (.mlx) on mesh files: its layers go to files of a folder, all or none.

A script may ask for more time and memory than there is, and some of MeshLab's filters end their process. It works
in a process of its own, with limits.
"""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bonecam.errors import FilterError
from bonecam.files import check_folder, require_name, whole_folder
from bonecam.progress import Progress, silent
from bonecam.runtime.worker import WorkerError, call_in_worker, function_of

NOTHING_STALE = "(?!)"
"""A regular expression of no name: layers of earlier runs stay."""

WORK = "bonecam_plugins.meshlab.script_on_mesh:apply_run"
"""The function that does the work."""
STEP = r"^line (\d+): (\w+)$"
"""A regular expression of the message with which each filter of a script begins."""
SECONDS = 900.0
"""Time that a script has, s: several times what all of the chain takes for a bone."""
MEMORY = 4.0
"""Memory that a script has for its data, GB: ten times what MeshLab takes for a million faces."""
MOST_SECONDS = 1e6
"""Most time that may be given, s: eleven days. Systems count waits in ms, with 31 bits."""
MOST_MEMORY = 1e6
"""Most memory that may be given, GB. Systems count it in bytes, with 63 bits."""


def run_script(
    script: str | Path,
    inputs: Sequence[str | Path],
    output_dir: str | Path,
    progress: Progress = silent,
    registry: Any = None,
    *,
    allow_outside: bool = False,
    force: bool = False,
    seconds: float = SECONDS,
    memory: float = MEMORY,
) -> list[Path]:
    """Load `inputs` as layers, run `script`, write every layer into `output_dir`; the files written, in the
    order of their names.

    Layers go to PLY, lines without faces to OBJ; files that filters write go there too. All of them are written
    or none. A script that writes outside `output_dir`, or reads what is not beside it or an input, is refused
    unless `allow_outside`; files that are there, and were not written by an earlier run, are written over with
    `force` only.

    The script works in a process of its own, which has `seconds` for all of it and `memory` (GB) for its data;
    with the filters of a `registry` (filters.Registry) it works in this one, without limits. Raises FileError (a
    file), FilterError (the script, with its line, or what its process did) or what a stage raises, with the line;
    ValueError where a limit is not above 0, or above MOST_SECONDS or MOST_MEMORY.
    """
    for name, limit, most in (("seconds", seconds, MOST_SECONDS), ("memory", memory, MOST_MEMORY)):
        if not 0 < limit <= most:
            raise ValueError(f"{name} = {limit!r}: give a number above 0, at most {most:,.0f}")
    for file in inputs:
        require_name(file)
    check_folder(output_dir)
    target = Path(os.path.realpath(output_dir))
    with whole_folder(output_dir, own=NOTHING_STALE, replace=force) as folder:
        run = Run(
            str(script), tuple(map(str, inputs)), folder=folder, target=target, allow_outside=allow_outside, force=force
        )
        if registry is None:
            _work_in_child(run, progress, seconds, memory)
        else:
            function_of(WORK)(run, registry, progress)
        names = sorted(str(item.relative_to(folder)) for item in folder.rglob("*") if item.is_file())
    return [Path(output_dir) / name for name in names]


@dataclass(frozen=True)
class Run:
    """A run of a script: its file, the meshes that it works on, the folder that it writes into, the one where that
    goes, and what it may do."""

    script: str
    inputs: tuple[str, ...]
    folder: Path
    target: Path
    allow_outside: bool
    force: bool


def _work_in_child(run: Run, progress: Progress, seconds: float, memory: float) -> None:
    """A run in a process of its own; FilterError names the last filter and its line where that broke down or hit a
    limit."""
    steps: list[re.Match[str]] = []

    def noted(fraction: float, message: str) -> bool | None:
        steps.extend(re.finditer(STEP, message))
        return progress(fraction, message)

    try:
        call_in_worker(WORK, run, None, seconds=seconds, memory=int(memory * 2**30), progress=noted, heard=True)
    except WorkerError as error:
        remedy = "leave it out, give it less to do, or allow more with --time-limit and --memory-limit"
        if not steps:
            raise FilterError(f"{run.script}: its beginning: {error}: {remedy}") from error
        line, name = steps[-1].groups()
        message = f"{run.script}, line {line}: {name}: {error}: {remedy}"
        raise FilterError(message, filter=name, line=int(line)) from error
