"""The files that a run writes. Their places are tried before the work; each file is written whole, the program
even where another cannot be."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bonecam.errors import BonecamError, FileError
from bonecam.files import check_files, check_folder, second_file
from bonecam.mesh.files.mesh_files import CAD, MESHES
from bonecam.nc.dialect import Dialect, dialect_names, read_dialect
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.parts.files import stage_program_files
from bonecam.nc.program import check_file_name, second_program_file
from bonecam.progress import Progress, report, silent
from bonecam.report.files.kept_folder import SERIES, fill_kept_folder
from bonecam.report.files.kept_view import check_page_name
from bonecam.report.files.result import Morphed, Result
from bonecam.report.tables.cl_text import apt_text
from bonecam.report.typed.run_report import report_text
from bonecam.runtime.staging import Staging, placed, staged
from bonecam.surface.files.save import TEXTS, check_target, save_surface
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
    program that is `split` has parts beside it."""

    program: File = None
    keep: File = None
    report: File = None
    surface: File = None
    html: File = None
    sheet: File = None
    apt: File = None
    second: bool = False
    split: bool = False

    def check(self, part: str | Path | None = None, dialect: Dialect | None = None) -> None:
        """FileError where a file cannot be written, has an ending of another kind of file, or is the part's
        file.

        `dialect` is that of the program, where one is wanted.
        """
        twice = [file for file in (self.program, self.html, self.apt) if file is not None]
        once = [file for file in (self.report, self.surface, self.sheet) if file is not None]
        files = [*twice, *once, *(second_file(file) for file in twice if self.second)]
        check_files(files, [] if part is None else [part])
        if self.program is not None and dialect is not None:
            check_ending(Path(self.program), dialect)
            check_file_name(Path(self.program), dialect, second=self.second, split=self.split)
        if self.surface is not None:
            check_target(self.surface)
        for page in (self.html, self.sheet):
            if page is not None:
                check_page_name(page)
        if self.apt is not None and Path(self.apt).suffix.lower() not in APT:
            remedy = f"name it {Path(self.apt).name}.apt"
            raise FileError(f"{self.apt}: APT files end in {', '.join(APT)}: {remedy}", file=str(self.apt))
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
            for path, write in self._beside(morphed, staging):
                try:
                    write()
                except Exception as error:  # it is raised once the program is written
                    troubles.append(staging.told(error))
                    staging.drop(path)
        if troubles:
            raise troubles[0]

    def _beside(self, morphed: Morphed, staging: Staging) -> list[tuple[str | Path, Callable[[], None]]]:
        """The wanted outputs beside the program, and what writes each."""
        outputs: list[tuple[str | Path, Callable[[], None]]] = []
        file = self.report
        if file is not None:
            outputs.append((file, lambda: staging.write(file, report_text(morphed.report))))
        surface = self.surface
        if surface is not None:
            outputs.append((surface, lambda: save_surface(morphed.surface, staging.file(surface))))
        page = self.html
        if page is not None:
            outputs.append((page, lambda: staging.write(page, morphed.page)))
        sheet = self.sheet
        if sheet is not None and isinstance(morphed, Result):
            outputs.append((sheet, lambda: staging.write(sheet, morphed.sheet)))
        apt = self.apt
        if apt is not None and isinstance(morphed, Result):
            text = apt_text(morphed.paths, morphed.program.name)
            outputs.append((apt, lambda: staging.write(apt, text)))
        outputs += self._of_second(morphed, staging)
        keep = self.keep
        if keep is not None:
            holding = morphed.job.holding
            post = (holding.diameter, post_below(morphed.part.mesh, holding).top)
            outputs.append((keep, lambda: fill_kept_folder(staging.folder(keep, SERIES), morphed, post)))
        return outputs

    def _of_second(self, morphed: Morphed, staging: Staging) -> list[tuple[str | Path, Callable[[], None]]]:
        """Page and cutter location data of a second clamping, and what writes each."""
        second = morphed.second if isinstance(morphed, Result) else None
        if second is None:
            return []
        outputs: list[tuple[str | Path, Callable[[], None]]] = []
        if self.html is not None:
            page = second_file(self.html)
            outputs.append((page, lambda: staging.write(page, second.page)))
        if self.apt is not None:
            apt = second_file(self.apt)
            outputs.append((apt, lambda: staging.write(apt, second.apt)))
        return outputs


SHARED = ".nc"
"""An ending that programs of many controls have: none of them owns it."""


def check_ending(program: Path, dialect: Dialect) -> None:
    """FileError where the name of a program has no ending, or the ending of another controller or of a
    part."""
    proposed = program.with_name(f"{program.stem.strip('.') or 'program'}{dialect.extension}").name
    if len(program.suffix) < 2:
        trouble = f"has no ending, {dialect.name} programs end in {dialect.extension}: name it {proposed}"
        raise FileError(f"{program}: {trouble}", file=str(program))

    programs = {read_dialect(name).extension for name in dialect_names()}
    other = ISO if dialect.grammar == "klartext" else ()
    foreign = {*MESHES, *CAD, *TEXTS, *programs, *other} - {dialect.extension, SHARED}
    if program.suffix.lower() in foreign:
        trouble = f"{dialect.name} programs do not end in {program.suffix}"
        remedy = f"name it {proposed}, or choose another --controller"
        raise FileError(f"{program}: {trouble}: {remedy}", file=str(program))
