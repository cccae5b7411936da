"""Many meshes: each in a process of its own (spawn), so that one bad mesh, or a crash, stops no other.

Each mesh NAME writes NAME.<ending> and, last, NAME.json with the report and a fingerprint of mesh, job and
version. A run that was killed resumes: a mesh whose NAME.json carries today's fingerprint is not done again.
"""

import hashlib
import json
import multiprocessing
import os
import pickle
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path

import bonecam
from bonecam.errors import BonecamError, JobError
from bonecam.files import check_folder, input_text, require_name, write_whole
from bonecam.job import Job, write_job
from bonecam.machine.machine import read_machine
from bonecam.mesh.files.mesh_files import READABLE
from bonecam.nc.dialect import read_dialect
from bonecam.pipeline import check_job
from bonecam.report.tables.batch_table import Outcome, read_rows, table_text
from bonecam.runtime.locking import locked
from bonecam.runtime.parent import safe_path, work_for
from bonecam.runtime.signals import kept_from_children, undisturbed
from bonecam.runtime.temporary import remove_abandoned
from bonecam.surface.files.tspline_text import ENDINGS

Work = Callable[[Path, Path, Job], Outcome]


def convert_many(
    meshes: Sequence[str | Path],
    folder: str | Path,
    job: Job | None = None,
    *,
    jobs: int = 2,
    resume: bool = False,
    told: Callable[[Outcome, int], object] = lambda outcome, left: None,
    work: Work | None = None,
) -> list[Outcome]:
    """Convert every mesh into `folder`, `jobs` at a time; also writes `batch.csv` there after each mesh.

    A folder among the meshes stands for the parts in it. Rows that `batch.csv` has of other meshes stay.

    `work` (default `convert_one`) is what each new process does. A process ends with this one, however that
    ends. Raises JobError where two meshes have one name (their programs would overwrite each other) or there
    is none.
    """
    job, target = job or Job(), Path(folder)
    files = [file for mesh in meshes for file in _parts_in(Path(mesh))]
    _check_names(files, jobs)
    check_job(job, read_machine(job.nc.machine), read_dialect(job.nc.controller))
    check_folder(target)
    table = target / "batch.csv"
    read_rows(table)  # a table that is none is refused before the work
    place = {str(file): index for index, file in enumerate(files)}
    target.mkdir(parents=True, exist_ok=True)
    outcomes: dict[int, Outcome] = {}
    for index, outcome in _outcomes(files, target, job, jobs, resume, work or convert_one):
        outcomes[index] = outcome
        _tell(table, outcome, place)
        told(outcome, len(files) - len(outcomes))
    return [outcomes[i] for i in sorted(outcomes)]


def _tell(table: Path, outcome: Outcome, place: dict[str, int]) -> None:
    """Add an outcome to the table. Rows of other meshes stay, those that another batch has written since too."""
    with locked([table.parent]):
        rows = {**read_rows(table), outcome.mesh: asdict(outcome)}
        write_whole(table, table_text(sorted(rows.values(), key=lambda row: place.get(row["mesh"], -1))))


def _outcomes(
    files: Sequence[Path], folder: Path, job: Job, jobs: int, resume: bool, work: Work
) -> Iterator[tuple[int, Outcome]]:
    """The outcome of each file, by its index, as they come; no process is left where the loop is left
    early."""
    waiting = deque(enumerate(files))
    running: dict[Connection, _Running] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                index, file = waiting.popleft()
                if resume and (kept := _kept(file, folder, job)):
                    yield index, kept
                else:
                    with undisturbed():
                        one = _Running(index, work, file, folder, job)
                        running[one.ending] = one
            ready = wait(list(running)) if running else []  # an empty wait never ends
            for ending in [ending for ending in running if ending in ready]:
                one = running.pop(ending)
                yield one.index, one.outcome()
    finally:
        with undisturbed():
            for one in running.values():
                one.process.kill()
                one.process.join()
            remove_abandoned(folder)


