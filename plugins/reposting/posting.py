"""Tool paths of a file that was written elsewhere: cutter location data, or a program of another machine and control.

The cutters are those of the job on the machine that is posted for. Where its spindle is slower, a cut that is faster
than its cutter may be there is slowed to that, so that no tooth takes a larger chip.

Whether a machine leans its tool as paths of others want it, told before anything is posted.

Paths of others: cutter location data of another system, or a program of another machine and control, posted for this
one, proved against the part, and simulated where its stock is known.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import FileError, JobError, MachineError, ProgramError, counted
from bonecam.files import check_files, required_text, write_whole
from bonecam.job import LINK_FEED, Job, NcJob, field_error
from bonecam.machine.check import reach_text
from bonecam.machine.kinematics import inverse_rotary, within_limits
from bonecam.machine.limits import polar_angles
from bonecam.machine.machine import Machine, read_machine
from bonecam.machining import ProvedProgram, post_and_prove
from bonecam.mesh import read_in_mm
from bonecam.mesh.distance import MeshDistance
from bonecam.nc.dialect import Dialect
from bonecam.nc.feeds import fastest_cut
from bonecam.nc.header import record_simulation
from bonecam.nc.parts import joined, part_count, write_program_files
from bonecam.nc.program import Program, program_name
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import job_dialect, machine_and_dialect
from bonecam.progress import Progress, part, silent
from bonecam.report.kept import kept_job, kept_surface, with_kept_cutters
from bonecam.report.outputs import Outputs
from bonecam.report.tables import ClPath, read_apt
from bonecam.simulation import simulate, simulation_report, simulation_text
from bonecam.surface import TSpline, load_surface
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.verify.findings import Removal
from bonecam.verify.removal import ACCURACY, check_removal_of_job
from bonecam.verify.sweeping import groups_of

SAME_BALL = 1e-3
"""Radii that differ by less are of one ball, mm."""


def read_paths(
    file: Path, origin: tuple[str | Path, str | Path | None] | None, job: Job, machine: Machine
) -> list[ToolPath]:
    """The tool paths of a file: of APT statements, or of a program for the machine and controller of `origin`.
    ProgramError where it cannot be read, has no moves, or uses a cutter that the job does not have."""
    try:
        if origin is None:
            paths = list(_of_apt(required_text(file, "cutter location data"), job, machine))
        else:
            dialect = job_dialect(NcJob(machine=str(origin[0]), controller=str(origin[1] or "")))
            text = joined(file, dialect).text
            paths = list(_of_program(text, read_machine(origin[0]), dialect, job, machine))
    except ProgramError as error:
        raise ProgramError(f"{file}: {error}", **error.evidence) from error
    if not paths:
        raise ProgramError(f"{file}: it has no moves: give cutter location data with GOTO", file=str(file))
    return paths


def slowed_cuts(paths: Sequence[ToolPath], job: Job) -> tuple[list[ToolPath], int]:
    """The paths with no cut faster than the job lets its cutter cut, and how many of their moves are slowed."""
    slowed = []
    count = 0
    for path in paths:
        fast = (path.kinds == MoveKind.CUT) & (path.feed_rates > fastest_cut(path.cutter, job))
        feeds = np.where(fast, fastest_cut(path.cutter, job), path.feed_rates)
        slowed.append(replace(path, feed_rates=feeds))
        count += int(fast.sum())
    return slowed, count


def _of_apt(text: str, job: Job, machine: Machine) -> Iterator[ToolPath]:
    """The paths of APT statements; those without a level are numbered down to 0."""
    paths = read_apt(text).paths
    for left, path in zip(range(len(paths))[::-1], paths, strict=True):
        cutter = _cutter(path.tool, _ball(path), path.level, job, machine)
        links = _links(path, cutter, job)
        kinds = np.select([path.rapid, links], [int(MoveKind.RAPID), int(MoveKind.LINK)], int(MoveKind.CUT))
        level = left if path.level is None else path.level
        yield _tool_path(level, cutter, kinds=kinds, poses=(path.tips, path.axes), feeds=path.feed_rates, job=job)


def _links(path: ClPath, cutter: Cutter, job: Job) -> Bool[ndarray, " n"]:
    """The moves that lead from cut to cut: as the text tells, or else those as fast as the job's links."""
    if path.links is not None:
        return path.links
    return (path.feed_rates >= LINK_FEED) & (path.feed_rates > fastest_cut(cutter, job))


