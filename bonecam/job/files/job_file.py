"""Jobs as TOML files, and the files that a job names: a stock, a shell, and machine, controller and material where they
are no shipped ones."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from bonecam import plugins
from bonecam.errors import JobError
from bonecam.files import input_text, is_unicode
from bonecam.job.parameter import record
from bonecam.job.sections import CUTTERS, Job, job_error
from bonecam.job.tool_section import AUTO, SIZES, ToolJob
from bonecam.text.toml import lines_of_keys, parse_toml, toml_lines

PATHS = {
    (section.name, item.name): record(item)
    for section in fields(Job)
    for item in fields(getattr(Job(), section.name))
    if record(item).file is not None
}
"""The parameters that may be the path of a file, by section and name."""


def job_files() -> dict[str, Path]:
    """The job files that come with bonecam, are the user's, or come with other packages, by name."""
    return plugins.named_files("jobs", Path(__file__).parent)


def read_job(path: str | Path, base: Job | None = None, tools: str | None = None) -> Job:
    """The job of a TOML file, or of a name (`job_files`), whose tables are the sections of a job. A value that it
    leaves out is that of `base`; `tools`, where given, is its nc.tools. Paths in it count from its folder.

    JobError names the file, and all that is wrong in it with the lines.
    """
    path = job_files().get(str(path), path)
    try:
        text = input_text(path)
        values = parse_toml(text)
    except OSError as error:
        remedy = f"give a readable job file, or one of the names {', '.join(job_files())}"
        raise JobError(f"{path}: {error.strerror}: {remedy}", file=str(path)) from error
    except ValueError as error:
        raise JobError(f"{path}: {error}: correct the TOML there", file=str(path)) from error

    faults = []
    for name in [name for name, value in values.items() if not isinstance(value, dict)]:
        faults.append(("", name, f"{name!r} stands outside a section: put it below one like [path]"))
        del values[name]
    try:
        values = counted_from(os.path.dirname(path), values)
        values |= {} if tools is None else {"nc": {**values.get("nc", {}), "tools": tools}}
        job = (base or Job()).with_values(**values)
    except JobError as error:
        faults += error.evidence["faults"]
    if faults:
        lines = lines_of_keys(text)
        placed = []
        for section, field, what in faults:
            line = lines.get((section, field)) or lines.get((section, ""))
            placed.append((line or 0, section, field, f"line {line}: {what}" if line else what))
        placed.sort(key=lambda fault: fault[0])
        whole = job_error([fault[1:] for fault in placed], f"{path}: ")
        raise JobError(str(whole), file=str(path), **whole.evidence)
    return job


OFTEN = {
    "mesh": "units mirror scale label facets",
    "surface": "tolerance",
    "stock": "kind diameter length width depth mesh allowance",
    "holding": "tailstock diameter length chuck_diameter chuck_height riser_diameter riser_height stub_diameter "
    "stub_length neck parting second",
    "levels": "finishing_depth finishing_levels roughing_depth schedule depths",
    "mechanics": "refuse",
    "path": "pattern direction chord_tolerance clearance fine_cutter feed max_tilt_deg",
    "nc": "machine controller tools plunge_feed tool_change coolant coolant_kind work_offset program_number split "
    "optional_stop park part_zero",
    "warnings": "refuse",
}
"""The parameters that are set often, of sections that have others too: what a part, its bar and the shop differ in."""
SELDOM = "# Set seldom"


def write_job(job: Job, beside: dict[str, Any] | None = None) -> str:
    """The TOML text of a job, every value with its tooltip, those that are set often first in each section. Its paths
    are absolute but for those of `beside`, values by section of files that lie beside the text. JobError where a text
    has characters without a code."""
    job = from_anywhere(job).with_values(**(beside or {}))
    lines: list[str] = []
    for item in fields(job):
        section = getattr(job, item.name)
        often, seldom = _groups(item.name, section)
        lines += [f"[{item.name}]", *_lines(item.name, section, often)]
        lines += [SELDOM, *_lines(item.name, section, seldom)] if seldom else []
        lines.append("")
    return "\n".join(lines)


def write_short_job(job: Job) -> str:
    """The TOML text of the same job, without what is set seldom and has its default, and without what sections of
    cutters have as the first one has it. JobError as for `write_job`."""
    job, plain = from_anywhere(job), Job()
    lines: list[str] = []
    for item in fields(job):
        section, usual = getattr(job, item.name), getattr(plain, item.name)
        often, seldom = _groups(item.name, section)
        changed = {name for name in (*often, *seldom) if getattr(section, name) != getattr(usual, name)}
        shown = [*often, *(name for name in seldom if name in changed)]
        like_first = item.name in CUTTERS[1:]
        if like_first and section.preset == AUTO:  # a cutter of its own states all: what is left out is its preset's
            first = getattr(job, CUTTERS[0])
            shown = [name for name in shown if name in changed or getattr(section, name) != getattr(first, name)]
        head = f"[{item.name}]" + (f"  # a cutter too, with the parameters of [{CUTTERS[0]}]" if like_first else "")
        lines += [head, *_lines(item.name, section, shown, tooltips=not like_first), ""]
    return "\n".join(lines)


def _groups(name: str, section: Any) -> tuple[list[str], list[str]]:
    """The parameters of a section that are set often and seldom, without the sizes of a cutter that is to be chosen."""
    chosen = SIZES if isinstance(section, ToolJob) and section.preset == AUTO else ()
    names = [item.name for item in fields(section) if item.name not in chosen]
    often = OFTEN[name].split() if name in OFTEN else names
    return often, [each for each in names if each not in often]


def _lines(name: str, section: Any, names: Sequence[str], tooltips: bool = True) -> list[str]:
    """The lines of some values of a section."""
    known_of = {item.name: record(item) for item in fields(section)}
    values = {key: getattr(section, key) for key in names}
    for key, value in values.items():
        if isinstance(value, str) and not is_unicode(value):
            remedy = "rename the file, so that its name is UTF-8"
            raise JobError(f"[{name}] {key} = {value!a}: {remedy}", section=name, field=key)
    lines = toml_lines(values) if values else []
    if not tooltips:
        return lines
    known = [known_of[key] for key in names]
    comments = [f"{each.tooltip} [{each.allowed}]" if each.allowed else each.tooltip for each in known]
    return [f"{line}  # {comment}" for line, comment in zip(lines, comments, strict=True)]


def named_files(job: Job) -> Iterator[tuple[str, str, Path]]:
    """Section, name and path of each parameter that is the path of a file."""
    for (section, name), known in PATHS.items():
        value = getattr(getattr(job, section), name)
        if known.is_path(value):
            yield section, name, Path(value)


def counted_from(folder: str, values: dict[str, Any]) -> dict[str, Any]:
    """Tables of values by section and name, whose paths count from `folder`; absolute ones stay."""
    counted = {name: dict(table) if isinstance(table, dict) else table for name, table in values.items()}
    for (section, name), known in PATHS.items():
        table = counted.get(section)
        if isinstance(table, dict) and known.is_path(table.get(name)):
            table[name] = os.path.join(folder, table[name])
    return counted


def from_anywhere(job: Job) -> Job:
    """The job with its paths absolute: it means the same in every folder."""
    changes: dict[str, dict[str, Any]] = {}
    for section, name, path in named_files(job):
        changes.setdefault(section, {})[name] = os.path.join(os.getcwd(), path)
    return job.with_values(**changes) if changes else job
