"""The job with all its sections."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, make_dataclass, replace
from functools import wraps
from typing import TYPE_CHECKING, Any

from bonecam.errors import JobError, did_you_mean
from bonecam.job.holding_section import HoldingJob
from bonecam.job.levels_section import LevelsJob
from bonecam.job.materials.preset import MechanicsJob, read_material
from bonecam.job.mesh_section import MeshJob, SurfaceJob
from bonecam.job.nc_section import NcJob
from bonecam.job.parameter import JobSection
from bonecam.job.path_section import PathJob
from bonecam.job.stock_section import StockJob
from bonecam.job.tool_list import preset_values
from bonecam.job.tool_section import AUTO, FINE, FINISHING, ROUGHING, MaterialJob, ToolJob
from bonecam.job.warnings_section import WarningsJob
from bonecam.machine.machine import USUAL_SPINDLE, read_machine
from bonecam.plugins import all_added
from bonecam.text.numbers import Faults, shown

Table = Mapping[str, Any]
"""Values of a section by name."""
CUTTERS = ("roughing", "finishing", "fine")
"""The sections of cutters, in the order of their numbers."""
SMOOTH_SHARE = 0.2
"""Scallops of a level before a finishing cut are this share of the depth of that cut: on the first finishing levels
nothing of them stays, and the cut is deeper by as much at their tips alone."""


@dataclass(frozen=True)
class Job:
    """All parameters of a run: everything but the part.

    A section may be given as a table of values by name; those that it leaves out have their defaults. The repr has the
    sections that differ from these. Plugins add sections of their own, which come last.
    """

    mesh: MeshJob = field(default_factory=MeshJob)
    surface: SurfaceJob = field(default_factory=SurfaceJob)
    stock: StockJob = field(default_factory=StockJob)
    holding: HoldingJob = field(default_factory=HoldingJob)
    levels: LevelsJob = field(default_factory=LevelsJob)
    material: MaterialJob = field(default_factory=MaterialJob)
    mechanics: MechanicsJob = field(default_factory=MechanicsJob)
    roughing: ToolJob = ROUGHING
    finishing: ToolJob = FINISHING
    fine: ToolJob = FINE
    path: PathJob = field(default_factory=PathJob)
    nc: NcJob = field(default_factory=NcJob)
    warnings: WarningsJob = field(default_factory=WarningsJob)

    if TYPE_CHECKING:  # what the generated __init__ takes, tables too

        def __init__(
            self,
            *,
            mesh: MeshJob | Table = ...,
            surface: SurfaceJob | Table = ...,
            stock: StockJob | Table = ...,
            holding: HoldingJob | Table = ...,
            levels: LevelsJob | Table = ...,
            material: MaterialJob | Table = ...,
            mechanics: MechanicsJob | Table = ...,
            roughing: ToolJob | Table = ...,
            finishing: ToolJob | Table = ...,
            fine: ToolJob | Table = ...,
            path: PathJob | Table = ...,
            nc: NcJob | Table = ...,
            warnings: WarningsJob | Table = ...,
        ) -> None: ...

    def __repr__(self) -> str:
        plain = Job()
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        changed = (f"{name}={value!r}" for name, value in values.items() if value != getattr(plain, name))
        return f"Job({', '.join(changed)})"

    def __post_init__(self) -> None:
        given = {item.name: (getattr(self, item.name), item.type) for item in fields(self)}
        tables = {name: value for name, (value, kind) in given.items() if type(value) is not kind}
        if tables:
            job = Job().with_values(**({"nc": self.nc} | tables))
            for name in tables:
                object.__setattr__(self, name, getattr(job, name))
        users: dict[int, str] = {}
        for place, name in enumerate(self.cutter_names, 1):
            number = getattr(self, name).number or place
            other = users.setdefault(number, name)
            if other != name:
                what = f"[{name}] number = {number}: [{other}] has this tool number too: give one of them another"
                raise job_error([(name, "number", what)])

    def with_values(self, **changes: dict[str, Any]) -> "Job":
        """A job with other values, given as `section={name: value}`; presets of cutters are those of its nc.tools.

        JobError names every unknown section or name and every wrong value (`faults`: section, field, text).
        """
        known = [item.name for item in fields(self)]
        faults: list[tuple[str, str, str]] = []
        sections = {}
        nc: Any = changes.get("nc", self.nc)
        tools = str(nc.get("tools", self.nc.tools) if isinstance(nc, dict) else getattr(nc, "tools", ""))
        for name, values in changes.items():
            if name not in known:
                remedy = f"{did_you_mean(name, known)}: use one of {', '.join(known)}"
                faults.append((name, "", f"[{name}] is no section of a job{remedy}"))
                continue
            try:
                sections[name] = _changed(name, getattr(self, name), values, tools)
            except JobError as error:
                faults += error.evidence["faults"]
        if faults:
            raise job_error(faults)
        return replace(self, **sections)

    @property
    def cutter_names(self) -> tuple[str, ...]:
        """The sections of the cutters that are used, in the order of their numbers in the tool changer, from 1."""
        return CUTTERS if self.path.fine_cutter else CUTTERS[:2]

    @property
    def open_cutters(self) -> tuple[str, ...]:
        """The sections whose cutters are to be chosen for the part, that of a fine one even where none is used."""
        return tuple(name for name in CUTTERS if getattr(self, name).preset == AUTO)

    @property
    def smallest_ball(self) -> float:
        """Radius of the smallest ball that cuts, mm."""
        return min(getattr(self, name).radius for name in self.cutter_names)

    def tool(self, name: str, level: int | None = None) -> ToolJob:
        """The cutter "roughing", "finishing" or "fine", with the material's spindle speed and feed where its section
        leaves them 0, at most what the machine turns and moves, and the flutes of [mechanics] likewise. The feed is
        that of the cut that leaves a `level`, whose chip is thinner the shallower it is, or of the cutter's deepest.
        JobError or MachineError where material or machine cannot be read."""
        given: ToolJob = getattr(self, name)
        tool = replace(given, flutes=given.flutes or self.mechanics.flutes)
        if tool.spindle and tool.feed:
            return tool
        machine = read_machine(self.nc.machine)
        depth = self.deepest(name) if level is None or level < 0 else self.levels.depth_onto(level)
        fastest = machine.spindle_speed if machine.spindle_speed < math.inf else USUAL_SPINDLE
        asked = tool.radius, depth, fastest, tool.spindle, given.flutes
        spindle, feed = read_material(self.material.name).speeds(*asked)
        slowest = min(axis.speed for axis in machine.linear)
        return replace(tool, spindle=spindle, feed=tool.feed or min(feed, slowest))

    def fastest_feed(self, name: str) -> float:
        """Feed (mm/min) of the shallowest cut of the cutter of a section."""
        of_morph = range(len(self.levels.cuts[0]) + 1) if self.path.strategy == "morph" else ()
        levels = [level for level in of_morph if self.is_finishing(level) == (name != "roughing")]
        return max(self.tool(name, level).feed for level in [None, *levels])

    def deepest(self, name: str) -> float:
        """Depth (mm) of the deepest cut of the cutter of a section: that onto the part is the finishing cutter's."""
        (first, beyond), finest = self.levels.cuts, self.levels.finishing_depth
        return max([*first, beyond] if name == "roughing" else [finest, self.levels.depth_onto(0)])

    def scallop(self, level: int) -> float:
        """Largest scallop (mm) that the path of a level leaves: that of its cutter; before a finishing cut SMOOTH_SHARE
        of its depth, of a roughing cutter no more than its own, of a finishing one no less; before a roughing cut
        `levels.scallop_share` of its depth, if that is more."""
        tool = self.finishing if self.is_finishing(level) else self.roughing
        if level <= 0:
            return tool.scallop
        if self.is_finishing(level - 1):
            share = SMOOTH_SHARE * self.levels.finishing_depth
            return max(tool.scallop, share) if self.is_finishing(level) else min(tool.scallop, share)
        return max(tool.scallop, self.levels.scallop_share * self.levels.depth_onto(level - 1))

    def is_finishing(self, level: int) -> bool:
        """Whether the finishing cutter machines a level: level 0 (the part), and cuts of at most the
        finishing depth; what follows level 0 (negative) parts the finished part from its post.

        `finishing_levels` cuts next to the part are such cuts, unless `depths` lists the depth of each cut.
        """
        if level <= 0:
            return level == 0
        counted = self.levels.listed or level < len(self.levels.cuts[0])
        return bool(counted) and self.levels.depth_onto(level) <= self.levels.finishing_depth


