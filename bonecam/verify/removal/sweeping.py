"""The material while a program runs: levels are swept one after the other, the three sets of rays side by
side."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.ndimage import distance_transform_edt

from bonecam.kernels.removal.bricks import SAMPLES, WATCHED, Bricks, bound_clearances, mark_bricks
from bonecam.kernels.removal.engagement import Edges
from bonecam.kernels.removal.rays import RaySet
from bonecam.kernels.removal.sweep import Pieces, SweepResult, sweep
from bonecam.material.dexels import with_more_room
from bonecam.material.rays import RayGrid, lay_grid, lay_rays, least_cell, order
from bonecam.mechanics.edges import NO_EDGES_ASKED
from bonecam.mechanics.workpiece import Standing
from bonecam.runtime.threads import in_pieces
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.verify.removal.normal_probes import NormalProbes, normal_probes_on
from bonecam.verify.removal.pieces import in_grid
from bonecam.verify.removal.stock_heights import rays_above

BRICK = 0.4
"""Side of the bricks, mm, in which tools are first looked at; larger where the box holds more than
MOST_BRICKS."""
MOST_BRICKS = 400_000
"""A distance transform of so many takes 0.05 s."""
BRICK_RAYS = 3
"""Every third ray either way marks the bricks."""
PARTS = ("shank", "holder", "spindle")
"""Parts of the tool that cut nothing."""
ALLOWED_TOUCH = -0.02
"""Signed distance of PARTS from material that is no collision yet, mm: rays and steps tell it to
0.02."""
BOUNDED = 4096
"""Pieces whose clearances are bounded at once."""


@dataclass(frozen=True)
class Accuracy:
    """Distance of the rays (`cell`, mm) and the memory that they and a copy of them may take (MB); where that does not
    suffice, a cell that fits is taken if `coarser`, or else refused."""

    cell: float = 0.05
    memory_mb: float = 500.0
    coarser: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.cell < np.inf:
            raise ValueError(f"a cell of {self.cell} mm: give a positive one, such as 0.05")


@dataclass(frozen=True, eq=False)
class SimulatedStock:
    """The material that stands: three `sets` of rays of a `grid`, and the `normal_probes` on the part (None where none
    is given), as they have been cut."""

    sets: Sequence[RaySet]
    grid: RayGrid
    normal_probes: NormalProbes | None

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner of the box of all rays, mm."""
        corners = self.grid.in_part(np.array(list(product(*zip(np.zeros(3), self.grid.size, strict=True)))))
        return np.array([corners.min(axis=0), corners.max(axis=0)])

    def move(self, pose: Float[ndarray, "4 4"]) -> "SimulatedStock":
        """The material under a rigid transform (4, 4); the rays are shared."""
        normal_probes = self.normal_probes.move(pose) if self.normal_probes is not None else None
        return SimulatedStock(self.sets, self.grid.move(pose), normal_probes)

    def above(self, height: float) -> "SimulatedStock":
        """The material above a height z, mm, in rays of its own."""
        sets = [rays_above(rays, self.grid, k, height) for k, rays in enumerate(self.sets)]
        return SimulatedStock(sets, self.grid, self.normal_probes)


def material_of(bodies: Sequence[Stock], part: TSpline | None, accuracy: Accuracy) -> SimulatedStock:
    """The union of convex bodies, and the normal probes on a `part`; JobError where the rays need too much memory."""
    grid = lay_grid(bodies, accuracy.cell)
    if accuracy.coarser:
        grid = lay_grid(bodies, max(accuracy.cell, least_cell(bodies, grid, accuracy.memory_mb)))
    return SimulatedStock(lay_rays(bodies, grid, accuracy.memory_mb), grid, normal_probes_on(part) if part else None)


