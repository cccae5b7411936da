"""Run a filter script (.mlx) on mesh files: its layers go to files of a folder, all or none."""

import os
import re
from collections.abc import Sequence
from pathlib import Path

from bonecam.errors import FileError
from bonecam.files import check_folder, require_name, require_room, whole_folder
from bonecam.filters.filter import Registry, installed
from bonecam.filters.meshset import MeshSet
from bonecam.filters.script_files import ScriptFiles
from bonecam.filters.script_steps import apply_steps, read_script
from bonecam.mesh.files.mesh_files import CAD, READABLE, bytes_of, read_mesh
from bonecam.mesh.files.named_files import refuse_names_outside
from bonecam.mesh.meshlab import meshlab
from bonecam.progress import Progress, silent

NOTHING_STALE = "(?!)"
"""A regular expression of no name: layers of earlier runs stay."""

NAMING = frozenset(".3ds .3mf .ctm .dae .fbx .glb .gltf .qobj .vmi .wrl .x3d .x3dv".split())
"""Endings of files, besides PLY and OBJ, that MeshLab reads and that name others: textures, buffers, parts."""


def run_script(
    script: str | Path,
    inputs: Sequence[str | Path],
    output_dir: str | Path,
    progress: Progress = silent,
    registry: Registry | None = None,
    *,
    allow_outside: bool = False,
    force: bool = False,
) -> list[Path]:
    """Load `inputs` as layers, run `script`, write every layer into `output_dir`; the files written, in the
    order of their names.

    Layers go to PLY, lines without faces to OBJ; files that filters write go there too. All of them are written
    or none. A script that writes outside `output_dir`, or reads what is not beside it or an input, is refused
    unless `allow_outside`; files that are there, and were not written by an earlier run, are written over with
    `force` only. Raises FileError (a file), FilterError (the script, with its line) or
    what a stage raises, with the line.
    """
    known = installed() if registry is None else registry
    steps = read_script(script, known)
    check_folder(output_dir)
    target = Path(os.path.realpath(output_dir))
    readable = tuple(Path(file).absolute().parent for file in (script, *inputs))
    with whole_folder(output_dir, own=NOTHING_STALE, replace=force) as folder:
        files = ScriptFiles(folder, target, readable, allow_outside, force)
        steps = files.placed(steps, str(script), known)
        meshes = MeshSet(registry=known, folder=folder)
        for file in inputs:
            require_name(file)
            if not allow_outside:
                _refuse_outside(Path(file), readable)
            load(meshes, file)
        apply_steps(meshes, steps, str(script), progress)
        save_layers(meshes, folder)
        names = sorted(str(item.relative_to(folder)) for item in folder.rglob("*") if item.is_file())
    return [Path(output_dir) / name for name in names]


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
        meshes.add_mesh(meshlab().Mesh(mesh.vertices, mesh.faces), Path(file).name)
        return
    meshes.load_new_mesh(str(file))


def _refuse_outside(file: Path, readable: Sequence[Path]) -> None:
    """FileError where an input names files in other folders, or may do so in ways that are not known."""
    if file.suffix.lower() in NAMING:
        what = "may name files anywhere: give a PLY, OBJ, STL or OFF, or allow it with --allow-outside"
        raise FileError(f"{file}: files of this kind {what}", file=str(file))
    refuse_names_outside(file, bytes_of(file), readable)


def save_layers(meshes: MeshSet, folder: Path) -> None:
    """Write every layer under a name made of its label; a name that is there already gets a number."""
    for key in sorted(meshes.layers.keys()):
        meshes.set_current_mesh(key)
        layer = meshes.current_mesh()
        lines = layer.edge_number() > 0 and layer.face_number() == 0
        file = _free_name(folder, layer.label(), ".obj" if lines else ".ply")
        try:
            meshes.save_current_mesh(str(file))
        except meshlab().PyMeshLabException as error:
            what = f"{file}: cannot be written (is the disk full?): make room there or choose another folder"
            raise FileError(what, file=str(file)) from error
        require_room(file)


def _free_name(folder: Path, label: str, ending: str) -> Path:
    stem = label[: -len(Path(label).suffix)] if Path(label).suffix.lower() in READABLE else label
    stem = re.sub(r"[^\w.-]+", "_", stem).strip("._") or "layer"
    number, name = 1, stem
    while (folder / f"{name}{ending}").exists():
        number += 1
        name = f"{stem}_{number}"
    return folder / f"{name}{ending}"
