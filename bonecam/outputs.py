"""The files that the chain writes: their names are checked before any work, and all of them are written or
none."""

import json
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bonecam.errors import FileError
from bonecam.files import check_files, check_folder, whole_file
from bonecam.levels.measure.level import Level
from bonecam.mesh.files.mesh_files import CAD, MESHES
from bonecam.nc.dialect import Dialect, dialect_names, read_dialect
from bonecam.setup.stock import Stock
from bonecam.surface.files.save import TEXTS, check_target, save_surface
from bonecam.surface.tspline import TSpline
from bonecam.toolpath.path import ToolPath

File = str | Path | None


@dataclass(frozen=True)
class Outputs:
    """Where the program, its report and its surface go, and the folder of what is kept; None where it is not
    wanted."""

    program: File = None
    keep: File = None
    report: File = None
    surface: File = None

    def check(self, inputs: Sequence[str | Path], dialect: Dialect | None = None) -> None:
        """A BonecamError where a name is none for what it would hold, is one of the inputs', or cannot be
        written.

        `dialect` is the program's, where one is wanted.
        """
        check_files([file for file in (self.program, self.report, self.surface) if file is not None], inputs)
        if self.program is not None and dialect is not None:
            check_ending(Path(self.program), dialect)
        if self.surface is not None:
            check_target(self.surface)
        if self.keep is not None:
            check_folder(self.keep)

    def write(
        self,
        program: str,
        report: dict[str, Any],
        surface: TSpline,
        levels: Sequence[Level],
        stock: Stock,
        paths: Sequence[ToolPath],
        post: tuple[float, float],
    ) -> None:
        """Write what is wanted; the program comes to its place last. `post` is (diameter, top z) in mm; there
        may be no `paths` yet."""
        from bonecam.keep import keep

        with ExitStack() as files:
            if self.program is not None:
                files.enter_context(whole_file(self.program)).write_text(
                    program, encoding="utf-8", newline=""
                )
            if self.report is not None:
                files.enter_context(whole_file(self.report)).write_text(
                    json.dumps(report, indent=2) + "\n", encoding="utf-8"
                )
            if self.surface is not None:
                save_surface(surface, files.enter_context(whole_file(self.surface)))
            if self.keep is not None:
                keep(self.keep, surface, levels, stock, paths, post)


def check_ending(program: Path, dialect: Dialect) -> None:
    """FileError where a program's name has no ending, or ends as another controller's programs or as a part's
    file."""
    name = program.with_name(f"{program.stem.strip('.') or 'program'}{dialect.extension}").name
    if len(program.suffix) < 2:
        raise FileError(
            f"{program}: has no ending, {dialect.name} programs end in {dialect.extension}: name it {name}",
            file=str(program),
        )
    foreign = {*MESHES, *CAD, *TEXTS, *(read_dialect(name).extension for name in dialect_names())} - {
        dialect.extension
    }
    if program.suffix.lower() in foreign:
        remedy = f"name it {name}, or choose another --controller"
        raise FileError(
            f"{program}: {dialect.name} programs do not end in {program.suffix}: {remedy}", file=str(program)
        )
