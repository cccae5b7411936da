"""Which roughing is fastest for these bones: the levels of the default job, or 3+2 roughing in layers?

    python tests/benchmarks/bench_roughing.py FOLDER [NAME ...] [--others MINUTES]

The phalanx that ships, and three bones of ../shared, left out where absent; each is converted by the default job into
FOLDER/NAME unless it is there. Compared is the way from the stock to level 1, one finishing depth outside the part.

levels: the kept paths of all levels but the finishing one, posted: minutes as the axes drive them (`driven`) and at the
feed (`bound`), mm3 as simulated, the largest 95 % peak (N) of a path; `of them`: what level 2 and those outside take.

3+2: layers from two to four tilts round the bar, the axis across it, down to level 1, or to level 2 with the level 1 of
the levels after them (`to`). Flat, bull-nose and ball ends of 3, 4 and 6 mm on the shanks of the catalogue. Depths are
what `neck.py` would bear there (peak, deflection, stress), or half of that; the peak of a flat end is that of a
straight edge as long as the depth with the thickest chip, also for a bull nose. The feed is `Material.speeds` of the
step, or of a ball's depth. Steps: a quarter or a half of the diameter; of a ball, scallops of a tenth of the depth.
Shown is, by the bound, the quickest of each end and of each number of tilts.
    bound: a lower bound. No collisions, holders, entries or air, no slow corners; flutes are long enough down to the
bar's axis; the way is the area of a layer where anything is cut over the step; one link a layer and island; a tilt is
a turn of C (the first of B too) and a retract, another cutter one change. The tool may sink a voxel (`CELLS`) into the
level. What stands outside the level then is charged at the mm3/min of the levels, as if these met no more.
    driven: instead the layers' arcs as the axes drive them, from rest to rest, a link each; and level 1 in full also
after layers down to it, for it meets stairs all over the part. Still no collisions and entries.

With --others, cancelled after so many minutes each: what bonecam has of 3+2, proved, with entries and retracts: the
roughing of `iso-height`, the ball of the default job in layers of 0.5 mm and as deep as its deepest level, from two
sides on its clamping, charged as 3+2 down to level 1, though its own finishing takes the stairs.
"""

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import chain, product
from pathlib import Path
from typing import Any

import contourpy
import igl
import numpy as np
from bonecam_meshes import path as shipped
from bonecam_plugins.reposting.posting import read_paths
from numpy import ndarray
from scipy import ndimage

import bonecam
from bonecam.job import Job, read_job
from bonecam.job.materials.preset import read_material
from bonecam.job.nc_section import LINK_FEED
from bonecam.machine.machine import Machine, read_machine
from bonecam.mechanics.edges import cutter_compliance, strip_force
from bonecam.mechanics.loads import mechanics_of_job
from bonecam.mesh.files.mesh_files import read_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.path_words import post_path
from bonecam.nc.requirements import job_dialect
from bonecam.planning.motion_time import motion_minutes
from bonecam.planning.neck import (
    BALL_SHARE,
    PEAK_SHARE,
    SCALLOP_SHARE,
    YIELD_SHARE,
    finished_beam,
    normal_compliance,
    preferred_depths,
)
from bonecam.planning.spacing import side_step
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import post_below

SHARED = Path(__file__).resolve().parents[3] / "shared" / "meshes" / "bones"
NAMES = ("phalanx", "3midph", "capitate", "1mc")
CELLS = 160
"""Voxels along the stock: 0.2 mm for one of 32 mm."""
SHAPES = {"flat": 0.0, "bull": 0.25, "ball": 1.0}
"""Corner radius of each end, as a share of the radius."""
DIAMETERS, TILTS, TARGETS, STEPS = (3, 4, 6), (2, 3, 4), (1, 2), (0.25, 0.5)
SHALLOWEST = 0.05
"""Of the layers that are tried, mm."""
COLUMNS = "bone | strategy | to | cutter | depth x step | bound | driven | mm3 | stands | peak N"