def _ball(path: ClPath) -> float:
    """The radius of the ball of a path's cutter, mm; ProgramError where it is none."""
    if abs(path.corner - path.diameter / 2) > SAME_BALL:
        what = f"tool {path.tool} of diameter {path.diameter:g} mm has a corner of {path.corner:g} mm and no ball"
        raise ProgramError(f"{what}: give paths of ball-end cutters")
    return path.corner


def _of_program(text: str, origin: Machine, dialect: Dialect, job: Job, machine: Machine) -> Iterator[ToolPath]:
    """The paths of a program for another machine and control, one a level and tool; feeds are those of its tip."""
    motions = read_program(text, origin, dialect)
    way = np.linalg.norm(np.diff(motions.tips, axis=0, prepend=motions.tips[:1]), axis=1)
    feeds = np.where(motions.inverse_time, motions.feed_rates * way, motions.feed_rates)
    feeds = np.where(feeds > 0, feeds, LINK_FEED)
    groups = list(groups_of(text, motions, dialect))
    for left, group in zip(range(len(groups))[::-1], groups, strict=True):
        rows = group.moves
        cutter = _cutter(group.tool, motions.controls[group.tool].radius, group.level, job, machine)
        kinds = np.select(
            [motions.rapid[rows] | ~motions.known_start[rows], motions.links[rows]],
            [int(MoveKind.RAPID), int(MoveKind.LINK)],
            int(MoveKind.CUT),
        )
        level = left if group.level is None else group.level
        poses = motions.tips[rows], motions.axes[rows]
        yield _tool_path(level, cutter, kinds=kinds, poses=poses, feeds=feeds[rows], job=job, rest=group.rest)


def _cutter(number: int, radius: float, level: int | None, job: Job, machine: Machine) -> Cutter:
    """The cutter of a job with a ball of this radius (mm), under its number there, with its feed on a level if that is
    known; `number` is that of the paths."""
    for own, name in enumerate(job.cutter_names, 1):
        tool = job.tool(name, level if job.path.strategy == "morph" else None)
        if abs(tool.radius - radius) <= SAME_BALL:
            return Cutter.from_job(own, name, tool, machine.nose)
    known = ", ".join(f"{name} {getattr(job, name).radius:g}" for name in job.cutter_names)
    what = f"tool {number} is a ball of radius {radius:g} mm, the job has {known}"
    raise ProgramError(f"{what}: describe it in the job (like --set finishing.radius={radius:g})", tool=number)


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


SHOWN = 6
"""Paths that are named."""


def check_axes(paths: Sequence[ToolPath], machine: Machine) -> None:
    """MachineError where moves want tool axes that no rotary angles of the machine within its limits give: of which
    paths, how many, how they lean, and what the machine has."""
    beyond = [_beyond(path, machine) for path in paths]
    if not any(mask.any() for mask in beyond):
        return
    axes = np.vstack([path.axes[mask] for path, mask in zip(paths, beyond, strict=True)])
    moves = sum(len(path.axes) for path in paths)
    low, high = np.degrees([polar_angles(axes).min(), polar_angles(axes).max()])
    named = list(dict.fromkeys(path.title for path, mask in zip(paths, beyond, strict=True) if mask.any()))
    more = f" and {len(named) - SHOWN} more" if len(named) > SHOWN else ""
    lean = f"{low:.0f} to {high:.0f} deg" if high - low > 1 else f"{low:.1f} deg"
    raise MachineError(
        f"{machine.name}: {len(axes)} of {moves} moves lean the tool by {lean} as its axes cannot, in "
        f"{', '.join(named[:SHOWN])}{more}; on it {reach_text(machine)}: plan the part for this machine "
        f"(bonecam convert PART --machine {machine.name}), or post the paths for one that leans so",
        machine=machine.name,
        moves=len(axes),
    )


def _beyond(path: ToolPath, machine: Machine) -> Bool[ndarray, " n"]:
    """The moves of a path whose axes the machine does not reach."""
    solutions, _ = inverse_rotary(machine, path.axes)
    return np.asarray(~within_limits(machine, solutions).any(axis=1))


