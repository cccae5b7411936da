"""The stock milled from the bar: what stands round a stock of revolution, and round the neck below it, is cut away.

The ball goes round the Z axis in a helix from above the sawn end of the bar down to the foot of the neck, in layers: a
layer brings the material `depth` nearer to the axis, at most, or down to what stays. The axis of the tool leans by one
angle from the plane across the bar, towards the end of the bar, and turns with the helix, so that the ball cuts beside
its tip and the neck of the tool rises out of the groove. The stiffer cutter goes first; the other takes what its ball
leaves in the groove.

The material is known by its radius over the height, as that of a lathe.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, repeat

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import runs_of
from bonecam.errors import OrientationError
from bonecam.job import HoldingJob, Job, field_error
from bonecam.job.holding_section import AUTO, MILLED, TURNED
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.solids import revolve, segments_around
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.layers import flat_step
from bonecam.planning.links import without_returns
from bonecam.planning.oriented_path import orient
from bonecam.planning.scene import Scene
from bonecam.planning.spacing import MAX_STEP
from bonecam.planning.stump import parting_cutters
from bonecam.setup.capsule import Capsule
from bonecam.setup.placement import Setup
from bonecam.setup.stock import Stock
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import BLANK, ContactPath, ToolPath
from bonecam.workholding.clamping import STUB_CLEARANCE, Clamping, holding_columns
from bonecam.workholding.post import Column, Post

STEP = 0.02
"""Heights at which radii are known are so far apart, mm."""
ROWS = 5
"""A mesh has a ring for so many of them: the largest."""
LEANS = tuple(np.radians([20.0, 30.0, 10.0, 45.0, 0.0]))
"""Angles of the tool from the plane across the bar that are tried, radians."""
UPRIGHT = np.pi / 2
"""The angle of a tool along the bar: no rotary axis turns, X and Y alone go round, several times as fast."""
MOST_TURN = np.radians(15.0)
"""The axis turns by no more from one point to the next, radians: half of what a cut may turn it."""
NEAREST = 0.1
"""The ball's centre comes no nearer to the Z axis, mm: the ball reaches over it."""
OFF = 0.02
"""The ball keeps so far from what stays, mm: on the caps radii between the heights are known to less."""
HOLLOW = 15
"""Rows, each a STEP, over which a hollow of a line is found."""
FAR = 1e6
"""Farther from the axis than any material, mm."""
LEAST = 0.02
"""A layer that takes less is none, mm."""
DEPTH_SHARE = 0.75
"""Of its radius, that the ball takes with one layer, cusps of the layer before included: the bar is many times as stiff
as the part on its neck, for which `tool.cutter.REST_SHARE` holds, and while C turns it chips are thin."""
CUSP = 0.1
"""Cusps that the last layers leave, mm; the levels follow."""
CUSP_SHARE = 0.1
"""Of its radius, cusps that the ball leaves before a layer follows."""
AROUND = 0.5
"""The links keep out of a capsule that is so much larger than the bar, mm."""


def blank_depth(cutter: Cutter) -> float:
    """Depth (mm) of a layer of a cutter at most."""
    return DEPTH_SHARE * cutter.radius


def bar_of(stock: Stock, holding: HoldingJob) -> Column | None:
    """The bar that a stock is milled from: as thick as the stub, from the foot of that to its sawn end; None where the
    stock is turned before."""
    stub = holding_columns(holding).get("stub") if holding.neck == MILLED else None
    return replace(stub, top=float(stock.bounds[1, 2]) + holding.bar_end) if stub else None


