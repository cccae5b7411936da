"""The job: one frozen dataclass a stage. Default, unit, range, label and tooltip are stated here once.

The command line, the job file (TOML) and the filters derive their parameters from these fields.
Degrees appear only in names that end in `_deg`; all other angles are radians, lengths mm, feeds mm/min.
"""

import dataclasses
import math
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from bonecam.errors import JobError
from bonecam.parameters import Stage, check, parameter, record


@dataclass(frozen=True)
class MeshJob(Stage):
    """How the mesh is read, repaired and cut into rows."""

    units: str = parameter("mm", "Units", "Unit of the mesh file's coordinates.", choices=("mm", "m", "inch"))
    upright: bool = parameter(
        True, "Upright", "Turn the longest principal axis to +Z and centre the part on the axis."
    )
    pit_radius: float = parameter(
        1.0,
        "Pit radius",
        "Pits that a ball of this radius, the finishing cutter's, cannot enter are filled before the fit; 0: none.",
        unit="mm",
        low=0.0,
        high=50.0,
    )
    edge_percent: float = parameter(
        1.3,
        "Remesh edge",
        "Target edge of the isotropic remesh, in percent of the bounding-box diagonal.",
        unit="%",
        low=0.2,
        high=10.0,
    )
    rows: int = parameter(48, "Rows", "Number of harmonic rows between the poles.", low=6, high=200)
    row_points: int = parameter(100, "Points a row", "Number of points on each row.", low=16, high=1000)


@dataclass(frozen=True)
class SurfaceJob(Stage):
    """How well the T-spline follows the mesh."""

    tolerance: float = parameter(
        0.08,
        "Tolerance",
        "Largest two-sided deviation wanted between surface and mesh.",
        unit="mm",
        low=0.001,
        high=5.0,
    )
    max_control_points: int = parameter(
        450, "Control points", "Never use more control points than this.", low=40, high=20000
    )
    largest_deviation: float = parameter(
        0.5,
        "Largest deviation",
        "A surface that misses the mesh by more is refused.",
        unit="mm",
        low=0.001,
        high=50.0,
    )


@dataclass(frozen=True)
class StockJob(Stage):
    """What the part is cut from, upright on the Z axis, and how the part lies in it. A size of zero: the
    smallest that holds the part."""

    kind: str = parameter(
        "capsule",
        "Kind",
        "Capsule, cylinder or box bar, or any closed convex mesh. Edges are rounded by levels of their own first.",
        choices=("capsule", "cylinder", "box", "mesh"),
    )
    diameter: float = parameter(
        0.0, "Diameter", "Diameter of capsule or cylinder; 0: the smallest.", unit="mm", low=0.0, high=500.0
    )
    length: float = parameter(
        0.0,
        "Length",
        "Length of capsule (over both caps) or bar; 0: the smallest.",
        unit="mm",
        low=0.0,
        high=2000.0,
    )
    width: float = parameter(
        0.0, "Width", "Side of a box along X; 0: the smallest.", unit="mm", low=0.0, high=500.0
    )
    depth: float = parameter(
        0.0, "Depth", "Side of a box along Y; 0: the smallest.", unit="mm", low=0.0, high=500.0
    )
    mesh: str = parameter("", "Mesh", "File of a closed convex stock, in mm, Z upright.")
    scale: float = parameter(
        1.0,
        "Scale",
        "Factor on that file's size; 0: the smallest copy that holds the part.",
        low=0.0,
        high=1000.0,
    )
    allowance: float = parameter(
        0.5,
        "Allowance",
        "Material round the part in a stock that is found, not given.",
        unit="mm",
        low=0.05,
        high=50.0,
    )
    spare_volume: float = parameter(
        0.03,
        "Spare volume",
        "How much larger than the smallest (share) a capsule may be that takes fewer cuts.",
        low=0.0,
        high=1.0,
    )
    offset_x: float = parameter(
        0.0,
        "Offset X",
        "How far the part lies off the stock's axis along X.",
        unit="mm",
        low=-500.0,
        high=500.0,
    )
    offset_y: float = parameter(
        0.0,
        "Offset Y",
        "How far the part lies off the stock's axis along Y.",
        unit="mm",
        low=-500.0,
        high=500.0,
    )
    offset_z: float = parameter(
        0.0,
        "Offset Z",
        "How far the part lies above the middle of a given stock.",
        unit="mm",
        low=-1000.0,
        high=1000.0,
    )
    tilt_x_deg: float = parameter(
        0.0,
        "Tilt about X",
        "Turn of the part about X in the stock, first.",
        unit="deg",
        low=-180.0,
        high=180.0,
    )
    tilt_y_deg: float = parameter(
        0.0, "Tilt about Y", "Turn of the part about Y, second.", unit="deg", low=-180.0, high=180.0
    )
    turn_deg: float = parameter(
        0.0,
        "Turn",
        "Turn of the part about Z, last (a box without sides finds its own).",
        unit="deg",
        low=-180.0,
        high=180.0,
    )