@dataclass(frozen=True, eq=False)
class Levels:
    """What a job made of a bone, in a folder."""

    folder: Path

    @cached_property
    def job(self) -> Job:
        """With the chosen cutters, depths and neck."""
        return read_job(self.folder / "job.toml")

    @cached_property
    def machine(self) -> Machine:
        """The job's."""
        return read_machine(self.job.nc.machine)

    @cached_property
    def report(self) -> dict[str, Any]:
        """As it was kept."""
        return json.loads((self.folder / "report.json").read_text())

    @cached_property
    def meshes(self) -> list[TriangleMesh]:
        """The surfaces of the levels, which stand on the table, and the stock."""
        return [read_mesh(file) for file in sorted(self.folder.glob("level_*.ply"))]

    @cached_property
    def minutes(self) -> dict[int, ndarray]:
        """Minutes of each level with its rest paths: at the feed, and as the axes drive it."""
        dialect = job_dialect(self.job.nc)
        paths = read_paths(self.folder / "toolpath.apt", None, self.job, self.machine)
        around = np.vstack([path.tips for path in paths])
        found: dict[int, ndarray] = {}
        before = None
        for path in paths:
            posted = post_path(path, self.machine, dialect, self.job, around, before=before)
            before = posted.moves.angles[-1]
            sums = np.array([posted.minutes.sum(), posted.driven_minutes.sum()])
            found[path.level] = found.get(path.level, np.zeros(2)) + sums
        return found

    def roughed(self, to: int) -> tuple[float, float, float]:
        """Of all levels down to this one: minutes at the feed and as driven, and mm3."""
        bound, driven = np.sum([pair for level, pair in self.minutes.items() if level >= to], axis=0)
        removed = sum(row["removed_mm3"] for row in self.report["removal"]["levels"] if row["index"] >= to)
        return float(bound), float(driven), removed

    def peak(self, to: int) -> float:
        """The largest 95 % peak (N) of a path of these levels."""
        rows = self.report["mechanics"]["levels"]
        return max(float(row["peak_p95_n"]) for row in rows if row["index"] >= to)

    @cached_property
    def holding(self) -> tuple[float, float, float]:
        """Compliance of the part (mm/N), stress in its neck (1/mm2) and the stress that it may have (N/mm2)."""
        stiffness, _ = mechanics_of_job(self.job)
        part = self.meshes[0]
        beam = finished_beam(part, post_below(part, self.job.holding), self.job.holding, stiffness)
        stress = beam.moment_stress(np.array([[1.0, 0.0, 0.0]]), part.bounds.mean(axis=0)[None])
        return normal_compliance(beam, part), float(stress[0]), YIELD_SHARE * stiffness.yield_strength


@dataclass(frozen=True)
class Layers:
    """3+2 roughing: end and diameter of the cutter, depth and step (mm) of the layers, feed (mm/min), peak (N); the
    level that it leaves, the number of tilts, the angle of the first (radians)."""

    shape: str
    diameter: int
    depth: float
    step: float
    feed: float
    peak: float
    to: int = 1
    tilts: int = 2
    start: float = 0.0


def layers_of(levels: Levels, shape: str, diameter: int, depth: float, share: float) -> Layers:
    """The layers of a depth and of a step of that share of the diameter (of a ball: that its scallops give)."""
    material, (_, force) = read_material(levels.job.material.name), mechanics_of_job(levels.job)
    radius = diameter / 2
    ball = shape == "ball"
    scallop = SCALLOP_SHARE * depth
    step = float(side_step(radius, scallop, np.zeros(1))[0]) if ball else share * diameter
    radial = depth if ball else step
    spindle, feed = material.speeds(radius, radial, levels.machine.spindle_speed)
    feed = min(feed, *(axis.speed for axis in levels.machine.linear))
    chip = feed / (spindle * material.teeth)
    thickest = chip * np.sqrt(1 - (1 - min(radial / radius, 1.0)) ** 2)
    edge = (force.array[:3] * thickest + force.array[3:]) * depth
    edge = strip_force(force, radius, depth, scallop, chip) if ball else edge
    return Layers(shape, diameter, depth, step, feed, PEAK_SHARE * float(np.linalg.norm(edge)))


def layers_borne(levels: Levels, shape: str, diameter: int, to: int) -> Iterator[Layers]:
    """The deepest layers of a cutter that are borne where a level stands under them, and half as deep ones."""
    preset = Job().with_values(roughing={"preset": f"ball-{diameter}"}).roughing
    cutter = Cutter.from_job(1, "roughing", replace(preset, spindle=1.0, feed=1.0))
    compliance, stress, strongest = levels.holding
    give = compliance + cutter_compliance(cutter)
    under = sum(levels.job.levels.depth_onto(level) for level in range(to))
    deepest = BALL_SHARE * cutter.radius if shape == "ball" else cutter.flute_length
    for share in STEPS if shape != "ball" else STEPS[:1]:
        tried = (layers_of(levels, shape, diameter, depth, share) for depth in preferred_depths(SHALLOWEST, deepest))
        borne = [one for one in tried if one.peak * give <= under and one.peak * stress <= strongest]
        if borne:
            yield borne[-1]
            yield min(borne, key=lambda one: abs(one.depth - borne[-1].depth / 2))


