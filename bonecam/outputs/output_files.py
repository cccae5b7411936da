"""The files that a run writes. Their names are checked before the work; all files are written or none."""

import json
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from bonecam.errors import FileError
from bonecam.files import check_files, check_folder, whole_file
from bonecam.job import HoldingJob
from bonecam.mesh.files.mesh_files import CAD, MESHES
from bonecam.nc.dialect import Dialect, dialect_names, read_dialect
from bonecam.outputs.kept_folder import write_kept_folder
from bonecam.outputs.result import Morphed
from bonecam.progress import Progress, report, silent
from bonecam.setup.holding import post_below
from bonecam.surface.files.save import TEXTS, check_target, save_surface
from bonecam.toolpath.path import ToolPath

File = str | Path | None


@dataclass(frozen=True)
class Outputs:
    """The files of program, report and surface, and the folder of --keep; None where one is not wanted."""

    program: File = None
    keep: File = None
    report: File = None
    surface: File = None

    def check(self, part: str | Path | None = None, dialect: Dialect | None = None) -> None:
        """FileError where a file cannot be written, has an ending of another kind of file, or is the part's
        file.

        `dialect` is that of the program, where one is wanted.
        """
        files = [file for file in (self.program, self.report, self.surface) if file is not None]
        check_files(files, [] if part is None else [part])
        if self.program is not None and dialect is not None:
            check_ending(Path(self.program), dialect)
        if self.surface is not None:
            check_target(self.surface)
        if self.keep is not None:
            check_folder(self.keep)

    def write(
        self,
        made: Morphed,
        holding: HoldingJob,
        paths: Sequence[ToolPath] = (),
        program: str = "",
        progress: Progress = silent,
    ) -> None:
        """Write the wanted files of a run, whole; the program is the last to appear."""
        report(progress, 0.0, "writing the files")
        post = (holding.diameter, post_below(made.part.mesh, holding).top)
        with ExitStack() as files:
            if self.program is not None:
                file = files.enter_context(whole_file(self.program))
                file.write_text(program, encoding="utf-8", newline="")
            if self.report is not None:
                file = files.enter_context(whole_file(self.report))
                file.write_text(json.dumps(made.report, indent=2) + "\n", encoding="utf-8")
            if self.surface is not None:
                save_surface(made.surface, files.enter_context(whole_file(self.surface)))
            if self.keep is not None:
                write_kept_folder(self.keep, made.surface, made.levels.levels, made.stock, paths, post)


def check_ending(program: Path, dialect: Dialect) -> None:
    """FileError where the name of a program has no ending, or the ending of another controller or of a
    part."""
    proposed = program.with_name(f"{program.stem.strip('.') or 'program'}{dialect.extension}").name
    if len(program.suffix) < 2:
        trouble = f"has no ending, {dialect.name} programs end in {dialect.extension}: name it {proposed}"
        raise FileError(f"{program}: {trouble}", file=str(program))

    programs = {read_dialect(name).extension for name in dialect_names()}
    foreign = {*MESHES, *CAD, *TEXTS, *programs} - {dialect.extension}
    if program.suffix.lower() in foreign:
        trouble = f"{dialect.name} programs do not end in {program.suffix}"
        remedy = f"name it {proposed}, or choose another --controller"
        raise FileError(f"{program}: {trouble}: {remedy}", file=str(program))
