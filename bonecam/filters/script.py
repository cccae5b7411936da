"""Filter scripts (.mlx) in which MeshLab's filters and ours stand side by side.

A script is checked whole before anything runs: every filter and parameter must be known and every value well
formed, or the error names the line. Names are MeshLab's shown ones, our display names, or Python's. MeshLab's
own filters are then applied one at a time through pymeshlab with values converted by their type; where a
script leaves a parameter out its default holds. Lengths are numbers of mm (MeshLab saves percentages that
way), or a percentage written `3%`.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bonecam.errors import BonecamError, FileError, FilterError
from bonecam.files import check_folder, whole_folder
from bonecam.filters import meshlab_names
from bonecam.filters.filter import Registry, installed
from bonecam.filters.meshlab_values import checked_value
from bonecam.filters.meshset import MeshSet, known_to_meshlab
from bonecam.filters.mlx import FilterCall, ScriptParameter, read_calls
from bonecam.mesh.files.mesh_files import CAD, MESHES, READABLE, read_mesh
from bonecam.mesh.meshlab import meshlab
from bonecam.progress import Progress, part, report, silent


@dataclass(frozen=True)
class Step:
    """One filter of a checked script: Python's name and values, and its line."""

    name: str
    values: Mapping[str, Any]
    line: int


def run_script(
    script: str | Path,
    inputs: Sequence[str | Path],
    output_dir: str | Path,
    progress: Progress = silent,
    registry: Registry | None = None,
) -> list[Path]:
    """Load `inputs` as layers, run `script`, write every layer into `output_dir`; the files written, in the
    order of the layers.

    Layers go to PLY, lines without faces to OBJ; files that filters write by a relative name go there too.
    All of them are written or none. Raises FileError (a file), FilterError (the script, with its line) or
    what a stage raises, with the line.
    """
    known = installed() if registry is None else registry
    steps = read_script(script, known)
    check_folder(output_dir)
    with whole_folder(output_dir) as folder:
        meshes = MeshSet(registry=known, folder=folder)
        for file in inputs:
            load(meshes, file)
        apply_steps(meshes, steps, str(script), progress)
        save_layers(meshes, folder)
        names = sorted(item.name for item in folder.iterdir())
    return [Path(output_dir) / name for name in names]


def apply_script(meshes: MeshSet, script: str | Path, progress: Progress = silent) -> None:
    """Run a script on the layers of `meshes`; FilterError with the line, before anything ran, where it is
    wrong."""
    apply_steps(meshes, read_script(script, meshes.registry), str(script), progress)


def read_script(script: str | Path, registry: Registry) -> list[Step]:
    """The checked steps of a script. FileError or FilterError with the line of what is wrong."""
    return [_step(call, str(script), registry) for call in read_calls(script)]


def apply_steps(meshes: MeshSet, steps: Sequence[Step], script: str, progress: Progress = silent) -> None:
    """Apply steps in their order; an error keeps its kind and gains the line."""
    before = meshes.progress
    try:
        for index, step in enumerate(steps):
            report(progress, index / len(steps), step.name)
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


def load(meshes: MeshSet, file: str | Path) -> None:
    """Load a mesh file as a layer, as it stands in the file; a CAD part as its triangles, in mm. FileError
    names what is wrong with it."""
    ending = Path(file).suffix.lower()
    if ending in CAD:
        mesh = read_mesh(file)
        meshes.add_mesh(meshlab().Mesh(mesh.vertices, mesh.faces), Path(file).name)
        return
    if ending in MESHES or Path(file).is_dir():
        read_mesh(file)
    try:
        meshes.load_new_mesh(str(file))
    except meshlab().PyMeshLabException as error:
        raise FileError(
            f"{file}: {' '.join(str(error).split()).rstrip(':')}: give a readable mesh file", file=str(file)
        ) from error


def save_layers(meshes: MeshSet, folder: Path) -> None:
    """Write every layer under a name made of its label; a name that is there already gets a number."""
    for key in sorted(meshes.layers.keys()):
        meshes.set_current_mesh(key)
        layer = meshes.current_mesh()
        lines = layer.edge_number() > 0 and layer.face_number() == 0
        meshes.save_current_mesh(str(_free_name(folder, layer.label(), ".obj" if lines else ".ply")))


def _free_name(folder: Path, label: str, ending: str) -> Path:
    stem = label[: -len(Path(label).suffix)] if Path(label).suffix.lower() in READABLE else label
    stem = re.sub(r"[^\w.-]+", "_", stem).strip("._") or "layer"
    number, name = 1, stem
    while (folder / f"{name}{ending}").exists():
        number += 1
        name = f"{stem}_{number}"
    return folder / f"{name}{ending}"


def _step(call: FilterCall, script: str, registry: Registry) -> Step:
    name = registry[call.name].name if call.name in registry else meshlab_names.python_name(call.name)
    if name not in registry and name not in known_to_meshlab():
        raise FilterError(
            f"{script}, line {call.line}: there is no filter {call.name!r}: `bonecam filters` and MeshLab list them",
            line=call.line, file=script, filter=call.name,
        )  # fmt: skip
    values: dict[str, Any] = {}
    for item in call.parameters:
        try:
            key, value = _ours(item, name, registry) if name in registry else checked_value(name, item)
        except FilterError as error:
            evidence = {**error.evidence, "line": item.line, "file": script}
            raise FilterError(
                f"{script}, line {item.line}: {_with_name(name, str(error))}", **evidence
            ) from error
        if key in values:
            raise FilterError(
                f"{script}, line {item.line}: {name}: {key} is there twice: leave one",
                line=item.line,
                file=script,
            )
        values[key] = value
    return Step(name, values, call.line)


def _ours(item: ScriptParameter, name: str, registry: Registry) -> tuple[str, Any]:
    known = registry[name].parameter(item.name)
    if "value" not in item.attributes:
        raise FilterError(f"parameter {known.name} has no value: add value=", parameter=known.name)
    return known.name, known.read(item.attributes["value"])


def _with_name(name: str, message: str) -> str:
    return message if message.startswith(name) else f"{name}: {message}"
