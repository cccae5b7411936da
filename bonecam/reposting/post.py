"""Paths of others: cutter location data of another system, or a program of another machine and control, posted for this
one, proved against the part, and simulated where its stock is known."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import FileError, JobError, ProgramError, counted
from bonecam.files import check_files, required_text, write_whole
from bonecam.job import Job
from bonecam.machine.machine import Machine, read_machine
from bonecam.mesh import read_mesh
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.units import to_mm
from bonecam.nc.dialect import read_dialect
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.parts.files import write_program_files
from bonecam.nc.parts.joined import joined
from bonecam.nc.parts.marks import part_count
from bonecam.nc.posting.header.header import record_simulation
from bonecam.nc.program import Program, program_name
from bonecam.nc.reading.read import read_program
from bonecam.post_and_prove import ProvedProgram, post_and_prove
from bonecam.progress import Progress, part, silent
from bonecam.report.files.kept_bodies import kept_surface
from bonecam.report.tables.cl_data import ClPath, read_apt
from bonecam.simulation import simulate, simulation_report, simulation_text
from bonecam.surface.files.tspline_text import read_tsm
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.verify.removal.groups import groups_of
from bonecam.verify.removal.of_job import ACCURACY, check_removal_of_job
from bonecam.verify.removal.result import Removal

SAME_BALL = 1e-3
"""Radii that differ by less are of one ball, mm."""


@dataclass(frozen=True, eq=False)
class Posted:
    """The program, the paths it was posted from and their proof, and what it removes, where that was simulated."""

    proved: ProvedProgram
    removal: Removal | None
    job: Job

    @property
    def program(self) -> Program:
        """The program as it is written."""
        return self.proved.program

    @property
    def summary(self) -> str:
        """What was made and proved, in lines for a person."""
        one = self.program
        paths = self.proved.paths
        program = f"{one.blocks} blocks for {one.machine} / {one.controller}, about {one.time_min:.0f} min"
        parts = part_count(one.text)
        program += f", with {counted(parts, 'file')} that it calls" if parts else ""
        removal = "removal   not simulated: give the folder of a run (--keep)"
        if self.removal is not None:
            removal = simulation_text(simulation_report(self.removal, self.job))
        return f"paths     {len(paths)}\nnc        {program}\nproof     {self.proved.proof}\n{removal}"


def post(
    paths: str | Path,
    part_file: str | Path | None = None,
    job: Job | None = None,
    *,
    program: str | Path | None = None,
    origin: tuple[str | Path, str | Path] | None = None,
    keep: str | Path | None = None,
    progress: Progress = silent,
) -> Posted:
    """The verified program of the `paths`: a file of APT statements, or, where the `origin` (machine and controller) is
    given, a program for these. It must not gouge `part_file`, a solid in the paths' frame: a mesh, a kept surface
    (.tspline), or the folder of a run, whose surface stands for its level_00.ply too; without it that of `keep`.

    Machine, controller, feeds of links and rapids, and the cutters (found by their balls) are those of the `job`. With
    the folder `keep` of a run the removal of its stock is simulated from the new text. The file `program` is written at
    the end. ProgramError where the paths cannot be read or use a cutter that the job does not have, MachineError where
    the machine does not reach them, VerifyError where the program is wrong.
    """
    job = job or Job()
    design = _design_file(part_file, keep)
    check_files([program] if program is not None else [], [paths, design])
    machine, dialect = read_machine(job.nc.machine), job_dialect(job.nc)
    planned = _planned(Path(paths), origin, job, machine)
    name = program_name(program or paths)
    note = [f"paths: {Path(paths).name}"]
    share = part(progress, 0.0, 0.5)
    proved = post_and_prove(
        planned, machine, dialect, job, _design(design, job), name=name, comments=note, progress=share
    )
    removal = None
    if keep is not None:
        removal = _simulated(proved.program, keep, job, part(progress, 0.5, 1.0))
        recorded = record_simulation(proved.program, dialect, ACCURACY.cell)
        proved = ProvedProgram(proved.paths, recorded, proved.proof)
    if program is not None:
        write_program_files(proved.program, dialect, program)
    return Posted(proved, removal, job)


def _design_file(part_file: str | Path | None, keep: str | Path | None) -> Path:
    """The file of what must not be gouged: a part, or the surface of a kept folder."""
    if part_file is None and keep is None:
        raise JobError(
            "no part is named that must not be gouged: give --part, or the folder of a run (--keep)"
        )
    if part_file is not None:
        return kept_surface(Path(part_file)) or Path(part_file)
    surface = kept_surface(Path(str(keep)))
    if surface is None:
        raise FileError(f"{keep}: is no folder: give the one that `convert --keep` wrote", file=str(keep))
    return surface


def _design(file: Path, job: Job) -> TSpline | MeshDistance:
    """What must not be gouged: the surface of a kept run, or a mesh."""
    if file.suffix == ".tspline":
        return read_tsm(file)
    return MeshDistance(to_mm(read_mesh(file), job.mesh.units, str(file)))


def _simulated(program: Program, keep: str | Path, job: Job, progress: Progress) -> Removal:
    """What the text removes of the stock of a kept run; VerifyError where it may not."""
    with TemporaryDirectory() as folder:
        text = Path(folder) / f"{program.name}{program.extension}"
        write_whole(text, program.text)
        removal = simulate(text, keep, job, progress=progress)
    check_removal_of_job(removal, job)
    return removal


def _planned(
    file: Path, origin: tuple[str | Path, str | Path] | None, job: Job, machine: Machine
) -> list[ToolPath]:
    """The tool paths of a file."""
    try:
        if origin is None:
            paths = list(_of_apt(required_text(file, "cutter location data"), job, machine))
        else:
            text = joined(file, read_dialect(origin[1])).text
            paths = list(_of_program(text, origin, job, machine))
    except ProgramError as error:
        raise ProgramError(f"{file}: {error}", **error.evidence) from error
    if not paths:
        raise ProgramError(f"{file}: it has no moves: give cutter location data with GOTO", file=str(file))
    return paths


def _of_apt(text: str, job: Job, machine: Machine) -> Iterator[ToolPath]:
    """The paths of APT statements; those without a level are numbered down to 0."""
    paths = read_apt(text).paths
    for left, path in zip(range(len(paths))[::-1], paths, strict=True):
        cutter = _cutter(path.tool, _ball(path), job, machine)
        # what is faster than the cutter cuts is a link: the simulation tells whether it cuts
        fast = path.feed_rates > cutter.feed
        kinds = np.select([path.rapid, fast], [int(MoveKind.RAPID), int(MoveKind.LINK)], int(MoveKind.CUT))
        level = left if path.level is None else path.level
        yield _tool_path(
            level, cutter, kinds=kinds, poses=(path.tips, path.axes), feeds=path.feed_rates, job=job
        )


def _ball(path: ClPath) -> float:
    """The radius of the ball of a path's cutter, mm; ProgramError where it is none."""
    if abs(path.corner - path.diameter / 2) > SAME_BALL:
        what = f"tool {path.tool} of diameter {path.diameter:g} mm has a corner of {path.corner:g} mm and no ball"
        raise ProgramError(f"{what}: give paths of ball-end cutters")
    return path.corner