@dataclass(frozen=True)
class HoldingJob(Stage):
    """The post that holds the part at its lower end, on the table."""

    diameter: float = parameter(
        4.0, "Post diameter", "Diameter of the post left at the lower end.", unit="mm", low=0.5, high=100.0
    )
    length: float = parameter(
        40.0, "Post length", "From the table to the lower end of the stock.", unit="mm", low=1.0, high=500.0
    )


@dataclass(frozen=True)
class LevelsJob(Stage):
    """The morph: depth schedule and energy (Gan et al. 2014, section 4.2). `depths` may be given as numbers
    too."""

    finishing_depth: float = parameter(
        0.1,
        "Finishing depth",
        "Largest cutting depth of the levels next to the part.",
        unit="mm",
        low=0.005,
        high=5.0,
    )
    finishing_levels: int = parameter(
        4, "Finishing levels", "How many levels next to the part are finishing.", low=0, high=50
    )
    roughing_depth: float = parameter(
        0.5, "Roughing depth", "Largest cutting depth of the other levels.", unit="mm", low=0.01, high=20.0
    )
    schedule: str = parameter(
        "numbers",
        "Schedule",
        "These numbers, or the fewest levels there can be: every cut at the roughing depth, the part alone with the finishing cutter.",
        choices=("numbers", "fewest"),
    )
    depths: str = parameter(
        "",
        "Depths",
        "Instead: depths (mm) of the cuts from the part outwards, like '0.1 0.1 0.3 0.5'; the last holds for all others.",
    )
    most_cuts: int = parameter(
        250, "Most cuts", "A stock so far from the part that it takes more is refused.", low=1, high=2000
    )
    even: bool = parameter(
        False,
        "Even",
        "Make the roughing cuts shallower, as many as before, until the outermost is no sliver.",
    )
    stiffness: float = parameter(5e-7, "Stiffness", "c_int / c_ext, parameters in [0, 1].", low=0.0, high=1.0)
    attraction: str = parameter(
        "stock",
        "Attraction",
        "Pull to the nearest stock point, or to the bounding sphere as published.",
        choices=("stock", "sphere"),
    )
    method: str = parameter(
        "qp",
        "Method",
        "Quadratic programs solved by splitting (ADMM), or the published cone program solved exactly (slow).",
        choices=("qp", "qcqp"),
    )
    chord_tolerance: float = parameter(
        0.01,
        "Chord tolerance",
        "Tessellation of the levels that are measured and kept.",
        unit="mm",
        low=0.0005,
        high=1.0,
    )

    def __post_init__(self) -> None:
        if not isinstance(self.depths, str):
            several = list(self.depths) if isinstance(self.depths, Iterable) else [self.depths]
            if not several:
                raise JobError(
                    f"depths = {self.depths!r}: give one at least, or leave them out", field="depths"
                )
            object.__setattr__(self, "depths", " ".join(map(str, several)))
        check(self)
        if self.depths.strip() and self.schedule == "fewest":
            raise JobError(
                f"depths = {self.depths!r}: they give every cut, schedule = 'fewest' too: leave one of them out",
                field="depths",
            )
        _ = self.cuts

    @property
    def cuts(self) -> tuple[tuple[float, ...], float]:
        """Depths (mm) of the first cuts, from the part outwards, and of all others. JobError where `depths`
        is no list of them."""
        if self.depths.strip():
            try:
                *first, beyond = (float(word) for word in self.depths.replace(",", " ").split())
            except ValueError as error:
                raise JobError(
                    f"depths = {self.depths!r}: give numbers like '0.1 0.1 0.5'", field="depths"
                ) from error
            if not all(0 < depth < math.inf for depth in (*first, beyond)):
                raise JobError(
                    f"depths = {self.depths!r}: give positive depths (mm), like '0.1 0.1 0.5'", field="depths"
                )
            return tuple(first), beyond
        count = self.finishing_levels if self.schedule == "numbers" else 0
        return (self.finishing_depth,) * count, self.roughing_depth


