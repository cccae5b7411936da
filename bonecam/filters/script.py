"""Run a filter script (.mlx) on mesh files: its layers go to files of a folder, all or none."""

import re
from collections.abc import Sequence
from pathlib import Path

from bonecam.errors import FileError
from bonecam.files import check_folder, require_room, whole_folder
from bonecam.filters.filter import Registry, installed
from bonecam.filters.meshset import MeshSet
from bonecam.filters.script_steps import apply_steps, read_script
from bonecam.mesh.files.mesh_files import CAD, MESHES, READABLE, read_mesh
from bonecam.mesh.meshlab import meshlab
from bonecam.progress import Progress, silent


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
