"""The report of a run, section by section, as `--report FILE.json` writes it: its names and types, which
`Result.report` holds, and how its sections are made.

Names end in their unit; places are [x, y, z] in the part's frame, mm. A section that was not made says why in
`skipped`, and has nothing else.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NotRequired, TypedDict

import numpy as np

from bonecam.job import HoldingJob, Job, PathJob
from bonecam.levels.sequences import Morph
from bonecam.mesh.part import Part
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.program import Program
from bonecam.report.stage_reports import levels_report, nc_report, parting_report, surface_report, toolpath_report
from bonecam.setup.stock import Stock, stock_figures
from bonecam.surface.fitting import distance_both_ways
from bonecam.surface.growth import Fit
from bonecam.tool.path import BESIDE, ToolPath
from bonecam.verify.proof import Verification
from bonecam.workholding.clamping import holding_columns
from bonecam.workholding.post import Post, footprint


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
    clearance_near: dict[str, str]
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


class ShellFigures(TypedDict):
    """The modulus of the shell of a second clamping, and how many times its feeds the program may be driven at."""

    modulus_mpa: float
    feeds_borne: float


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
    shell: ShellFigures | None
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
    probe: NotRequired[str]
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
    time_blank_min: float
    time_texts: list[str]
    feed_median_mm_min: float
    feed_low_mm_min: float
    feed_axis_limited_share: float
    feed_beyond_axes_share: float
    feed_under_half_blocks: int


def report_text(report: Mapping[str, Any]) -> str:
    """The text of a report's file."""
    return json.dumps(report, indent=2) + "\n"


def input_report(part: Part) -> dict[str, Any]:
    """The section `input`: the part's mesh, and what was changed of it."""
    return {
        "file": part.file,
        "faces": part.faces,
        "units": part.units,
        "notes": list(part.notes),
        "repairs": [str(each) for each in part.repairs],
        "repair_steps": [each.report for each in part.repairs],
        "facets": part.coarseness.report if part.coarseness else None,
        "smoothed": part.smoothing.report if part.smoothing else None,
        "filled": part.fill.report if part.fill else None,
        "area_mm2": round(part.mesh.area, 3),
        "hole_max_mm": round(part.widest_hole, 6),
        "guessed_share": round(part.guessed_share, 6),
        "repair_taken_off_max_mm": round(part.taken_off.depth if part.taken_off else 0.0, 6),
        "repair_deviation_max_mm": round(part.repair_deviation, 6),
    }


def report_to_levels(part: Part, fitted: Fit, stock: Stock, morph: Morph, job: Job) -> dict[str, Any]:
    """The sections of input, surface, stock and levels."""
    # How far the surface and the mesh as given are from each other: where nothing was repaired or filled that is the
    # deviation of the fit
    ways = fitted.deviation.surface_to_mesh_max, fitted.deviation.mesh_to_surface_max
    if part.repairs:
        ways = distance_both_ways(fitted.surface, part.placed_given)
    return {
        "input": input_report(part),
        "surface": {
            **surface_report(fitted),
            "tolerance_why": job.surface.tolerance_why(part.sagitta, fitted.tolerance),
            "given_deviation_max_mm": round(max(ways), 6),
            "surface_to_given_max_mm": round(ways[0], 6),
            "given_to_surface_max_mm": round(ways[1], 6),
        },
        "stock": stock_figures(stock),
        "levels": levels_report(morph.levels),
        "levels_lower_bound": morph.lower_bound,
        "levels_break_mm": round(morph.breaks, 6),
        "levels_method": job.levels.method,
    }


def post_report(post: Post, part: TriangleMesh, job: HoldingJob) -> dict[str, Any]:
    """`post` of the report: its sizes, `length_mm` from the table and `neck_mm` above what holds it, the columns below
    it, and the area of the part that stays under it; `tailstock` likewise, if there is one."""
    sizes: dict[str, Any] = {"diameter_mm": job.diameter, "length_mm": job.length}
    held = {
        name: {"diameter_mm": 2 * column.radius, "from_mm": column.bottom, "to_mm": column.top}
        for name, column in holding_columns(job).items()
    }
    if held:
        sizes |= {"neck_mm": job.length - job.support_height, "held_by": held}
    if post.pin is not None:
        # Pin or upper neck: `at_mm` from the axis of the post, between two heights, and the area of the part that
        # stays under it; and the bracket's column and arm
        sizes["tailstock"] = {
            "kind": job.tailstock,
            "diameter_mm": 2 * post.pin.radius,
            "at_mm": [round(post.pin.x, 3), round(post.pin.y, 3)],
            "from_mm": round(post.pin.bottom, 3),
            "to_mm": round(post.pin.top, 3),
            "footprint_mm2": round(footprint(post.pin, part), 2),
            "reach_mm": job.tailstock_reach,
            "azimuth_deg": job.tailstock_azimuth_deg,
            "column_mm": job.tailstock_column,
            "arm_mm": job.tailstock_arm,
        }
    return {**sizes, "footprint_mm2": round(footprint(post.column, part), 2)}


def report_to_program(
    file: str | Path | None,
    paths: Sequence[ToolPath],
    program: Program,
    proof: Verification,
    job: PathJob,
    part: TriangleMesh,
) -> dict[str, Any]:
    """The sections of tool paths, of the parting groove of the `part` if there is one, and of the program; `file` is
    the program's, None where none is written."""
    on_levels = [path for path in paths if path.level not in BESIDE]
    reported = toolpath_report(on_levels, float(np.radians(job.least_lead_deg)))
    posted = {"file": Path(file or "").name, **nc_report(program, proof)}
    return {"toolpath": reported, **parting_report(paths, part), "nc": posted}


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
    added: dict[str, dict[str, Any]]
    second: SecondFigures
    axes: list[dict[str, object]]
