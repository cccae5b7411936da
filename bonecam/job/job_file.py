"""Jobs as TOML files."""

from dataclasses import fields
from pathlib import Path
from typing import Any

from bonecam.errors import JobError
from bonecam.files import input_text, is_unicode
from bonecam.job.parameter import record
from bonecam.job.sections import Job, job_error
from bonecam.text.toml import lines_of_keys, parse_toml, toml_lines


def read_job(path: str | Path, base: Job | None = None) -> Job:
    """The job of a TOML file, whose tables are the sections of a job. A value that it leaves out is that of
    `base`.

    JobError names the file, and all that is wrong in it with the lines.
    """
    try:
        text = input_text(path)
        values = parse_toml(text)
    except OSError as error:
        raise JobError(f"{path}: {error.strerror}: give a readable job file", file=str(path)) from error
    except ValueError as error:
        raise JobError(f"{path}: {error}: correct the TOML there", file=str(path)) from error

    faults = []
    for name in [name for name, value in values.items() if not isinstance(value, dict)]:
        faults.append(("", name, f"{name!r} stands outside a section: put it below one like [path]"))
        del values[name]
    try:
        job = (base or Job()).with_values(**values)
    except JobError as error:
        faults += error.evidence["faults"]
    if faults:
        raise _error_of(path, text, faults)
    return job


def _error_of(path: str | Path, text: str, faults: list[tuple[str, str, str]]) -> JobError:
    """The error of all faults of a file, with their lines and in the order of these."""
    lines = lines_of_keys(text)
    placed = []
    for section, field, what in faults:
        line = lines.get((section, field)) or lines.get((section, ""))
        placed.append((line or 0, section, field, f"line {line}: {what}" if line else what))
    placed.sort(key=lambda fault: fault[0])
    error = job_error([fault[1:] for fault in placed], f"{path}: ")
    return JobError(str(error), file=str(path), **error.evidence)


def write_job(job: Job) -> str:
    """The TOML text of a job, every value with its tooltip. JobError where a text has characters without a code."""
    lines: list[str] = []
    for item in fields(job):
        lines += [f"[{item.name}]", *_lines(item.name, getattr(job, item.name)), ""]
    return "\n".join(lines)


def _lines(name: str, section: Any) -> list[str]:
    """The lines of the values of a section."""
    values = {item.name: getattr(section, item.name) for item in fields(section)}
    for key, value in values.items():
        if isinstance(value, str) and not is_unicode(value):
            remedy = "rename the file, so that its name is UTF-8"
            raise JobError(f"[{name}] {key} = {value!a}: {remedy}", section=name, field=key)
    records = map(record, fields(section))
    comments = [f"{known.tooltip} [{known.unit}]" if known.unit else known.tooltip for known in records]
    return [f"{line}  # {comment}" for line, comment in zip(toml_lines(values), comments, strict=True)]