class Sweeping:
    """Material that moves are taken out of; used for one program.

    `sets` are the rays along the three directions of `grid`, `found` what each has told so far; the material lies
    within `bounds`.
    """

    def __init__(self, sets: Sequence[RaySet], grid: RayGrid, bounds: Float[ndarray, "2 3"], moves: int) -> None:
        self.sets = list(sets)
        self.grid = grid
        self.bounds = bounds
        self.found = [
            SweepResult(np.zeros(moves), np.zeros(moves), np.full(3, WATCHED), np.full(3, -1), np.full(3, -1))
            for _ in range(3)
        ]

    def run(
        self, pieces: Pieces, cutter: Cutter, beside: Callable[[Pieces], None], edges: Sequence[Edges] = NO_EDGES_ASKED
    ) -> Pieces:
        """Take the pieces of one cutter out of the material, in their order, while a core that has no set of
        rays to cut works on them `beside`; returns them with their `reach`. Each set of rays answers what its `edges`
        engage before each piece is cut."""
        sections, parts = sections_of(cutter)
        least = np.max([swept.least for swept in self.found], axis=0)
        # flutes matter where they may meet material, the others where they may come nearer than they have
        bounded = _bounded(pieces, sections, np.r_[0.0, least[parts[1:]]], self._bricks())

        def work(which: slice) -> None:
            if which.start < len(self.sets):
                self._sweep(bounded, sections, parts, which.start, edges[which.start])
            else:
                beside(bounded)

        in_pieces(work, len(self.sets) + 1, 1)
        return bounded

    def _sweep(
        self, pieces: Pieces, sections: Float[ndarray, "s 4"], parts: Int[ndarray, " s"], direction: int, edges: Edges
    ) -> None:
        """Take the pieces out of one set of rays, with more room on them where it is needed."""
        turned = in_grid(pieces, self.grid, direction)
        radius = float(sections[0, 2])
        swept = self.found[direction]
        at = 0
        while at < len(pieces.starts):
            rays = self.sets[direction]
            at = sweep(
                rays=rays,
                pieces=turned,
                radius=radius,
                sections=sections[1:],
                parts=parts[1:],
                allowed=ALLOWED_TOUCH,
                first=at,
                found=swept,
                turn=direction,
                edges=edges,
            )
            if at < len(pieces.starts):
                self.sets[direction] = with_more_room(rays)

    def _bricks(self) -> Bricks:
        """The bricks of the material that stands now."""
        extent = self.bounds[1] - self.bounds[0]
        size = max(BRICK, float(np.cbrt(extent.prod() / MOST_BRICKS)))
        corner = self.bounds[0] - size
        occupied = np.zeros(np.ceil(extent / size).astype(int) + 2, dtype=bool)
        for direction, rays in enumerate(self.sets):
            rotation = np.ascontiguousarray(self.grid.rotation[order(direction)])
            mark_bricks(rays, rotation, self.grid.corner, BRICK_RAYS, corner, size=size, occupied=occupied)
        spare = size / SAMPLES / 2 + BRICK_RAYS * self.grid.cell
        if occupied.any():
            distance = distance_transform_edt(~occupied) * size
        else:
            distance = np.full(occupied.shape, float(np.linalg.norm(extent)) + WATCHED)
        return Bricks(distance, corner, size, spare)

    @property
    def standing(self) -> Standing:
        """What stands now."""
        return Standing(self.sets, self.grid, float(self.bounds[1, 2]), float(np.ptp(self.bounds[:, :2], axis=0).min()))

    @property
    def volumes(self) -> Float[ndarray, " n"]:
        """What each move has removed, the mean of the three sets, mm^3."""
        return np.mean([swept.volumes for swept in self.found], axis=0)

    @property
    def depths(self) -> Float[ndarray, " n"]:
        """How deep each rapid and link cuts, by the set that tells it best, mm; 0 for cutting moves."""
        return np.min([swept.depths for swept in self.found], axis=0)

    def clearance(self, part: int) -> tuple[float, int]:
        """The least signed distance (mm) of one of the PARTS from material, and its move (-1: more than WATCHED
        everywhere); of one that enters material that of the first move that does."""
        touching = [swept for swept in self.found if swept.touched[part] >= 0]
        if touching:
            first = min(touching, key=lambda swept: int(swept.touched[part]))
            return float(first.least[part]), int(first.touched[part])
        best = min(self.found, key=lambda swept: float(swept.least[part]))
        return float(best.least[part]), int(best.where[part])

    def touched(self, part: int) -> int:
        """The first move in which one of the PARTS enters material, -1 for none."""
        moves = [int(swept.touched[part]) for swept in self.found if swept.touched[part] >= 0]
        return min(moves, default=-1)


def volumes(sets: Sequence[RaySet]) -> list[float]:
    """The volume of the material as each set tells it, mm^3."""
    totals = []
    for rays in sets:
        used = np.arange(rays.spans.shape[2] // 2) < rays.counts[:, :, None]
        lengths = (rays.spans[:, :, 1::2] - rays.spans[:, :, ::2])[used]
        totals.append(float(lengths.sum(dtype=np.float64)) * rays.cell**2)
    return totals


def sections_of(cutter: Cutter) -> tuple[Float[ndarray, "s 4"], Int[ndarray, " s"]]:
    """The stack of a tool above its ball's centre: from, to (mm from there) and the radius at either end; and which
    of PARTS each is, -1 for the flutes, which come first."""
    rows = [
        (one.start - cutter.centre_height, one.end - cutter.centre_height, one.radius, one.end_radius)
        for one in cutter.profile
    ]
    return np.array(rows), np.array([-1, *(PARTS.index(one.name) for one in cutter.profile[1:])])


def _bounded(pieces: Pieces, sections: Float[ndarray, "s 4"], watched: Float[ndarray, " s"], bricks: Bricks) -> Pieces:
    """The pieces with what the bricks tell of flutes and of the sections above them."""
    bounds = np.empty((len(pieces.starts), len(sections)))
    near = np.empty((len(pieces.starts), len(sections), 2))

    def bound(some: slice) -> None:
        poses = (pieces.starts, pieces.ends, pieces.start_axes, pieces.end_axes)
        sliced = [pose[some] for pose in poses]
        bound_clearances(*sliced, sections, watched, bricks, bounds[some], near[some])

    in_pieces(bound, len(bounds), BOUNDED)
    reach = np.where(bounds[:, 0] < 0, near[:, 0, 1], 0.0)
    return pieces._replace(reach=reach, bounds=bounds[:, 1:].copy(), near=near[:, 1:].copy())
