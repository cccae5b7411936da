"""Filter scripts (.mlx): read, checked, and run in a process of their own.

Filter scripts (.mlx) in which MeshLab's filters and ours stand side by side: read, checked and applied.

A script is checked whole before anything runs: every filter and parameter must be known and every value well
formed, or the error names the line. Names are MeshLab's shown ones, our display names, or Python's. MeshLab's
own filters are then applied one at a time through pymeshlab with values converted by their type; where a
script leaves a parameter out its default holds. Lengths are numbers of mm (MeshLab saves percentages that
way), or a percentage written `3%`.

Where a script may read and write: a script comes from a stranger as often as a mesh does.

It writes into the folder of outputs and over no file that is there; it reads files beside the script and beside
the inputs. pymeshlab tells of a parameter of MeshLab's only that it is text, not that it is a file name. So every
parameter that takes any text counts as the name of a file to write, but for those that are known to be formulas
and names (TEXTS) or files to read (READ): a filter that a later MeshLab adds is refused, not trusted.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bonecam_plugins.meshlab import filter
from bonecam_plugins.meshlab.filter import Kind, Registry
from bonecam_plugins.meshlab.guards import meshlab_filters
from bonecam_plugins.meshlab.meshlab_values import CAMERAS, FilterCall, checked_value, free_texts, read_calls

from bonecam.errors import BonecamError, FilterError, did_you_mean
from bonecam.progress import Progress, part, report, silent
from bonecam.runtime.own_files import is_own
from bonecam.runtime.staging import leads_out


@dataclass(frozen=True)
class ScriptStep:
    """One filter of a checked script: Python's name and values, and its line."""

    name: str
    values: Mapping[str, Any]
    line: int


def read_script(script: str | Path, registry: Registry) -> list[ScriptStep]:
    """The checked steps of a script. FileError or FilterError with the line of what is wrong."""
    return [_step(call, str(script), registry) for call in read_calls(script)]


def apply_steps(meshes: Any, steps: Sequence[ScriptStep], script: str, progress: Progress = silent) -> None:
    """Apply steps to a MeshSet in their order; an error keeps its kind and gains the line."""
    before = meshes.progress
    try:
        for index, step in enumerate(steps):
            report(progress, index / len(steps), f"line {step.line}: {step.name}")
            meshes.progress = part(progress, index / len(steps), (index + 1) / len(steps))
            meshes.apply_filter(step.name, **step.values)
    except BonecamError as error:
        evidence = {**error.evidence, "script_line" if "line" in error.evidence else "line": step.line}
        raise type(error)(f"{script}, line {step.line}: {error}", **evidence) from error
    finally:
        meshes.progress = before


def _step(call: FilterCall, script: str, registry: Registry) -> ScriptStep:
    name = registry[call.name].name if call.name in registry else filter.python_name(call.name)
    if name not in registry and name not in meshlab_filters():
        shown = (known for known in filter.all_names() if filter.python_name(known) in meshlab_filters())
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
            if name not in registry:
                key, value = checked_value(name, item)
            else:
                known = registry[name].parameter(item.name)
                if "value" not in item.attributes:
                    raise FilterError(f"parameter {known.name} has no value: add value=", parameter=known.name)
                key, value = known.name, known.read(item.attributes["value"])
        except FilterError as error:
            evidence = {**error.evidence, "line": item.line, "file": script}
            what = str(error) if str(error).startswith(name) else f"{name}: {error}"
            raise FilterError(f"{script}, line {item.line}: {what}", **evidence) from error
        if key in values:
            raise FilterError(
                f"{script}, line {item.line}: {name}: {key} is there twice: leave one", line=item.line, file=script
            )
        values[key] = value
    return ScriptStep(name, values, call.line)


TEXTS = frozenset(
    "x y z r g b a q u v u0 v0 u1 v1 u2 v2 expr x_expr y_expr z_expr condselect grammar name attr_name".split()
)
"""Names of MeshLab's parameters that are formulas, conditions, grammars or names of attributes."""
NAMES = frozenset({"set_mesh_name", "set_raster_name"})
"""MeshLab's filters whose text is the name of a layer."""
READ = frozenset(
    {
        ("set_texture_per_mesh", "textname"),
        ("load_active_raster_cameras", "importfile"),
        ("compute_color_from_scalar_using_transfer_function_per_vertex", "csvfilename"),
        ("nxs_build", "input_file"),
        ("nxs_compress", "input_file"),
    }
)
"""Filters and parameters of MeshLab's that are files to read."""
TEXTURES = frozenset({"textname", "texturename"})
"""Names of MeshLab's parameters that are the file of a texture, written beside the mesh when that is saved."""
NETWORK = frozenset({"export_mesh_to_sketchfab"})
"""Filters of MeshLab's that send the mesh to a site."""


