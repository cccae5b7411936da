"""The files that a run writes. Their places are tried before the work; each file is written whole, the program even
where another cannot be.

A refused run writes its report, as far as it came, and where its own proof refused the program the kept folder: what
planned the program should have known, so that this is a fault of bonecam's, and the folder is what a report of it
needs. What `bonecam.finish` hands back writes itself, all or nothing.
"""

import os
import re
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from bonecam.errors import (
    BendingError,
    BodiesError,
    BonecamError,
    Cancelled,
    FileError,
    LimitError,
    VerifyError,
    file_error,
    knowing,
)
from bonecam.files import check_files, check_folder, second_file, whole_folder, write_whole
from bonecam.job import Job, write_job
from bonecam.machine.machine import read_machine
from bonecam.mesh.files.mesh_files import CAD, MESHES, write_mesh
from bonecam.nc.dialect import Dialect, dialect_names, read_dialect
from bonecam.nc.header import record_simulation
from bonecam.nc.parts import stage_program_files
from bonecam.nc.path_words import machine_limits
from bonecam.nc.probing import probing_file
from bonecam.nc.program import Program, check_file_name, second_program_file
from bonecam.nc.requirements import job_dialect
from bonecam.planning.surface_paths import Workpiece
from bonecam.plugins import reader_endings
from bonecam.progress import Progress, report, silent
from bonecam.report.kept import (
    GIVEN,
    SERIES,
    VIEW,
    Morphed,
    Result,
    Shown,
    check_page_name,
    fill_kept_folder,
    keep_elements,
    keep_into,
    keep_job,
    write_paths,
    write_simulated,
)
from bonecam.report.machine_picture import draw_machine
from bonecam.report.page.contents import pack, surface_contents
from bonecam.report.pictures import draw_axes, draw_compared_axes, draw_refused
from bonecam.report.summary import AxisComparison, compare_axes, finished_summary
from bonecam.report.tables import apt_text, toolpath_csv
from bonecam.report.typed import RefusedFigures, report_text
from bonecam.report.warnings import NOT_ASKED, Warned, simulated_text, with_warnings
from bonecam.runtime.staging import placed, staged
from bonecam.runtime.timing import StageTimes
from bonecam.surface.files.tspline_text import TSPLINE, check_target, save_surface
from bonecam.tool.path import ToolPath
from bonecam.verify.findings import Removal
from bonecam.verify.proof import CHORD
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import post_below

File = str | Path | None

ISO = (".gcode", ".gco", ".g", ".tap", ".cnc", ".eia", ".iso")
"""Endings that say G code, which no Klartext program is."""
APT = (".apt", ".cl", ".cls")
"""Endings of files of APT statements."""


