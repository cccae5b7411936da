"""The kept folder of a run whose program was refused by its own proof: what planned the program should have known, so
that such a refusal is a fault of bonecam's, and the folder is what a report of it needs."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from bonecam.errors import BendingError, BonecamError, FileError, LimitError, VerifyError
from bonecam.files import whole_folder, write_whole
from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.nc.program import Program
from bonecam.report.files.kept_bodies import GIVEN
from bonecam.report.files.kept_folder import SERIES, keep_into, keep_job
from bonecam.report.files.result import Morphed
from bonecam.report.pictures.level_sections import draw_refused
from bonecam.report.tables.toolpath_csv import toolpath_csv
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
def keep_refused(made: Morphed, folder: str | Path | None) -> Iterator[None]:
    """Where the block raises a VerifyError or LimitError, the `folder` (None: nothing is kept) gets refused.txt,
    refused.png with the place, job, part, surface and levels of what was `made`, and the program with its tool path
    where one was posted. A VerifyError that is not of bending says whose fault it is."""
    try:
        yield
    except (VerifyError, LimitError) as error:
        how = _kept(made, folder, error)
        if isinstance(error, BendingError | LimitError):
            raise
        raise VerifyError(f"{error} ({FAULT}: {how})", **error.evidence) from error


def _kept(morphed: Morphed, folder: str | Path | None, error: BonecamError) -> str:
    """Keep what a report of the refusal needs in the `folder`, and say how to report it."""
    if folder is None:
        return "report it with what --keep DIR writes of this run"
    try:
        with whole_folder(folder, SERIES) as work:
            _fill(work, morphed, error)
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
    program, paths = error.evidence.get("program"), error.evidence.get("paths", ())
    if program is not None:
        write_whole(work / f"program{program.extension}", program.text)
        write_whole(work / "toolpath.csv", toolpath_csv(paths))
    if "place" in error.evidence:
        draw_refused(error.evidence["place"], levels, paths, work / "refused.png")