@dataclass(frozen=True)
class ScriptFiles:
    """Where a script may write and read: it writes into `work`, whose files go to `output`; it reads below the
    folders `readable`. `allow_outside` lifts both limits, `force` lets it write over files."""

    work: Path
    output: Path
    readable: tuple[Path, ...]
    allow_outside: bool = False
    force: bool = False

    def placed(self, steps: Sequence[ScriptStep], script: str, registry: Registry) -> list[ScriptStep]:
        """The steps with every file's name made absolute. FilterError with the line where one leads out of the
        folders, or would be written over a file."""
        placed = []
        for step in steps:
            try:
                if step.name in NETWORK and not self.allow_outside:
                    raise FilterError(f"{step.name} sends the mesh to a site: allow it with --allow-outside")
                given = {**_default_files(step.name, registry), **step.values}
                values = {key: self._value(step.name, key, value, registry) for key, value in given.items()}
            except FilterError as error:
                message = f"{script}, line {step.line}: {error}"
                raise FilterError(message, line=step.line, **error.evidence) from error
            placed.append(replace(step, values=values))
        return placed

    def _value(self, name: str, parameter: str, value: object, registry: Registry) -> object:
        """A value that a filter may have."""
        if not isinstance(value, str) or not value:
            return value
        if name in registry:
            kind = registry[name].parameter(parameter).kind
            if kind is Kind.SAVE_FILE:
                return str(self.to_write(value))
            if kind is Kind.OPEN_FILE or (kind is Kind.STRING and self._names_file(value)):
                return str(self.to_read(value))
            return value
        if not _is_file(name, parameter):
            return value
        if (name, parameter) in READ:
            return str(self.to_read(value))
        place = self.to_write(value)
        return value if parameter in TEXTURES else str(place)

    def _names_file(self, value: str) -> bool:
        """Whether a text of ours names a file: machine, controller and mesh are names or files."""
        try:
            there = any((folder / value).exists() for folder in (Path(), *self.readable))
        except (OSError, ValueError):
            return True
        return there or Path(value).is_absolute() or ".." in Path(value).parts

    def to_write(self, name: str) -> Path:
        """Where a file to be written goes. FilterError where it would leave the folder, or is there already."""
        place = Path(os.path.realpath(self.work / name))
        root = Path(os.path.realpath(self.work))
        inside = root in place.parents
        if not inside and not self.allow_outside:
            remedy = "give a name in it, or allow it with --allow-outside"
            raise FilterError(f"file {name!r} leads out of the folder of outputs: {remedy}", file=name)
        final = self.output / place.relative_to(root) if inside else place
        own = inside and is_own(self.output, str(final.relative_to(self.output)))
        if inside:  # a file can take its place in the folder of outputs when all filters have run
            blocked = next((folder for folder in final.parents if folder.is_file()), None)
            if leads_out(final, self.output):
                raise FilterError(f"file {name!r}: {final}: a link leads out of the folder: remove it", file=name)
            if blocked is not None:
                raise FilterError(f"file {name!r}: {blocked} is a file: give another name, or remove it", file=name)
            if final.is_dir():
                raise FilterError(f"file {name!r}: {final} is a folder: give another name, or remove it", file=name)
        if os.path.lexists(final) and not own and not self.force:
            remedy = "give another name, or write over it with --force"
            raise FilterError(f"file {name!r}: {final} exists already: {remedy}", file=name)
        if inside:
            place.parent.mkdir(parents=True, exist_ok=True)
        return place

    def to_read(self, name: str) -> Path:
        """Where a file to be read is: beside the script or an input. FilterError where it is elsewhere."""
        roots = [Path(os.path.realpath(folder)) for folder in self.readable]
        candidates = [Path(os.path.realpath(root / name)) for root in (*roots, Path())]
        for place in candidates:
            if place.exists() and (self.allow_outside or any(root in place.parents for root in roots)):
                return place
        if any(place.exists() for place in candidates):
            remedy = "put it there, or allow it with --allow-outside"
            raise FilterError(f"file {name!r} is not in the folder of the script or of an input: {remedy}", file=name)
        raise FilterError(f"file {name!r} does not exist: put it into the script's folder", file=name)


def _is_file(name: str, parameter: str) -> bool:
    """Whether the value of a parameter of one of MeshLab's filters may be the name of a file."""
    return parameter in free_texts(name) and parameter not in TEXTS and name not in NAMES


def _default_files(name: str, registry: Registry) -> dict[str, str]:
    """The files that a filter writes or reads where a script does not name them."""
    if name in registry:
        files = [item for item in registry[name].parameters if item.kind in (Kind.SAVE_FILE, Kind.OPEN_FILE)]
        return {item.name: item.default for item in files}
    return {key: value for key, value in free_texts(name).items() if _is_file(name, key)}
