"""What `bonecam.blades` hands back, and its files."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import bonecam
from bonecam.job import Job
from bonecam.levels.sequences.begun_morph import Morph
from bonecam.machine.machine import read_machine
from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.nc.program import Program
from bonecam.planning.strategies.surface_path import Workpiece
from bonecam.report.files.finished import Written, fill_shared
from bonecam.report.files.kept_folder import write_simulated
from bonecam.report.page.packing import pack
from bonecam.report.page.wheel_contents import bladed_summary, wheel_contents
from bonecam.report.pictures.machine.bodies import draw_machine
from bonecam.report.pictures.surface_axes import draw_wheel
from bonecam.report.sheet.setup_sheet import setup_sheet
from bonecam.report.sheet.wheel_article import wheel_article
from bonecam.setup.turned_blank import TurnedBlank
from bonecam.surface.blades.wheel import Wheel
from bonecam.surface.files.iga import write_iga
from bonecam.tool.path import ToolPath
from bonecam.verify.removal.result import Removal


@dataclass(frozen=True, eq=False, repr=False)
class Bladed(Written):
    """The result of `bonecam.blades`: the wheel as it stands on its post, its blank, the levels of a channel, the paths
    of all channels and blades, the program, and what it removes (None where that was not simulated)."""

    workpiece: Workpiece
    wheel: Wheel
    blank: TurnedBlank
    levels: Morph
    paths: tuple[ToolPath, ...]
    program: Program
    report: dict[str, Any]
    job: Job
    removal: Removal | None = None

    @property
    def all_paths(self) -> Sequence[ToolPath]:
        """The paths in machining order."""
        return self.paths

    @cached_property
    def packed_view(self) -> bytes:
        """What `view` shows, packed as `bonecam.report.page` has it."""
        return pack(
            wheel_contents(
                self.workpiece.solid,
                self.blank,
                morph=self.levels,
                wheel=self.wheel,
                paths=self.paths,
                program=self.program.text,
                job=self.job,
                report=self.report,
                removal=self.removal,
                version=bonecam.__version__,
            )
        )

    @property
    def sheet(self) -> str:
        """The setup sheet as the text of an HTML file."""
        shapes = self.workpiece.solid, self.blank
        page = wheel_article(self._title, *shapes, self.job, self.program, self.report, bonecam.__version__)
        return setup_sheet(self._title, [page])

    def fill_folder(self, work: Path) -> None:
        """Write surface.iga, solid.ply, blank.ply, blank.csv, toolpath.png, machine.png, what all runs have, and where
        it was simulated left.ply, error.ply and error.png."""
        write_iga(self.wheel.blade, work / "surface.iga")
        write_mesh(self.workpiece.solid, work / "solid.ply")
        write_mesh(self.blank.mesh, work / "blank.ply")
        rows = [f"{radius:.4f},{height:.4f}\n" for radius, height in self.blank.profile]
        (work / "blank.csv").write_text("".join(["radius_mm,height_mm\n", *rows]), encoding="utf-8", newline="")
        self._draw(work / "toolpath.png")
        machine = read_machine(self.job.nc.machine)
        draw_machine(self.paths, self.workpiece.solid, self.job.holding, machine, work / "machine.png")
        write_simulated(work, self.removal)
        fill_shared(work, self)

    @property
    def _title(self) -> str:
        return str(self.report["surface"]["file"])

    def _draw(self, file: Path) -> str:
        draw_wheel(self.workpiece.solid, self.blank, self.paths, self.wheel.count, file)
        return "the wheel with the paths of one channel and of one blade, and its blank in section"

    def __repr__(self) -> str:
        return f"<Bladed of {self._title}: {self.wheel.count} blades, {self.program!r}>"

    @property
    def summary(self) -> str:
        """The report in a few lines of text."""
        return bladed_summary(self.report)