@dataclass(frozen=True)
class ToolJob(Stage):
    """One ball-end cutter in its holder, from the tip up: ball and flutes, shank, holder."""

    radius: float = parameter(2.0, "Radius", "Ball radius.", unit="mm", low=0.05, high=50.0)
    flute_length: float = parameter(
        8.0, "Flute length", "From the tip to the end of the cutting edge.", unit="mm", low=0.1, high=300.0
    )
    shank_diameter: float = parameter(
        4.0, "Shank diameter", "Diameter of the shank above the flutes.", unit="mm", low=0.1, high=100.0
    )
    overhang: float = parameter(
        30.0, "Overhang", "From the tip to the holder's nose.", unit="mm", low=1.0, high=500.0
    )
    holder_diameter: float = parameter(
        20.0, "Holder diameter", "Diameter of the holder.", unit="mm", low=1.0, high=200.0
    )
    holder_length: float = parameter(
        50.0, "Holder length", "Length of the holder above its nose.", unit="mm", low=1.0, high=500.0
    )
    spindle: float = parameter(12000.0, "Spindle", "Spindle speed.", unit="1/min", low=1.0, high=100000.0)
    feed: float = parameter(900.0, "Feed", "Cutting feed of the tip.", unit="mm/min", low=1.0, high=30000.0)
    scallop: float = parameter(
        0.05, "Scallop", "Largest height of the cusps between passes.", unit="mm", low=0.0005, high=2.0
    )


ROUGHING = ToolJob()
FINISHING = ToolJob(radius=1.0, flute_length=4.0, shank_diameter=2.0, overhang=25.0, feed=900.0, scallop=0.01)


@dataclass(frozen=True)
class PathJob(Stage):
    """How a level is covered and how passes are linked."""

    direction: str = parameter(
        "around",
        "Direction",
        "Passes round the bone (t = const) or from pole to pole (s = const).",
        choices=("around", "along"),
    )
    chord_tolerance: float = parameter(
        0.004,
        "Chord tolerance",
        "Largest distance of a straight move from the cutter's true way.",
        unit="mm",
        low=0.0005,
        high=0.5,
    )
    max_step: float = parameter(1.0, "Largest step", "Longest cutting move.", unit="mm", low=0.05, high=10.0)
    clearance: float = parameter(
        2.0,
        "Clearance",
        "Distance kept from the stock while moving between passes.",
        unit="mm",
        low=0.2,
        high=50.0,
    )
    lead_deg: float = parameter(
        10.0, "Lead", "Tool axis leans this far forward along the feed.", unit="deg", low=-60.0, high=60.0
    )
    max_tilt_deg: float = parameter(
        75.0,
        "Largest tilt",
        "Tool axis never further from the normal than this.",
        unit="deg",
        low=1.0,
        high=89.0,
    )
    gouge_tolerance: float = parameter(
        0.01,
        "Gouge tolerance",
        "The ball never enters the design surface by more.",
        unit="mm",
        low=0.001,
        high=0.5,
    )

    def __post_init__(self) -> None:
        check(self)
        if abs(self.lead_deg) > self.max_tilt_deg:
            bound = f"keep it within path.max_tilt_deg ({self.max_tilt_deg:g})"
            raise JobError(f"lead_deg = {self.lead_deg:g}: {bound}", field="lead_deg")


