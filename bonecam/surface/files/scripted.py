"""A filter script (.mlx) that a part's mesh goes through before anything else."""

from bonecam.errors import FilterError, counted
from bonecam.filters.scripts.run_script import run_script
from bonecam.mesh.files.mesh_files import read_mesh, write_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.runtime.temporary import temporary_folder


def scripted_mesh(mesh: TriangleMesh, script: str) -> TriangleMesh:
    """What a script leaves of a mesh.

    FilterError where it leaves more or less than one layer with faces, or what `run_script` raises.
    """
    with temporary_folder() as folder:
        write_mesh(mesh, folder / "mesh.ply")
        layers = map(read_mesh, run_script(script, [folder / "mesh.ply"], folder / "layers"))
        meshes = [layer for layer in layers if len(layer.faces)]
    if len(meshes) != 1:
        what = f"leaves {counted(len(meshes), 'layer')} with faces"
        raise FilterError(f"{script}: {what}: let it end with the part's mesh alone", file=script)
    return meshes[0]