@dataclass(frozen=True)
class Outputs:
    """The files of program, report, surface, page, sheet and cutter location data, and the folder of --keep; None where
    not wanted. Where a run has a `second` clamping, program, page and cutter location data are two files each; a
    program that is `split` has parts beside it, and one for the touch `probe`, if that is wanted."""

    program: File = None
    keep: File = None
    report: File = None
    surface: File = None
    html: File = None
    sheet: File = None
    apt: File = None
    second: bool = False
    split: bool = False
    probe: bool = False

    def check(self, part: str | Path | None = None, dialect: Dialect | None = None) -> None:
        """FileError where a file cannot be written, has an ending of another kind of file, or is the part's
        file.

        `dialect` is that of the program, where one is wanted.
        """
        twice = (self.program, self.html, self.apt)
        beside = [second_file(file) for file in twice if file is not None and self.second]
        beside += [probing_file(self.program)] if self.program is not None and self.probe else []
        check_files([*twice, self.report, self.surface, self.sheet, *beside], [part])
        if self.program is not None and dialect is not None:
            check_ending(Path(self.program), dialect)
            check_file_name(Path(self.program), dialect, second=self.second, split=self.split, probe=self.probe)
        if self.surface is not None:
            check_target(self.surface)
        for page in (self.html, self.sheet):
            if page is not None:
                check_page_name(page)
        if self.apt is not None and Path(self.apt).suffix.lower() not in APT:
            remedy = f"name it {Path(self.apt).name}.apt"
            raise file_error(self.apt, f"APT files end in {', '.join(APT)}", remedy)
        if self.keep is not None:
            check_folder(self.keep)

    def write(self, made: Morphed, progress: Progress = silent) -> None:
        """Write the wanted files of a run, each whole; together they take their places.

        What cannot be written keeps neither the program nor the other files from being written: FileError then
        names it, and what was. Where the program itself cannot be written, nothing is.
        """
        report(progress, 0.0, "writing the files")
        before = len(placed)
        try:
            self._write(made)
        except Exception as error:
            if self.program is None or os.path.realpath(self.program) not in placed[before:]:
                raise
            remark = f"{self.program} is written and complete"
            if not isinstance(error, BonecamError):
                error.add_note(remark)
                raise
            raise type(error)(f"{error} ({remark})", **error.evidence) from error

    def _write(self, morphed: Morphed) -> None:
        troubles: list[Exception] = []
        with staged() as staging:
            if self.program is not None and isinstance(morphed, Result):
                programs = {Path(self.program): morphed.program}
                dialect = job_dialect(morphed.job.nc)
                if morphed.second is not None:
                    programs[second_program_file(self.program, dialect)] = morphed.second.program
                stage_program_files(staging, programs, dialect)
                if morphed.probing is not None:
                    staging.write(probing_file(self.program), morphed.probing.text)
            # the wanted outputs beside the program, and what writes each
            wanted: list[tuple[File, Callable[[str | Path], None]]] = [
                (self.report, lambda file: staging.write(file, report_text(morphed.report))),
                (self.surface, lambda file: save_surface(morphed.surface, staging.file(file))),
                (self.html, lambda file: staging.write(file, morphed.page)),
            ]
            if isinstance(morphed, Result):
                wanted += [
                    (self.sheet, lambda file: staging.write(file, morphed.sheet)),
                    (self.apt, lambda file: staging.write(file, apt_text(morphed.paths, morphed.program.name))),
                ]
                second = morphed.second
                if second is not None:
                    wanted += [
                        (self.html and second_file(self.html), lambda file: staging.write(file, second.page)),
                        (self.apt and second_file(self.apt), lambda file: staging.write(file, second.apt)),
                    ]
            wanted.append((self.keep, lambda file: fill_kept_folder(staging.folder(file, SERIES), morphed)))
            for path, write in wanted:
                if path is None:
                    continue
                try:
                    write(path)
                except Exception as error:  # it is raised once the program is written
                    troubles.append(staging.told(error))
                    staging.drop(path)
        if troubles:
            raise troubles[0]


SHARED = ".nc"
"""An ending that programs of many controls have: none of them owns it."""


def check_ending(program: Path, dialect: Dialect) -> None:
    """FileError where the name of a program has no ending, or the ending of another controller or of a
    part."""
    proposed = program.with_name(f"{program.stem.strip('.') or 'program'}{dialect.extension}").name
    if len(program.suffix) < 2:
        trouble = f"has no ending, {dialect.name} programs end in {dialect.extension}"
        raise file_error(program, trouble, f"name it {proposed}")

    programs = {read_dialect(name).extension for name in dialect_names()}
    other = ISO if dialect.grammar == "klartext" else ()
    foreign = {*MESHES, *CAD, TSPLINE, *reader_endings(), *programs, *other} - {dialect.extension, SHARED}
    if program.suffix.lower() in foreign:
        trouble = f"{dialect.name} programs do not end in {program.suffix}"
        remedy = f"name it {proposed}, or choose another --controller"
        raise file_error(program, trouble, remedy)


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
    levels, holding = morphed.levels.levels, morphed.job.holding
    try:
        with whole_folder(folder, SERIES) as work:
            write_whole(work / "refused.txt", f"{error}\n")
            keep_job(work, morphed)
            write_mesh(morphed.part.placed_given, work / GIVEN)
            save_surface(morphed.surface, work / "surface.tspline")
            keep_into(work, levels, morphed.stock, (holding.diameter, post_below(morphed.part.mesh, holding).top))
            program = error.evidence.get("program")
            paths = error.evidence.get("paths", ())
            if program is not None:
                write_whole(work / f"program{program.extension}", program.text)
                write_whole(work / "toolpath.csv", toolpath_csv(paths))
            if "place" in error.evidence:
                draw_refused(error.evidence["place"], levels, paths, work / "refused.png")
            write_whole(work / "report.json", report_text(report))
    except FileError as trouble:
        return f"nothing could be kept: {trouble}"
    return f"report it with {folder}, which holds program, place and picture"


@dataclass(frozen=True, eq=False, repr=False)
class Machined(Shown):
    """The result of what is machined beside solids, not in a stock round it: surface and solid as they stand on the
    post, the program, and what it removes, if that was simulated. `report` is the content of the file of --report."""

    workpiece: Workpiece
    program: Program
    report: dict[str, Any]
    job: Job
    removal: Removal | None = field(default=None, kw_only=True)

    @property
    @abstractmethod
    def all_paths(self) -> Sequence[ToolPath]:
        """The paths in machining order."""

    @abstractmethod
    def fill_folder(self, work: Path) -> None:
        """Write the files of the folder to keep."""


