"""What a filter script (.mlx) does in its process: load meshes as layers, apply filters, write the layers."""

import re
from itertools import chain, count
from pathlib import Path

from bonecam_plugins.meshlab.filter import Registry, installed
from bonecam_plugins.meshlab.guards import refuse_names_outside
from bonecam_plugins.meshlab.meshset import MeshSet
from bonecam_plugins.meshlab.scripting import Run
from bonecam_plugins.meshlab.scripts import ScriptFiles, apply_steps, read_script

from bonecam.errors import FileError
from bonecam.files import in_unicode, library_name, require_room
from bonecam.mesh.files.mesh_files import CAD, READABLE, bytes_of, read_mesh
from bonecam.mesh.meshlab import meshlab
from bonecam.progress import Progress, silent

NAMING = frozenset(".3ds .3mf .ctm .dae .fbx .glb .gltf .qobj .vmi .wrl .x3d .x3dv".split())
"""Endings of files, besides PLY and OBJ, that MeshLab reads and that name others: textures, buffers, parts."""


def apply_run(run: Run, registry: Registry | None, progress: Progress) -> None:
    """Run a script on its inputs in this process, and write every layer into its folder under a name made of its label.

    FileError where an input names files in other folders, or may do so in ways that are not known.
    """
    known = installed() if registry is None else registry
    steps = read_script(run.script, known)
    readable = tuple(Path(file).absolute().parent for file in (run.script, *run.inputs))
    files = ScriptFiles(run.folder, run.target, readable, run.allow_outside, run.force)
    steps = files.placed(steps, run.script, known)
    # what its inputs name is held against `readable` here
    meshes = MeshSet(registry=known, folder=run.folder, allow_outside=True)
    for file in map(Path, run.inputs):
        if not run.allow_outside:
            if file.suffix.lower() in NAMING:
                what = "may name files anywhere: give a PLY, OBJ, STL or OFF, or allow it with --allow-outside"
                raise FileError(f"{file}: files of this kind {what}", file=str(file))
            where = "is not in the folder of the script or of an input"
            remedy = f"{where}: put it there, or allow it with --allow-outside"
            refuse_names_outside(file, bytes_of(file), readable, remedy)
        load(meshes, file)
    apply_steps(meshes, steps, run.script, progress)
    for key in sorted(meshes.layers.keys()):
        meshes.set_current_mesh(key)
        layer = meshes.current_mesh()
        lines = layer.edge_number() > 0 and layer.face_number() == 0
        # a name made of the label; one that is there already gets a number
        label, ending = layer.label(), ".obj" if lines else ".ply"
        stem = label[: -len(Path(label).suffix)] if Path(label).suffix.lower() in READABLE else label
        stem = re.sub(r"[^\w.-]+", "_", stem).strip("._") or "layer"
        names = chain([stem], (f"{stem}_{number}" for number in count(2)))
        places = (run.folder / f"{name}{ending}" for name in names)
        target = next(place for place in places if not place.exists())
        try:
            with library_name(target.parent) as place:
                meshes.save_current_mesh(str(Path(place) / target.name))
        except meshlab().PyMeshLabException as error:
            what = f"{target}: cannot be written (is the disk full?): make room there or choose another folder"
            raise FileError(what, file=str(target)) from error
        require_room(target)


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