@dataclass(frozen=True)
class NcJob(Stage):
    """Machine, controller and feeds."""

    machine: str = parameter("mikron-ucp600", "Machine", "Name of a machine file.")
    controller: str = parameter("heidenhain", "Controller", "Name of a dialect.")
    link_feed: float = parameter(
        1500.0,
        "Link feed",
        "Feed of links close to the part and of retracts.",
        unit="mm/min",
        low=1.0,
        high=30000.0,
    )
    plunge_feed: float = parameter(
        300.0, "Plunge feed", "Feed of the approach to the part.", unit="mm/min", low=1.0, high=30000.0
    )
    rapid_feed: float = parameter(
        10000.0,
        "Rapid rate",
        "Rate of rapid moves where a controller needs a number.",
        unit="mm/min",
        low=1.0,
        high=100000.0,
    )
    coolant: bool = parameter(True, "Coolant", "Switch the coolant on while cutting.")
    part_zero: str = parameter(
        "table", "Part zero", "The program's zero: on the table under the part.", choices=("table",)
    )


@dataclass(frozen=True)
class Job:
    """Everything but the mesh."""

    mesh: MeshJob = MeshJob()
    surface: SurfaceJob = SurfaceJob()
    stock: StockJob = StockJob()
    holding: HoldingJob = HoldingJob()
    levels: LevelsJob = LevelsJob()
    roughing: ToolJob = ROUGHING
    finishing: ToolJob = FINISHING
    path: PathJob = PathJob()
    nc: NcJob = NcJob()

    def with_values(self, **changes: dict[str, Any]) -> "Job":
        """The same job with `section={name: value}` changed; JobError names what is unknown."""
        stages = {}
        for section, values in changes.items():
            if section not in {item.name for item in fields(self)}:
                raise JobError(
                    f"[{section}] is no section of a job: use one of {', '.join(i.name for i in fields(self))}",
                    section=section,
                )
            if not isinstance(values, dict):
                raise JobError(
                    f"[{section}] = {values!r}: give its values by name, like {section}={{name: value}}",
                    section=section,
                )
            stage = getattr(self, section)
            unknown = set(values) - {item.name for item in fields(stage)}
            if unknown:
                raise JobError(
                    f"[{section}] knows no {sorted(unknown)[0]!r}: use one of {', '.join(i.name for i in fields(stage))}",
                    section=section,
                )
            try:
                stages[section] = dataclasses.replace(stage, **values)
            except JobError as error:
                raise JobError(f"[{section}] {error}", section=section, **error.evidence) from error
        return dataclasses.replace(self, **stages)

    def is_finishing(self, level: int) -> bool:
        """Whether the finishing cutter machines a level: the part itself, and what is cut no deeper than the
        finishing depth."""
        first, beyond = self.levels.cuts
        if level < len(first):
            return level == 0 or first[level] <= self.levels.finishing_depth
        return level == 0 or (bool(self.levels.depths.strip()) and beyond <= self.levels.finishing_depth)


def wrong(section: str, name: str, value: object, why: str) -> JobError:
    """The refusal of a field of a job: its value, and `why` with the bound and the remedy."""
    shown = f"{value:g}" if isinstance(value, float) else repr(value)
    return JobError(f"[{section}] {name} = {shown}: {why}", section=section, field=name)


def read_job(path: str | Path, base: Job | None = None) -> Job:
    """The job of a TOML file: sections named as the fields of Job; what is left out keeps its default."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
        values = tomllib.loads(text)
    except OSError as error:
        raise JobError(f"{path}: {error.strerror}: give a readable job file", file=str(path)) from error
    except ValueError as error:
        raise JobError(f"{path}: {error}: mend the TOML there", file=str(path)) from error
    loose = [name for name, value in values.items() if not isinstance(value, dict)]
    if loose:
        raise JobError(
            f"{path}: {loose[0]!r} stands outside a section: put it below one like [path]", file=str(path)
        )
    try:
        return (base or Job()).with_values(**values)
    except JobError as error:
        raise JobError(f"{path}: {error}", file=str(path), **error.evidence) from error


def write_job(job: Job) -> str:
    """The TOML text of a job, every value with its tooltip as a comment."""
    lines = []
    for section in fields(job):
        lines.append(f"[{section.name}]")
        for item in fields(getattr(job, section.name)):
            value, known = getattr(getattr(job, section.name), item.name), record(item)
            text = (
                f'"{value}"'
                if isinstance(value, str)
                else str(value).lower()
                if isinstance(value, bool)
                else repr(value)
            )
            lines.append(f"{item.name} = {text}  # {known.tooltip}{f' [{known.unit}]' if known.unit else ''}")
        lines.append("")
    return "\n".join(lines)
