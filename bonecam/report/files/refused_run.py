"""What a refused run writes: its report, as far as it came, and where its own proof refused the program the kept
folder: what planned the program should have known, so that this is a fault of bonecam's, and the folder is what a
report of it needs."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bonecam.errors import (
    BendingError,
    BodiesError,
    BonecamError,
    Cancelled,
    FileError,
    LimitError,
    VerifyError,
    knowing,
)
from bonecam.files import whole_folder, write_whole
from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.nc.program import Program
from bonecam.report.files.kept_bodies import GIVEN
from bonecam.report.files.kept_folder import SERIES, keep_into, keep_job
from bonecam.report.files.output_files import File
from bonecam.report.files.result import Morphed
from bonecam.report.pictures.level_sections import draw_refused
from bonecam.report.tables.toolpath_csv import toolpath_csv
from bonecam.report.typed.report import RefusedFigures
from bonecam.report.typed.run_report import report_text
from bonecam.runtime.timing import StageTimes
from bonecam.surface.files.tspline_text import write_tsm
from bonecam.tool.path import ToolPath
from bonecam.workholding.post import post_below

FAULT = "a fault of bonecam, which planned this program, not of the mesh or the job"
"""What is added to a refusal by the proof of a program that bonecam planned."""


@contextmanager
def refusing(program: Program, paths: Sequence[ToolPath]) -> Iterator[None]:
    """A VerifyError or LimitError of the block knows the `program` that it refuses, and its `paths`."""
    try:
        yield
    except (VerifyError, LimitError) as error:
        error.evidence |= {"program": program, "paths": tuple(paths)}
        raise


@contextmanager
def report_refused(file: File) -> Iterator[StageTimes]:
    """The block takes the times of its stages. Where it raises a BonecamError, write the report `file` (None: nothing
    is written): `refused`, and the sections that are known so far. The error then knows the section `refused` too."""
    times = StageTimes()
    try:
        yield times
    except Cancelled:
        raise
    except BonecamError as error:
        report = _report(error, times)
        if file is None:
            raise
        try:
            write_whole(file, report_text(report))
        except FileError as trouble:
            raise type(error)(f"{error} ({trouble})", **error.evidence) from error
        raise


@contextmanager
def keep_refused(made: Morphed, folder: File, times: StageTimes) -> Iterator[None]:
    """Where the block raises a VerifyError or LimitError, the `folder` (None: nothing is kept) gets report.json,
    refused.txt, refused.png with the place, job, part, surface and levels of what was `made`, and the program with its
    tool path where one was posted. A VerifyError that is not of bending or of bodies says whose fault it is."""
    try:
        with knowing(made.report):
            yield
    except (VerifyError, LimitError) as error:
        report = _report(error, times)
        how = _kept(made, folder, error, report)
        if isinstance(error, BendingError | BodiesError | LimitError):
            raise
        raise VerifyError(f"{error} ({FAULT}: {how})", **error.evidence) from error


def _report(error: BonecamError, times: StageTimes) -> dict[str, Any]:
    """The report of a run that the error refuses, which knows its section `refused` from now on."""
    refused = error.evidence.setdefault("refused", refused_figures(error, times.reached))
    known = {"seconds": times.seconds, "cpu_seconds": times.cpu_seconds}
    return {"refused": refused, **known, **error.evidence.get("report", {})}


def refused_figures(error: BonecamError, stage: str) -> RefusedFigures:
    """`refused` of the report of a run whose `stage` raised the error. The remedy of a message is behind its last
    colon, where the error does not know it apart."""
    message = str(error)
    evidence = error.evidence
    figures: RefusedFigures = {
        "code": evidence.get("code", code_of(error)),
        "stage": stage,
        "message": message,
        "remedy": evidence.get("remedy", message.rpartition(": ")[2]),
    }
    if evidence.get("place") is not None:
        figures["place"] = [round(float(value), 3) for value in evidence["place"]]
    if evidence.get("line"):
        figures["line"] = int(evidence["line"])
    if "level" in evidence:
        figures["level"] = int(evidence["level"])
    return figures


def code_of(error: BonecamError) -> str:
    """The kind of an error in small letters: `tool_path` of a ToolPathError."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", type(error).__name__.removesuffix("Error")).lower()


def _kept(morphed: Morphed, folder: File, error: BonecamError, report: Mapping[str, Any]) -> str:
    """Keep what a report of the refusal needs in the `folder`, and say how to report it."""
    if folder is None:
        return "report it with what --keep DIR writes of this run"
    try:
        with whole_folder(folder, SERIES) as work:
            _fill(work, morphed, error)
            write_whole(work / "report.json", report_text(report))
    except FileError as trouble:
        return f"nothing could be kept: {trouble}"
    return f"report it with {folder}, which holds program, place and picture"


def _fill(work: Path, morphed: Morphed, error: BonecamError) -> None:
    """Write the files of a refused run into `work`."""
    levels, holding = morphed.levels.levels, morphed.job.holding
    write_whole(work / "refused.txt", f"{error}\n")
    keep_job(work, morphed)
    write_mesh(morphed.part.placed_given, work / GIVEN)
    write_tsm(morphed.surface, work / "surface.tspline")
    keep_into(work, levels, morphed.stock, (holding.diameter, post_below(morphed.part.mesh, holding).top))
    program = error.evidence.get("program")
    paths = error.evidence.get("paths", ())
    if program is not None:
        write_whole(work / f"program{program.extension}", program.text)
        write_whole(work / "toolpath.csv", toolpath_csv(paths))
    if "place" in error.evidence:
        draw_refused(error.evidence["place"], levels, paths, work / "refused.png")
