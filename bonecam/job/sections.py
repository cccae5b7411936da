"""The job with all its sections."""

from dataclasses import dataclass, field, fields, replace
from typing import Any

from bonecam.errors import JobError
from bonecam.job.holding_section import HoldingJob
from bonecam.job.levels_section import LevelsJob
from bonecam.job.mesh_section import MeshJob
from bonecam.job.nc_section import NcJob
from bonecam.job.path_section import PathJob
from bonecam.job.stock_section import StockJob
from bonecam.job.surface_section import SurfaceJob
from bonecam.job.tool_section import FINISHING, ROUGHING, ToolJob


@dataclass(frozen=True)
class Job:
    """All parameters of a run: everything but the part."""

    mesh: MeshJob = field(default_factory=MeshJob)
    surface: SurfaceJob = field(default_factory=SurfaceJob)
    stock: StockJob = field(default_factory=StockJob)
    holding: HoldingJob = field(default_factory=HoldingJob)
    levels: LevelsJob = field(default_factory=LevelsJob)
    roughing: ToolJob = ROUGHING
    finishing: ToolJob = FINISHING
    path: PathJob = field(default_factory=PathJob)
    nc: NcJob = field(default_factory=NcJob)

    def with_values(self, **changes: dict[str, Any]) -> "Job":
        """A job with other values, given as `section={name: value}`; JobError names an unknown section or
        name."""
        known = [item.name for item in fields(self)]
        for section in changes:
            if section not in known:
                remedy = f"use one of {', '.join(known)}"
                raise JobError(f"[{section}] is no section of a job: {remedy}", section=section)
        sections = {name: _changed(name, getattr(self, name), values) for name, values in changes.items()}
        return replace(self, **sections)

    def is_finishing(self, level: int) -> bool:
        """Whether the finishing cutter machines a level: level 0 (the part), and cuts of at most the
        finishing depth.

        `finishing_levels` cuts next to the part are such cuts, unless `depths` lists the depth of each cut.
        """
        first, beyond = self.levels.cuts
        if level == 0:
            return True
        if level < len(first):
            return first[level] <= self.levels.finishing_depth
        return bool(self.levels.depths.strip()) and beyond <= self.levels.finishing_depth


def _changed(name: str, section: Any, values: object) -> Any:
    """A section of a job with other values by name; JobError names the section."""
    if not isinstance(values, dict):
        remedy = f"give its values by name, like {name}={{name: value}}"
        raise JobError(f"[{name}] = {values!r}: {remedy}", section=name)
    known = [item.name for item in fields(section)]
    unknown = sorted(set(values) - set(known))
    if unknown:
        remedy = f"use one of {', '.join(known)}"
        raise JobError(f"[{name}] knows no {unknown[0]!r}: {remedy}", section=name)
    try:
        return replace(section, **values)
    except JobError as error:
        raise JobError(f"[{name}] {error}", section=name, **error.evidence) from error


def field_error(section: str, name: str, value: object, why: str) -> JobError:
    """The error of a field of a job: the field with its value, then `why` with the bound and the remedy."""
    shown = f"{value:g}" if isinstance(value, float) else repr(value)
    return JobError(f"[{section}] {name} = {shown}: {why}", section=section, field=name)
