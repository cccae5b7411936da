"""A probe of the program that `convert --keep` wrote: simulated from its text, touched along a line."""

from pathlib import Path

from bonecam.errors import FileError
from bonecam.files import check_files, write_whole
from bonecam.job import read_job
from bonecam.machine.machine import read_machine
from bonecam.mesh.distance import MeshDistance
from bonecam.nc.job_dialect import job_dialect
from bonecam.progress import Progress, part, report, silent
from bonecam.report.files.kept_bodies import REMEDY, kept_levels
from bonecam.report.files.kept_view import kept_contents
from bonecam.simulation import simulate
from bonecam.study.pictures.probed_line import draw_probed
from bonecam.surface.files.tspline_text import read_tsm
from bonecam.verify.control.program_file import program_text
from bonecam.verify.probing.line import probe_line
from bonecam.verify.probing.machined import PostedProgram
from bonecam.verify.probing.measuring_program import measuring_program
from bonecam.verify.probing.probe import RUBY, Probed, probe_surface
from bonecam.verify.removal.of_job import cutters_of
from bonecam.workholding.post import post_below

File = str | Path | None


def probe(
    keep: str | Path,
    *,
    points: int = 100,
    line: float | None = None,
    radius: float = RUBY,
    csv: File = None,
    picture: File = None,
    program: File = None,
    progress: Progress = silent,
) -> Probed:
    """Touch the surface that the program of a kept folder leaves with a ball of `radius` (mm), at so many `points` of
    the line s = `line` (None: the back of the part), approaching along the nominal normal.

    Writes the points as `csv`, the curve as `picture`, and a measuring `program` for the machine's own probe in the
    words of the job's controller. FileError where the folder is of another version or not whole, JobError for a line
    off the part, MachineError where no measuring program is known for the controller.
    """
    folder = Path(keep)
    check_files([file for file in (csv, picture, program) if file is not None])
    kept_contents(folder)  # a folder of another version is refused
    job = read_job(folder / "job.toml")
    machine, dialect = read_machine(job.nc.machine), job_dialect(job.nc)
    kept = folder / f"program{dialect.extension}"
    if not kept.exists():
        raise FileError(f"{folder}: has no {kept.name}: {REMEDY}", file=str(kept))
    text = program_text(kept, machine, dialect, job)
    mesh, _, _ = kept_levels(text, kept, folder)
    part_surface = read_tsm(folder / "surface.tspline")
    probed_line = probe_line(part_surface, post_below(mesh, job.holding), radius, points, line)
    measuring = ""
    if program is not None:
        measuring = measuring_program(probed_line, radius, MeshDistance(mesh), dialect.name)
    removal = simulate(kept, folder, job, progress=part(progress, 0.0, 0.9))
    report(progress, 0.9, "probing")
    cutters = tuple(cutters_of(job, machine))
    posted = PostedProgram(text, machine, dialect=dialect, cutters=cutters, part=part_surface, removal=removal)
    probed = probe_surface(posted, probed_line, radius)
    if csv is not None:
        write_whole(csv, probed.csv)
    if picture is not None:
        draw_probed([("as simulated", probed)], picture)
    if program is not None:
        write_whole(program, measuring)
    return probed