def _refusing_unknown(init: Callable[..., None]) -> Callable[..., None]:
    """A job's `__init__` that refuses a section that there is none of, as `with_values` does."""

    @wraps(init)
    def checked_init(self: Job, *given: Any, **sections: Any) -> None:
        unknown = sections.keys() - {item.name for item in fields(Job)}
        if unknown:
            Job().with_values(**{name: sections[name] for name in sections if name in unknown})
        init(self, *given, **sections)

    return checked_init


if not TYPE_CHECKING:
    _sections = [
        (name, kind, field(default_factory=kind))
        for name, kind in all_added("sections", type, taken=Job.__dataclass_fields__).items()
    ]
    if _sections:
        _where = {"__module__": __name__}
        Job = make_dataclass("Job", _sections, bases=(Job,), namespace=_where, frozen=True, repr=False)
Job.__init__ = _refusing_unknown(Job.__init__)  # type: ignore[method-assign]


def _changed(name: str, section: Any, values: object, tools: str) -> Any:
    """A section of a job with other values by name, those of a preset from the list `tools`; JobError names the
    section."""
    if isinstance(values, JobSection) and type(values) is type(section):
        return values
    if not isinstance(values, dict):
        remedy = f"give its values by name, like {name}={{name: value}}"
        raise job_error([(name, "", f"[{name}] = {shown(values)}: {remedy}")])
    known = [item.name for item in fields(section)]
    remedy = f"use one of {', '.join(known)}"
    unknown = [str(key) for key in values if key not in known]
    faults = [(name, key, f"[{name}] knows no {key!r}{did_you_mean(key, known)}: {remedy}") for key in unknown]
    try:
        if isinstance(section, ToolJob) and values.get("preset") not in (None, "", AUTO):
            values = {**preset_values(str(values["preset"]), tools), **values}
        elif isinstance(section, ToolJob | LevelsJob):
            values = section.completed(values)
        changed = replace(section, **{key: value for key, value in values.items() if key in known})
    except JobError as error:
        message = error.evidence.get("faults") or [(error.evidence.get("field", ""), str(error))]
        faults += [(name, field, f"[{name}] {text}") for field, text in message]
    if faults:
        raise job_error(faults)
    return changed