@dataclass(frozen=True, eq=False)
class Model:
    """Voxels (x, y, z), z along the bar: of a `target`, a level with the post, and `spare`, what stands between it and
    the stock. A tilt by an angle looks at them along v (across), h (towards the tool) and z, at the nearest voxel."""

    spare: ndarray
    target: ndarray
    cell: float

    @classmethod
    def between(cls, levels: Levels, to: int) -> "Model":
        """What the levels down to one take off the stock."""
        stock, level = levels.meshes[-1], levels.meshes[to]
        low, high = stock.bounds
        cell = float(high[2] - low[2]) / CELLS
        half = int(np.ceil(np.abs(stock.bounds[:, :2]).max() / cell))
        across, up = cell * (np.arange(2 * half) + 0.5 - half), low[2] + cell * (np.arange(CELLS) + 0.5)
        places = np.stack(np.meshgrid(across, across, up, indexing="ij"), axis=-1)
        bar, target = (
            (igl.fast_winding_number(mesh.vertices, mesh.faces.astype(np.int64), places.reshape(-1, 3)) > 0.5)
            for mesh in (stock, level)
        )
        post = post_below(levels.meshes[0], levels.job.holding)
        target |= post.distance(places.reshape(-1, 3)) < 0
        shape = places.shape[:3]
        return cls((bar & ~target).reshape(shape), target.reshape(shape), cell)

    @cached_property
    def across(self) -> ndarray:
        """Distance of each row of voxels from the bar's axis, mm."""
        return self.cell * (np.arange(len(self.spare)) + 0.5 - len(self.spare) / 2)

    def turned(self, angle: float) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """Where each place (a, b) of a section is after a turn: two rows, whether they are within the voxels, and the
        height, mm."""
        a, b = np.meshgrid(self.across, self.across, indexing="ij")
        places = np.stack([a * np.cos(angle) - b * np.sin(angle), a * np.sin(angle) + b * np.cos(angle)])
        rows = np.floor(places / self.cell + len(a) / 2).astype(int)
        inside = ((rows >= 0) & (rows < len(a))).all(axis=0)
        return *np.clip(rows, 0, len(a) - 1), inside, places[1]

    def seen(self, voxels: ndarray, angle: float) -> ndarray:
        """The voxels as a tilt looks at them."""
        x, y, inside, _ = self.turned(-angle)
        return voxels[x, y] & inside[..., None]

    def end_of(self, shape: str, diameter: int, narrower: float = 0.0) -> ndarray:
        """Height (mm) of a cutter's end over its tip at the cells of its disc, infinite outside."""
        radius = diameter / 2 - narrower
        corner = SHAPES[shape] * radius
        line = self.cell * np.arange(-int(radius / self.cell), int(radius / self.cell) + 1)
        off = np.hypot(line[:, None], line)
        beyond = np.clip(off - (radius - corner), 0.0, corner)
        return np.where(off <= radius, corner - np.sqrt(corner**2 - beyond**2), np.inf)

    @cache  # noqa: B019
    def tips(self, angle: float, shape: str, diameter: int) -> ndarray:
        """The lowest tip (mm, no lower than the bar's axis) at each place (v, z), with a margin round them: as deep as
        one cell in the target, by a tool that is half a cell narrower."""
        tops = np.where(self.seen(self.target, angle), self.across[:, None] - self.cell / 2, 0.0).max(axis=1)
        end = self.end_of(shape, diameter, self.cell / 2)
        disc, lowered = np.isfinite(end), np.where(np.isfinite(end), -end, 0.0)
        return np.maximum(
            ndimage.grey_dilation(np.pad(tops, self.margin(diameter)), footprint=disc, structure=lowered), 0
        )

    def margin(self, diameter: int) -> int:
        """Cells round the section where a cutter may stand."""
        return 2 * int(np.ceil(diameter / 2 / self.cell))


