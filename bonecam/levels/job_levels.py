"""The levels that a job asks for."""

from bonecam.job import Job, LevelsJob
from bonecam.levels.edge_rounding import levels_in
from bonecam.levels.equal_depths import even_levels
from bonecam.levels.measure.cut_measures import NO_CUT
from bonecam.levels.measure.level import PartLevel, StockLevel
from bonecam.levels.sequences.begun_morph import Morph
from bonecam.levels.solvers.clarabel import require_clarabel
from bonecam.mesh.distance import MeshDistance
from bonecam.progress import Progress, silent
from bonecam.setup.schedule import schedule_of
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline


def make_levels(surface: TSpline, stock: Stock, job: Job, progress: Progress = silent) -> Morph:
    """The measured levels from a closed part to its stock, with the parameters of `job.levels`; of another
    strategy than morphing only the part and the stock."""
    if job.path.strategy != "morph":
        return part_and_stock(surface, stock, job.levels.chord_tolerance)
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


def part_and_stock(surface: TSpline, stock: Stock, chord_tolerance: float) -> Morph:
    """The part and the stock without levels between them, for a strategy that does not morph."""
    part = PartLevel(surface, surface.tessellate(chord_tolerance), NO_CUT)
    around = stock.mesh(chord_tolerance)
    distance = float(MeshDistance(part.mesh).unsigned(around.vertices).max())
    levels = part, StockLevel(1, around, distance, NO_CUT)
    return Morph(levels, lower_bound=1, distance=distance, solve_seconds=0.0, check_seconds=0.0)


def check_method(levels: LevelsJob) -> None:
    """JobError where the solver of the levels is not installed."""
    if levels.method == "qcqp":
        require_clarabel("method", "qcqp", "qp")
    elif levels.solver == "clarabel":
        require_clarabel("solver", "clarabel", "admm")
