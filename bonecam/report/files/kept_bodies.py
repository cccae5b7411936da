"""Part, stock and the mesh as given, as `convert --keep` left them in its folder, for another look at the program."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bonecam.errors import BonecamError, FileError, ProgramError
from bonecam.files import input_text
from bonecam.job import Job, LevelsJob, StockJob, read_job
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets.hull import convex_hull
from bonecam.mesh.files.mesh_files import read_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.runtime.own_files import is_own
from bonecam.setup.schedule import schedule_of
from bonecam.setup.stock import Stock
from bonecam.setup.stock_kind import LyingPart, stock_round
from bonecam.setup.stocks.mesh import ConvexStock
from bonecam.verify.control.program_file import header_of
from bonecam.verify.removal.given import GivenSurface, NotJudged, allowed_depth

LEVEL = re.compile(r"level_(\d{2,})\.ply")
"""Names of the levels in a kept folder: the first is the part, the last the stock."""
PART = "level_00.ply"
"""Level 0 in a kept folder: the part, as a mesh."""
SURFACE = "surface.tspline"
"""The surface of level 0 in a kept folder, exact."""
GIVEN = "given.ply"
"""The mesh as given, in the program's frame."""
STOCK = re.compile(r"STOCK\W .* FROM Z (-?[\d.]+) TO Z (-?[\d.]+)", re.IGNORECASE)
"""What the header says of the stock."""
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
            raise FileError(f"{given}: has no {SURFACE}: {REMEDY}", file=str(given))
        return surface
    return surface if given.name == PART and is_own(folder, PART) and is_own(folder, SURFACE) else None


def kept_levels(text: str, program: Path, keep: Path) -> tuple[TriangleMesh, TriangleMesh, int]:
    """Part and stock of a kept folder, and the number of its levels. FileError where it has none, ProgramError where
    the `text` of `program` is for another stock."""
    names = sorted(path.name for path in keep.glob("level_*.ply") if LEVEL.fullmatch(path.name))
    if len(names) < 2:
        raise FileError(f"{keep}: has no levels (level_00.ply, ...): {REMEDY}", file=str(keep))
    stock = read_mesh(keep / names[-1])
    _require_stock(text, stock, program, keep)
    return read_mesh(keep / names[0]), stock, len(names)


def _require_stock(text: str, stock: TriangleMesh, program: Path, keep: Path) -> None:
    """ProgramError where the header tells another stock than the kept one."""
    reported = STOCK.search(header_of(text))
    if reported is None:
        return
    heights = [float(reported[1]), float(reported[2])]
    kept_heights = stock.bounds[:, 2].tolist()
    if max(abs(a - b) for a, b in zip(heights, kept_heights, strict=True)) > SAME_STOCK:
        raise ProgramError(
            f"{program}: its stock reaches from z {heights[0]:.2f} to {heights[1]:.2f} mm, that of {keep} from "
            f"{kept_heights[0]:.2f} to {kept_heights[1]:.2f}: {REMEDY}",
            line=0,
        )


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
        raise FileError(f"{file}: tells no stock ({error}): {REMEDY}", file=str(file)) from error
    if np.abs(stock.bounds - mesh.bounds).max() > SAME_STOCK + chord:
        raise FileError(f"{file}: tells another stock ({stock}) than the kept levels: {REMEDY}", file=str(file))
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
        what = f"tells no deviation of the fit ({error})"
        raise FileError(f"{file}: {what}: {REMEDY}", file=str(file)) from error
    return GivenSurface(MeshDistance(read_mesh(keep / GIVEN)), allowed_depth(job, missed, smoothed))


def _report(keep: Path) -> Any:
    """The report of a kept folder. OSError or ValueError where it cannot be read."""
    return json.loads(input_text(keep / "report.json"))
