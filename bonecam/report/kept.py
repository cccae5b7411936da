"""What a run hands back, its page in the browser, and the folder of `--keep`: surface, levels, tool path and pictures,
to look at or to use again.

Results show themselves as a page, which a notebook shows beside their summary. A kept folder gives that page again,
and part, stock and the mesh as given for another look at its program.
"""

import base64
import html
import json
import re
import webbrowser
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any

import numpy as np

from bonecam.errors import BonecamError, FileError, LevelError, ProgramError, file_error
from bonecam.files import check_files, input_bytes, input_text, second_file, whole_folder, write_whole
from bonecam.job import Job, LevelsJob, StockJob, read_job, write_job
from bonecam.levels.measure import LINE, Level, line_depths, step_depths
from bonecam.levels.sequences import Morph
from bonecam.machine.machine import read_machine
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.files.mesh_files import read_mesh, write_mesh
from bonecam.mesh.part import Part
from bonecam.mesh.smooth_surface import convex_hull
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.motions import zero_height_of
from bonecam.nc.path_words import machine_limits
from bonecam.nc.probing import Probing
from bonecam.nc.program import Program
from bonecam.planning.collision import level_scene
from bonecam.planning.stump import cut_groove
from bonecam.plugins import reader_endings
from bonecam.report.machine_picture import draw_machine
from bonecam.report.page.contents import NO_LEVEL, Contents, pack, run_contents, second_contents, unpack
from bonecam.report.page.page import page_html
from bonecam.report.pictures import (
    draw_coloured,
    draw_compared_axes,
    draw_depths,
    draw_engagement,
    draw_error,
    draw_levels,
    draw_second,
    draw_stump,
    draw_toolpath,
)
from bonecam.report.sheet.setup_sheet import second_article, setup_article, setup_sheet
from bonecam.report.summary import AxisComparison, compare_axes, second_text, summary_of
from bonecam.report.tables import apt_text, cones_csv, toolpath_csv
from bonecam.report.typed import Report, SecondFigures, report_text
from bonecam.runtime.own_files import is_own
from bonecam.runtime.staging import staged
from bonecam.setup.placement import KEPT_STOCK
from bonecam.setup.stock import LyingPart, Stock, schedule_of, stock_round
from bonecam.setup.stocks.mesh import ConvexStock
from bonecam.surface.files.tspline_text import save_surface
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.verify.control import header_of
from bonecam.verify.findings import GivenSurface, NotJudged, Removal, allowed_depth
from bonecam.workholding.post import post_below
from bonecam.workholding.shell import SecondClamping

PAGES = (".html", ".htm")
"""Endings of pages."""
VIEW = "view.gz"
"""The file of a kept folder with all that the page shows."""
SECOND_VIEW = "second_view.gz"
"""That of its second clamping."""


def view(keep: str | Path, file: str | Path) -> Path:
    """Write the page of the run whose files are in the folder `keep`, and that of its second clamping beside it, if it
    has one (bone.second.html beside bone.html); returns the name of the first.

    FileError where the folder holds no run, one of another version or damaged files, or a page cannot be written.
    """
    pages = kept_pages(keep, file)
    check_files(pages)
    check_page_name(file)
    views = [kept_contents(Path(keep), name) for name in (VIEW, SECOND_VIEW)[: len(pages)]]
    with staged() as staging:
        for page, (packed, contents) in zip(pages, views, strict=True):
            staging.write(page, page_html(packed, str(contents.facts["name"])))
    return Path(file)


def kept_pages(keep: str | Path, file: str | Path) -> list[Path]:
    """The pages that `view` writes."""
    return [Path(file), *([second_file(file)] if (Path(keep) / SECOND_VIEW).exists() else [])]


def check_page_name(file: str | Path) -> None:
    """FileError where the name of a page has no ending of one."""
    if Path(file).suffix.lower() not in PAGES:
        raise file_error(file, "a page ends in .html", f"name it {Path(file).name}.html")