@dataclass(frozen=True, eq=False)
class Posted:
    """The program, the paths it was posted from and their proof, and what it removes, where that was simulated;
    `slowed` cuts of the paths are faster than their cutters may be here, and were slowed to that."""

    proved: ProvedProgram
    removal: Removal | None
    job: Job
    slowed: int = 0

    @property
    def program(self) -> Program:
        """The program as it is written."""
        return self.proved.program

    @property
    def summary(self) -> str:
        """What was made and proved, in lines for a person."""
        one = self.program
        paths = self.proved.paths
        program = f"{one.blocks} blocks for {one.machine} / {one.controller}"
        parts = part_count(one.text)
        program += f", with {counted(parts, 'file')} that it calls" if parts else ""
        program += "".join(f"\n          {text}" for text in one.time.texts)
        feeds = f"\nfeed      {counted(self.slowed, 'cut')} slowed to what the cutters take on this machine"
        removal = "removal   not simulated: give the folder of a run (--keep)"
        if self.removal is not None:
            removal = simulation_text(simulation_report(self.removal, self.job))
        proof = f"nc        {program}\nproof     {self.proved.proof}\n{removal}"
        return f"paths     {len(paths)}{feeds if self.slowed else ''}\n{proof}"


def post(
    paths: str | Path,
    part_file: str | Path | None = None,
    job: Job | None = None,
    *,
    program: str | Path | None = None,
    origin: tuple[str | Path, str | Path | None] | None = None,
    keep: str | Path | None = None,
    progress: Progress = silent,
) -> Posted:
    """The verified program of the `paths`: a file of APT statements, or, where the `origin` is given, a program
    for these: machine, and controller or None, which is the machine's usual one. It must not gouge `part_file`, a solid
    in the paths' frame: a mesh, a kept surface (.tspline), or the folder of a run, whose surface stands for its
    level_00.ply too; without it that of `keep`.

    Machine, controller, feeds of rapids, and the cutters (found by their balls) are those of the `job`, that of the
    folder `keep` if none is given; a cut that is faster than its cutter may be there is slowed. With the folder `keep`
    of a run the removal of its stock is simulated from the new text. The file `program` is written at the end.
    ProgramError where the paths cannot be read or use a cutter that the job does not have, MachineError where the
    machine does not reach them, VerifyError where the program is wrong.
    """
    job = with_kept_cutters(job or kept_job(keep), keep)
    design = _design_file(part_file, keep)
    check_files([program], [design])
    machine, dialect = machine_and_dialect(job.nc)
    if job.nc.probe:
        raise field_error(
            "nc", "probe", True, "paths that are posted again know no bar: leave it out, or use `convert`"
        )
    Outputs(program, split=job.nc.is_split).check(paths, dialect)
    planned, slowed = slowed_cuts(read_paths(Path(paths), origin, job, machine), job)
    check_axes(planned, machine)
    name = program_name(program or paths, dialect)
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
    return Posted(proved, removal, job, slowed)


def _design_file(part_file: str | Path | None, keep: str | Path | None) -> Path:
    """The file of what must not be gouged: a part, or the surface of a kept folder."""
    if part_file is None and keep is None:
        raise JobError("no part is named that must not be gouged: give --part, or the folder of a run (--keep)")
    if part_file is not None:
        return kept_surface(Path(part_file)) or Path(part_file)
    surface = kept_surface(Path(str(keep)))
    if surface is None:
        raise FileError(f"{keep}: is no folder: give the one that `convert --keep` wrote", file=str(keep))
    return surface


def _design(file: Path, job: Job) -> TSpline | MeshDistance:
    """What must not be gouged: the surface of a kept run, or a mesh."""
    if file.suffix == ".tspline":
        return load_surface(file)
    return MeshDistance(read_in_mm(file, job.mesh.units))


def _simulated(program: Program, keep: str | Path, job: Job, progress: Progress) -> Removal:
    """What the text removes of the stock of a kept run; VerifyError where it may not."""
    with TemporaryDirectory() as folder:
        text = Path(folder) / f"{program.name}{program.extension}"
        write_whole(text, program.text)
        removal = simulate(text, keep, job, progress=progress)
    check_removal_of_job(removal, job)
    return removal