def setting(key: str, value: str) -> tuple[str, str, Any] | None:
    """Section, name and value of a parameter, None where the key is not of the form section.name. The value is of the
    parameter's type; where there is no such parameter, or it is no such value, it is left as text for the job to
    refuse."""
    section, dot, name = key.strip().partition(".")
    if not dot:
        return None
    known = fields(getattr(Job(), section)) if section in {item.name for item in fields(Job)} else ()
    kind: Any = {item.name: type(item.default) for item in known}.get(name, str)
    try:
        if kind is bool:
            return section, name, {"true": True, "false": False}[value.strip().lower()]
        return section, name, kind(value.strip())
    except (ValueError, KeyError):
        return section, name, value.strip()


def job_error(faults: Sequence[tuple[str, str, str]], place: str = "") -> JobError:
    """The error of all faults of a job, each as (section, field, text); the evidence has section and field of the
    first."""
    section, field, _ = faults[0]
    message = Faults([("", text) for _, _, text in faults])
    evidence: dict[str, Any] = {"section": section, "faults": list(faults)}
    if field:
        evidence["field"] = field
    return JobError(f"{place}{message}", **evidence)


def field_error(section: str, name: str, value: object, why: str) -> JobError:
    """The error of a field of a job: the field with its value, then `why` with the bound and the remedy."""
    message = f"{value:g}" if isinstance(value, float) else shown(value)
    return JobError(f"[{section}] {name} = {message}: {why}", section=section, field=name)