@dataclass(frozen=True, eq=False, repr=False)
class Finished(Machined):
    """The result of `bonecam.finish`, with the path."""

    path: ToolPath

    @cached_property
    def packed_view(self) -> bytes:
        """What `view` shows, packed as `bonecam.report.page` has it."""
        shapes = self.workpiece.surface.tessellate(CHORD), self.workpiece.solid
        return pack(surface_contents(*shapes, self.path, self.program.text, self.job, self.report, self.removal))

    def compare_axes(self) -> AxisComparison:
        """The tool axes beside the surface's normals and axes that lean by the lead angle, at the same contacts:
        turning, collisions, speeds and time."""
        machine = read_machine(self.job.nc.machine)
        scene = self.workpiece.scene(self.job, clamping_of(self.job.holding, machine.table))
        return compare_axes(self.path, scene, machine_limits(machine), self.job.path)

    @property
    def _title(self) -> str:
        return self.report["surface"]["file"] or "a surface"

    def _draw(self, file: Path) -> str:
        draw_axes(self.path, self.workpiece.surface, file)
        return "the surface with its contacts and tool axes, from two sides"

    @property
    def all_paths(self) -> Sequence[ToolPath]:
        """The path."""
        return [self.path]

    def fill_folder(self, work: Path) -> None:
        """Write surface.iga, solid.ply, toolpath.png, axes.png, axes.md, and what all runs have."""
        keep_elements(self.workpiece.surface, work)
        write_mesh(self.workpiece.solid, work / "solid.ply")
        self._draw(work / "toolpath.png")
        compared = self.compare_axes()
        draw_compared_axes(compared, self.workpiece.surface.tessellate(CHORD), work / "axes.png")
        write_whole(work / "axes.md", compared.table)
        fill_shared(work, self, axes=compared.report)

    def __repr__(self) -> str:
        return f"<Finished of {self._title}: {self.program!r}>"

    @property
    def summary(self) -> str:
        """The report in a few lines of text."""
        return finished_summary(self.report)


def write_run(made: Machined, wanted: Outputs, more: Sequence[tuple[File, Callable[[], str]]] = ()) -> None:
    """Write the wanted files, all or none: program, report, page, `more` files with their texts, cutter location data,
    and the folder to keep. FileError names what cannot be written."""
    texts: list[tuple[File, Callable[[], str]]] = [
        (wanted.report, lambda: report_text(made.report)),
        (wanted.html, lambda: made.page),
        *more,
        (wanted.apt, lambda: apt_text(made.all_paths, made.program.name)),
    ]
    with staged() as staging:
        if wanted.program is not None:
            stage_program_files(staging, {Path(wanted.program): made.program}, job_dialect(made.job.nc))
        for file, text in texts:
            if file is not None:
                staging.write(file, text())
        if wanted.keep is not None:
            made.fill_folder(staging.folder(wanted.keep, SERIES))


def fill_shared(work: Path, made: Machined, **more: Any) -> None:
    """Write toolpath.csv and .apt, cones.csv, program, view.gz, job.toml and report.json, which tells `more`; where it
    was simulated left.ply, error.ply and error.png; and machine.png."""
    (work / VIEW).write_bytes(made.packed_view)
    write_paths(work, made.program, made.all_paths)
    write_whole(work / "job.toml", write_job(made.job))
    write_whole(work / "report.json", report_text({**made.report, **more}))
    machine = read_machine(made.job.nc.machine)
    draw_machine(made.all_paths, made.workpiece.solid, made.job.holding, machine, work / "machine.png")
    write_simulated(work, made.removal)


Made = TypeVar("Made", bound=Result | Machined)


def with_removal(
    made: Made,
    removal: Removal,
    sections: Mapping[str, Any] = {},
    *,
    skipped: Mapping[str, str] = NOT_ASKED,
    more: Iterable[Warned] = (),
) -> Made:
    """The result with what its posted text removes: in its report, with more `sections` and `more` warnings, and in the
    program's header; `skipped` says why force and bending are not known, where they are not. LimitError as in
    `with_warnings`."""
    figures = {**made.report, "mechanics": skipped, **removal.sections, **sections}
    report: Any = with_warnings(figures, made.job, more)
    summary = simulated_text(report, str(removal.mechanics or skipped["skipped"]))
    program = record_simulation(made.program, job_dialect(made.job.nc), removal.cell, summary)
    return replace(made, program=program, report=report, removal=removal)
