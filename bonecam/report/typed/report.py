"""The names and types of a run's report (`--report FILE.json`): what `Result.report` holds.

Names end in their unit; places are [x, y, z] in the part's frame, mm. A section that was not made says why in
`skipped`, and has nothing else.
"""

from typing import NotRequired, TypedDict

from bonecam.report.typed.simulated import ForceFeedFigures, MechanicsFigures, RemovalFigures
from bonecam.report.typed.to_levels import (
    CutterFigures,
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


class RefusedFigures(TypedDict):
    """Why a run was refused: `code` is that of the warning whose limit it is beyond, or else the kind of trouble (mesh,
    level, verify, bending, ...), `stage` the one that it had come to. Place, `line` of the program's text and `level`
    where the trouble has one."""

    code: str
    stage: str
    message: str
    remedy: str
    place: NotRequired[list[float]]
    line: NotRequired[int]
    level: NotRequired[int]


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

    refused: RefusedFigures
    warnings: list[WarningFigures]
    input: InputFigures
    surface: SurfaceFigures
    stock: StockFigures
    levels: list[LevelFigures]
    levels_lower_bound: int
    levels_break_mm: float
    levels_method: str
    strategy: str
    cutters: CutterFigures
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
