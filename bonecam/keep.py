"""What `--keep DIR` writes for a person to look at or reuse."""

import csv
import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from bonecam.errors import LevelError
from bonecam.files import whole_folder, write_whole
from bonecam.levels.measure.level import Level
from bonecam.levels.measure.line_depths import LINE, line_depths, step_depths
from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock
from bonecam.surface.files.tspline_text import write_tsm
from bonecam.surface.tspline import TSpline
from bonecam.toolpath.path import Kind, ToolPath
from bonecam.verify.pictures import draw_coloured, draw_depths, draw_levels, draw_toolpath

COLUMNS = (
    "level,pass,index,contact_x,contact_y,contact_z,tip_x,tip_y,tip_z,axis_x,axis_y,axis_z,kind,feed".split(
        ","
    )
)
FAILED = r"failed_level_\d{2,}\.ply"
SERIES = rf"level_\d{{2,}}\.ply|toolpath\.(csv|png)|{FAILED}"
"""Names of the files that an earlier run may have left, of other levels than these and paths on them."""


def keep(
    folder: str | Path,
    surface: TSpline,
    levels: Sequence[Level],
    stock: Stock,
    paths: Sequence[ToolPath],
    post: tuple[float, float],
) -> None:
    """Write surface.tspline, what `keep_levels` writes, and where there are paths toolpath.csv and
    toolpath.png; all of them or none.

    Levels and paths of an earlier run are removed. `post` is (diameter, top z) in mm.
    """
    with whole_folder(folder, SERIES) as work:
        write_tsm(surface, work / "surface.tspline")
        _write_levels(work, levels, stock, post, LINE)
        if paths:
            write_whole(work / "toolpath.csv", toolpath_csv(paths))
            draw_toolpath(paths, levels, work / "toolpath.png", post)


def keep_levels(
    folder: str | Path,
    levels: Sequence[Level],
    stock: Stock | None = None,
    post: tuple[float, float] | None = None,
    line: float = LINE,
) -> None:
    """Write level_00.ply (the part) ..., levels.png, coloured.png and depths.png of levels in a stock (open
    ones: None); all or none.

    The levels' vertices carry the depth of their cut (mm) as quality and colour (all on one scale). `post` is
    (diameter, top z) in mm, `line` the parameter s of the line that depths.png shows. Levels and paths of an
    earlier run are removed.
    """
    with whole_folder(folder, SERIES) as work:
        _write_levels(work, levels, stock, post, line)


def _write_levels(
    work: Path, levels: Sequence[Level], stock: Stock | None, post: tuple[float, float] | None, line: float
) -> None:
    deepest = max(level.limit for level in levels)
    for level, depth in zip(levels, step_depths(levels), strict=True):
        write_mesh(level.mesh, work / f"level_{level.index:02d}.ply", quality=depth, largest=deepest)
    draw_levels(levels, post, work / "levels.png")
    draw_coloured(levels, work / "coloured.png")
    draw_depths(levels, line_depths(levels, stock, line), work / "depths.png", line)


@contextmanager
def failed_level_kept(folder: str | Path | None) -> Iterator[None]:
    """Where a level fails its check inside the block, write the patch it failed on as failed_level_NN.ply;
    the error names the file."""
    try:
        yield
    except LevelError as error:
        patch = error.evidence.get("patch")
        if folder is None or not isinstance(patch, TriangleMesh):
            raise
        name = f"failed_level_{error.evidence['level']:02d}.ply"
        with whole_folder(folder, FAILED) as work:
            write_mesh(patch, work / name)
        file = Path(folder) / name
        raise LevelError(f"{error} ({file} shows it)", **error.evidence, file=str(file)) from error


def toolpath_csv(paths: Sequence[ToolPath]) -> str:
    """One line a point in machining order; mm, unit axes, mm/min; contacts are empty on links and rapids."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for path in paths:
        for i in range(len(path.tips)):
            cut = path.kinds[i] == Kind.CUT
            contact = [f"{value:.6f}" for value in path.contacts[i]] if cut else ["", "", ""]
            tip, axis = (
                [f"{value:.{digits}f}" for value in row]
                for row, digits in ((path.tips[i], 6), (path.axes[i], 9))
            )
            kind = Kind(path.kinds[i]).name.lower()
            writer.writerow(
                [path.level, path.pass_index[i], i, *contact, *tip, *axis, kind, f"{path.feed_rates[i]:.1f}"]
            )
    return text.getvalue()
