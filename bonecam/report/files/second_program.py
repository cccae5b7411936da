"""The program of the second clamping, as a result keeps it, what the report tells of it, and its page."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import bonecam
from bonecam.job import Job
from bonecam.nc.program import Program
from bonecam.report.files.shown import Shown
from bonecam.report.page.packing import pack
from bonecam.report.page.second_contents import second_contents
from bonecam.report.pictures.level_sections import draw_second
from bonecam.report.sheet.second_article import second_article
from bonecam.report.summary import second_text
from bonecam.report.tables.cl_text import apt_text
from bonecam.report.typed.report import SecondFigures
from bonecam.tool.path import ToolPath
from bonecam.verify.removal.result import Removal
from bonecam.workholding.shell import SecondClamping


@dataclass(frozen=True, eq=False, repr=False)
class SecondProgram(Shown):
    """Part and shell after the turn-over, the tool path of each layer in machining order, the program and what it
    removes. `name` is that of the part's file, `report` is `second` of the run's report, `job` that of the run with the
    [holding] of the shell."""

    name: str
    clamping: SecondClamping
    paths: tuple[ToolPath, ...]
    program: Program
    removal: Removal
    report: SecondFigures
    job: Job

    @cached_property
    def packed_view(self) -> bytes:
        """What `view` shows, packed as `bonecam.report.page` has it."""
        posted = (self.clamping, self.program.text, self.paths, self.removal)
        return pack(second_contents(*posted, self.job, self.report, self.name, bonecam.__version__))

    @property
    def apt(self) -> str:
        """The tool paths as cutter location data in APT words."""
        return apt_text(self.paths, self.program.name)

    @property
    def setup_article(self) -> str:
        """Its page of the run's setup sheet."""
        arguments = (self.clamping, self.job, self.program, self.report)
        return second_article(self.name, *arguments, bonecam.__version__)

    @property
    def summary(self) -> str:
        """The report in a few lines of text."""
        return second_text(self.report)

    @property
    def _title(self) -> str:
        return f"{self.name}, second clamping"

    def _draw(self, file: Path) -> str:
        draw_second(self.clamping, self.paths, file)
        return "part and shell in the second clamping"

    def __repr__(self) -> str:
        return f"<second clamping: {self.program!r}>"
