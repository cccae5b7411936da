"""Filter scripts (.mlx) in which MeshLab's filters and ours stand side by side: read, checked and applied.

A script is checked whole before anything runs: every filter and parameter must be known and every value well
formed, or the error names the line. Names are MeshLab's shown ones, our display names, or Python's. MeshLab's
own filters are then applied one at a time through pymeshlab with values converted by their type; where a
script leaves a parameter out its default holds. Lengths are numbers of mm (MeshLab saves percentages that
way), or a percentage written `3%`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from bonecam.errors import BonecamError, FilterError, did_you_mean
from bonecam.filters import meshlab_names
from bonecam.filters.filter import Registry
from bonecam.filters.meshlab_values import CAMERAS, checked_value
from bonecam.filters.mlx import FilterCall, ScriptParameter, read_calls
from bonecam.mesh.meshlab import meshlab_filters
from bonecam.progress import Progress, part, report, silent


@dataclass(frozen=True)
class ScriptStep:
    """One filter of a checked script: Python's name and values, and its line."""

    name: str
    values: Mapping[str, Any]
    line: int


class Applies(Protocol):
    """What steps are applied to: a MeshSet."""

    registry: Registry
    progress: Progress

    def apply_filter(self, filter_name: str, **values: Any) -> dict[str, Any]:
        """Apply a filter by its Python name."""


def read_script(script: str | Path, registry: Registry) -> list[ScriptStep]:
    """The checked steps of a script. FileError or FilterError with the line of what is wrong."""
    return [_step(call, str(script), registry) for call in read_calls(script)]


def apply_steps(meshes: Applies, steps: Sequence[ScriptStep], script: str, progress: Progress = silent) -> None:
    """Apply steps in their order; an error keeps its kind and gains the line."""
    before = meshes.progress
    try:
        for index, step in enumerate(steps):
            report(progress, index / len(steps), f"line {step.line}: {step.name}")
            meshes.progress = part(progress, index / len(steps), (index + 1) / len(steps))
            meshes.apply_filter(step.name, **step.values)
    except BonecamError as error:
        evidence = (
            {**error.evidence, "script_line": step.line}
            if "line" in error.evidence
            else {**error.evidence, "line": step.line}
        )
        raise type(error)(f"{script}, line {step.line}: {error}", **evidence) from error
    finally:
        meshes.progress = before


def _step(call: FilterCall, script: str, registry: Registry) -> ScriptStep:
    name = registry[call.name].name if call.name in registry else meshlab_names.python_name(call.name)
    if name not in registry and name not in meshlab_filters():
        shown = (known for known in meshlab_names.all_names() if meshlab_names.python_name(known) in meshlab_filters())
        names = {*registry.names, *(item.display_name for item in registry), *meshlab_filters(), *shown}
        what = f"there is no filter {call.name!r}{did_you_mean(call.name, names)}"
        message = f"{script}, line {call.line}: {what}: `bonecam filters` and MeshLab list them"
        raise FilterError(message, line=call.line, file=script, filter=call.name)
    values: dict[str, Any] = {}
    if name in CAMERAS:
        message = f"{script}, line {call.line}: {name} takes a camera, which pymeshlab cannot pass: leave it out"
        raise FilterError(message, line=call.line, file=script, filter=call.name)
    for item in call.parameters:
        try:
            key, value = _ours(item, name, registry) if name in registry else checked_value(name, item)
        except FilterError as error:
            evidence = {**error.evidence, "line": item.line, "file": script}
            raise FilterError(f"{script}, line {item.line}: {_with_name(name, str(error))}", **evidence) from error
        if key in values:
            raise FilterError(
                f"{script}, line {item.line}: {name}: {key} is there twice: leave one", line=item.line, file=script
            )
        values[key] = value
    return ScriptStep(name, values, call.line)


def _ours(item: ScriptParameter, name: str, registry: Registry) -> tuple[str, Any]:
    known = registry[name].parameter(item.name)
    if "value" not in item.attributes:
        raise FilterError(f"parameter {known.name} has no value: add value=", parameter=known.name)
    return known.name, known.read(item.attributes["value"])


def _with_name(name: str, message: str) -> str:
    return message if message.startswith(name) else f"{name}: {message}"