def kept_contents(keep: Path, name: str = VIEW) -> tuple[bytes, Contents]:
    """What the page of a kept run shows, packed and unpacked, from the file `name`; FileError where it is not there or
    damaged."""
    path = keep / name
    try:
        packed = input_bytes(path)
    except OSError as error:
        trouble = "is no folder" if not keep.is_dir() else f"{name} cannot be read ({error.strerror})"
        remedy = "give the folder of `--keep` or `levels -o`, made by this version"
        raise FileError(f"{keep}: {trouble}: {remedy}", file=str(path)) from error
    contents = unpack(packed, str(path))
    try:
        names = [name for level in contents.facts["levels"] for name in (f"level_{level['index']}", level["faces"])]
        whole = bool(contents.facts["name"]) and contents.arrays.keys() >= set(names)
    except (KeyError, TypeError):
        whole = False
    if not whole:
        raise file_error(path, "is damaged", "make it again with --keep")
    return packed, contents


INLINE = 30_000_000
"""A page of more characters is not put into a notebook."""
FRAME = "width: 100%; height: 640px; border: 1px solid #dde2e8"
"""The frame of a page in a notebook."""


class Shown(ABC):
    """A result that can be looked at."""

    @property
    @abstractmethod
    def summary(self) -> str:
        """The report in a few lines of text."""

    @property
    @abstractmethod
    def packed_view(self) -> bytes:
        """What `view` shows, packed as `bonecam.report.page` has it."""

    @property
    @abstractmethod
    def _title(self) -> str:
        """The title of the page."""

    @abstractmethod
    def _draw(self, file: Path) -> str:
        """Write the picture for notebooks; returns what it shows."""

    @property
    def page(self) -> str:
        """The text of the HTML file of `view`."""
        return page_html(self.packed_view, self._title)

    def view(self, file: str | Path) -> Path:
        """Write one HTML file that shows the run in a browser, without network; returns its name. FileError where it
        cannot be written."""
        write_whole(file, self.page)
        return Path(file)

    def show(self) -> Path:
        """Show the run in the browser; returns the page's file, in a new folder for temporary files."""
        page = self.view(Path(mkdtemp(prefix="bonecam-")) / "view.html")
        webbrowser.open(page.resolve().as_uri())
        return page

    def _repr_html_(self) -> str:
        """The summary and the page, as notebooks show a value; a picture where the page is too large for one."""
        summary = f'<pre style="font-family: monospace">{html.escape(self.summary)}</pre>'
        page = self.page
        if len(page) <= INLINE:
            return f'{summary}<iframe srcdoc="{html.escape(page)}" style="{FRAME}"></iframe>'
        with TemporaryDirectory() as folder:
            path = Path(folder) / "picture.png"
            reported = self._draw(path)
            data = base64.b64encode(path.read_bytes()).decode("ascii")
        picture = f'<img alt="{html.escape(reported)}" src="data:image/png;base64,{data}">'
        note = f"The page has {len(page) / 1e6:.0f} MB: show() opens it in the browser, view(FILE) writes it."
        return f"{summary}{picture}<p>{note}</p>"


@dataclass(frozen=True, eq=False, repr=False)
class SecondProgram(Shown):
    """Part and shell after the turn-over, the tool path of each layer in machining order, the program and what it
    removes. `name` is that of the part's file, `report` is `second` of the run's report, `job` that of the run with the
    [holding] of the shell."""

    name: str
    clamping: SecondClamping
    paths: tuple[ToolPath, ...]
    program: Program
    removal: Removal
    report: SecondFigures
    job: Job

    @cached_property
    def packed_view(self) -> bytes:
        """What `view` shows, packed as `bonecam.report.page` has it."""
        posted = (self.clamping, self.program.text, self.paths, self.removal)
        return pack(second_contents(*posted, self.job, self.report, self.name))

    @property
    def apt(self) -> str:
        """The tool paths as cutter location data in APT words."""
        return apt_text(self.paths, self.program.name)

    @property
    def setup_article(self) -> str:
        """Its page of the run's setup sheet."""
        return second_article(self.name, self.clamping, self.job, self.program, self.report)

    @property
    def summary(self) -> str:
        """The report in a few lines of text."""
        return second_text(self.report)

    @property
    def _title(self) -> str:
        return f"{self.name}, second clamping"

    def _draw(self, file: Path) -> str:
        draw_second(self.clamping, self.paths, file)
        return "part and shell in the second clamping"

    def __repr__(self) -> str:
        return f"<second clamping: {self.program!r}>"


