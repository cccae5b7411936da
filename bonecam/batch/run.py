"""The run of a batch on an executor: any object whose `submit(function, *arguments)` returns a future as those of
concurrent.futures. Each part is worked on in a process of its own, wherever the executor runs its task, so that a part
that fails, or ends its process, stops no other and not its worker.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor, as_completed
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from threading import Event

import bonecam
from bonecam.batch.one_part import Wanted, convert_part, kept_outcome, package_digest
from bonecam.batch.parts import BatchPart, batch_parts
from bonecam.errors import BonecamError, FileError, JobError
from bonecam.files import check_folder, write_whole
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.parts.grouping import is_split
from bonecam.nc.program import check_file_name
from bonecam.pipeline import check_job
from bonecam.report.tables.batch_table import TABLE, Outcome, failed, read_rows, table_text
from bonecam.runtime.locking import locked
from bonecam.runtime.signals import undisturbed
from bonecam.runtime.temporary import remove_abandoned
from bonecam.runtime.worker import WorkerError, call_in_worker

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
    wanted: Wanted = Wanted(),  # noqa: B008  # frozen
    told: Callable[[Outcome, int], object] = lambda outcome, left: None,
    progress: PartProgress = lambda name, fraction, message: None,
    work: str = WORK,
) -> list[Outcome]:
    """Convert every part into `folder`; also writes `batch.csv` there after each. The outcomes, in the parts' order.

    Parts are files, folders, tables (or one of these) and `BatchPart`s, as `bonecam.batch.parts` has them. Without an
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
        _tell(target / TABLE, outcome, place)
        told(outcome, len(own_parts) - len(outcomes))
    return [outcomes[index] for index in sorted(outcomes)]


def _check_jobs(parts: Sequence[BatchPart], folder: Path) -> None:
    """Every job fits its machine, the error naming the job file where it is a part's own; and the control takes the
    names of all programs in the `folder`."""
    dialects: dict[Job, Dialect] = {}
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
            check_file_name(program, dialect, second=second, split=is_split(part.job.nc))
        except FileError as error:
            what = f"{part.file}: {error}, by the name of the part or an `output` in a table of parts"
            raise FileError(what, **error.evidence) from error


def _tell(table: Path, outcome: Outcome, place: dict[str, int]) -> None:
    """Add an outcome to the table. Rows of other parts stay, those that another batch has written since too."""
    with locked([table.parent]):
        rows = {**read_rows(table), outcome.name: asdict(outcome)}
        write_whole(table, table_text(sorted(rows.values(), key=lambda row: place.get(row["name"], -1))))


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
    pool = ThreadPoolExecutor(jobs) if executor is None else executor
    here = partial(ask, stopped=stopped, progress=progress) if executor is None else ask
    futures: dict[Future[Outcome], BatchPart] = {}
    try:
        for part in parts:
            if not kept.get(part.name):
                progress(part.name, 0.0, WAITING)
                there = replace(part, file=part.file.absolute())  # a worker may be in another folder
                futures[pool.submit(here, there)] = part
        for future in as_completed(futures):
            yield _outcome_of(future, futures[future])
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
    """The task of a part, on whatever computer: its outcome, from a new process; whatever happens to that is told."""
    began = time.perf_counter()

    def tell(fraction: float, message: str) -> None:
        progress(part.name, fraction, message)

    code = ""
    try:
        _check_worker(folder, version)
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


def _check_worker(folder: Path, version: str) -> None:
    """JobError where this computer has another bonecam than the one that asks, by its content, or not its files."""
    if version != package_digest():
        what = f"a worker has another bonecam {bonecam.__version__} than this run (their files differ)"
        raise JobError(f"{what}: install the same on both")
    if not folder.is_dir():
        raise JobError(f"{folder}: a worker does not see this folder: give one that all computers share")