@dataclass(frozen=True, eq=False)
class Profile:
    """Radii (k,) of a body of revolution at `heights` (k,), rising by STEP, mm; negative where there is none."""

    heights: Float[ndarray, " k"]
    radii: Float[ndarray, " k"]

    def around(self, radius: float) -> Float[ndarray, " k"]:
        """The least distance of a ball's centre from the axis at each height with which it stays out of the body."""
        out = np.full(len(self.radii), -np.inf)
        count = int(np.ceil(radius / STEP))
        for shift in range(-count, count + 1):
            inner = np.sqrt(max(radius**2 - (shift * STEP) ** 2, 0.0))
            there = np.arange(len(out)) + shift
            there = np.clip(there, 0, len(out) - 1)
            out = np.maximum(out, np.where(self.radii[there] > 0, self.radii[there] + inner, -np.inf))
        return out

    def without(self, away: Float[ndarray, " j"], heights: Float[ndarray, " j"], radius: float) -> "Profile":
        """What balls leave that go round the axis at these distances and heights."""
        off = self.heights[:, None] - heights
        reached = away - np.sqrt(np.maximum(radius**2 - off**2, 0.0))
        left = np.where(np.abs(off) < radius, reached, np.inf).min(axis=1, initial=np.inf)
        return replace(self, radii=np.where(left < self.radii, np.where(left > 0, left, -1.0), self.radii))

    def mesh(self, chord: float, more: float) -> TriangleMesh:
        """A closed mesh of the body, `more` mm larger."""
        there = np.flatnonzero(self.radii > 0)
        first = np.arange(0, len(there), ROWS)
        radii, heights = np.maximum.reduceat(self.radii[there], first) + more, self.heights[there][first]
        ends = (float(heights[0]) - more - STEP, float(heights[-1]) + more + STEP)
        return revolve(radii, heights, ends, segments_around(float(radii.max()), chord))


def stock_profile(stock: Stock, neck: float, foot: float, heights: Float[ndarray, " k"]) -> Profile:
    """What stays: the stock, and below its middle down to the `foot` a neck of this radius; OFF mm larger."""
    low, high = np.zeros(len(heights)), np.full(len(heights), stock.diameter)

    def inside(radii: Float[ndarray, " k"]) -> Bool[ndarray, " k"]:
        return stock.signed_distance(np.column_stack([radii, 0 * radii, heights])) < OFF

    for _ in range(40):
        middle = (low + high) / 2
        within = inside(middle)
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    radii = np.where(low > 0, low, -1.0)
    below = (heights >= foot) & (heights < stock.middle[2])
    return Profile(heights, np.where(below, np.maximum(radii, neck + OFF), radii))


Line = tuple[Float[ndarray, " s"], Float[ndarray, " s"]]
"""Distances from the axis and heights of a ball's centre, mm."""


@dataclass(frozen=True, eq=False)
class Lathe:
    """How a cutter takes the material down to what stays: `final` distances of its centre at the heights, no lower than
    `lowest`; a layer is `depth` deep at most, where the layer before left no cusps."""

    cutter: Cutter
    final: Float[ndarray, " k"]
    lowest: float
    depth: float

    def layers(
        self, material: Profile, stays: Profile, within: Bool[ndarray, " k"]
    ) -> Iterator[tuple[list[Line], float]]:
        """The stretches of each layer among these heights, from the top down, and the cusps (mm) that are left. A layer
        follows what `stays`, at equal distances, and brings the ball's centre no farther than `depth` from where it
        could be before."""
        heights, there = material.heights, within & (material.heights >= self.lowest)
        clear = np.maximum(material.around(self.cutter.radius), self.final)
        before = np.where(heights < self.lowest, FAR, clear)  # nothing is reached from below

        def over(more: float) -> Float[ndarray, " k"]:
            """Where the ball goes that leaves so much on what stays."""
            return np.maximum(stays.around(self.cutter.radius + more), self.final)

        low, high = 0.0, 2 * float(material.radii.max())
        while high - low > LEAST:
            middle = (low + high) / 2
            low, high = (middle, high) if (there & (clear - over(middle) > LEAST)).any() else (low, middle)
        count = int(np.ceil(high / self.depth)) if high > LEAST else 0
        for more in chain(np.linspace(high, 0.0, count + 1)[1:].tolist(), repeat(0.0)):
            after = np.where(there, np.clip(over(more), self.reached(before), before), before)
            cuts = before - after > LEAST
            stretches = [(after[a:b][::-1], heights[a:b][::-1]) for a, b in runs_of(cuts) if b - a > 1]
            if stretches:
                yield stretches[::-1], CUSP if more == 0.0 else CUSP_SHARE * self.cutter.radius
            elif more == 0.0:
                return
            before = np.where(cuts, after, before)

    def reached(self, before: Float[ndarray, " k"]) -> Float[ndarray, " k"]:
        """The least distances of the centre that are no farther than `depth` from one `before`."""
        rows, count = np.arange(len(before)), int(self.depth / STEP)
        shifts = np.arange(-count, count + 1)
        there = np.clip(rows + shifts[:, None], 0, len(rows) - 1)
        return (before[there] - np.sqrt(np.maximum(self.depth**2 - (shifts * STEP) ** 2, 0.0))[:, None]).min(axis=0)


