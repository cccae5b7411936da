"""The surface of a part: fitted to its mesh within the job's tolerance, or given with it."""

from collections.abc import Iterator
from dataclasses import replace

from bonecam.arrays import SURFACE_QUANTUM, settled
from bonecam.errors import SurfaceError, hundredths, place_name
from bonecam.job import Job
from bonecam.mesh.part import Part
from bonecam.mesh.sections.harmonic_rows import Rows
from bonecam.mesh.sections.row_choices import row_choices
from bonecam.progress import Progress, part, silent
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.surface.files import surface_input
from bonecam.surface.fitting.fit import Fit, fit
from bonecam.surface.tessellation.validity import require_valid


def part_rows(placed: Part, job: Job, progress: Progress = silent) -> Iterator[Rows]:
    """The sets of rows that a fit of the part may start from, the usual one first (`row_choices`)."""
    edge = job.mesh.edge_percent / 100 * placed.mesh.diagonal
    return row_choices(placed.mesh, job.mesh.rows, job.mesh.row_points, edge, progress)


def fit_surface(
    placed: Part, job: Job, progress: Progress = silent, given: Fit | None = None, rows: Rows | None = None
) -> Fit:
    """A T-spline within the tolerance of the part, through `rows` or else the usual ones; a `given` surface is moved to
    the part.

    Raises SurfaceError where the surface misses the mesh by more than the job allows, or is not valid.
    """
    if given is not None:
        return surface_input.move_with_part(given, placed.transform)
    rows = rows or next(part_rows(placed, job, part(progress, 0.0, 0.2)))
    found = on_one_blas_thread(fit)(
        placed.mesh,
        job.surface.tolerance,
        job.surface.max_control_points,
        rows=rows,
        progress=part(progress, 0.2, 1.0),
        round_poles=True,
    )
    surface = found.surface.with_control_points(settled(found.surface.control_points, SURFACE_QUANTUM))
    found = replace(found, surface=surface)
    _check_deviation(found, max(job.surface.tolerance, job.surface.largest_deviation), placed.file)
    require_valid(found.surface, job.levels.chord_tolerance, placed.file)
    return found


def _check_deviation(found: Fit, limit: float, name: str) -> None:
    """Raises SurfaceError where the surface misses the mesh by more than `limit` (mm)."""
    missed = found.deviation
    if missed.max <= limit:
        return
    where = f"by {missed.max:.2f} mm near {place_name(missed.place)}"
    raise SurfaceError(
        f"{name}: {found.control_points} control points miss the mesh {where}: {found.shortfall}, "
        f"or raise surface.largest_deviation ({limit:g} mm) to {hundredths(missed.max)}",
        deviation=missed,
    )