@dataclass(frozen=True, eq=False, repr=False)
class Morphed(Shown):
    """The result of `bonecam.morph_levels`. `report` is the content of the file of --report, `job` that of the run with
    the post's length."""

    part: Part
    surface: TSpline
    stock: Stock
    levels: Morph
    report: Report
    job: Job

    @cached_property
    def packed_view(self) -> bytes:
        """What `view` shows, packed as `bonecam.report.page` has it."""
        return pack(run_contents(self.part, self.levels.levels, self.stock, self.job, self.report, **self._posted))

    @property
    def _title(self) -> str:
        return Path(self.part.file).name

    def _draw(self, file: Path) -> str:
        """The levels, coloured by depth."""
        draw_coloured(self.levels.levels, file)
        return "levels, coloured by the depth of their cut"

    @property
    def _posted(self) -> dict[str, Any]:
        """What there is of a program, as `run_contents` takes it."""
        return {}

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.part.file}: {self._told}>"

    @property
    def _told(self) -> str:
        """What was made, in a few words."""
        return f"{self.levels.cuts} cuts, K_min {self.levels.lower_bound}"

    @property
    def summary(self) -> str:
        """The report in a few lines of text."""
        return summary_of(self.report)


@dataclass(frozen=True, eq=False, repr=False)
class Result(Morphed):
    """The result of `bonecam.convert`: levels, the tool path of each level in machining order, the program, and what it
    removes (None where that was not simulated); `second` is the program of the second clamping and `probing` that of
    the touch probe, if the job has them."""

    paths: tuple[ToolPath, ...]
    program: Program
    removal: Removal | None = None
    second: SecondProgram | None = None
    probing: Probing | None = None

    @property
    def sheet(self) -> str:
        """The setup sheet as the text of an HTML file, with a page for each clamping."""
        pages = [setup_article(self.part, self.stock, self.job, self.program, self.report)]
        if self.second is not None:
            pages.append(self.second.setup_article)
        return setup_sheet(Path(self.part.file).name, pages)

    def compare_axes(self, level: int = 0) -> AxisComparison:
        """The tool axes of a level beside the surface's normals and axes that lean by the lead angle, at the same
        contacts: turning, collisions, speeds and time. ValueError where the level has no path."""
        machine = read_machine(self.job.nc.machine)
        scene = level_scene(self.levels.levels, level, self.stock, self.job, machine.bodies)
        (path,) = (path for path in self.paths if path.level == level and not path.rest)
        return compare_axes(path, scene, machine_limits(machine), self.job.path)

    @property
    def _posted(self) -> dict[str, Any]:
        """The program with its paths and what it removes."""
        return {"program": self.program.text, "paths": self.paths, "removal": self.removal}

    @property
    def _told(self) -> str:
        """What was made, in a few words."""
        return f"{super()._told}, {self.program!r}"


LEVEL = re.compile(r"level_(\d{2,})\.ply")
"""Names of the levels in a kept folder: the first is the part, the last the stock."""
PART = "level_00.ply"
"""Level 0 in a kept folder: the part, as a mesh."""
SURFACE = "surface.tspline"
"""The surface of level 0 in a kept folder, exact."""
GIVEN = "given.ply"
"""The mesh as given, in the program's frame."""
STOCK = re.compile(r"STOCK\W+FROM Z (-?[\d.]+) TO Z (-?[\d.]+)", re.IGNORECASE)
"""What the header says of the stock's ends, over the program's zero."""
SAME_STOCK = 0.1
"""A kept stock is a mesh: its ends lie within this of those of the header, mm; so do stumps."""
REMEDY = "give the folder that `convert --keep` wrote beside the program"


def kept_surface(given: Path) -> Path | None:
    """The part's surface that a kept folder holds, where `given` is that folder, or its mesh of level 0 as it was
    written: that is drawn within path.chord_tolerance and more, and the proof of a program asks for the surface. None
    where `given` is a file of its own. FileError where a folder keeps no surface."""
    folder = given if given.is_dir() else given.parent
    surface = folder / SURFACE
    if given.is_dir():
        if not surface.is_file():
            raise file_error(given, f"has no {SURFACE}", REMEDY)
        return surface
    return surface if given.name == PART and is_own(folder, PART) and is_own(folder, SURFACE) else None


