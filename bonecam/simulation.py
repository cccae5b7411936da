"""The simulation of a program alone: from its text, its job, and the folder that `convert --keep` wrote."""

import re
from dataclasses import replace
from pathlib import Path

from bonecam.errors import FileError, ProgramError
from bonecam.files import check_files, input_text, write_whole
from bonecam.job import Job
from bonecam.mesh.facets.hull import convex_hull
from bonecam.mesh.files.mesh_files import read_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect, read_dialect
from bonecam.nc.machine import Machine, read_machine
from bonecam.nc.posting.header import comment
from bonecam.outputs.kept_view import check_page_name, kept_contents
from bonecam.progress import Progress, silent
from bonecam.setup.fixture.clamping import clamping_of
from bonecam.setup.holding import post_below
from bonecam.setup.stocks.mesh import ConvexStock
from bonecam.surface.files.tspline_text import read_tsm
from bonecam.toolpath.layers.limits import layer_limits
from bonecam.verify.page.contents import level_meshes, with_program
from bonecam.verify.page.packing import pack
from bonecam.verify.page.page import page_html
from bonecam.verify.page.program_contents import program_contents
from bonecam.verify.removal.of_job import ACCURACY, cutters_of, followed_surfaces
from bonecam.verify.removal.result import Removal
from bonecam.verify.removal.simulate import simulate_removal
from bonecam.verify.summary import removal_text

LEVEL = re.compile(r"level_(\d{2,})\.ply")
"""Names of the levels in a kept folder: the first is the part, the last the stock."""
HEADER_LINES = 20
"""Lines of a program in which its header names the machine."""


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
    machine and post of the `job` that it was made with; `cell` (mm) is the distance of the rays. The page `html` shows
    the program as simulated, whatever came out.

    FileError where a file is not there, ProgramError where the text cannot be read or is for another machine, JobError
    where the cell needs too much memory. `check_removal` refuses what a program may not do.
    """
    job = job or Job()
    machine = read_machine(job.nc.machine)
    dialect = read_dialect(job.nc.controller)
    if html is not None:
        check_files([html], [program])
        check_page_name(html)
    text = _text_of(Path(program))
    _require_machine(text, machine, dialect, Path(program))
    part, stock, levels = _kept(Path(keep))
    run = kept_contents(Path(keep))[1] if html is not None else None
    removal = simulate_removal(
        text,
        machine,
        dialect,
        ConvexStock(convex_hull(stock.vertices), proven=True),
        post_below(part, job.holding),
        cutters_of(job, machine),
        clamping=clamping_of(job.holding, machine.table),
        part=read_tsm(Path(keep) / "surface.tspline"),
        limits=_limits(job, levels),
        surfaces=followed_surfaces(job, level_meshes(run)) if run else {},
        accuracy=replace(ACCURACY, cell=cell, coarser=False),
        progress=progress,
    )
    if html is not None and run is not None:
        posted = program_contents(text, level_meshes(run), job, machine, dialect, removal=removal)
        page = with_program(run, posted, {"removal": removal.report}, removal_text(removal.report))
        write_whole(html, page_html(pack(page), Path(program).name))
    return removal


def _limits(job: Job, levels: int) -> dict[int, float]:
    """The largest depth (mm) of the cut on each level, or on each layer of a strategy in layers."""
    if job.path.strategy != "morph":
        return layer_limits(job)
    first, beyond = job.levels.cuts
    return {index: first[index] if index < len(first) else beyond for index in range(levels - 1)}


def _text_of(program: Path) -> str:
    try:
        return input_text(program)
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "it is no text"
        raise FileError(
            f"{program}: cannot be read ({why}): give an NC program", file=str(program)
        ) from error


def _require_machine(text: str, machine: Machine, dialect: Dialect, program: Path) -> None:
    """ProgramError where the header names another machine."""
    wanted = comment(f"machine {machine.title}", dialect)
    start = comment("machine", dialect).rstrip(")")
    named = [line for line in text.split("\n")[:HEADER_LINES] if start in line]
    if named and not any(wanted in line for line in named):
        told = named[0].strip()
        raise ProgramError(
            f"{program}: it was made for another machine ({told}), not for {machine.title}: give its --machine",
            line=0,
        )


def _kept(keep: Path) -> tuple[TriangleMesh, TriangleMesh, int]:
    """Part and stock of a kept folder, and the number of its levels."""
    names = sorted(path.name for path in keep.glob("level_*.ply") if LEVEL.fullmatch(path.name))
    if len(names) < 2:
        remedy = "give the folder that `convert --keep` wrote beside the program"
        raise FileError(f"{keep}: has no levels (level_00.ply, ...): {remedy}", file=str(keep))
    return read_mesh(keep / names[0]), read_mesh(keep / names[-1]), len(names)
