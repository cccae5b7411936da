"""Types of a report's sections from the mesh to the levels."""

from typing import NotRequired, TypedDict


class RepairStepFigures(TypedDict):
    """A change of the mesh, how far it moved the surface at most, and the area that is not as it was given."""

    change: str
    outward_mm: float
    inward_mm: float
    guessed_mm2: float


class FacetsFigures(TypedDict):
    """How coarse the facets of the mesh are."""

    edge_mm: float
    crease_deg: float
    sagitta_mm: float
    bumps_mm: float
    noise: bool
    steps: bool
    pitch_mm: list[float] | None
    true_edges: bool


class SmoothedFigures(TypedDict):
    """Distances of the smooth surface that took the place of coarse facets from these."""

    distance_max_mm: float
    distance_mean_mm: float
    outward_mm: float
    inward_mm: float
    place: list[float]
    kept_mm2: float


class FilledFigures(TypedDict):
    """Hollows that were filled up to the smallest ball."""

    ball_radius_mm: float
    hollows: int
    left_open: int
    depth_max_mm: float
    place: list[float]
    area_mm2: float
    volume_mm3: float


class InputFigures(TypedDict):
    """The mesh and what was changed of it."""

    file: str
    faces: int
    units: str
    notes: list[str]
    repairs: list[str]
    repair_steps: list[RepairStepFigures]
    facets: FacetsFigures | None
    smoothed: SmoothedFigures | None
    filled: FilledFigures | None
    area_mm2: float
    hole_max_mm: float
    guessed_share: float
    repair_taken_off_max_mm: float
    repair_deviation_max_mm: float


class SurfaceFigures(TypedDict):
    """The T-spline beside the repaired mesh and the mesh as given."""

    control_points: int
    deviation_max_mm: float
    deviation_rms_mm: float
    surface_to_mesh_max_mm: float
    mesh_to_surface_max_mm: float
    tolerance_mm: float
    tolerance_why: str
    tolerance_reached: bool
    given_deviation_max_mm: float
    surface_to_given_max_mm: float
    given_to_surface_max_mm: float


class StockFigures(TypedDict):
    """The stock's kind and the sizes that its kind has."""

    kind: str
    file: NotRequired[str]
    diameter_mm: NotRequired[float]
    length_mm: NotRequired[float]
    width_mm: NotRequired[float]
    depth_mm: NotRequired[float]


class LevelFigures(TypedDict):
    """A morph level beside the one inside it; `..._certified_mm` hold everywhere, also between the points measured."""

    index: int
    limit_mm: float
    depth_max_mm: float
    depth_back_max_mm: float
    depth_mean_mm: float
    nesting_min_mm: float
    self_intersections: int
    depth_full_mean_mm: float | None
    outside_stock_mm: float
    depth_shares: list[float]
    rounding: bool
    depth_certified_mm: float | None
    nesting_certified_mm: float | None
    outside_certified_mm: float | None
    not_certified: list[str] | None


class ColumnFigures(TypedDict):
    """A round body that holds the part."""

    diameter_mm: float
    from_mm: float
    to_mm: float


class NeckFigures(TypedDict):
    """A neck that was tried, and how it holds the part; with depths that are found, the time of those that it bears."""

    diameter_mm: float
    length_mm: float
    left_mm2: float
    um_per_n: float
    shift_um: float
    stress_mpa: float
    first_hz: float
    shift_p99_um: float
    holds: bool
    tailstock: str
    machining_min: NotRequired[float]


class NeckWanted(TypedDict):
    """What a neck that holds has: error and stress at most, frequency at least."""

    shift_um: float
    stress_mpa: float
    first_hz: float


class NeckRemedyFigures(NeckFigures):
    """A change of the job, and the neck that is taken, with it."""

    change: str


class CutterSetFigures(TypedDict):
    """Cutters that were tried together, by the names of their list (empty: the job's own), and what is foretold of them
    on the best neck; `left_...` of hollows away from the post."""

    roughing: str
    finishing: str
    fine: NotRequired[str]
    minutes: float
    left_mm2: float
    left_mm: float
    at_post_mm2: float
    neck_mm: float
    shift_um: float
    stress_mpa: float
    holds: bool


class FinerFigures(TypedDict):
    """A finer ball, what it would leave in hollows, and the minutes that it would take."""

    preset: str
    radius_mm: float
    left_mm2: float
    left_mm: float
    minutes: float


class CutterFigures(TypedDict):
    """The best sets of so many that were tried, the one that is taken first; the best with the catalogue's cutters,
    where these would be worth it; and a `finer` ball that would leave half as much in hollows."""

    sets: list[CutterSetFigures]
    tried: int
    more: NotRequired[CutterSetFigures]
    finer: NotRequired[FinerFigures]


class ShorteningFigures(TypedDict):
    """A change of the job, and the length of the post with it."""

    change: str
    length_mm: float


class ShorterFigures(TypedDict):
    """A shorter post, and what stays uncut with it."""

    length_mm: float
    uncut_mm2: float


class TailstockFigures(TypedDict):
    """What holds the free end, beside the axis of the post, and its bracket; the share of contacts it stands in front
    of."""

    kind: str
    diameter_mm: float
    at_mm: list[float]
    from_mm: float
    to_mm: float
    footprint_mm2: float
    reach_mm: float
    azimuth_deg: float
    column_mm: float
    arm_mm: float
    blocked_share: float


class PostFigures(TypedDict):
    """What the part stands on."""

    diameter_mm: float
    length_mm: float
    footprint_mm2: float
    neck_mm: NotRequired[float]
    held_by: NotRequired[dict[str, ColumnFigures]]
    tailstock: NotRequired[TailstockFigures]
    neck_stated: NotRequired[bool]
    necks: NotRequired[list[NeckFigures]]
    neck_wanted: NotRequired[NeckWanted]
    holds_with: NotRequired[list[NeckRemedyFigures]]
    depths_found: NotRequired[list[float]]
    remedies: NotRequired[list[ShorteningFigures]]
    shorter: NotRequired[list[ShorterFigures]]
