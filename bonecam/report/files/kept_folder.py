"""The folder of `--keep`: surface, levels, tool path and pictures, to look at or to use again."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from bonecam.errors import FileError, LevelError
from bonecam.files import whole_folder, write_whole
from bonecam.job import write_job
from bonecam.levels.measure.level import Level
from bonecam.levels.measure.line_depths import LINE, line_depths, step_depths
from bonecam.machine.machine import read_machine
from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.passes.parting import cut_groove
from bonecam.report.files.kept_bodies import GIVEN
from bonecam.report.files.kept_view import SECOND_VIEW, VIEW
from bonecam.report.files.result import Morphed, Result
from bonecam.report.files.second_program import SecondProgram
from bonecam.report.page.packing import unpack
from bonecam.report.page.program_contents import NO_LEVEL
from bonecam.report.pictures.compared_axes import draw_compared_axes
from bonecam.report.pictures.depth_colours import draw_coloured, draw_error
from bonecam.report.pictures.depth_curves import draw_depths
from bonecam.report.pictures.engagement import draw_engagement
from bonecam.report.pictures.level_sections import draw_levels, draw_second, draw_stump
from bonecam.report.pictures.machine.bodies import draw_machine
from bonecam.report.pictures.tool_paths import draw_toolpath
from bonecam.report.tables.cl_text import apt_text
from bonecam.report.tables.cones_csv import cones_csv
from bonecam.report.tables.toolpath_csv import toolpath_csv
from bonecam.report.typed.run_report import report_text
from bonecam.setup.given_stock import KEPT_STOCK
from bonecam.setup.stock import Stock
from bonecam.setup.stocks.mesh import ConvexStock
from bonecam.surface.files.tspline_text import write_tsm
from bonecam.tool.path import MoveKind
from bonecam.verify.removal.result import Removal

FAILED = r"failed_level_\d{2,}\.ply"
"""Name of the file that shows where a level failed its check, as a regular expression."""
LEFT_COLOURED = 0.1
"""Leftovers are coloured from 0 to this height, mm."""
SERIES = (
    r"level_\d{2,}\.ply|given\.ply|left\.ply|error\.(ply|png)|solid\.ply|surface\.(tspline|iga)|toolpath\.(csv|apt|png)|program\.\w+"
    rf"|second(_view)?\.\w+|cones\.csv|engagement\.png|axes\.(png|md)|machine\.png|stump\.png|view\.gz|job\.toml|stock\.ply|refused\.(txt|png)|report\.json|{FAILED}"
)
"""Names of the files of levels, surfaces, paths and program, as a regular expression. A later run in the same folder
removes those that an earlier one wrote there."""


def fill_kept_folder(work: Path, made: Morphed, post: tuple[float, float]) -> None:
    """Write into `work` surface.tspline, given.ply, the files of `keep_levels`, view.gz, job.toml and report.json; of a
    program its text, toolpath.csv, toolpath.apt, toolpath.png, machine.png, stump.png, second.* if there is a second
    clamping, cones.csv if axes are chosen in cones, axes.png and axes.md of the part if levels are cut, left.ply and
    engagement.png where it was simulated, and error.ply and error.png where it was asked what bends. `post` is
    (diameter, top z), mm."""
    levels = made.levels.levels
    write_tsm(made.surface, work / "surface.tspline")
    write_mesh(made.part.placed_given, work / GIVEN)
    keep_into(work, levels, made.stock, post)
    (work / VIEW).write_bytes(made.packed_view)
    keep_job(work, made)
    axes = {}
    if isinstance(made, Result):
        write_whole(work / f"program{made.program.extension}", made.program.text)
        write_whole(work / "toolpath.csv", toolpath_csv(made.paths))
        write_whole(work / "toolpath.apt", apt_text(made.paths, made.program.name))
        if any(path.cones for path in made.paths):
            write_whole(work / "cones.csv", cones_csv(made.paths))
        if made.job.path.strategy == "morph":
            compared = made.compare_axes()
            draw_compared_axes(compared, levels[0].mesh, work / "axes.png")
            write_whole(work / "axes.md", compared.table)
            axes = {"axes": compared.report}
        draw_toolpath(made.paths, levels, work / "toolpath.png", post)
        if made.second is not None:
            _write_second(work, made.second)
        machine = read_machine(made.job.nc.machine)
        draw_stump(levels[0].mesh, post, cut_groove(made.paths), work / "stump.png")
        draw_machine(made.paths, levels[0].mesh, made.job.holding, machine, work / "machine.png")
        write_simulated(work, made.removal)
        if made.removal and made.removal.left:
            _draw_engagement(made, work / "engagement.png")
    write_whole(work / "report.json", report_text({**made.report, **axes}))


def keep_job(work: Path, made: Morphed) -> None:
    """Write the job as job.toml, beside it the body of a stock that no file of the job tells."""
    beside = {}
    if isinstance(made.stock, ConvexStock) and made.job.stock.kind == made.stock.kind and not made.job.stock.mesh:
        write_mesh(made.stock.surface, work / KEPT_STOCK)
        beside = {"stock": {"mesh": KEPT_STOCK}}
    write_whole(work / "job.toml", write_job(made.job, beside))


def write_simulated(work: Path, removal: Removal | None) -> None:
    """Write what a removal leaves on the part as left.ply, and the error that bending leaves as error.ply and
    error.png, as far as these are known."""
    if removal and removal.left:
        left = removal.left
        write_mesh(left.mesh, work / "left.ply", quality=left.heights, largest=LEFT_COLOURED)
    if removal and removal.mechanics and removal.mechanics.error:
        error = removal.mechanics.error
        write_mesh(error.mesh, work / "error.ply", quality=error.sizes, largest=error.p99)
        draw_error(error, work / "error.png")


def _write_second(work: Path, second: SecondProgram) -> None:
    """The second clamping: its program and cutter location data, part and shell as they stand, its page and its
    picture."""
    write_whole(work / f"second{second.program.extension}", second.program.text)
    write_whole(work / "second.apt", second.apt)
    (work / SECOND_VIEW).write_bytes(second.packed_view)
    write_mesh(second.clamping.solids, work / "second.ply")
    draw_second(second.clamping, second.paths, work / "second.png")


def _draw_engagement(result: Result, file: Path) -> None:
    """The picture of the moves on levels that the page plays."""
    view = unpack(result.packed_view, VIEW)
    moves = view.arrays
    radius_of = {tool["number"]: tool["radius"] for tool in view.facts["tools"]}
    radii = np.array([radius_of[number] for number in moves["move_tool"].tolist()])
    draw_engagement(
        result.levels.levels,
        moves["move_level"],
        contacts=moves["move_contact"],
        outward=moves["move_tip"] + radii[:, None] * moves["move_axis"] - moves["move_contact"],
        sections=moves["move_section"],
        cuts=(moves["move_kind"] == MoveKind.CUT) & (moves["move_level"] < NO_LEVEL),
        path=file,
    )


def keep_levels(
    folder: str | Path,
    levels: Sequence[Level],
    stock: Stock | None = None,
    post: tuple[float, float] | None = None,
    line: float = LINE,
) -> None:
    """Write the levels as level_00.ply (the part), level_01.ply, ..., and levels.png, coloured.png,
    depths.png.

    The depth of the cut (mm) is the quality of the vertices and their colour, on one scale for all levels.
    `stock` is None for open levels; `post` is (diameter, top z), mm; `line` is the parameter s of the line
    along which depths.png shows the depths. All files are written or none; levels and paths of an earlier run
    are removed.
    """
    with whole_folder(folder, SERIES) as work:
        keep_into(work, levels, stock, post, line)


def keep_into(
    work: Path, levels: Sequence[Level], stock: Stock | None, post: tuple[float, float] | None, line: float = LINE
) -> None:
    """Write the files of `keep_levels` into the folder `work`."""
    deepest = max(level.limit for level in levels)
    for level, depth in zip(levels, step_depths(levels), strict=True):
        write_mesh(level.mesh, work / f"level_{level.index:02d}.ply", quality=depth, largest=deepest)
    draw_levels(levels, post, work / "levels.png")
    draw_coloured(levels, work / "coloured.png")
    draw_depths(levels, line_depths(levels, stock, line), work / "depths.png", line)


@contextmanager
def keep_failed_level(folder: str | Path | None) -> Iterator[None]:
    """Where the block raises a LevelError with a patch of the level, write the patch as failed_level_NN.ply.

    The error then names the file, or why it cannot be written. Nothing is written where `folder` is None.
    """
    try:
        yield
    except LevelError as error:
        patch = error.evidence.get("patch")
        if folder is None or not isinstance(patch, TriangleMesh):
            raise
        name = f"failed_level_{error.evidence['level']:02d}.ply"
        try:
            with whole_folder(folder, FAILED) as work:
                write_mesh(patch, work / name)
        except FileError as trouble:
            raise LevelError(f"{error} ({trouble})", **error.evidence) from error
        file = Path(folder) / name
        raise LevelError(f"{error} ({file} shows it)", **error.evidence, file=str(file)) from error
