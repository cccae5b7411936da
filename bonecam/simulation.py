"""The simulation of a program alone: from its text, its job, and the folder that `convert --keep` wrote."""

import re
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from bonecam.errors import FileError, JobError, ProgramError
from bonecam.files import check_files, write_whole
from bonecam.job import Job
from bonecam.mechanics.loads import workpiece_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.motions import zero_height_of
from bonecam.nc.parts import joined
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import job_dialect, machine_and_dialect, second_job
from bonecam.planning.blank import bar_of
from bonecam.progress import Progress, part, silent
from bonecam.report.kept import (
    REMEDY,
    SAME_STOCK,
    SECOND_VIEW,
    check_page_name,
    kept_contents,
    kept_given,
    kept_job,
    kept_levels,
    kept_stock,
    with_kept_cutters,
    with_kept_holding,
)
from bonecam.report.page.contents import Contents, layers_on, level_meshes, pack, program_contents, with_program
from bonecam.report.page.page import page_html
from bonecam.report.stage_reports import gouge_to_given
from bonecam.report.summary import removal_lines
from bonecam.report.warnings import NOT_ASKED, mechanics_lines, warning_lines, warnings_of
from bonecam.surface.files.tspline_text import load_surface
from bonecam.verify.control import header_of, program_text
from bonecam.verify.findings import GivenRemoval, GivenSurface, NotJudged, Removal, into_given
from bonecam.verify.gouge import measure_gouge
from bonecam.verify.removal import (
    ACCURACY,
    beside_given,
    cutters_of,
    depth_limits,
    followed_surfaces,
    level_scallops,
    simulate_removal,
    simulate_stump,
    with_limits,
)
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import Post, post_below
from bonecam.workholding.shell import turn_over

SECOND = re.compile(r"SECOND CLAMPING: ", re.IGNORECASE)
"""How the header of the program of a second clamping begins."""
STUMP = re.compile(r"STUMP: .* UP TO Z (-?[\d.]+)", re.IGNORECASE)
"""What that says of the stump."""
COARSEST = 0.5
"""Rays are no farther apart than this share of the radius of the smallest ball."""


def simulate(
    program: str | Path,
    keep: str | Path,
    job: Job | None = None,
    *,
    cell: float = ACCURACY.cell,
    html: str | Path | None = None,
    mechanics: bool = True,
    progress: Progress = silent,
) -> Removal:
    """What the NC text in the file `program` removes, with the part and the stock of the folder `keep` and the
    cutters, machine and post of the `job` that it was made with, that of the folder if none is given (cutters and
    sizes of [holding] that a job leaves open are the folder's); `cell` (mm) is the distance of the rays. The
    program of a second clamping begins with what the kept first one leaves, which is simulated before it. The text
    is judged against the mesh as given too, if the folder has it; `given` of the result tells. Without `mechanics`
    force and bending are left out. The page `html` shows the program as simulated, whatever came out.

    FileError where a file is not there, ProgramError where the text cannot be read or is for another machine, control,
    stock or stump, VerifyError where its control would refuse the text or run it otherwise than the job means (axis
    limits, feeds, spindle, coolant, lengths of tools), JobError where the cell is too fine or too coarse.
    `check_removal` refuses what a program may not do.
    """
    job = with_kept_cutters(job or kept_job(keep), keep)
    radius = job.smallest_ball
    if cell > COARSEST * radius:
        what = f"rays {cell:g} mm apart miss what a ball of {radius:g} mm does"
        raise JobError(f"{what}: give a cell of at most {COARSEST * radius:g} mm")
    machine, dialect = machine_and_dialect(job.nc)
    if html is not None:
        check_files([html], [program])
        check_page_name(html)
    is_second = bool(SECOND.search(header_of(joined(Path(program), dialect).text)))
    if is_second:
        dialect = job_dialect(second_job(job).nc)
    text = program_text(Path(program), machine, dialect, job)
    keep = Path(keep)
    job = with_kept_holding(job, keep)
    given = kept_given(keep, job)
    run: Contents | None
    if is_second:
        run = _kept_second(text, Path(program), keep)
        removal = _simulate_second(
            text, run, keep=keep, job=job, given=given, cell=cell, progress=progress, mechanics=mechanics
        )
        job = second_job(job)
    else:
        run = kept_contents(keep)[1] if html is not None else None
        removal, post = _simulate_first(text, Path(program), keep, job, run, cell, progress, mechanics=mechanics)
        removal = _judged(removal, text, given, post, job)
    if html is not None and run is not None:
        _write_page(html, Path(program).name, text=text, run=run, job=job, removal=removal)
    return removal


def _write_page(html: str | Path, name: str, text: str, run: Contents, job: Job, removal: Removal) -> None:
    """Write the page of a `run` with the moves of another `text` and what they remove."""
    machine, dialect = machine_and_dialect(job.nc)
    meshes = level_meshes(run)
    surfaces = layers_on(meshes[0], removal) if removal.shell is not None else None
    posted = program_contents(text, meshes, job, machine, dialect, removal=removal, surfaces=surfaces)
    reported = simulation_report(removal, job)
    page = with_program(run, posted, reported, simulation_text(reported))
    write_whole(html, page_html(pack(page), name))


