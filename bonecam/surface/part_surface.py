"""The surface of a part: fitted to its mesh within the job's tolerance, or given with it."""

from collections.abc import Iterator
from dataclasses import replace

from bonecam.arrays import SURFACE_QUANTUM, settled
from bonecam.errors import SurfaceError, hundredths, place_name
from bonecam.job import Job
from bonecam.mesh.part import Part
from bonecam.mesh.rows import Rows, row_choices
from bonecam.progress import Progress, part, silent
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.surface.files import surface_input
from bonecam.surface.growth import Fit, fit, without_creases
from bonecam.surface.tessellation import require_valid
from bonecam.surface.tspline import TSpline

SHARP = 0.3
"""Bends with a radius below this share of the smallest ball's are smoothed where a surface cannot be used without."""
FINEST = 0.002
"""Chord tolerance (mm) of the finest tessellation that planning and reports make of a surface."""


def part_rows(placed: Part, job: Job, progress: Progress = silent) -> Iterator[Rows]:
    """The sets of rows that a fit of the part may start from, the usual one first (`row_choices`)."""
    return row_choices(placed.mesh, job.mesh.rows, progress=progress)


def fit_surface(
    placed: Part,
    job: Job,
    progress: Progress = silent,
    given: Fit | None = None,
    rows: Rows | None = None,
    tolerance: float | None = None,
) -> Fit:
    """A T-spline within `tolerance` (mm), or else that of the job for the facets of the part, through `rows` or else
    the usual ones; a `given` surface is moved to the part.

    Within one that is wider than the job has for any facets the fit is judged by the latter.
    One that is not valid is smoothed where it bends sharply (`smoother_fit`). Raises SurfaceError where the surface
    misses the mesh by more than the job allows, or is not valid.
    """
    if given is not None:
        return surface_input.move_with_part(given, placed.transform)
    rows = rows or next(part_rows(placed, job, part(progress, 0.0, 0.2)))
    fitted = on_one_blas_thread(fit)(
        placed.mesh,
        tolerance or job.surface.tolerance_for(placed.sagitta),
        job.surface.max_control_points,
        rows=rows,
        progress=part(progress, 0.2, 1.0),
        round_poles=True,
    )
    fitted = _settled(fitted)
    widest = job.surface.tolerance_for()
    if fitted.tolerance > widest:
        fitted = replace(fitted, tolerance=widest, reached=fitted.deviation.max <= widest)
    missed = fitted.deviation
    limit = max(widest, job.surface.largest_deviation)
    if missed.max > limit:
        where = f"by {missed.max:.2f} mm near {place_name(missed.place)}"
        raise SurfaceError(
            f"{placed.file}: {fitted.control_points} control points miss the mesh {where}: {fitted.shortfall}, "
            f"or raise surface.largest_deviation ({limit:g} mm) to {hundredths(missed.max)}",
            deviation=missed,
        )
    try:
        _require_usable(fitted.surface, job, placed.file)
    except SurfaceError:
        smoother = smoother_fit(fitted, placed, job)
        if smoother is None:
            raise
        _require_usable(smoother.surface, job, placed.file)
        return smoother
    return fitted


def smoother_fit(found: Fit, placed: Part, job: Job) -> Fit | None:
    """The fit of a part without bends far sharper than the smallest ball (SHARP), no farther from the mesh than it is,
    or than the tolerance; None where it has none or they stay."""
    limit = max(found.tolerance, found.deviation.max)
    radius = SHARP * job.smallest_ball
    smoother = on_one_blas_thread(without_creases)(found, placed.mesh, radius, limit)
    return None if smoother is None else _settled(smoother)


def _settled(fitted: Fit) -> Fit:
    """The fit with control points free of their last digits."""
    surface = fitted.surface.with_control_points(settled(fitted.surface.control_points, SURFACE_QUANTUM))
    return replace(fitted, surface=surface)


def _require_usable(surface: TSpline, job: Job, name: str) -> None:
    """Raises SurfaceError where a surface is not valid, or so sharp in a place that it has no fine tessellation."""
    surface.tessellate(FINEST)
    require_valid(surface, job.levels.chord_tolerance, name)
