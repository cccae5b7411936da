"""The simulation of a program alone: from its text, its job, and the folder that `convert --keep` wrote."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from bonecam.errors import BonecamError, FileError, JobError, ProgramError
from bonecam.files import check_files, input_text, write_whole
from bonecam.job import Job, LevelsJob, StockJob
from bonecam.machine.machine import read_machine
from bonecam.mesh.facets.hull import convex_hull
from bonecam.mesh.files.mesh_files import read_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import read_dialect
from bonecam.planning.layers.layer_limits import layer_limits
from bonecam.progress import Progress, part, silent
from bonecam.report.files.kept_view import SECOND_VIEW, check_page_name, kept_contents
from bonecam.report.page.contents import level_meshes, with_program
from bonecam.report.page.packing import Contents, pack
from bonecam.report.page.page import page_html
from bonecam.report.page.program_contents import program_contents
from bonecam.report.page.second_contents import layers_on
from bonecam.report.summary import removal_text
from bonecam.setup.schedule import schedule_of
from bonecam.setup.stock import Stock
from bonecam.setup.stock_kind import LyingPart, kind_of
from bonecam.setup.stocks.mesh import ConvexStock
from bonecam.surface.files.tspline_text import read_tsm
from bonecam.tool.path import PARTING
from bonecam.verify.control.program_file import header_of, program_text
from bonecam.verify.removal.of_job import ACCURACY, cutters_of, followed_surfaces, simulate_stump
from bonecam.verify.removal.result import Removal
from bonecam.verify.removal.simulate import simulate_removal
from bonecam.verify.removal.sweeping import SimulatedStock
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import post_below
from bonecam.workholding.shell import turn_over

LEVEL = re.compile(r"level_(\d{2,})\.ply")
"""Names of the levels in a kept folder: the first is the part, the last the stock."""
STOCK = re.compile(r"STOCK\W .* FROM Z (-?[\d.]+) TO Z (-?[\d.]+)", re.IGNORECASE)
"""What the header says of the stock."""
SECOND = re.compile(r"SECOND CLAMPING: ", re.IGNORECASE)
"""How the header of the program of a second clamping begins."""
STUMP = re.compile(r"STUMP: .* UP TO Z (-?[\d.]+)", re.IGNORECASE)
"""What that says of the stump."""
SAME_STOCK = 0.1
"""A kept stock is a mesh: its ends lie within this of those of the header, mm; so do stumps."""
COARSEST = 0.5
"""Rays are no farther apart than this share of the radius of the smallest ball."""


def simulate(
    program: str | Path,
    keep: str | Path,
    job: Job | None = None,
    *,
    cell: float = ACCURACY.cell,
    html: str | Path | None = None,
    progress: Progress = silent,
) -> Removal:
    """What the NC text in the file `program` removes, with the part and the stock of the folder `keep` and the cutters,
    machine and post of the `job` that it was made with; `cell` (mm) is the distance of the rays. The program of a
    second clamping begins with what the kept first one leaves, which is simulated before it. The page `html` shows the
    program as simulated, whatever came out.

    FileError where a file is not there, ProgramError where the text cannot be read or is for another machine, control,
    stock or stump, VerifyError where its control would refuse the text or run it otherwise than the job means (axis
    limits, feeds, spindle, coolant, lengths of tools), JobError where the cell is too fine or too coarse.
    `check_removal` refuses what a program may not do.
    """
    job = job or Job()
    _check_cell(cell, job)
    machine = read_machine(job.nc.machine)
    dialect = read_dialect(job.nc.controller)
    if html is not None:
        check_files([html], [program])
        check_page_name(html)
    text = program_text(Path(program), machine, dialect, job)
    keep = Path(keep)
    run: Contents | None
    if SECOND.search(header_of(text)):
        run = _kept_second(text, Path(program), keep)
        kept = keep / f"program{dialect.extension}"
        first = program_text(kept, machine, dialect, job)
        before = _simulate_first(first, kept, keep, job, None, cell, part(progress, 0.0, 0.8))
        job = replace(job, holding=job.holding.turned_over)
        removal = _simulate_second(text, run, job, before.remaining, part(progress, 0.8, 1.0))
    else:
        run = kept_contents(keep)[1] if html is not None else None
        removal = _simulate_first(text, Path(program), keep, job, run, cell, progress)
    if html is not None and run is not None:
        _write_page(html, Path(program).name, text, run, job, removal)
    return removal


def _write_page(html: str | Path, name: str, text: str, run: Contents, job: Job, removal: Removal) -> None:
    """Write the page of a `run` with the moves of another `text` and what they remove."""
    machine, dialect = read_machine(job.nc.machine), read_dialect(job.nc.controller)
    meshes = level_meshes(run)
    surfaces = layers_on(meshes[0], removal) if removal.shell is not None else None
    posted = program_contents(text, meshes, job, machine, dialect, removal=removal, surfaces=surfaces)
    page = with_program(run, posted, {"removal": removal.report}, removal_text(removal.report))
    write_whole(html, page_html(pack(page), name))


def _simulate_first(
    text: str, program: Path, keep: Path, job: Job, run: Contents | None, cell: float, progress: Progress
) -> Removal:
    """What the `text` of a first clamping removes; what stands is told on the levels of the page of a `run`."""
    machine, dialect = read_machine(job.nc.machine), read_dialect(job.nc.controller)
    part, stock_mesh, levels = _kept_for(text, program, keep)
    return simulate_removal(
        text,
        machine,
        dialect,
        _kept_stock(keep, stock_mesh, job.levels.chord_tolerance),
        post_below(part, job.holding),
        cutters_of(job, machine),
        clamping=clamping_of(job.holding, machine.table),
        part=read_tsm(keep / "surface.tspline"),
        limits=_limits(job, levels),
        surfaces=followed_surfaces(job, level_meshes(run)) if run else {},
        accuracy=replace(ACCURACY, cell=cell, coarser=False),
        progress=progress,
    )


def _simulate_second(
    text: str, run: Contents, job: Job, before: SimulatedStock, progress: Progress
) -> Removal:
    """What the `text` of a second clamping removes of what stood `before` on the first one's post; part, shell and
    pose are those of the page of a `run`."""
    machine, dialect = read_machine(job.nc.machine), read_dialect(job.nc.controller)
    turned = run.facts["turned"]
    material = before.above(turned["cut_off_mm"]).move(turn_over(turned["zero_mm"]))
    shell = TriangleMesh(run.arrays["solid"], run.arrays["solid_faces"].astype(np.int32))
    return simulate_stump(text, machine, dialect, job, material, level_meshes(run)[0], shell, progress)


def _kept_second(text: str, program: Path, keep: Path) -> Contents:
    """The page of the second clamping of a kept folder. FileError where it has none, ProgramError where the text is for
    another stump."""
    remedy = "give the folder that `convert --keep` wrote beside the program"
    if not (keep / SECOND_VIEW).exists():
        what = f"the program is of a second clamping, of which {keep} has no {SECOND_VIEW}"
        raise FileError(f"{program}: {what}: {remedy}", file=str(keep / SECOND_VIEW))
    run = kept_contents(keep, SECOND_VIEW)[1]
    reported = STUMP.search(header_of(text))
    top = run.facts["turned"]["zero_mm"] - run.facts["turned"]["cut_off_mm"]
    if reported is not None and abs(float(reported[1]) - top) > SAME_STOCK:
        what = f"its stump reaches up to z {float(reported[1]):.2f} mm, that of {keep} up to {top:.2f}"
        raise ProgramError(f"{program}: {what}: {remedy}", line=0)
    return run


def _limits(job: Job, levels: int) -> dict[int, float]:
    """The largest depth (mm) of the cut on each level, or on each layer of a strategy in layers, and of PARTING."""
    first, beyond = job.levels.cuts
    parting = {PARTING: beyond}
    if job.path.strategy != "morph":
        return parting | layer_limits(job)
    return parting | {index: first[index] if index < len(first) else beyond for index in range(levels - 1)}


def _check_cell(cell: float, job: Job) -> None:
    """JobError where the smallest ball passes between the rays."""
    radius = job.smallest_ball
    if cell > COARSEST * radius:
        what = f"rays {cell:g} mm apart miss what a ball of {radius:g} mm does"
        raise JobError(f"{what}: give a cell of at most {COARSEST * radius:g} mm")


def _require_stock(text: str, stock: TriangleMesh, program: Path, keep: Path) -> None:
    """ProgramError where the header tells another stock than the kept one."""
    reported = STOCK.search(header_of(text))
    if reported is None:
        return
    heights = [float(reported[1]), float(reported[2])]
    found = stock.bounds[:, 2].tolist()
    if max(abs(a - b) for a, b in zip(heights, found, strict=True)) > SAME_STOCK:
        raise ProgramError(
            f"{program}: its stock reaches from z {heights[0]:.2f} to {heights[1]:.2f} mm, that of {keep} from "
            f"{found[0]:.2f} to {found[1]:.2f}: give the folder that `convert --keep` wrote beside the program",
            line=0,
        )


def _kept_stock(keep: Path, mesh: TriangleMesh, chord: float) -> Stock:
    """The stock of a kept folder, exact: its kept `mesh` lies inside a round one by up to its `chord` tolerance (mm),
    and what is cut there would be missed."""
    file = keep / "report.json"
    remedy = "give the folder that `convert --keep` wrote beside the program"
    try:
        figures = json.loads(input_text(file))["stock"]
        kind = figures["kind"]
        sizes = {name.removesuffix("_mm"): size for name, size in figures.items() if name.endswith("_mm")}
        if kind == "mesh":
            return ConvexStock(convex_hull(mesh.vertices), proven=True)
        job = StockJob(kind=kind, **sizes)
        middle = float(mesh.bounds[:, 2].mean())
        stock = kind_of(job).make(job, LyingPart(mesh.vertices, middle), schedule_of(LevelsJob()))
    except (OSError, ValueError, KeyError, TypeError, BonecamError) as error:
        raise FileError(f"{file}: tells no stock ({error}): {remedy}", file=str(file)) from error
    if np.abs(stock.bounds - mesh.bounds).max() > SAME_STOCK + chord:
        raise FileError(
            f"{file}: tells another stock ({stock}) than the kept levels: {remedy}", file=str(file)
        )
    return stock


def _kept_for(text: str, program: Path, keep: Path) -> tuple[TriangleMesh, TriangleMesh, int]:
    """Part and stock of a kept folder, and the number of its levels. ProgramError where the text is for another
    stock."""
    names = sorted(path.name for path in keep.glob("level_*.ply") if LEVEL.fullmatch(path.name))
    if len(names) < 2:
        remedy = "give the folder that `convert --keep` wrote beside the program"
        raise FileError(f"{keep}: has no levels (level_00.ply, ...): {remedy}", file=str(keep))
    stock = read_mesh(keep / names[-1])
    _require_stock(text, stock, program, keep)
    return read_mesh(keep / names[0]), stock, len(names)
