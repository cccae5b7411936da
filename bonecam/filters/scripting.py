"""Run a filter script (.mlx) on mesh files: its layers go to files of a folder, all or none.

A script may ask for more time and memory than there is, and some of MeshLab's filters end their process. It works
in a process of its own, with limits.

What a filter script (.mlx) does in its process: load meshes as layers, apply filters, write the layers.
"""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bonecam.errors import FileError, FilterError
from bonecam.files import check_folder, in_unicode, library_name, require_name, require_room, whole_folder
from bonecam.filters.filter import Registry, installed
from bonecam.filters.meshset import MeshSet
from bonecam.filters.scripts import ScriptFiles, apply_steps, read_script
from bonecam.mesh.files.mesh_files import CAD, READABLE, bytes_of, read_mesh, refuse_names_outside
from bonecam.mesh.meshlab import meshlab
from bonecam.progress import Progress, silent
from bonecam.runtime.worker import WorkerError, call_in_worker, function_of

NOTHING_STALE = "(?!)"
"""A regular expression of no name: layers of earlier runs stay."""

WORK = "bonecam.filters.scripting:apply_run"
"""The function that does the work."""
STEP = r"^line (\d+): (\w+)$"
"""A regular expression of the message with which each filter of a script begins."""
SECONDS = 900.0
"""Time that a script has, s: several times what all of the chain takes for a bone."""
MEMORY = 4.0
"""Memory that a script has for its data, GB: ten times what MeshLab takes for a million faces."""
MOST_SECONDS = 1e6
"""Most time that may be given, s: eleven days. Systems count waits in ms, with 31 bits."""
MOST_MEMORY = 1e6
"""Most memory that may be given, GB. Systems count it in bytes, with 63 bits."""


def run_script(
    script: str | Path,
    inputs: Sequence[str | Path],
    output_dir: str | Path,
    progress: Progress = silent,
    registry: Any = None,
    *,
    allow_outside: bool = False,
    force: bool = False,
    seconds: float = SECONDS,
    memory: float = MEMORY,
) -> list[Path]:
    """Load `inputs` as layers, run `script`, write every layer into `output_dir`; the files written, in the
    order of their names.

    Layers go to PLY, lines without faces to OBJ; files that filters write go there too. All of them are written
    or none. A script that writes outside `output_dir`, or reads what is not beside it or an input, is refused
    unless `allow_outside`; files that are there, and were not written by an earlier run, are written over with
    `force` only.

    The script works in a process of its own, which has `seconds` for all of it and `memory` (GB) for its data;
    with the filters of a `registry` (filters.Registry) it works in this one, without limits. Raises FileError (a
    file), FilterError (the script, with its line, or what its process did) or what a stage raises, with the line;
    ValueError where a limit is not above 0, or above MOST_SECONDS or MOST_MEMORY.
    """
    for name, limit, most in (("seconds", seconds, MOST_SECONDS), ("memory", memory, MOST_MEMORY)):
        if not 0 < limit <= most:
            raise ValueError(f"{name} = {limit!r}: give a number above 0, at most {most:,.0f}")
    for file in inputs:
        require_name(file)
    check_folder(output_dir)
    target = Path(os.path.realpath(output_dir))
    with whole_folder(output_dir, own=NOTHING_STALE, replace=force) as folder:
        run = Run(
            str(script), tuple(map(str, inputs)), folder=folder, target=target, allow_outside=allow_outside, force=force
        )
        if registry is None:
            _work_in_child(run, progress, seconds, memory)
        else:
            function_of(WORK)(run, registry, progress)
        names = sorted(str(item.relative_to(folder)) for item in folder.rglob("*") if item.is_file())
    return [Path(output_dir) / name for name in names]


@dataclass(frozen=True)
class Run:
    """A run of a script: its file, the meshes that it works on, the folder that it writes into, the one where that
    goes, and what it may do."""

    script: str
    inputs: tuple[str, ...]
    folder: Path
    target: Path
    allow_outside: bool
    force: bool


