"""The names and types of a run's report (`--report FILE.json`): what `Result.report` holds.

Names end in their unit; places are [x, y, z] in the part's frame, mm. A section that was not made says why in
`skipped`, and has nothing else.
"""

from typing import TypedDict

from bonecam.report.typed.simulated import ForceFeedFigures, MechanicsFigures, RemovalFigures
from bonecam.report.typed.to_levels import (
    InputFigures,
    LevelFigures,
    PostFigures,
    StockFigures,
    SurfaceFigures,
)
from bonecam.report.typed.to_program import EstimateFigures, PartingFigures, PathFigures, ProgramFigures


class WarningFigures(TypedDict):
    """A warning: a `figure` above its `limit`, and what helps."""

    code: str
    text: str
    figure: float | None
    limit: float | None
    refused_above: float | None
    remedy: str


class SecondFigures(ProgramFigures):
    """The program of the second clamping, and what the stump's area keeps before and after it."""

    warnings: list[WarningFigures]
    toolpath: list[PathFigures]
    removal: RemovalFigures
    mechanics: MechanicsFigures
    at_post_before_mm2: float
    at_post_after_mm2: float
    at_post_after_max_mm: float
    at_tailstock_mm2: float


class Report(TypedDict, total=False):
    """All sections; those that a run did not come to, or that its job does not ask for, are absent. `axes`, the table
    of `axes.md`, stands in kept folders alone."""

    warnings: list[WarningFigures]
    input: InputFigures
    surface: SurfaceFigures
    stock: StockFigures
    levels: list[LevelFigures]
    levels_lower_bound: int
    levels_break_mm: float
    levels_method: str
    strategy: str
    post: PostFigures
    seconds: dict[str, float]
    cpu_seconds: dict[str, float]
    estimate: EstimateFigures
    uncut_mm2: dict[str, float]
    toolpath: list[PathFigures]
    parting: PartingFigures
    nc: ProgramFigures
    removal: RemovalFigures
    mechanics: MechanicsFigures
    feed: ForceFeedFigures
    second: SecondFigures
    axes: list[dict[str, object]]
