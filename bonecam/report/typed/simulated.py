"""Types of a report's sections of what the simulation of the posted text finds."""

from typing import TypedDict


class RemovedLevelFigures(TypedDict):
    """What the path of a level removes; lines are those of the program's text."""

    index: int
    rest: int
    removed_mm3: float
    depth_max_mm: float
    depth_max_line: int | None
    depth_p99_mm: float
    depth_mean_mm: float
    over_limit_mm: float | None
    air_time_share: float
    rubbing_time_share: float
    links_mm3: float
    links_depth_mm: float


class LinksFigures(TypedDict):
    """What moves between passes remove."""

    removed_mm3: float
    allowed_mm3: float
    most_mm3: float | None
    most_line: int | None
    depth_max_mm: float
    depth_max_line: int | None


class LeftFigures(TypedDict):
    """What stays on the part away from its post; areas by the height over which they keep more, and by the reason."""

    area_over_0_02_mm2: float
    part_mm2: float
    areas_over_mm2: dict[str, float]
    max_mm: float
    place: list[float]
    by_reason: dict[str, float]
    gouge_max_mm: float


class GivenFigures(TypedDict, total=False):
    """What is left beside the mesh as given."""

    skipped: str
    gouge_max_mm: float
    gouge_place: list[float]
    left_max_mm: float
    left_place: list[float]


class RemovalFigures(TypedDict, total=False):
    """What the posted text does to the stock."""

    skipped: str
    cell_mm: float
    levels: list[RemovedLevelFigures]
    rapid_contact_mm3: float
    links: LinksFigures
    clearance_mm: dict[str, float | None]
    left: LeftFigures
    given: GivenFigures | None
    bridge_diameter_mm: float | None


class LoadedPathFigures(TypedDict):
    """Force and bending along a path, by shares of its time."""

    index: int
    rest: int
    force_mean_n: float
    force_p95_n: float
    peak_p95_n: float
    peak_max_n: float
    deflection_median_um: float
    deflection_p95_um: float
    first_hz: float | None
    tooth_hz: float


class ErrorKeptFigures(TypedDict):
    """The error that bending leaves on the finished surface, by shares of its area."""

    median: float
    p95: float
    p99: float
    place: list[float]


class RemedyFigures(TypedDict):
    """A remedy, and what would be with it."""

    what: str
    p99_um: float
    stress_mpa: float


class MechanicsFigures(TypedDict, total=False):
    """Force and bending of the program."""

    skipped: str
    material: str
    levels: list[LoadedPathFigures]
    error_kept_um: ErrorKeptFigures | None
    neck_stress_mpa: float
    neck_stress_p99_mpa: float
    neck_stress_max_mpa: float
    yield_mpa: float
    first_hz: float | None
    tooth_hz: float | None
    band: list[float]
    coefficients: str
    scaled: bool
    faults: list[str]
    remedies: list[RemedyFigures]


class FeedOfCutterFigures(TypedDict):
    """Peaks of a cutter with constant feed and with feed by the force."""

    tool: int
    target_n: float
    peak_p95_n: list[float]
    peak_max_n: list[float]


class ForceFeedFigures(TypedDict):
    """What feeds by the force changed: before, after."""

    by: str
    time_min: list[float]
    cutters: list[FeedOfCutterFigures]
