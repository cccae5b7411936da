"""What a batch consists of: files, folders of files, and tables of parts, each part with its job.

A job file beside a part that has its name (patient_07.toml beside patient_07.stl) holds what differs for it from the
job of the batch. A table (CSV with a header) has a part a line:

    file            the part; paths count from the table's folder
    job             a job file, in place of one beside the part
    units           the unit of the part's coordinates
    stock           a kind of stock, or the file of a closed convex one
    output          the name of its results without ending; that of the part by default
    section.name    any other parameter of the job, such as stock.diameter or mesh.label

Empty cells leave what the job says. Of job, job file and cells the latter win.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bonecam.errors import BonecamError, JobError, did_you_mean
from bonecam.files import input_text, require_name
from bonecam.job import Job, read_job
from bonecam.job.files.job_file import counted_from, from_anywhere
from bonecam.job.sections import setting
from bonecam.job.stock_section import STOCK_KINDS
from bonecam.mesh.files.formats.label_map import LABEL_MAPS
from bonecam.mesh.files.mesh_files import READABLE, ending_of
from bonecam.report.tables.batch_table import TABLE
from bonecam.surface.files.tspline_text import ENDINGS
from bonecam.text.faults import Faults, shown

COLUMNS = ("file", "job", "units", "stock", "output")
"""The columns of a table beside section.name; `file` is the one that it must have."""


@dataclass(frozen=True)
class BatchPart:
    """A part of a batch: its file, the name of its results without ending, its job, and the job file that is its own,
    if it has one."""

    file: Path
    name: str
    job: Job
    job_file: str = ""


def batch_parts(given: Sequence[str | Path | BatchPart], job: Job) -> list[BatchPart]:
    """The parts of files, folders and tables, in their order, with `job` where they have none of their own. JobError
    where there is none, two have one name, or a table or a job file is wrong."""
    parts = [part for each in given for part in _parts_of(each, job)]
    if not parts:
        raise JobError("no part given: name at least one")
    seen: dict[str, Path] = {}
    for part in parts:
        require_name(part.file)
        if part.name in seen:
            what = f"{seen[part.name]} and {part.file} would both write {part.name}"
            remedy = "rename one, name its `output` in a table, or use two folders"
            raise JobError(f"{what}: {remedy}", file=str(part.file))
        seen[part.name] = part.file
    return parts


def _parts_of(given: str | Path | BatchPart, job: Job) -> list[BatchPart]:
    if isinstance(given, BatchPart):
        return [given]
    require_name(given)
    place = Path(given)
    if place.is_dir():
        return [_with_job_beside(file, job) for file in _files_in(place)]
    columns = _columns_of(place)
    if "file" in columns:
        return _parts_in_table(place, job)
    if set(columns) & set(COLUMNS):  # as a part a .csv is a cloud of points
        what = "line 1: no column `file`: a table of parts names them there"
        raise JobError(f"{place}: {what}", file=str(place))
    return [_with_job_beside(place, job)]


def _with_job_beside(file: Path, job: Job) -> BatchPart:
    """The part of a file, with the job beside it, if there is one."""
    name = name_of(file)
    beside = file.with_name(f"{name}.toml")
    if beside.is_file():
        return BatchPart(file, name, from_anywhere(read_job(beside, job)), str(beside))
    return BatchPart(file, name, from_anywhere(job))


def name_of(file: Path) -> str:
    """The name of a file without the ending that tells its kind."""
    return file.name[: len(file.name) - len(ending_of(file))]


def _files_in(folder: Path) -> list[Path]:
    """The files of parts in a folder, hidden ones and the table of results left out, in alphabetical order. JobError
    where there are none, or a table of parts among them."""
    endings = (*READABLE, *LABEL_MAPS, *ENDINGS)
    shown = [file for file in folder.iterdir() if not file.name.startswith(".") and file.name != TABLE]
    files = sorted(file for file in shown if ending_of(file) in endings)
    if not files:
        remedy = f"give files that end in one of {', '.join(endings)}"
        raise JobError(f"{folder}: holds no part: {remedy}", file=str(folder))
    tables = [file for file in files if is_table(file)]
    if tables:
        remedy = "give the table itself, or move it out of the folder"
        raise JobError(f"{folder}: {tables[0].name} in it is a table of parts: {remedy}", file=str(folder))
    return files


def is_table(file: Path) -> bool:
    """Whether a file is a table of parts: a .csv whose first line names the column `file`."""
    return "file" in _columns_of(file)


def _columns_of(file: Path) -> list[str]:
    """What the first line of a .csv names; nothing of another file, or one that cannot be read."""
    if file.suffix.lower() != ".csv":
        return []
    try:
        return _header(input_text(file))
    except (OSError, ValueError):
        return []


def _header(text: str) -> list[str]:
    first = text.partition("\n")[0]
    return [name.strip().lower() for name in first.split(_separator(first))]


def _separator(first: str) -> str:
    """What parts the cells: a semicolon where the first line has one, as spreadsheets write it where the decimal
    separator is a comma."""
    return ";" if ";" in first else ","


def _parts_in_table(table: Path, job: Job) -> list[BatchPart]:
    """The parts of a table. JobError tells all that is wrong in it with the lines."""
    text = input_text(table)
    header = _header(text)
    unknown = [name for name in header if name not in COLUMNS and "." not in name]
    if unknown:
        remedy = f"use {', '.join(COLUMNS)}, or section.name of a job{did_you_mean(unknown[0], COLUMNS)}"
        raise JobError(f"{table}: column {shown(unknown[0])} is unknown: {remedy}", file=str(table))
    faults: list[tuple[str, str]] = []
    parts = []
    for line, cells in _lines(table, text):
        try:
            parts.append(_part_of(table.parent, cells, job))
        except BonecamError as error:
            faults.append((f"line {line}", str(error)))
    if faults:
        raise JobError(f"{table}: {Faults(faults)}", file=str(table))
    return parts


def _lines(table: Path, text: str) -> Iterator[tuple[int, dict[str, str]]]:
    """The number and the cells of each line that has one, by their columns; JobError where it has more than the
    header."""
    header = _header(text)
    try:
        rows = csv.reader(text.splitlines(), delimiter=_separator(text.partition("\n")[0]), strict=True)
        for row in rows:
            cells = [cell.strip() for cell in row]
            if rows.line_num == 1 or not any(cells):
                continue
            if len(cells) > len(header):
                what = f"line {rows.line_num} has {len(cells)} cells and the header {len(header)}"
                raise JobError(f"{table}: {what}: quote cells with commas", file=str(table))
            yield rows.line_num, dict(zip(header, cells, strict=False))
    except csv.Error as error:
        raise JobError(f"{table}: line {rows.line_num}: {error}: correct the quotes", file=str(table)) from error


def _part_of(folder: Path, cells: dict[str, str], job: Job) -> BatchPart:
    """The part of a line of a table."""
    given = cells.get("file", "")
    file = folder / given
    if not given or not file.is_file():
        raise JobError(f"{file if given else 'file'} is missing: give the file of a part", file=str(file))
    if cells.get("job"):
        own = folder / cells["job"]
        part = BatchPart(file, "", from_anywhere(read_job(own, job)), str(own))
    else:
        part = _with_job_beside(file, job)
    name = cells.get("output") or name_of(file)
    if name.startswith(".") or Path(name).name != name:
        raise JobError(f"output {shown(name)} is no name of a file in the folder: leave out folders and dots")
    changed = part.job.with_values(**_changes(folder, cells))
    return BatchPart(file, name, changed, part.job_file)


def _changes(folder: Path, cells: dict[str, str]) -> dict[str, dict[str, Any]]:
    """What the cells of a line change in a job, by section and name."""
    keys = {"units": "mesh.units"}
    given = [(keys.get(column, column), cell) for column, cell in cells.items() if cell]
    settings = [each for each in (setting(key, cell) for key, cell in given) if each]
    stock = cells.get("stock", "")
    if stock in STOCK_KINDS:
        settings.append(("stock", "kind", stock))
    elif stock:
        settings += [("stock", "kind", "mesh"), ("stock", "mesh", str((folder / stock).absolute()))]
    changes: dict[str, dict[str, Any]] = {}
    for section, name, value in settings:
        changes.setdefault(section, {})[name] = value
    return counted_from(str(folder.absolute()), changes)
