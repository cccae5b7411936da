"""The files of one surface machined alone."""

from collections.abc import Callable, Sequence
from pathlib import Path

from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.orientation.surface_path import Workpiece
from bonecam.outputs.output_files import File
from bonecam.outputs.toolpath_csv import toolpath_csv
from bonecam.runtime.staging import staged
from bonecam.surface.files.iga import write_iga
from bonecam.toolpath.path import ToolPath
from bonecam.verify.pictures.surface_axes import draw_axes

SERIES = r"surface\.iga|solid\.ply|toolpath\.(csv|png)"
"""Names of the files in the kept folder, as a regular expression."""


def write_finished(
    workpiece: Workpiece, path: ToolPath, keep: File, texts: Sequence[tuple[File, Callable[[], str]]]
) -> None:
    """Write the wanted files, all or none: the `texts`, each a file with what makes its content, and the folder
    `keep` with surface.iga, solid.ply, toolpath.csv and toolpath.png. FileError names what cannot be written."""
    with staged() as staging:
        for file, content in texts:
            if file is not None:
                staging.file(file).write_text(content(), encoding="utf-8", newline="")
        if keep is not None:
            folder = staging.folder(keep, SERIES)
            write_iga(workpiece.surface, folder / "surface.iga")
            write_mesh(workpiece.solid, folder / "solid.ply")
            (folder / "toolpath.csv").write_text(toolpath_csv([path]), encoding="utf-8")
            draw_axes(path, workpiece.surface, Path(folder) / "toolpath.png")
