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

The work on one part of a batch, in a process of its own: its program and what else is wanted, its report last.

NAME.json has the report and a fingerprint of all that decides the outcome, by which a later run knows that the part is
done.

The run of a batch on an executor: any object whose `submit(function, *arguments)` returns a future as those of
concurrent.futures. Each part is worked on in a process of its own, wherever the executor runs its task, so that a part
that fails, or ends its process, stops no other and not its worker.
"""

import csv
import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from threading import Event
from typing import Any

import bonecam
from bonecam.errors import BonecamError, FileError, JobError, did_you_mean
from bonecam.files import check_folder, input_text, require_name, write_whole
from bonecam.job import Job, read_job, write_job
from bonecam.job.files.job_file import counted_from, from_anywhere, named_files
from bonecam.job.sections import setting
from bonecam.job.stock_section import STOCK_KINDS
from bonecam.job.tool_list import tool_list
from bonecam.kernels.warming import warming
from bonecam.machine.machine import read_machine
from bonecam.mesh.files.label_map import LABEL_MAPS
from bonecam.mesh.files.mesh_files import READABLE, ending_of
from bonecam.nc.dialect import Dialect
from bonecam.nc.probing import probing_file
from bonecam.nc.program import check_file_name, second_program_file
from bonecam.nc.requirements import job_dialect
from bonecam.pipeline import check_job
from bonecam.plugins import plugin_folders, reader_endings
from bonecam.progress import Progress, silent
from bonecam.report.tables import TABLE, Outcome, failed, outcome_of, read_rows, table_text
from bonecam.runtime.own_files import PACKAGE, folder_digest, locked
from bonecam.runtime.staging import remove_abandoned, undisturbed
from bonecam.runtime.worker import POLL, WorkerError, call_in_worker
from bonecam.surface.files.tspline_text import TSPLINE
from bonecam.text.numbers import Faults, shown

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
    """The parts of a file, a table, or a folder, where hidden files and the table of results are left out."""
    if isinstance(given, BatchPart):
        return [given]
    require_name(given)
    place = Path(given)
    if place.is_dir():
        endings = (*READABLE, *LABEL_MAPS, TSPLINE, *reader_endings())
        seen = [file for file in place.iterdir() if not file.name.startswith(".") and file.name != TABLE]
        files = sorted(file for file in seen if ending_of(file) in endings)
        if not files:
            remedy = f"give files that end in one of {', '.join(endings)}"
            raise JobError(f"{place}: holds no part: {remedy}", file=str(place))
        tables = [file for file in files if "file" in _columns_of(file)]
        if tables:
            remedy = "give the table itself, or move it out of the folder"
            raise JobError(f"{place}: {tables[0].name} in it is a table of parts: {remedy}", file=str(place))
        return [_with_job_beside(file, job) for file in files]
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

    # What the cells change in the job, by section and name
    keys = {"units": "mesh.units"}
    texts = [(keys.get(column, column), cell) for column, cell in cells.items() if cell]
    settings = [each for each in (setting(key, cell) for key, cell in texts) if each]
    stock = cells.get("stock", "")
    if stock in STOCK_KINDS:
        settings.append(("stock", "kind", stock))
    elif stock:
        settings += [("stock", "kind", "mesh"), ("stock", "mesh", str((folder / stock).absolute()))]
    changes: dict[str, dict[str, Any]] = {}
    for section, field, value in settings:
        changes.setdefault(section, {})[field] = value
    changed = part.job.with_values(**counted_from(str(folder.absolute()), changes))
    return BatchPart(file, name, changed, part.job_file)


@dataclass(frozen=True)
class Wanted:
    """What a batch writes of each part beside program and report: the page NAME.html, the setup sheet NAME.sheet.html,
    the folder NAME of --keep."""

    html: bool = False
    sheet: bool = False
    keep: bool = False

    def files(self, part: BatchPart, folder: Path) -> dict[str, Path]:
        """Every output of `bonecam.convert` for the part, by its name."""
        extension = job_dialect(part.job.nc).extension
        outputs = {"program": folder / f"{part.name}{extension}"}
        if self.html:
            outputs["html"] = folder / f"{part.name}.html"
        if self.sheet:
            outputs["sheet"] = folder / f"{part.name}.sheet.html"
        if self.keep:
            outputs["keep"] = folder / part.name
        return outputs


def convert_part(part: BatchPart, folder: Path, wanted: Wanted, progress: Progress) -> Outcome:
    """Convert in this process and write program and report into `folder`, the fingerprint last; of a part that is
    refused the report alone."""
    began = time.perf_counter()
    mark = fingerprint(part)
    files = {**wanted.files(part, folder), "report": _report_of(part, folder)}
    result = bonecam.convert(part.file, part.job, **files, progress=progress)  # type: ignore[arg-type]
    report = {**result.report, "fingerprint": mark}
    write_whole(files["report"], json.dumps(report, indent=2) + "\n")
    return outcome_of(part.name, str(part.file), part.job_file, report, time.perf_counter() - began)


def kept_outcome(part: BatchPart, folder: Path, wanted: Wanted) -> Outcome | None:
    """The outcome of an earlier run with the same mesh, job and package, if all that is wanted of it is there."""
    try:
        report = json.loads(input_text(_report_of(part, folder)))
        files = wanted.files(part, folder)
        if part.job.holding.second:
            files["second"] = second_program_file(files["program"], job_dialect(part.job.nc))
        if part.job.nc.probe:
            files["probe"] = probing_file(files["program"])
        if report["fingerprint"] != fingerprint(part) or not all(file.exists() for file in files.values()):
            return None
        seconds = sum(report["seconds"].values())
        return outcome_of(part.name, str(part.file), part.job_file, report, seconds, state="kept")
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _report_of(part: BatchPart, folder: Path) -> Path:
    return folder / f"{part.name}.json"


def package_digest() -> str:
    """One for the content of bonecam and of the packages of its plugins."""
    return "".join(map(folder_digest, [PACKAGE, *plugin_folders()]))


def fingerprint(part: BatchPart) -> str:
    """A hash of all that decides the outcome: the content of the package, the job, the bytes of the part, of each file
    that the job names, and of those that its list of cutters names. Where these files are does not count."""
    named = [*named_files(part.job), *(("nc", "tools", file) for file in tool_list(part.job.nc.tools).files)]
    without_paths: dict[str, dict[str, str]] = {}
    for section, name, _ in named_files(part.job):
        without_paths.setdefault(section, {})[name] = ""
    digest = hashlib.sha256(package_digest().encode())
    digest.update(write_job(part.job.with_values(**without_paths)).encode())
    for section, name, file in [("", "", part.file), *named]:
        content = file.read_bytes() if file.is_file() else b""
        digest.update(f"{section}.{name}\0".encode() + hashlib.sha256(content).digest())
    return digest.hexdigest()


WAITING = "waits"
"""What `progress` is told of each part that is to be done, before the first."""
PartProgress = Callable[[str, float, str], object]
"""What is called with the name of a part, the share of it that is done, and what is done next."""
WORK = f"{convert_part.__module__}:{convert_part.__name__}"


def convert_many(
    parts: str | Path | Sequence[str | Path | BatchPart],
    folder: str | Path,
    job: Job | None = None,
    *,
    jobs: int = 2,
    executor: Executor | None = None,
    resume: bool = False,
    share: tuple[int, int] = (1, 1),
    wanted: Wanted = Wanted(),  # frozen
    told: Callable[[Outcome, int], object] = lambda outcome, left: None,
    progress: PartProgress = lambda name, fraction, message: None,
    work: str = WORK,
) -> list[Outcome]:
    """Convert every part into `folder`; also writes `batch.csv` there after each. The outcomes, in the parts' order.

    Parts are files, folders, tables (or one of these) and `BatchPart`s, as `bonecam.batch.run` has them. Without an
    `executor`, `jobs` parts at a time are worked on here, and `progress` tells of them, from other threads; no process
    is left, however this one ends. An executor takes one task a part; its workers need this version of bonecam and see
    the same files.
    With `resume`, parts that an earlier run did from the same content are kept. `share` (k, n) is the kth of n shares
    of the parts: the others are not done. Rows that `batch.csv` has of other parts stay. `told` is called with each
    outcome and the number of parts that are left. `work` names the function that does a part.

    Raises a BonecamError, before any part, where what is given is wrong.
    """
    target = Path(folder).absolute()
    if executor is None and jobs < 1:
        raise JobError(f"--jobs {jobs}: give 1 or more")
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise TypeError(f"executor is a {type(executor).__name__}: give an object whose submit returns a future")
    given = [parts] if isinstance(parts, str | Path) else parts
    own_parts = batch_parts(given, job or Job())[share[0] - 1 :: share[1]]
    _check_jobs(own_parts, target)
    check_folder(target)
    read_rows(target / TABLE)  # a table that is none is refused before the work
    target.mkdir(parents=True, exist_ok=True)
    place = {part.name: index for index, part in enumerate(own_parts)}
    outcomes: dict[int, Outcome] = {}
    ask = partial(_in_process, folder=target, wanted=wanted, work=work, version=package_digest())
    for outcome in _outcomes(own_parts, ask, jobs=jobs, executor=executor, resume=resume, progress=progress):
        outcomes[place[outcome.name]] = outcome
        with locked([target]):  # rows of other parts stay, those that another batch has written since too
            rows = {**read_rows(target / TABLE), outcome.name: asdict(outcome)}
            write_whole(target / TABLE, table_text(sorted(rows.values(), key=lambda row: place.get(row["name"], -1))))
        told(outcome, len(own_parts) - len(outcomes))
    return [outcomes[index] for index in sorted(outcomes)]


def _check_jobs(parts: Sequence[BatchPart], folder: Path) -> None:
    """Every job fits its machine, the error naming the job file where it is a part's own; and the control takes the
    names of all programs in the `folder`."""
    dialects: dict[Job, Dialect] = {}
    names = {part.name for part in parts}
    for part in parts:
        try:
            if part.job not in dialects:
                dialects[part.job] = job_dialect(part.job.nc)
                check_job(part.job, read_machine(part.job.nc.machine), dialects[part.job])
        except BonecamError as error:
            place = f"{part.job_file}: " if part.job_file else ""
            raise type(error)(f"{place}{error}", **error.evidence) from error
        dialect, second = dialects[part.job], bool(part.job.holding.second)
        try:
            program = folder / f"{part.name}{dialect.extension}"
            probe = part.job.nc.probe
            check_file_name(program, dialect, second=second, split=part.job.nc.is_split, probe=probe)
            if probe and probing_file(program).stem in names:
                raise FileError(f"{program}: {probing_file(program).name} is the program of another part: name it anew")
        except FileError as error:
            what = f"{part.file}: {error}, by the name of the part or an `output` in a table of parts"
            raise FileError(what, **error.evidence) from error


def _outcomes(
    parts: Sequence[BatchPart],
    ask: "partial[Outcome]",
    jobs: int,
    executor: Executor | None,
    resume: bool,
    progress: PartProgress,
) -> Iterator[Outcome]:
    """The outcome of each part as they come; nothing works on here where the loop is left early."""
    folder, wanted = ask.keywords["folder"], ask.keywords["wanted"]
    kept = {part.name: kept_outcome(part, folder, wanted) for part in parts if resume}
    yield from (outcome for outcome in kept.values() if outcome)
    stopped = Event()
    left = [part for part in parts if not kept.get(part.name)]
    if left:
        with warming(silent):  # once here, not in each part's process
            pass
    pool = ThreadPoolExecutor(jobs) if executor is None else executor
    here = partial(ask, stopped=stopped, progress=progress) if executor is None else ask
    futures: dict[Future[Outcome], BatchPart] = {}
    try:
        for part in left:
            progress(part.name, 0.0, WAITING)
            there = replace(part, file=part.file.absolute())  # a worker may be in another folder
            futures[pool.submit(here, there)] = part
        while futures:  # a signal to another thread, or just before the wait, is heeded once the wait ends
            for future in wait(futures, POLL, FIRST_COMPLETED).done:
                yield _outcome_of(future, futures.pop(future))
    finally:
        with undisturbed():
            stopped.set()
            for future in futures:
                future.cancel()
            if executor is None:
                pool.shutdown()
            remove_abandoned(folder)


def _outcome_of(future: "Future[Outcome]", part: BatchPart) -> Outcome:
    """What a future holds; where its executor gave the part up, that."""
    try:
        outcome = future.result()
        message = outcome.message.replace(str(part.file.absolute()), str(part.file))
        return replace(outcome, mesh=str(part.file), message=message)
    except (Exception, CancelledError) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        return failed(part.name, str(part.file), part.job_file, 0.0, f"its worker was lost ({reason}): try it again")


def _in_process(
    part: BatchPart,
    *,
    folder: Path,
    wanted: Wanted,
    work: str,
    version: str,
    stopped: Event | None = None,
    progress: PartProgress = lambda name, fraction, message: None,
) -> Outcome:
    """The task of a part, on whatever computer: its outcome, from a new process; whatever happens to that is told, also
    that this computer has not the content or the files of the one that asks."""
    began = time.perf_counter()

    def tell(fraction: float, message: str) -> None:
        progress(part.name, fraction, message)

    code = ""
    try:
        if version != package_digest():
            what = f"a worker has another bonecam {bonecam.__version__} than this run (their files differ)"
            raise JobError(f"{what}: install the same on both")
        if not folder.is_dir():
            raise JobError(f"{folder}: a worker does not see this folder: give one that all computers share")
        outcome: Outcome = call_in_worker(work, part, folder, wanted, progress=tell, stopped=stopped)
        return outcome
    except BonecamError as error:
        message = " ".join(str(error).splitlines())
        code = error.evidence.get("refused", {}).get("code", "")
    except WorkerError as error:
        message = f"its process {error} (out of memory?): try it alone with bonecam convert -v"
    except Exception as error:
        reason = " ".join(str(error).split())
        message = f"internal error {type(error).__name__}: {reason}: please report it with the part"
    return failed(
        part.name, str(part.file), job=part.job_file, seconds=time.perf_counter() - began, message=message, code=code
    )
