"""What `bonecam.finish` hands back, and its files."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import bonecam
from bonecam.job import Job, write_job
from bonecam.machine.machine import read_machine
from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.parts.files import stage_program_files
from bonecam.nc.posting.rotary.machine_limits import machine_limits
from bonecam.nc.program import Program
from bonecam.planning.strategies.surface_path import Workpiece
from bonecam.report.axis_comparison import AxisComparison, compare_axes
from bonecam.report.files.kept_folder import SERIES, write_simulated
from bonecam.report.files.kept_view import VIEW
from bonecam.report.files.output_files import File, Outputs
from bonecam.report.files.shown import Shown
from bonecam.report.page.packing import pack
from bonecam.report.page.surface_contents import surface_contents
from bonecam.report.pictures.compared_axes import draw_compared_axes
from bonecam.report.pictures.machine.bodies import draw_machine
from bonecam.report.pictures.surface_axes import draw_axes
from bonecam.report.summary import finished_summary
from bonecam.report.tables.cl_text import apt_text
from bonecam.report.tables.cones_csv import cones_csv
from bonecam.report.tables.toolpath_csv import toolpath_csv
from bonecam.report.typed.run_report import report_text
from bonecam.runtime.staging import staged
from bonecam.surface.files.iga import write_iga
from bonecam.tool.path import ToolPath
from bonecam.verify.removal.proofs.of_surface import CHORD
from bonecam.verify.removal.result import Removal
from bonecam.workholding.clamping import clamping_of


class Written(Shown):
    """A result with a program and a folder of its own to keep."""

    program: Program
    report: dict[str, Any]
    job: Job

    @property
    @abstractmethod
    def all_paths(self) -> Sequence[ToolPath]:
        """The paths in machining order."""

    @property
    def sheet(self) -> str:
        """The setup sheet as the text of an HTML file."""
        raise NotImplementedError(f"{type(self).__name__} has no setup sheet")

    @abstractmethod
    def fill_folder(self, work: Path) -> None:
        """Write the files of the folder to keep."""


@dataclass(frozen=True, eq=False, repr=False)
class Finished(Written):
    """The result of `bonecam.finish`: surface and solid as they stand on the post, the path, the program, and
    what it removes, if that was simulated. `report` is the content of the file of --report."""

    workpiece: Workpiece
    path: ToolPath
    program: Program
    report: dict[str, Any]
    job: Job
    removal: Removal | None = None

    @cached_property
    def packed_view(self) -> bytes:
        """What `view` shows, packed as `bonecam.report.page` has it."""
        surface = self.workpiece.surface.tessellate(CHORD)
        parts = (surface, self.workpiece.solid, self.path, self.program.text, self.job, self.report)
        return pack(surface_contents(*parts, bonecam.__version__, self.removal))

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
        """Write surface.iga, solid.ply, toolpath.png, axes.png, axes.md, machine.png, what all runs have, and where it
        was simulated left.ply, error.ply and error.png."""
        write_iga(self.workpiece.surface, work / "surface.iga")
        write_mesh(self.workpiece.solid, work / "solid.ply")
        self._draw(work / "toolpath.png")
        compared = self.compare_axes()
        draw_compared_axes(compared, self.workpiece.surface.tessellate(CHORD), work / "axes.png")
        machine = read_machine(self.job.nc.machine)
        draw_machine([self.path], self.workpiece.solid, self.job.holding, machine, work / "machine.png")
        (work / "axes.md").write_text(compared.table, encoding="utf-8", newline="")
        write_simulated(work, self.removal)
        fill_shared(work, self, axes=compared.report)

    def __repr__(self) -> str:
        return f"<Finished of {self._title}: {self.program!r}>"

    @property
    def summary(self) -> str:
        """The report in a few lines of text."""
        return finished_summary(self.report)


def write_run(made: Written, wanted: Outputs) -> None:
    """Write the wanted files, all or none: program, report, page, sheet, cutter location data, and the folder to keep.
    FileError names what cannot be written."""
    texts: tuple[tuple[File, Callable[[], str]], ...] = (
        (wanted.report, lambda: report_text(made.report)),
        (wanted.html, lambda: made.page),
        (wanted.sheet, lambda: made.sheet),
        (wanted.apt, lambda: apt_text(made.all_paths, made.program.name)),
    )
    with staged() as staging:
        if wanted.program is not None:
            programs = {Path(wanted.program): made.program}
            stage_program_files(staging, programs, job_dialect(made.job.nc))
        for file, text in texts:
            if file is not None:
                staging.write(file, text())
        if wanted.keep is not None:
            made.fill_folder(staging.folder(wanted.keep, SERIES))


def fill_shared(work: Path, made: Written, **more: Any) -> None:
    """Write toolpath.csv and .apt, cones.csv, program, view.gz, job.toml and report.json, which tells `more`."""
    (work / VIEW).write_bytes(made.packed_view)
    paths = made.all_paths
    texts = {
        f"program{made.program.extension}": made.program.text,
        "toolpath.csv": toolpath_csv(paths),
        "toolpath.apt": apt_text(paths, made.program.name),
        "job.toml": write_job(made.job),
        "report.json": report_text({**made.report, **more}),
    }
    if any(path.cones for path in paths):
        texts["cones.csv"] = cones_csv(paths)
    for name, text in texts.items():
        (work / name).write_text(text, encoding="utf-8", newline="")
