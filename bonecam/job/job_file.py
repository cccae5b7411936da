"""Jobs as TOML files."""

import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any

from bonecam.errors import JobError
from bonecam.files import input_text
from bonecam.job.parameter import record
from bonecam.job.sections import Job


def read_job(path: str | Path, base: Job | None = None) -> Job:
    """The job of a TOML file, whose tables are the sections of a job. A value that it leaves out is that of
    `base`.

    JobError names the file and what is wrong in it.
    """
    try:
        values = tomllib.loads(input_text(path))
    except OSError as error:
        raise JobError(f"{path}: {error.strerror}: give a readable job file", file=str(path)) from error
    except ValueError as error:
        raise JobError(f"{path}: {error}: correct the TOML there", file=str(path)) from error

    loose = [name for name, value in values.items() if not isinstance(value, dict)]
    if loose:
        trouble = f"{loose[0]!r} stands outside a section: put it below one like [path]"
        raise JobError(f"{path}: {trouble}", file=str(path))
    try:
        return (base or Job()).with_values(**values)
    except JobError as error:
        raise JobError(f"{path}: {error}", file=str(path), **error.evidence) from error


def write_job(job: Job) -> str:
    """The TOML text of a job, every value with its tooltip and unit as a comment."""
    lines: list[str] = []
    for item in fields(job):
        lines += [f"[{item.name}]", *_lines(getattr(job, item.name)), ""]
    return "\n".join(lines)


def _lines(section: Any) -> list[str]:
    """The lines of the values of a section."""
    lines = []
    for item in fields(section):
        known = record(item)
        comment = f"{known.tooltip} [{known.unit}]" if known.unit else known.tooltip
        lines.append(f"{item.name} = {_toml(getattr(section, item.name))}  # {comment}")
    return lines


def _toml(value: object) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return str(value).lower() if isinstance(value, bool) else repr(value)