def _of_program(
    text: str, origin: tuple[str | Path, str | Path], job: Job, machine: Machine
) -> Iterator[ToolPath]:
    """The paths of a program for another machine and control, one a level and tool; feeds are those of its tip."""
    dialect = read_dialect(origin[1])
    motions = read_program(text, read_machine(origin[0]), dialect)
    way = np.linalg.norm(np.diff(motions.tips, axis=0, prepend=motions.tips[:1]), axis=1)
    feeds = np.where(motions.inverse_time, motions.feed_rates * way, motions.feed_rates)
    feeds = np.where(feeds > 0, feeds, job.nc.link_feed)
    groups = list(groups_of(text, motions, dialect))
    for left, group in zip(range(len(groups))[::-1], groups, strict=True):
        rows = group.moves
        cutter = _cutter(group.tool, motions.controls[group.tool].radius, job, machine)
        kinds = np.select(
            [motions.rapid[rows] | ~motions.known_start[rows], motions.links[rows]],
            [int(MoveKind.RAPID), int(MoveKind.LINK)],
            int(MoveKind.CUT),
        )
        level = left if group.level is None else group.level
        poses = motions.tips[rows], motions.axes[rows]
        yield _tool_path(level, cutter, kinds=kinds, poses=poses, feeds=feeds[rows], job=job, rest=group.rest)


def _cutter(number: int, radius: float, job: Job, machine: Machine) -> Cutter:
    """The cutter of a job with a ball of this radius (mm), under its number there; `number` is that of the paths."""
    for own, name in enumerate(job.cutter_names, 1):
        tool = job.tool(name)
        if abs(tool.radius - radius) <= SAME_BALL:
            return Cutter.from_job(own, name, tool, machine.nose)
    known = ", ".join(f"{name} {getattr(job, name).radius:g}" for name in job.cutter_names)
    what = f"tool {number} is a ball of radius {radius:g} mm, the job has {known}"
    raise ProgramError(
        f"{what}: describe it in the job (like --set finishing.radius={radius:g})", tool=number
    )


def _tool_path(
    level: int,
    cutter: Cutter,
    kinds: Int[ndarray, " n"],
    poses: tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]],
    feeds: Float[ndarray, " n"],
    job: Job,
    rest: int = 0,
) -> ToolPath:
    """The tool path of moves, each stretch of cuts a pass."""
    cut: Bool[ndarray, " n"] = kinds == MoveKind.CUT
    number = np.cumsum(cut & ~np.r_[False, cut[:-1]]) - 1
    unknown = np.full((len(kinds), 3), np.nan)
    return ToolPath(
        level=level,
        cutter=cutter,
        kinds=kinds.astype(np.int64),
        pass_index=np.where(cut, number, -1),
        parameters=unknown[:, :2],
        contacts=unknown,
        tips=poses[0],
        axes=poses[1],
        feed_rates=np.where(kinds == MoveKind.RAPID, job.nc.rapid_feed, feeds),
        uncut=np.zeros((0, 3)),
        reasons=(),
        rest=rest,
    )
