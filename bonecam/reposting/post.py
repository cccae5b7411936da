"""Paths of others: cutter location data of another system, or a program of another machine and control, posted for this
one, proved against the part, and simulated where its stock is known."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from bonecam.errors import FileError, JobError, counted
from bonecam.files import check_files, write_whole
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.mesh import read_in_mm
from bonecam.mesh.distance import MeshDistance
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.parts.files import write_program_files
from bonecam.nc.parts.grouping import is_split
from bonecam.nc.parts.marks import part_count
from bonecam.nc.posting.header.header import record_simulation
from bonecam.nc.program import Program, program_name
from bonecam.post_and_prove import ProvedProgram, post_and_prove
from bonecam.progress import Progress, part, silent
from bonecam.report.files.kept_bodies import kept_job, kept_surface, with_kept_cutters
from bonecam.report.files.output_files import Outputs
from bonecam.reposting.reached import check_axes
from bonecam.reposting.read_paths import read_paths, slowed_cuts
from bonecam.simulation import simulate, simulation_report, simulation_text
from bonecam.surface.files.tspline_text import read_tsm
from bonecam.surface.tspline import TSpline
from bonecam.verify.removal.of_job import ACCURACY, check_removal_of_job
from bonecam.verify.removal.result import Removal


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
    check_files([program] if program is not None else [], [design])
    machine, dialect = read_machine(job.nc.machine), job_dialect(job.nc)
    Outputs(program, split=is_split(job.nc)).check(paths, dialect)
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
        return read_tsm(file)
    return MeshDistance(read_in_mm(file, job.mesh.units))


def _simulated(program: Program, keep: str | Path, job: Job, progress: Progress) -> Removal:
    """What the text removes of the stock of a kept run; VerifyError where it may not."""
    with TemporaryDirectory() as folder:
        text = Path(folder) / f"{program.name}{program.extension}"
        write_whole(text, program.text)
        removal = simulate(text, keep, job, progress=progress)
    check_removal_of_job(removal, job)
    return removal