def kept_levels(text: str, program: Path, keep: Path) -> tuple[TriangleMesh, TriangleMesh, int]:
    """Part and stock of a kept folder, and the number of its levels. FileError where it has none, ProgramError where
    the `text` of `program` is for another stock."""
    names = sorted(path.name for path in keep.glob("level_*.ply") if LEVEL.fullmatch(path.name))
    if len(names) < 2:
        raise file_error(keep, "has no levels (level_00.ply, ...)", REMEDY)
    stock = read_mesh(keep / names[-1])
    # ProgramError where the header tells another stock than the kept one
    header = header_of(text)
    reported = STOCK.search(header)
    if reported is not None:
        heights = [float(end) + zero_height_of(header) for end in reported.groups()]
        kept_heights = stock.bounds[:, 2].tolist()
        if max(abs(a - b) for a, b in zip(heights, kept_heights, strict=True)) > SAME_STOCK:
            raise ProgramError(
                f"{program}: its stock reaches from z {heights[0]:.2f} to {heights[1]:.2f} mm, that of {keep} from "
                f"{kept_heights[0]:.2f} to {kept_heights[1]:.2f}: {REMEDY}",
                line=0,
            )
    return read_mesh(keep / names[0]), stock, len(names)


def kept_job(keep: str | Path | None) -> Job:
    """The job of a kept folder; that of no file where there is no folder, or none in it. JobError as of `read_job`."""
    file = job_file_of(keep)
    return Job() if file is None else read_job(file)


def job_file_of(keep: str | Path | None) -> Path | None:
    """The job.toml of a kept folder; None where there is no folder, or none in it."""
    file = None if keep is None else Path(keep) / "job.toml"
    return file if file is not None and file.is_file() else None


def folder_of(file: str | Path) -> Path | None:
    """The folder that a program, or its paths, lie in, where a run kept it."""
    folder = Path(file).parent
    return folder if job_file_of(folder) and (folder / SURFACE).is_file() else None


def with_kept_cutters(job: Job, keep: str | Path | None) -> Job:
    """The job, the cutters that it leaves open as they were chosen for the folder, if that tells. JobError as of
    `read_job`."""
    left = job.open_cutters
    if not left or job_file_of(keep) is None:
        return job
    kept = kept_job(keep)
    chosen: dict[str, Any] = {name: getattr(kept, name) for name in left}
    fine = kept.path.fine_cutter if "fine" in left else job.path.fine_cutter
    return replace(job, **chosen, path=replace(job.path, fine_cutter=fine))


def with_kept_holding(job: Job, keep: Path) -> Job:
    """The job, what its [holding] and its depths of cuts leave to be found as it was found for the folder. FileError
    where that does not tell."""
    holding = job.holding
    held = bool(holding.diameter) and bool(holding.stub_length) == bool(holding.stub_diameter)
    deep = not job.levels.found and (held or not job.levels.automatic)
    if held and deep:
        return job
    file = keep / "job.toml"
    try:
        kept = read_job(file)
    except BonecamError as error:
        what = "levels.depths were found" if held else "[holding] was found"
        raise FileError(f"{what}, and {file} does not tell how ({error}): {REMEDY}", file=str(file)) from error
    return replace(job, holding=holding if held else kept.holding, levels=job.levels if deep else kept.levels)


def kept_stock(keep: Path, mesh: TriangleMesh, chord: float) -> Stock:
    """The stock of a kept folder, exact: its kept `mesh` lies inside a round one by up to its `chord` tolerance (mm),
    and what is cut there would be missed."""
    file = keep / "report.json"
    try:
        figures = _report(keep)["stock"]
        kind = figures["kind"]
        sizes = {name.removesuffix("_mm"): size for name, size in figures.items() if name.endswith("_mm")}
        if kind == "mesh":
            return ConvexStock(convex_hull(mesh.vertices), proven=True)
        job = StockJob(kind=kind, **sizes)
        middle = float(mesh.bounds[:, 2].mean())
        stock = stock_round(job, LyingPart(mesh.vertices, middle), schedule_of(LevelsJob()))
    except (OSError, ValueError, KeyError, TypeError, BonecamError) as error:
        raise file_error(file, f"tells no stock ({error})", REMEDY) from error
    if np.abs(stock.bounds - mesh.bounds).max() > SAME_STOCK + chord:
        raise file_error(file, f"tells another stock ({stock}) than the kept levels", REMEDY)
    return stock


