"""JSON schemas of jobs, machines, dialects, materials and tools for editors, made of the declarations that check the
files.
"""

import math
from dataclasses import Field, fields
from typing import Any

from bonecam.job import Job
from bonecam.job.materials.preset import MaterialFile
from bonecam.job.parameter import record
from bonecam.job.tool_list import MM
from bonecam.job.tool_section import ToolJob
from bonecam.machine.machine_file import MachineFile
from bonecam.nc.schema import DialectFile
from bonecam.text.record import Record

DRAFT = "https://json-schema.org/draft/2020-12/schema"
TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}
"""What JSON calls the type of a parameter."""
ALSO_LISTS = ("depths", "holder")
"""Texts that may be given as a number or a list, too."""


def job_schema() -> dict[str, Any]:
    """The schema of a job file: sections, parameters, their ranges, choices, units and defaults."""
    job = Job()
    sections = {item.name: _section(getattr(job, item.name)) for item in fields(job)}
    return _closed(sections) | {"$schema": DRAFT, "title": "bonecam job"}


def file_schema(kind: str) -> dict[str, Any]:
    """The schema of the files of a catalogue: machines, dialects, materials or tools."""
    if kind == "tools":
        text = {"type": "string"}
        cutter = _section(ToolJob())["properties"] | {"name": text, "source": text}
        del cutter["preset"]
        holders = {"type": "object", "additionalProperties": {"type": ["string", "array"]}}
        whole = {"from": text, "units": {"enum": list(MM)}, "only": {"type": ["array", "integer", "string"]}}
        tools = {"type": "array", "items": _closed(cutter)}
        schema = _closed({**cutter, **whole, "holders": holders, "tool": tools})
        return schema | {"$schema": DRAFT, "title": "bonecam tools"}
    models: dict[str, type[Record]] = {"machines": MachineFile, "dialects": DialectFile, "materials": MaterialFile}
    return models[kind].model_json_schema() | {"$schema": DRAFT}


def _closed(properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _section(section: Any) -> dict[str, Any]:
    """The schema of a section, whose defaults are its values."""
    return _closed({item.name: _parameter(item, getattr(section, item.name)) for item in fields(section)})


def _parameter(item: "Field[Any]", value: Any) -> dict[str, Any]:
    known = record(item)
    unit = f" [{known.unit}]" if known.unit else ""
    schema: dict[str, Any] = {"title": known.label, "description": f"{known.tooltip}{unit}", "default": value}
    schema["type"] = [TYPES[type(value)], "number", "array"] if item.name in ALSO_LISTS else TYPES[type(value)]
    if known.choices:
        schema["enum"] = list(known.choices)
    if math.isfinite(known.low):
        schema["minimum"] = known.low
    if math.isfinite(known.high):
        schema["maximum"] = known.high
    return schema
