"""The work on one part of a batch, in a process of its own: its program and what else is wanted, its report last.

NAME.json has the report and a fingerprint of all that decides the outcome, by which a later run knows that the part is
done.
"""

import hashlib
import json
import time
from dataclasses import dataclass
from importlib.resources import files as resources
from pathlib import Path

import bonecam
from bonecam.batch.parts import BatchPart
from bonecam.files import input_text, write_whole
from bonecam.job import Job, write_job
from bonecam.job.files.job_file import named_files
from bonecam.job.tool_list import tool_list
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.program import second_program_file
from bonecam.progress import Progress
from bonecam.report.tables.batch_table import Outcome, outcome_of
from bonecam.runtime.own_files import PACKAGE, folder_digest


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
        if report["fingerprint"] != fingerprint(part) or not all(file.exists() for file in files.values()):
            return None
        seconds = sum(report["seconds"].values())
        return outcome_of(part.name, str(part.file), part.job_file, report, seconds, state="kept")
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _report_of(part: BatchPart, folder: Path) -> Path:
    return folder / f"{part.name}.json"


def package_digest() -> str:
    """One for the content of bonecam and of the filters that come with it, which the script of a job may run."""
    return folder_digest(PACKAGE) + folder_digest(Path(str(resources("bonecam_plugins"))))


def fingerprint(part: BatchPart) -> str:
    """A hash of all that decides the outcome: the content of the package, the job, the bytes of the part, of each file
    that the job names, and of those that its list of cutters names. Where these files are does not count."""
    named = [*named_files(part.job), *(("nc", "tools", file) for file in tool_list(part.job.nc.tools).files)]
    digest = hashlib.sha256(package_digest().encode())
    digest.update(write_job(_without_paths(part.job)).encode())
    for section, name, file in [("", "", part.file), *named]:
        content = file.read_bytes() if file.is_file() else b""
        digest.update(f"{section}.{name}\0".encode() + hashlib.sha256(content).digest())
    return digest.hexdigest()


def _without_paths(job: Job) -> Job:
    changes: dict[str, dict[str, str]] = {}
    for section, name, _ in named_files(job):
        changes.setdefault(section, {})[name] = ""
    return job.with_values(**changes)
