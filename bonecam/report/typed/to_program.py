"""Types of a report's sections of tool paths and program."""

from typing import NotRequired, TypedDict


class EstimateFigures(TypedDict):
    """What was expected of the program before it was planned."""

    length_mm: int
    blocks: int
    machining_min: float
    least_min: float
    planning_cpu_s: int


class ConeCheckFigures(TypedDict):
    """FCL's word on the cones of a path."""

    asked: int
    narrowed: int
    refused: int


class PoseCheckFigures(TypedDict):
    """FCL's word on the poses of a path whose axes lie in no cone that it has certified."""

    asked: int
    refused: int


class ConesFigures(TypedDict):
    """The cones that the tool axes of a path keep to."""

    count: int
    shape: str
    fcl: ConeCheckFigures | None


class PathFigures(TypedDict):
    """A tool path."""

    level: int
    cutter_radius_mm: float
    scallop_limit_mm: float
    passes: int
    contacts: int
    entries: int
    entries_tangential: int
    exits_tangential: int
    length_mm: float
    trimmed_mm: float
    trimmed_min: float
    uncut_contacts: int
    uncut_reasons: dict[str, int]
    blocked_by: dict[str, int]
    cones: ConesFigures | None
    poses: PoseCheckFigures | None
    near_normal_contacts: int | None
    near_normal_without_choice: int | None


class PartingFigures(TypedDict):
    """The groove that parts the part from its post."""

    tool: int
    steps: int
    z_mm: float
    width_mm: float
    bridge_diameter_mm: float
    stump_height_mm: float


class ProgramFigures(TypedDict):
    """The program, and what reading it back proved."""

    file: NotRequired[str]
    machine: str
    controller: str
    parts: int
    blocks: int
    moves: int
    readback_tip_error_mm: float
    readback_axis_error_deg: float
    gouge_max_mm: float
    gouge_to_given_max_mm: NotRequired[float]
    gouge_to_given_line: NotRequired[int]
    gouge_to_given_place: NotRequired[list[float]]
    rewinds: int
    rewinds_lifted: int
    rotary_max_deg_per_block: float
    time_min: float
    time_axes_min: float | None
    time_whole_min: float | None
    time_texts: list[str]
    feed_median_mm_min: float
    feed_low_mm_min: float
    feed_axis_limited_share: float
    feed_beyond_axes_share: float
    feed_under_half_blocks: int