def kept_given(keep: Path, job: Job) -> GivenSurface | NotJudged:
    """The mesh as given of a kept folder, and how deep a program of the `job` may go into it; or that there is none.

    FileError where the mesh is damaged, or its report does not tell the deviation of the fit.
    """
    if not (keep / GIVEN).exists():
        return NotJudged(f"{keep} has no {GIVEN}, make it again with `convert --keep`")
    file = keep / "report.json"
    try:
        report = _report(keep)
        missed = float(report["surface"]["deviation_max_mm"])
        smoothed = float((report["input"]["smoothed"] or {"inward_mm": 0.0})["inward_mm"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise file_error(file, f"tells no deviation of the fit ({error})", REMEDY) from error
    return GivenSurface(MeshDistance(read_mesh(keep / GIVEN)), allowed_depth(job, missed, smoothed))


def _report(keep: Path) -> Any:
    """The report of a kept folder. OSError or ValueError where it cannot be read."""
    return json.loads(input_text(keep / "report.json"))


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


def keep_elements(surface: TSpline, work: Path) -> None:
    """Write the surface.iga of a surface that is machined alone, where a plugin writes such files."""
    if ".iga" in reader_endings():
        save_surface(surface, work / "surface.iga")


def fill_kept_folder(work: Path, made: Morphed) -> None:
    """Write into `work` surface.tspline, given.ply, the files of `keep_levels`, view.gz, job.toml and report.json; of a
    program its text, toolpath.csv, toolpath.apt, toolpath.png, machine.png, stump.png, second.* if there is a second
    clamping, cones.csv if axes are chosen in cones, axes.png and axes.md of the part if levels are cut, left.ply and
    engagement.png where it was simulated, and error.ply and error.png where it was asked what bends."""
    levels = made.levels.levels
    post = (made.job.holding.diameter, post_below(made.part.mesh, made.job.holding).top)
    save_surface(made.surface, work / "surface.tspline")
    write_mesh(made.part.placed_given, work / GIVEN)
    keep_into(work, levels, made.stock, post)
    (work / VIEW).write_bytes(made.packed_view)
    keep_job(work, made)
    axes = {}
    if isinstance(made, Result):
        write_paths(work, made.program, made.paths)
        if made.job.path.strategy == "morph":
            compared = made.compare_axes()
            draw_compared_axes(compared, levels[0].mesh, work / "axes.png")
            write_whole(work / "axes.md", compared.table)
            axes = {"axes": compared.report}
        draw_toolpath(made.paths, levels, work / "toolpath.png", post)
        second = made.second
        if second is not None:
            write_whole(work / f"second{second.program.extension}", second.program.text)
            write_whole(work / "second.apt", second.apt)
            (work / SECOND_VIEW).write_bytes(second.packed_view)
            write_mesh(second.clamping.solids, work / "second.ply")
            draw_second(second.clamping, second.paths, work / "second.png")
        machine = read_machine(made.job.nc.machine)
        draw_stump(levels[0].mesh, post, cut_groove(made.paths), work / "stump.png")
        draw_machine(made.paths, levels[0].mesh, made.job.holding, machine, work / "machine.png")
        write_simulated(work, made.removal)
        if made.removal and made.removal.left:
            _draw_engagement(made, work / "engagement.png")
    write_whole(work / "report.json", report_text({**made.report, **axes}))


def write_paths(work: Path, program: Program, paths: Sequence[ToolPath]) -> None:
    """Write a program, its paths as toolpath.csv and toolpath.apt, and cones.csv if axes are chosen in cones."""
    write_whole(work / f"program{program.extension}", program.text)
    write_whole(work / "toolpath.csv", toolpath_csv(paths))
    write_whole(work / "toolpath.apt", apt_text(paths, program.name))
    if any(path.cones for path in paths):
        write_whole(work / "cones.csv", cones_csv(paths))


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