def _work_in_child(run: Run, progress: Progress, seconds: float, memory: float) -> None:
    """A run in a process of its own; FilterError names the last filter and its line where that broke down or hit a
    limit."""
    steps: list[re.Match[str]] = []

    def noted(fraction: float, message: str) -> bool | None:
        steps.extend(re.finditer(STEP, message))
        return progress(fraction, message)

    try:
        call_in_worker(WORK, run, None, seconds=seconds, memory=int(memory * 2**30), progress=noted, heard=True)
    except WorkerError as error:
        remedy = "leave it out, give it less to do, or allow more with --time-limit and --memory-limit"
        if not steps:
            raise FilterError(f"{run.script}: its beginning: {error}: {remedy}") from error
        line, name = steps[-1].groups()
        message = f"{run.script}, line {line}: {name}: {error}: {remedy}"
        raise FilterError(message, filter=name, line=int(line)) from error


NAMING = frozenset(".3ds .3mf .ctm .dae .fbx .glb .gltf .qobj .vmi .wrl .x3d .x3dv".split())
"""Endings of files, besides PLY and OBJ, that MeshLab reads and that name others: textures, buffers, parts."""


def apply_run(run: Run, registry: Registry | None, progress: Progress) -> None:
    """Run a script on its inputs in this process, and write all layers into its folder."""
    known = installed() if registry is None else registry
    steps = read_script(run.script, known)
    readable = tuple(Path(file).absolute().parent for file in (run.script, *run.inputs))
    files = ScriptFiles(run.folder, run.target, readable, run.allow_outside, run.force)
    steps = files.placed(steps, run.script, known)
    # what its inputs name is held against `readable` here
    meshes = MeshSet(registry=known, folder=run.folder, allow_outside=True)
    for file in run.inputs:
        if not run.allow_outside:
            _refuse_outside(Path(file), readable)
        load(meshes, file)
    apply_steps(meshes, steps, run.script, progress)
    save_layers(meshes, run.folder)


def apply_script(meshes: MeshSet, script: str | Path, progress: Progress = silent) -> None:
    """Run a script on the layers of `meshes`; FilterError with the line, before anything ran, where it is
    wrong."""
    steps = meshes.placed(read_script(script, meshes.registry), str(script))
    apply_steps(meshes, steps, str(script), progress)


def load(meshes: MeshSet, file: str | Path) -> None:
    """Load a mesh file as a layer, as it stands in the file; a CAD part as its triangles, in mm. FileError
    names what is wrong with it."""
    if Path(file).suffix.lower() in CAD:
        mesh = read_mesh(file)
        meshes.add_mesh(meshlab().Mesh(mesh.vertices, mesh.faces), in_unicode(Path(file).name))
        return
    meshes.load_new_mesh(str(file))


def _refuse_outside(file: Path, readable: Sequence[Path]) -> None:
    """FileError where an input names files in other folders, or may do so in ways that are not known."""
    if file.suffix.lower() in NAMING:
        what = "may name files anywhere: give a PLY, OBJ, STL or OFF, or allow it with --allow-outside"
        raise FileError(f"{file}: files of this kind {what}", file=str(file))
    where = "is not in the folder of the script or of an input"
    remedy = f"{where}: put it there, or allow it with --allow-outside"
    refuse_names_outside(file, bytes_of(file), readable, remedy)


def save_layers(meshes: MeshSet, folder: Path) -> None:
    """Write every layer under a name made of its label; a name that is there already gets a number."""
    for key in sorted(meshes.layers.keys()):
        meshes.set_current_mesh(key)
        layer = meshes.current_mesh()
        lines = layer.edge_number() > 0 and layer.face_number() == 0
        file = _free_name(folder, layer.label(), ".obj" if lines else ".ply")
        try:
            with library_name(file.parent) as place:
                meshes.save_current_mesh(str(Path(place) / file.name))
        except meshlab().PyMeshLabException as error:
            what = f"{file}: cannot be written (is the disk full?): make room there or choose another folder"
            raise FileError(what, file=str(file)) from error
        require_room(file)


def _free_name(folder: Path, label: str, ending: str) -> Path:
    stem = label[: -len(Path(label).suffix)] if Path(label).suffix.lower() in READABLE else label
    stem = re.sub(r"[^\w.-]+", "_", stem).strip("._") or "layer"
    number = 1
    name = stem
    while (folder / f"{name}{ending}").exists():
        number += 1
        name = f"{stem}_{number}"
    return folder / f"{name}{ending}"