def _simulate_first(
    text: str,
    program: Path,
    keep: Path,
    job: Job,
    run: Contents | None,
    cell: float,
    progress: Progress,
    *,
    mechanics: bool,
) -> tuple[Removal, Post]:
    """What the `text` of a first clamping removes, and its post; what stands is told on the levels of the page of a
    `run`."""
    machine, dialect = machine_and_dialect(job.nc)
    part, stock_mesh, levels = kept_levels(text, program, keep)
    post = post_below(part, job.holding)
    clamping = clamping_of(job.holding, machine.table)
    stock = kept_stock(keep, stock_mesh, job.levels.chord_tolerance)
    removal = simulate_removal(
        text,
        machine,
        dialect=dialect,
        stock=stock,
        post=post,
        cutters=cutters_of(job, machine),
        clamping=clamping,
        part=load_surface(keep / "surface.tspline"),
        limits=depth_limits(text, machine, dialect, job, map(job.levels.depth_onto, range(levels - 1))),
        scallops=level_scallops(job, levels),
        surfaces=followed_surfaces(job, level_meshes(run)) if run else {},
        bar=bar_of(stock, job.holding),
        accuracy=replace(ACCURACY, cell=cell, coarser=False),
        workpiece=workpiece_of(job, post, clamping) if mechanics else None,
        progress=progress,
    )
    return with_limits(removal, machine, job), post


def _judged(removal: Removal, text: str, given: GivenSurface | NotJudged, post: Post | None, job: Job) -> Removal:
    """The removal by a `text` with what it does to the part as it was `given`, on this `post`."""
    if isinstance(given, NotJudged):
        return replace(removal, given=given)
    motions = read_program(text, *machine_and_dialect(job.nc))
    return beside_given(removal, given, post, job, measure_gouge(motions, given))


def simulation_report(removal: Removal, job: Job) -> dict[str, Any]:
    """The sections `warnings`, `removal` and, as far as the mesh as given is kept, `nc` of the report of a
    simulation."""
    nc = gouge_to_given(removal.given.ball) if isinstance(removal.given, GivenRemoval) else {}
    sections = {**({"nc": nc} if nc else {}), "mechanics": NOT_ASKED, **removal.sections}
    return {"warnings": [asdict(each) for each in warnings_of(sections, job)], **sections}


def simulation_text(report: Mapping[str, Any]) -> str:
    """The report of a simulation in a few lines."""
    lines = [
        *warning_lines(report["warnings"]),
        *(f"cut in    {line}" for line in into_given(report.get("nc", {}))),
        *removal_lines(report["removal"]),
        *mechanics_lines(report["mechanics"]),
    ]
    return "\n".join(lines)


def _simulate_second(
    text: str,
    run: Contents,
    keep: Path,
    job: Job,
    given: GivenSurface | NotJudged,
    cell: float,
    progress: Progress,
    *,
    mechanics: bool,
) -> Removal:
    """What the `text` of a second clamping removes of what the kept first program leaves; part, shell and pose are
    those of the page of a `run`."""
    machine, dialect = machine_and_dialect(job.nc)
    kept = keep / f"program{dialect.extension}"
    first = program_text(kept, machine, dialect, job)
    before, _ = _simulate_first(first, kept, keep, job, None, cell, part(progress, 0.0, 0.8), mechanics=False)
    turned = run.facts["turned"]
    pose = turn_over(turned["zero_mm"])
    material = before.remaining.above(turned["cut_off_mm"]).move(pose)
    shell = TriangleMesh(run.arrays["solid"], run.arrays["solid_faces"].astype(np.int32))
    job = second_job(job)
    cut = text, machine, job_dialect(job.nc), job, material, level_meshes(run)[0], shell, part(progress, 0.8, 1.0)
    removal = simulate_stump(*cut, mechanics=mechanics)
    return _judged(removal, text, given.move(pose), None, job)


def _kept_second(text: str, program: Path, keep: Path) -> Contents:
    """The page of the second clamping of a kept folder. FileError where it has none, ProgramError where the text is for
    another stump."""
    if not (keep / SECOND_VIEW).exists():
        what = f"the program is of a second clamping, of which {keep} has no {SECOND_VIEW}"
        raise FileError(f"{program}: {what}: {REMEDY}", file=str(keep / SECOND_VIEW))
    run = kept_contents(keep, SECOND_VIEW)[1]
    header = header_of(text)
    reported = STUMP.search(header)
    top = run.facts["turned"]["zero_mm"] - run.facts["turned"]["cut_off_mm"] - zero_height_of(header)
    if reported is not None and abs(float(reported[1]) - top) > SAME_STOCK:
        what = f"its stump reaches up to z {float(reported[1]):.2f} mm, that of {keep} up to {top:.2f}"
        raise ProgramError(f"{program}: {what}: {REMEDY}", line=0)
    return run
