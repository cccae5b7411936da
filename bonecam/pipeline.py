"""The flow: mesh -> surface -> levels -> toolpath -> orientation -> nc -> verify, one function a stage.

All stages work in one frame, mm: the part's long axis is +Z, the table is z = 0 and is the program's zero,
the post stands on it.
"""

import re
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bonecam.errors import SurfaceError, place_name
from bonecam.job import Job
from bonecam.keep import failed_level_kept
from bonecam.levels.closed_morph import Morph
from bonecam.levels.job_levels import make_levels
from bonecam.mesh.part import Part
from bonecam.mesh.sections.rows import harmonic_rows
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import read_dialect
from bonecam.nc.kinematics import axis_limits
from bonecam.nc.machine import Machine, read_machine
from bonecam.nc.posting.write import write_program
from bonecam.nc.program import Program
from bonecam.orientation.level_paths import plan_paths
from bonecam.outputs import File, Outputs
from bonecam.progress import Progress, part, report, silent
from bonecam.requirements import check_job, check_method, check_room
from bonecam.setup.holding import post_below
from bonecam.setup.placement import place
from bonecam.setup.schedule import check_cuts
from bonecam.setup.stock import Stock, stock_figures
from bonecam.surface.files import surface_input
from bonecam.surface.fitting.fit import Fit, fit
from bonecam.surface.tessellation.validity import require_valid
from bonecam.surface.tspline import TSpline
from bonecam.threads import on_one_blas_thread
from bonecam.toolpath.path import ToolPath
from bonecam.verify.proof import verify
from bonecam.verify.readback import Tolerances
from bonecam.verify.report import levels_report, nc_report, summary_of, surface_report, toolpath_report


@dataclass(frozen=True, eq=False)
class Morphed:
    """What the chain makes up to the levels. `report` is what --report writes."""

    part: Part
    surface: TSpline
    stock: Stock
    levels: Morph
    report: dict[str, Any]

    @property
    def summary(self) -> str:
        """What came of it, in a few lines."""
        return summary_of(self.report)


@dataclass(frozen=True, eq=False)
class Result(Morphed):
    """Everything the chain makes."""

    paths: tuple[ToolPath, ...]
    program: Program


def convert(
    mesh: str | Path | TriangleMesh,
    job: Job | None = None,
    *,
    program: File = None,
    keep: File = None,
    report: File = None,
    surface: File = None,
    progress: Progress = silent,
) -> Result:
    """Mesh in, verified NC program out: the whole chain.

    `mesh` is a file or a TriangleMesh in the job's units. Files named by `program`, `keep`, `report` and
    `surface` (its ending says its kind) are written last, each whole; where anything fails nothing is
    written, but for the patch of a level that failed its check, in `keep`. Raises a BonecamError that names
    the trouble.
    """
    job, clock = _job(job), _Clock()
    machine, dialect = (
        read_machine(job.nc.machine),
        read_dialect(job.nc.controller),
    )  # what is wrong is refused before the work
    check_job(job, machine)
    outputs = Outputs(program, keep, report, surface)
    outputs.check(_files(mesh), dialect)
    made = _morphed(mesh, job, clock, keep, part(progress, 0.0, 0.3), machine)
    with clock.stage("toolpath"):
        paths = plan_paths(
            made.levels.levels, made.stock, job, axis_limits(machine), part(progress, 0.3, 0.85)
        )
    with clock.stage("nc"):
        source = next(iter(_files(mesh)), "")
        posted = post(
            paths,
            made.stock,
            job,
            part(progress, 0.85, 0.9),
            name=program_name(program or source),
            source=source,
        )
    with clock.stage("verify"):
        design = made.levels.levels[0].surface
        assert design is not None
        tolerances = Tolerances(gouge=job.path.gouge_tolerance)
        proof = verify(posted.text, paths, machine, dialect, design, tolerances, part(progress, 0.9, 0.97))
    figures = {
        **made.report,
        "toolpath": toolpath_report(paths),
        "nc": {"file": Path(program).name if program else "", **nc_report(posted, proof)},
    }
    result = Result(made.part, made.surface, made.stock, made.levels, figures, paths, posted)
    with clock.stage("files"):
        _write(outputs, result, job, part(progress, 0.97, 1.0), paths, posted.text)
    return result


def morph_levels(
    mesh: str | Path | TriangleMesh,
    job: Job | None = None,
    *,
    keep: File = None,
    report: File = None,
    surface: File = None,
    progress: Progress = silent,
) -> Morphed:
    """Mesh in, measured levels out: `convert` up to the levels, for any machine."""
    job, clock = _job(job), _Clock()
    outputs = Outputs(keep=keep, report=report, surface=surface)
    outputs.check(_files(mesh))
    made = _morphed(mesh, job, clock, keep, part(progress, 0.0, 0.95))
    with clock.stage("files"):
        _write(outputs, made, job, part(progress, 0.95, 1.0))
    return made