def helix(away: ndarray, heights: ndarray, pitch: float, turn: float) -> tuple[ndarray, ndarray, ndarray]:
    """Angles, distances from the axis and heights of a helix along a line of the half plane, a `pitch` (mm of the line)
    a turn, no more than `turn` radians apart. In hollows of the line, where a turn on either side would leave more than
    a cusp, and at its end it goes round once."""
    along = np.r_[0.0, np.cumsum(np.hypot(np.diff(away), np.diff(heights)))]
    sag = np.zeros(len(away))
    sag[HOLLOW:-HOLLOW] = (away[: -2 * HOLLOW] + away[2 * HOLLOW :]) / 2 - away[HOLLOW:-HOLLOW]
    places = [along[a + sag[a:b].argmax()] for a, b in runs_of(sag > CUSP / 2)]
    knots = np.r_[0.0, np.repeat([*places, along[-1]], 2)]
    angles = 2 * np.pi * np.cumsum(np.r_[0.0, np.where(np.diff(knots) > 0, np.diff(knots) / pitch, 1.0)])
    angle = np.linspace(0.0, angles[-1], int(np.ceil(angles[-1] / turn)) + 1)
    at = np.interp(angle, angles, knots)
    return angle, np.interp(at, along, away), np.interp(at, along, heights)


def settled_neck(job: Job) -> Job:
    """The job that says how stock and neck come out of the bar: milled, where that is left open and can be."""
    holding = job.holding
    if holding.neck != AUTO:
        return job
    return replace(job, holding=replace(holding, neck=TURNED if _not_milled(job, job.stock.kind) else MILLED))


def check_blank(setup: Setup, job: Job) -> None:
    """JobError where a stock that is to be milled from the bar cannot be."""
    why = _not_milled(job, setup.stock.kind)
    if job.holding.neck == MILLED and why:
        raise field_error("holding", "neck", job.holding.neck, f"{why}, or 'turned'")


def _not_milled(job: Job, kind: str) -> str:
    """Why a stock of a kind is not milled from the bar, with the remedy: it is none of revolution, stands on no bar, or
    its neck is too short for the finishing ball; empty where it is."""
    holding = job.holding
    if job.path.strategy != "morph":
        return f"the strategy {job.path.strategy!r} does not mill the blank: give path.strategy = 'morph'"
    if kind != Capsule.kind:
        return f"a {kind} cannot be milled from the bar: give stock.kind = 'capsule'"
    if not (holding.stub_length or holding.names_nothing):
        return "there is no bar to mill it from: give holding.stub_length, or nothing of the holding"
    if holding.has_tailstock:
        return "the bracket of a tailstock stands where the bar's end is milled: give no tailstock"
    need = holding.support_height + 2 * job.finishing.radius
    if 0 < holding.length < need:
        return f"the finishing ball does not get between stub and stock: give holding.length = {need:g} or more"
    return ""


def blank_paths(stock: Stock, post: Post, clamping: Clamping, job: Job, limits: MachineLimits) -> list[ToolPath]:
    """The paths that mill stock and neck from the bar; none where they are turned before. OrientationError where no
    cutter gets all round."""
    stub = clamping.stub
    bar = bar_of(stock, job.holding)
    if stub is None or bar is None:
        return []
    widest = max(job.tool(name).radius for name in ("roughing", "finishing"))
    heights = np.arange(stub.top, bar.top + widest + STEP, STEP)
    stays = stock_profile(stock, post.radius, stub.top, heights)
    material = Profile(heights, np.where(heights <= bar.top, bar.radius, -1.0))
    cap = float(stock.bounds[1, 2]) - stock.diameter / 2
    paths: list[ToolPath] = []
    for cutter in parting_cutters(job, limits.bodies):
        final = np.maximum(stays.around(cutter.radius), NEAREST)
        lathe = Lathe(cutter, final, stub.top + cutter.radius, blank_depth(cutter) - CUSP_SHARE * cutter.radius)
        for upper in (True, False):
            for stretches, cusp in lathe.layers(material, stays, (heights > cap) == upper):
                after = material
                for away, at in stretches:
                    after = after.without(away, at, cutter.radius)
                scene = _scene(material, stays, stock, bar, post, clamping, job, cutter)
                layer = _contacts(stretches, lathe, stays, job, cusp, upper, number=len(paths) + 1)
                leans = (UPRIGHT, *LEANS) if upper else LEANS
                paths.append(_leaning(layer, scene, limits, job, leans, paths[-1] if paths else None))
                material = after
    return without_returns(paths)