class _Running:
    """One mesh in a new process; whatever happens to it becomes an Outcome."""

    def __init__(self, index: int, work: Work, mesh: Path, folder: Path, job: Job) -> None:
        self.index, self.mesh, self.began = index, mesh, time.perf_counter()
        spawn = multiprocessing.get_context("spawn")
        self.ending, answer = spawn.Pipe(duplex=False)
        order = pickle.dumps((_answer, (work, mesh, folder, job)))
        self.process = spawn.Process(target=work_for, args=(os.getpid(), answer, order))
        with safe_path():
            resource_tracker.ensure_running()  # it lets the signals in again that are kept out below
            with kept_from_children():
                self.process.start()
        answer.close()

    def outcome(self) -> Outcome:
        """What came of it, once it has answered or ended."""
        try:
            found: Outcome | str = self.ending.recv()
        except EOFError:
            found = ""
        self.ending.close()
        self.process.join()
        if isinstance(found, Outcome):
            return found
        died = f"its process died (exit {self.process.exitcode}; out of memory?): try it alone with bonecam convert -v"
        return Outcome(
            mesh=str(self.mesh),
            state="failed",
            program="",
            levels=0,
            time_min=0.0,
            seconds=round(time.perf_counter() - self.began, 2),
            message=found or died,
        )


def _answer(answer: Connection, work: Work, mesh: Path, folder: Path, job: Job) -> None:
    """In the new process: the Outcome of a mesh, or what went wrong."""
    try:
        answer.send(work(mesh, folder, job))
    except BonecamError as error:
        answer.send(" ".join(str(error).splitlines()))
    except (Exception, SystemExit) as error:
        answer.send(
            f"internal error {type(error).__name__}: {' '.join(str(error).split())}: please report it with the mesh"
        )


def _parts_in(place: Path) -> list[Path]:
    """The files of parts in a folder, hidden ones left out, in alphabetical order; a file is its own part. JobError
    where there are none."""
    if not place.is_dir():
        return [place]
    endings = (*READABLE, *ENDINGS)
    shown = [file for file in place.iterdir() if not file.name.startswith(".")]
    files = sorted(file for file in shown if file.suffix.lower() in endings)
    if not files:
        raise JobError(
            f"{place}: holds no part: give files that end in one of {', '.join(endings)}", file=str(place)
        )
    return files


def _check_names(files: Sequence[Path], jobs: int) -> None:
    if not files:
        raise JobError("no mesh given: name at least one")
    if jobs < 1:
        raise JobError(f"--jobs {jobs}: give 1 or more")
    seen: dict[str, Path] = {}
    for file in files:
        require_name(file)
        if file.stem in seen:
            raise JobError(
                f"{seen[file.stem]} and {file} would both write {file.stem}: rename one or use two folders",
                file=str(file),
            )
        seen[file.stem] = file


def fingerprint(mesh: Path, job: Job) -> str:
    """A hash of all that decides the outcome: the version, the job, the bytes of the mesh and of the files
    that the job names."""
    digest = hashlib.sha256(bonecam.__version__.encode() + b"\0" + write_job(job).encode() + b"\0")
    for file in (mesh, *map(Path, (job.stock.mesh, job.nc.machine, job.nc.controller))):
        digest.update(hashlib.sha256(file.read_bytes() if file.is_file() else b"").digest())
    return digest.hexdigest()


def convert_one(mesh: Path, folder: Path, job: Job) -> Outcome:
    """Convert in this process and write program and report into `folder`, the report last."""
    began, mark = time.perf_counter(), fingerprint(mesh, job)
    result = bonecam.convert(mesh, job)
    program = folder / f"{mesh.stem}{result.program.extension}"
    write_whole(program, result.program.text)
    report = {**result.report, "nc": {**result.report["nc"], "file": program.name}, "fingerprint": mark}
    write_whole(folder / f"{mesh.stem}.json", json.dumps(report, indent=2) + "\n")
    seconds = round(time.perf_counter() - began, 2)
    return Outcome(
        mesh=str(mesh),
        state="done",
        program=program.name,
        levels=len(report["levels"]) - 1,
        time_min=report["nc"]["time_min"],
        seconds=seconds,
        message="",
    )


def _kept(mesh: Path, folder: Path, job: Job) -> Outcome | None:
    """The outcome of an earlier run with the same mesh, job and version, if its files are still there."""
    try:
        report = json.loads(input_text(folder / f"{mesh.stem}.json"))
        if report["fingerprint"] != fingerprint(mesh, job) or not (folder / report["nc"]["file"]).is_file():
            return None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    seconds = round(sum(report["seconds"].values()), 2)
    return Outcome(
        mesh=str(mesh),
        state="kept",
        program=report["nc"]["file"],
        levels=len(report["levels"]) - 1,
        time_min=report["nc"]["time_min"],
        seconds=seconds,
        message="",
    )
