"""The levels that a job asks for."""

from bonecam.job import Job, LevelsJob
from bonecam.levels.closed_morph import Morph
from bonecam.levels.edge_rounding import levels_in
from bonecam.levels.equal_depths import even_levels
from bonecam.levels.solvers.clarabel import require_clarabel
from bonecam.progress import Progress, silent
from bonecam.setup.schedule import schedule_of
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline


def make_levels(surface: TSpline, stock: Stock, job: Job, progress: Progress = silent) -> Morph:
    """The measured levels from a closed part to its stock, with the parameters of `job.levels`."""
    levels_to = even_levels if job.levels.even else levels_in
    return levels_to(
        surface,
        stock,
        schedule_of(job.levels),
        stiffness=job.levels.stiffness,
        attraction=job.levels.attraction,
        method=job.levels.method,
        solver=job.levels.solver,
        chord_tolerance=job.levels.chord_tolerance,
        progress=progress,
    )


def check_method(levels: LevelsJob) -> None:
    """JobError where the solver of the levels is not installed."""
    if levels.method == "qcqp":
        require_clarabel("method", "qcqp", "qp")
    elif levels.solver == "clarabel":
        require_clarabel("solver", "clarabel", "admm")