def _contacts(
    stretches: list[Line], lathe: Lathe, stays: Profile, job: Job, cusp: float, upper: bool, number: int
) -> ContactPath:
    """The contacts of a layer that leaves a `cusp` (mm), a pass each stretch, from the top down; seen from above
    clockwise at the `upper` end, where the tool stands along the bar and climbs so, else counter-clockwise."""
    cutter, sense = lathe.cutter, -1.0 if upper else 1.0
    parts = []
    for index, (away, at) in enumerate(stretches):
        half = np.arccos(1 - job.path.chord_tolerance / float(away.max()))
        turn = min(2 * half, MAX_STEP / float(away.max()), MOST_TURN)
        angle, radii, z = helix(away, at, flat_step(cutter.radius, cusp), turn)
        angle *= sense
        # The normal of what stays where the ball touches it, else away from the axis
        final = np.interp(z, stays.heights, lathe.final)
        slope = np.gradient(lathe.final, STEP)
        rise = np.where(radii - final < LEAST, -np.interp(z, stays.heights, slope), 0.0)
        flat = 1 / np.hypot(1.0, rise)
        normals = np.column_stack([flat * np.cos(angle), flat * np.sin(angle), rise * flat])
        centres = np.column_stack([radii * np.cos(angle), radii * np.sin(angle), z])
        feeds = sense * np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle])
        parts.append((np.full(len(angle), index), centres, normals, feeds))
    passes, centres, normals, feeds = (np.concatenate(each) for each in zip(*parts, strict=True))
    count = len(passes)
    return ContactPath(
        level=BLANK,
        cutter=cutter,
        pass_index=passes,
        parameters=np.full((count, 2), np.nan),
        contacts=centres - cutter.radius * normals,
        normals=normals,
        feeds=feeds,
        centres=centres,
        lifts=np.zeros(count),
        ramp=np.zeros(count, dtype=bool),
        uncut=np.zeros((0, 3)),
        reasons=(),
        rest=number,
    )


def _scene(
    material: Profile,
    stays: Profile,
    stock: Stock,
    bar: Column,
    post: Post,
    clamping: Clamping,
    job: Job,
    cutter: Cutter,
) -> Scene:
    """What stands round the tool on a layer. The stub is held by its foot: its upper end is cut with the neck's."""
    stub = clamping.stub
    assert stub is not None
    foot = replace(stub, top=stub.top - 2 * STUB_CLEARANCE)
    around = Capsule(np.array([0.0, 0.0, stub.bottom]), np.array([0.0, 0.0, bar.top]), bar.radius + AROUND)
    return Scene(
        level=stock.mesh(job.path.chord_tolerance),
        material=material.mesh(job.path.chord_tolerance, max(CUSP, CUSP_SHARE * cutter.radius)),
        stock=around,
        post=post,
        clamping=replace(clamping, stub=foot),
    )


def _leaning(
    contacts: ContactPath,
    scene: Scene,
    limits: MachineLimits,
    job: Job,
    leans: Sequence[float],
    before: ToolPath | None,
) -> ToolPath:
    """The path of a layer with the first of these angles (rad) with which all of it is cut, `before` it that path."""
    out = contacts.normals * [1.0, 1.0, 0.0]
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    for lean in leans:
        axes = np.sin(lean) * np.array([0.0, 0.0, 1.0]) + (np.cos(lean) if lean < UPRIGHT else 0.0) * out
        try:
            path = orient(contacts, scene, limits, job.path, job.nc, fixed=axes, before=before)
        except OrientationError:
            continue
        if not len(path.uncut):
            return path
    remedy = 'give holding.neck = "turned", a longer post (holding.length) or a longer overhang'
    raise OrientationError(f"blank {contacts.rest}: no tool axis leads all round the bar: {remedy}")