@cache
def rough(
    model: Model, shape: str, diameter: int, depth: float, tilts: int, start: float
) -> tuple[list[tuple[ndarray, ndarray]], ndarray]:
    """The layers of all tilts, of at most that depth, with a margin: where (v, z) something is cut, and where the tip
    may not be; and what stands after them."""
    spare, end, margin = model.spare, model.end_of(shape, diameter), model.margin(diameter)
    disc, lowered = np.isfinite(end), np.where(np.isfinite(end), -end, 0.0)
    top = float(model.across[-1]) + model.cell / 2
    count = int(np.ceil(top / depth))
    layer = np.floor((top - model.across) * count / top).astype(int)
    found = []
    for angle in start + 2 * np.pi * np.arange(tilts) / tilts:
        planes = np.floor((top - model.tips(float(angle), shape, diameter)) * count / top + 1e-9)
        left = ndimage.grey_erosion(top * (1 - planes / count), footprint=disc, structure=lowered)
        left = left[margin:-margin, margin:-margin]
        cut = model.seen(spare, angle) & (model.across[:, None] > left[:, None])
        for k in range(count):
            places = np.pad(cut[:, layer == k].any(axis=1), margin)
            if places.any():
                found.append((places, planes <= k))
        v, _, _, height = model.turned(angle)
        spare = spare & (height[..., None] <= left[v])
    return found, spare


def arcs_of(places: ndarray, blocked: ndarray, layers: Layers, cell: float) -> Iterator[ndarray]:
    """The tip's ways in a layer, mm: parallel to where it may not be, one step apart, from outside, each where the
    cutter meets what those before it leave."""
    outside, inside = (ndimage.distance_transform_edt(each) * cell for each in (~blocked, blocked))
    if not blocked.any():  # straight ways along the bar
        outside = np.broadcast_to(cell * np.arange(len(inside))[:, None], inside.shape)
    off = ndimage.gaussian_filter(outside - inside, 1.0)
    way_of = np.maximum(np.floor((outside - inside + layers.diameter / 2) / layers.step), 0)
    for k in np.unique(way_of[places]):
        meets = ndimage.distance_transform_edt(~(places & (way_of == k))) * cell <= layers.diameter / 2
        for line in contourpy.contour_generator(z=off).lines(k * layers.step + cell / 2):
            column, row = np.round(line).astype(int).T
            on = meets[row, column]
            for piece in np.split(np.arange(len(on)), np.flatnonzero(np.diff(on)) + 1):
                if on[piece[0]] and len(piece) > 1:
                    yield np.asarray(line[piece]) * cell


def arc_minutes(arc: ndarray, feed: float, machine: Machine) -> float:
    """Minutes of a way as X and Y drive it, from rest to rest."""
    way = np.linalg.norm(np.diff(arc, axis=0), axis=1)
    kept = way > 1e-6
    joints = np.zeros((int(kept.sum()) + 1, 5))
    joints[:, :2] = arc[np.r_[True, kept]]
    return float(motion_minutes(machine, joints, way[kept] / feed).sum())


def tilt_minutes(levels: Levels, tilts: int, another: bool) -> float:
    """Minutes of tilts, retracts and the change to `another` cutter."""
    seconds, (b, c) = levels.machine.seconds, levels.machine.rotary
    assert seconds is not None
    stops = tilts * seconds.retract + another * (seconds.tool_change + seconds.spindle_start)
    return np.pi / 2 / b.speed + (tilts - 1) * 2 * np.pi / tilts / c.speed + stops / 60


def figures(levels: Levels, model: Model, layers: Layers, driven: bool) -> tuple[float, float, float, float]:
    """Minutes of the bound and, if asked, as `driven`; mm3 that the layers remove, and that stand after them beyond
    what the levels leave too, at the post."""
    cell = model.cell
    found, spare = rough(model, layers.shape, layers.diameter, layers.depth, layers.tilts, layers.start)
    removed = float((model.spare & ~spare).sum()) * cell**3
    _, of_levels, taken = levels.roughed(layers.to)
    stands = max(min(taken, float(model.spare.sum()) * cell**3) - removed, 0.0)
    rest, inner = stands * of_levels / taken, float(levels.minutes[1][1])
    link = 2 * (levels.job.path.clearance + layers.depth) / LINK_FEED
    another = layers.shape != "ball" or layers.diameter != 2 * levels.job.roughing.radius
    turns = tilt_minutes(levels, layers.tilts, another)

    area = cell**2 * sum(float(places.sum()) for places, _ in found)
    islands = sum(ndimage.label(places)[1] for places, _ in found)
    bound = area / layers.step / layers.feed + islands * link + turns + rest + (layers.to > 1) * inner
    if not driven:
        return bound, np.nan, removed, stands
    arcs = [arc for one in found for arc in arcs_of(*one, layers, cell)]
    cutting = sum(arc_minutes(arc, layers.feed, levels.machine) for arc in arcs)
    return bound, cutting + len(arcs) * link + turns + inner + (layers.to > 1) * rest, removed, stands


