"""Jobs as TOML files, and the files that a job names: a stock, a shell, and machine, controller and material where they
are no shipped ones."""

import os
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from bonecam import plugins
from bonecam.errors import JobError
from bonecam.files import input_text, is_unicode
from bonecam.job.parameter import record
from bonecam.job.sections import Job, job_error
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


def write_job(job: Job, beside: dict[str, Any] | None = None) -> str:
    """The TOML text of a job, every value with its tooltip, its paths absolute but for those of `beside`, values by
    section of files that lie beside the text. JobError where a text has characters without a code."""
    job = from_anywhere(job).with_values(**(beside or {}))
    lines: list[str] = []
    for item in fields(job):
        lines += [f"[{item.name}]", *_lines(item.name, getattr(job, item.name)), ""]
    return "\n".join(lines)


def _lines(name: str, section: Any) -> list[str]:
    """The lines of the values of a section, without the sizes of a cutter that is to be chosen."""
    chosen = SIZES if isinstance(section, ToolJob) and section.preset == AUTO else ()
    known_of = {item.name: record(item) for item in fields(section) if item.name not in chosen}
    values = {key: getattr(section, key) for key in known_of}
    for key, value in values.items():
        if isinstance(value, str) and not is_unicode(value):
            remedy = "rename the file, so that its name is UTF-8"
            raise JobError(f"[{name}] {key} = {value!a}: {remedy}", section=name, field=key)
    comments = [f"{known.tooltip} [{known.allowed}]" if known.allowed else known.tooltip for known in known_of.values()]
    return [f"{line}  # {comment}" for line, comment in zip(toml_lines(values), comments, strict=True)]


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
