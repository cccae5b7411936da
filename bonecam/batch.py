"""Many meshes: each in a process of its own (spawn), so that one bad mesh, or a crash, stops no other.

Each mesh NAME writes NAME.<ending> and, last, NAME.json with the report and a fingerprint of mesh, job and version.
A run that was killed resumes: a mesh whose NAME.json carries today's fingerprint is not done again.
"""

import csv
import hashlib
import io
import json
import multiprocessing
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from pathlib import Path

import bonecam
from bonecam.errors import BonecamError, FileError, JobError
from bonecam.files import write_whole
from bonecam.job import Job, write_job


@dataclass(frozen=True)
class Outcome:
    """What came of one mesh: state `done`, `kept` (from an earlier run) or `failed` with its message."""

    mesh: str
    state: str
    program: str
    levels: int
    time_min: float
    seconds: float
    message: str


def convert_many(
    meshes: Sequence[str | Path],
    folder: str | Path,
    job: Job | None = None,
    *,
    jobs: int = 2,
    resume: bool = False,
    told: Callable[[Outcome, int], object] = lambda outcome, left: None,
) -> list[Outcome]:
    """Convert every mesh into `folder`, `jobs` at a time; also writes `batch.csv` there after each mesh.

    Raises JobError where two meshes have one name (their programs would overwrite each other) or there is none.
    """
    job, target = job or Job(), Path(folder)
    files = [Path(mesh) for mesh in meshes]
    _check_names(files, jobs)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{target}: {error.strerror}: name a folder that may be made", file=str(target)) from error
    outcomes: dict[int, Outcome] = {}
    with ThreadPoolExecutor(jobs) as pool:
        waiting = {pool.submit(_one, file, target, job, resume): index for index, file in enumerate(files)}
        for future in as_completed(waiting):
            index = waiting[future]
            outcomes[index] = future.result()
            told(outcomes[index], len(files) - len(outcomes))
            write_whole(target / "batch.csv", _table([outcomes[i] for i in sorted(outcomes)]))
    return [outcomes[i] for i in sorted(outcomes)]


def _check_names(files: Sequence[Path], jobs: int) -> None:
    if not files:
        raise JobError("no mesh given: name at least one")
    if jobs < 1:
        raise JobError(f"--jobs {jobs}: give 1 or more")
    seen: dict[str, Path] = {}
    for file in files:
        if file.stem in seen:
            raise JobError(f"{seen[file.stem]} and {file} would both write {file.stem}: rename one or use two folders", file=str(file))
        seen[file.stem] = file


def fingerprint(mesh: Path, job: Job) -> str:
    """A hash of all that decides the outcome: the mesh's bytes, the job and the version."""
    digest = hashlib.sha256(bonecam.__version__.encode() + b"\0" + write_job(job).encode() + b"\0")
    digest.update(mesh.read_bytes())
    return digest.hexdigest()


def _one(mesh: Path, folder: Path, job: Job, resume: bool) -> Outcome:
    """One mesh in one new process; whatever happens to it becomes an Outcome."""
    began = time.perf_counter()
    if resume and (kept := _kept(mesh, folder, job)):
        return kept
    try:
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as process:
            return process.submit(convert_one, mesh, folder, job).result()
    except BrokenProcessPool:
        message = "the process died (out of memory?): try it alone with bonecam convert -v"
    except BonecamError as error:
        message = str(error)
    except Exception as error:
        message = f"internal error {type(error).__name__}: {error}: please report it with the mesh"
    return Outcome(str(mesh), "failed", "", 0, 0.0, round(time.perf_counter() - began, 2), message)


def convert_one(mesh: Path, folder: Path, job: Job) -> Outcome:
    """Convert in this process and write program and report into `folder`, the report last."""
    began = time.perf_counter()
    result = bonecam.convert(mesh, job)
    program = folder / f"{mesh.stem}{result.program.extension}"
    write_whole(program, result.program.text)
    report = {**result.report, "nc": {**result.report["nc"], "file": program.name}, "fingerprint": fingerprint(mesh, job)}
    write_whole(folder / f"{mesh.stem}.json", json.dumps(report, indent=2) + "\n")
    seconds = round(time.perf_counter() - began, 2)
    return Outcome(str(mesh), "done", program.name, len(report["levels"]) - 1, report["nc"]["time_min"], seconds, "")


def _kept(mesh: Path, folder: Path, job: Job) -> Outcome | None:
    """The outcome of an earlier run with the same mesh, job and version, if its files are still there."""
    try:
        report = json.loads((folder / f"{mesh.stem}.json").read_text(encoding="utf-8"))
        if report["fingerprint"] != fingerprint(mesh, job) or not (folder / report["nc"]["file"]).is_file():
            return None
    except (OSError, ValueError, KeyError):
        return None
    return Outcome(str(mesh), "kept", report["nc"]["file"], len(report["levels"]) - 1, report["nc"]["time_min"], 0.0, "")


def _table(outcomes: Sequence[Outcome]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(Outcome.__dataclass_fields__), lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(outcome) for outcome in outcomes)
    return text.getvalue()