def line(name: str, strategy: str, to: int, cutter: str, layers: str, found: Sequence[float], peak: float) -> str:
    """A row of the table; what was `found`: minutes of the bound and as driven, mm3 removed and standing."""
    bound, driven, removed, stands = found
    cells = name, strategy, f"{to}", cutter, layers, f"{bound:.2f}", f"{driven:.2f}", f"{removed:.0f}"
    return " | ".join([*cells, f"{stands:.0f}", f"{peak:.0f}"])


def rows_of_levels(name: str, levels: Levels) -> Iterator[str]:
    """The rows of bonecam's own levels."""
    tool = levels.job.roughing
    depths = " ".join(f"{depth:g}" for depth in levels.job.levels.listed[1:])
    for to, strategy in ((1, "levels"), (2, "of them")):
        found = *levels.roughed(to), 0.0
        yield line(name, strategy, to, f"{tool.shape} {2 * tool.radius:g}", depths, found, levels.peak(to))


def rows_of_layers(name: str, levels: Levels) -> Iterator[str]:
    """The rows of 3+2 roughing."""
    best: dict[tuple[int, str | int], tuple[float, Layers]] = {}
    models = {to: Model.between(levels, to) for to in TARGETS}
    for to, shape, diameter, tilts in product(models, SHAPES, DIAMETERS, TILTS):
        for layers, start in product(layers_borne(levels, shape, diameter, to), (0.0, np.pi / tilts)):
            one = replace(layers, to=to, tilts=tilts, start=start)
            least = figures(levels, models[to], one, driven=False)[0]
            for key in ((to, shape), (to, tilts)):
                best[key] = min(best.get(key, (np.inf, one)), (least, one), key=lambda pair: pair[0])
    for one in dict.fromkeys(one for _, one in best.values()):
        found = figures(levels, models[one.to], one, driven=True)
        size = f"{one.depth:g} x {one.step:.2g}"
        yield line(name, f"3+2, {one.tilts} tilts", one.to, f"{one.shape} {one.diameter}", size, found, one.peak)


def row_of_iso_height(name: str, levels: Levels, own: Levels) -> str:
    """The row of bonecam's roughing layers from two sides, which its levels 1 and 0 finish."""
    bound, driven, removed = own.roughed(2)
    _, of_levels, taken = levels.roughed(1)
    stands, turns = max(taken - removed, 0.0), tilt_minutes(levels, 2, another=False)
    minutes = bound + turns + stands * of_levels / taken, driven + turns + float(levels.minutes[1][1])
    tool, depth = f"ball {2 * own.job.roughing.radius:g}", f"{own.job.levels.layer_depth:g}"
    return line(name, "iso-height", 1, tool, depth, (*minutes, removed, stands), own.peak(2))


def converted(name: str, folder: Path, job: Job, minutes: float = np.inf) -> Levels | str:
    """What a job made of a bone, cancelled after so many minutes; or why there is nothing."""
    file = Path(shipped("phalanx")) if name == "phalanx" else SHARED / f"{name}_m.stl"
    if not file.is_file():
        return f"{name} | skipped: its mesh is absent"
    if not (folder / "report.json").is_file():
        end = time.monotonic() + 60 * minutes
        job = job.with_values(mesh={"units": "mm" if name == "phalanx" else "m"})
        try:
            bonecam.convert(file, job, keep=folder, progress=lambda *_: time.monotonic() < end)
        except bonecam.BonecamError as error:
            return f"{name} | {folder.name}: no program: {error}"
    return Levels(folder)


def main() -> None:
    """Convert, and print the table row by row."""
    options = argparse.ArgumentParser()
    options.add_argument("folder", type=Path)
    options.add_argument("names", nargs="*", default=NAMES)
    options.add_argument("--others", type=float)
    given = options.parse_args()
    print(COLUMNS)
    for name in given.names:
        levels = converted(name, given.folder / name, Job())
        if isinstance(levels, str):
            print(levels)
            continue
        rows = [rows_of_levels(name, levels)]
        for depth in (0.5, max(levels.job.levels.listed)) if given.others else ():
            path = {"strategy": "iso-height", "fine_cutter": False}
            job = levels.job.with_values(path=path, levels={"roughing_depth": depth})
            own = converted(name, given.folder / f"{name}-{depth:g}", job, given.others)
            rows.append(iter([own if isinstance(own, str) else row_of_iso_height(name, levels, own)]))
        for row in chain(*rows, rows_of_layers(name, levels)):
            print(row, flush=True)
        rough.cache_clear()


if __name__ == "__main__":
    main()