def _job(job: Job | None) -> Job:
    if not isinstance(job, Job | None):
        raise TypeError(f"job {job!r}: give a bonecam.Job, such as bonecam.read_job(file)")
    return job or Job()


def _files(mesh: str | Path | TriangleMesh) -> list[str | Path]:
    return [] if isinstance(mesh, TriangleMesh) else [mesh]


def _morphed(
    mesh: str | Path | TriangleMesh,
    job: Job,
    clock: "_Clock",
    keep: File,
    progress: Progress,
    machine: Machine | None = None,
) -> Morphed:
    """The chain up to the levels, in a stock that the machine has room for."""
    check_method(job.levels)
    with clock.stage("mesh"):
        raw, given = surface_input.read_part(mesh, job, part(progress, 0.0, 0.1))
        setup = place(raw, job)
        placed, stock = setup.part, setup.stock
        if machine is not None:
            check_room(stock, job, machine)
        check_cuts(placed.mesh, stock, job.levels)
    with clock.stage("surface"):
        fitted = fit_surface(placed, job, part(progress, 0.1, 0.5), given)
    with clock.stage("levels"), failed_level_kept(keep):
        levels = make_levels(fitted.surface, stock, job, part(progress, 0.5, 1.0))
    figures = {
        "input": {
            "file": placed.file,
            "faces": placed.faces,
            "units": placed.units,
            "repairs": list(placed.repairs),
        },
        "surface": surface_report(fitted),
        "stock": stock_figures(stock),
        "levels": levels_report(levels.levels),
        "levels_lower_bound": levels.lower_bound,
        "levels_break_mm": round(levels.breaks, 6),
        "levels_method": job.levels.method,
        "seconds": clock.seconds,
    }
    return Morphed(placed, fitted.surface, stock, levels, figures)


def _write(
    outputs: Outputs,
    made: Morphed,
    job: Job,
    progress: Progress,
    paths: Sequence[ToolPath] = (),
    program: str = "",
) -> None:
    report(progress, 0.0, "writing the files")
    post = job.holding.diameter, post_below(made.part.mesh, job.holding).top
    outputs.write(program, made.report, made.surface, made.levels.levels, made.stock, paths, post)


def fit_surface(placed: Part, job: Job, progress: Progress = silent, given: Fit | None = None) -> Fit:
    """Harmonic rows, then the T-spline within the tolerance; a `given` surface is moved to where the part is.

    SurfaceError where it misses the mesh.
    """
    if given is not None:
        return surface_input.placed(given, placed.transform)
    edge = job.mesh.edge_percent / 100 * placed.mesh.diagonal
    rows = harmonic_rows(placed.mesh, job.mesh.rows, job.mesh.row_points, edge, part(progress, 0.0, 0.2))
    tolerance, most = job.surface.tolerance, job.surface.max_control_points
    found = on_one_blas_thread(fit)(
        placed.mesh, tolerance, most, rows=rows, progress=part(progress, 0.2, 1.0), round_poles=True
    )
    missed, limit = found.deviation, max(job.surface.tolerance, job.surface.largest_deviation)
    if missed.max > limit:
        what = f"{placed.file}: {found.control_points} control points miss the mesh by {missed.max:.2f} mm near {place_name(missed.place)}"
        raise SurfaceError(
            f"{what}: {found.shortfall}, or raise surface.largest_deviation ({limit:g} mm)", deviation=missed
        )
    require_valid(found.surface, job.levels.chord_tolerance, placed.file)
    return found


def post(
    paths: Sequence[ToolPath],
    stock: Stock,
    job: Job,
    progress: Progress = silent,
    *,
    name: str = "BONE",
    source: str | Path = "",
) -> Program:
    """The program of the paths for the job's machine and controller; its header names the part's file,
    `source`, where there is one."""
    machine, dialect = read_machine(job.nc.machine), read_dialect(job.nc.controller)
    comments = [f"part: {Path(source).name}"] if source else []
    return write_program(
        paths,
        machine,
        dialect,
        job,
        name=name,
        comments=comments,
        stock_bounds=stock.bounds,
        progress=progress,
    )


def program_name(file: str | Path) -> str:
    """The name of a program in this file, or of a part in it: capitals, digits and _ are what every control
    takes."""
    return re.sub(r"[^A-Z0-9_]", "_", Path(file).stem.upper()) or "BONE"


class _Clock:
    """Wall seconds of each stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time one stage."""
        began = time.perf_counter()
        yield
        self.seconds[name] = round(time.perf_counter() - began, 3)
