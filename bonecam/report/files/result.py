"""What a run hands back: part, surface, stock, levels, tool paths, program and report."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import bonecam
from bonecam.job import Job
from bonecam.levels.sequences.begun_morph import Morph
from bonecam.machine.machine import read_machine
from bonecam.mesh.part import Part
from bonecam.nc.posting.rotary.machine_limits import machine_limits
from bonecam.nc.program import Program
from bonecam.planning.collision.level_scene import level_scene
from bonecam.report.axis_comparison import AxisComparison, compare_axes
from bonecam.report.files.second_program import SecondProgram
from bonecam.report.files.shown import Shown
from bonecam.report.page.contents import run_contents
from bonecam.report.page.packing import pack
from bonecam.report.pictures.depth_colours import draw_coloured
from bonecam.report.sheet.setup_sheet import setup_article, setup_sheet
from bonecam.report.summary import summary_of
from bonecam.report.typed.report import Report
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import ToolPath
from bonecam.verify.removal.result import Removal


@dataclass(frozen=True, eq=False, repr=False)
class Morphed(Shown):
    """The result of `bonecam.morph_levels`. `report` is the content of the file of --report, `job` that of the run with
    the post's length."""

    part: Part
    surface: TSpline
    stock: Stock
    levels: Morph
    report: Report
    job: Job

    @cached_property
    def packed_view(self) -> bytes:
        """What `view` shows, packed as `bonecam.report.page` has it."""
        parts = (self.part, self.levels.levels, self.stock, self.job, self.report, bonecam.__version__)
        return pack(run_contents(*parts, **self._posted))

    @property
    def _title(self) -> str:
        return Path(self.part.file).name

    def _draw(self, file: Path) -> str:
        """The levels, coloured by depth."""
        draw_coloured(self.levels.levels, file)
        return "levels, coloured by the depth of their cut"

    @property
    def _posted(self) -> dict[str, Any]:
        """What there is of a program, as `run_contents` takes it."""
        return {}

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.part.file}: {self._told}>"

    @property
    def _told(self) -> str:
        """What was made, in a few words."""
        return f"{self.levels.cuts} cuts, K_min {self.levels.lower_bound}"

    @property
    def summary(self) -> str:
        """The report in a few lines of text."""
        return summary_of(self.report)


@dataclass(frozen=True, eq=False, repr=False)
class Result(Morphed):
    """The result of `bonecam.convert`: levels, the tool path of each level in machining order, the program, and what it
    removes (None where that was not simulated); `second` is the program of the second clamping, if the job has one."""

    paths: tuple[ToolPath, ...]
    program: Program
    removal: Removal | None = None
    second: SecondProgram | None = None

    @property
    def sheet(self) -> str:
        """The setup sheet as the text of an HTML file, with a page for each clamping."""
        version = bonecam.__version__
        pages = [
            setup_article(
                self.part, self.stock, job=self.job, program=self.program, report=self.report, version=version
            )
        ]
        if self.second is not None:
            pages.append(self.second.setup_article)
        return setup_sheet(Path(self.part.file).name, pages)

    def compare_axes(self, level: int = 0) -> AxisComparison:
        """The tool axes of a level beside the surface's normals and axes that lean by the lead angle, at the same
        contacts: turning, collisions, speeds and time. ValueError where the level has no path."""
        machine = read_machine(self.job.nc.machine)
        scene = level_scene(self.levels.levels, level, self.stock, self.job, machine.bodies)
        (path,) = (path for path in self.paths if path.level == level and not path.rest)
        return compare_axes(path, scene, machine_limits(machine), self.job.path)

    @property
    def _posted(self) -> dict[str, Any]:
        """The program with its paths and what it removes."""
        return {"program": self.program.text, "paths": self.paths, "removal": self.removal}

    @property
    def _told(self) -> str:
        """What was made, in a few words."""
        return f"{super()._told}, {self.program!r}"
