"""Material removal simulated from the posted text.

The text is read back and run through the machine's kinematics. Between blocks the control moves as
`machine/control.py` says; the path of the ball's centre is divided until it is straight within 1 um, and each piece
removes its capsule from the stock, which is held as intervals on three sets of rays (Benouamer & Michelucci 1997).
Post and stub are part of the material, above what holds them, and so is what holds the free end. Of a move from an
unknown place, after a retract or a tool change, only the end is run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.kernels.removal.rays import RaySet
from bonecam.kernels.removal.sweep import Pieces
from bonecam.machine.machine import Machine
from bonecam.material.cut_depths import cut_depths, move_through
from bonecam.material.dexels import copy_of
from bonecam.mechanics.loads import Loads
from bonecam.mechanics.result import mechanics_of
from bonecam.mechanics.workpiece import Workpiece
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.motions import Motions
from bonecam.nc.reading.read import read_program
from bonecam.progress import Progress, report, silent
from bonecam.setup.stock import Stock
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.verify.removal.clearances.link_bodies import body_clearance
from bonecam.verify.removal.clearances.table import table_clearance
from bonecam.verify.removal.groups import Group, feed_minutes, groups_of, link_volumes, time_shares, tools_of
from bonecam.verify.removal.left import measure_left
from bonecam.verify.removal.normal_probes import NormalProbes
from bonecam.verify.removal.pieces import straight_pieces
from bonecam.verify.removal.result import LINK_ALLOWED, RAPID_ALLOWED, Clearance, LevelRemoval, Removal, Spot
from bonecam.verify.removal.stock_heights import StockHeights, parted_bridge, stock_heights
from bonecam.verify.removal.sweeping import PARTS, Accuracy, SimulatedStock, Sweeping, material_of, volumes
from bonecam.workholding.clamping import Clamping
from bonecam.workholding.post import Post


def simulate_removal(
    text: str,
    machine: Machine,
    dialect: Dialect,
    stock: Stock,
    post: Post,
    cutters: Sequence[Cutter],
    *,
    clamping: Clamping | None = None,
    part: TSpline | None = None,
    limits: Mapping[int, float] | None = None,
    scallops: Mapping[int, float] | None = None,
    surfaces: Mapping[int, TriangleMesh] | None = None,
    accuracy: Accuracy | None = None,
    workpiece: Workpiece | None = None,
    progress: Progress = silent,
) -> Removal:
    """What the program `text` removes from `stock` on its `post`, what it leaves on `part`, and what its
    tools touch.

    `cutters` are the tools with shank, holder and spindle nose, by number; `clamping` is what stands below (None: a
    table that nothing may go below); `limits` the largest depth (mm) of the cut on each level, `scallops` what it may
    leave (mm; by default that of its tool); `surfaces` the meshes that levels leave, on which is told what stands;
    force and bending of the `workpiece` are told if there is one. ProgramError where the text cannot be read or calls
    another tool, JobError where the rays need too much memory, MachineError as in
    `body_clearance`.
    """
    clamping = (clamping or Clamping()).with_pin(post)
    carried = [Cylinder(one.radius, one.bottom, one.top, (one.x, one.y)) for one in clamping.carried(post)]
    material = material_of([stock, *carried], part, accuracy or Accuracy())
    given = text, machine, dialect, material, post, cutters
    asked = clamping, limits, scallops, surfaces, workpiece, progress
    return simulate_further(*given, *asked)


def simulate_further(
    text: str,
    machine: Machine,
    dialect: Dialect,
    material: SimulatedStock,
    post: Post | None,
    cutters: Sequence[Cutter],
    clamping: Clamping | None = None,
    limits: Mapping[int, float] | None = None,
    scallops: Mapping[int, float] | None = None,
    surfaces: Mapping[int, TriangleMesh] | None = None,
    workpiece: Workpiece | None = None,
    progress: Progress = silent,
) -> Removal:
    """What the program `text` removes from `material`, which it changes; otherwise as `simulate_removal`."""
    report(progress, 0.0, "reading the program for the simulation")
    motions = read_program(text, machine, dialect)
    tools = tools_of(motions, cutters)
    sweeping = Sweeping(material.sets, material.grid, material.bounds, len(motions.tips))
    kept = clamping or Clamping(), limits or {}, surfaces or {}
    bodies = body_clearance(motions, machine, list(tools.values()), kept[0], material.bounds)
    simulation = _Simulation(motions, sweeping, material.normal_probes, *kept, workpiece)
    groups = list(groups_of(text, motions, dialect))
    levels = []
    for count, group in enumerate(groups):
        report(progress, count / len(groups), f"simulating level {group.level}")
        before = [one for one in groups[:count] if one.level != group.level]
        left = {one.level: tools[one.tool].scallop for one in before[-1:]} | dict(scallops or {})
        scallop = left[before[-1].level] if before else 0.0
        levels.append(simulation.run(group, tools[group.tool], scallop))
    bridge = parted_bridge(groups, motions, tools, post, sweeping.sets, grid=material.grid) if post else None
    return replace(simulation.result(levels, tools, post), bridge=bridge, bodies=bodies)


@dataclass(eq=False)
class _Simulation:
    """One program being run; what stands lies in `sweeping`."""

    motions: Motions
    sweeping: Sweeping
    normal_probes: NormalProbes | None
    clamping: Clamping
    limits: Mapping[int, float]
    surfaces: Mapping[int, TriangleMesh]
    workpiece: Workpiece | None

    def __post_init__(self) -> None:
        self.grid = self.sweeping.grid
        self.minutes = feed_minutes(self.motions)
        self.loads = Loads(self.workpiece, self.minutes, self.motions.spindle)
        self.finished = self.normal_probes.finished if self.normal_probes is not None else None
        self.table = self.tailstock = Clearance("tool", None, 0)
        self.standing: list[StockHeights] = []

    def run(self, group: Group, cutter: Cutter, scallop: float) -> LevelRemoval:
        """Run the moves of one path on a level; the level before may have left this `scallop`, mm."""
        before = [copy_of(rays) for rays in self.sweeping.sets]
        surface = self.surfaces.get(group.level) if group.level is not None else None

        def cut_normal_probes(pieces: Pieces) -> None:
            if self.normal_probes is not None:
                self.normal_probes.cut(pieces, cutter.radius)

        whole = straight_pieces(self.motions, group.moves, cutter)
        edges = self.loads.edges(whole, self.grid, cutter)
        pieces = self.sweeping.run(whole, cutter, cut_normal_probes, edges.asked)
        seen = self.sweeping.standing, self.finished
        self.loads.take((group.level, group.rest), pieces, edges, cutter, *seen)
        if surface is not None and group.level is not None:
            after = self._standing(surface, self.sweeping.sets)
            self.standing.append(StockHeights(group.level, self._standing(surface, before), after))
        self.table = self._nearer(self.table, whole, cutter, self.clamping.below)
        if self.clamping.beside:
            self.tailstock = self._nearer(self.tailstock, whole, cutter, self.clamping.above)
        depths = cut_depths(self.sweeping.sets, before, self.grid)
        deepest = None
        if len(depths.depths):
            place = depths.places[depths.deepest]
            move = move_through(place, pieces, cutter.envelope_radius)
            deepest = self._spot(float(depths.depths[depths.deepest]), move, place)
        limit = self.limits.get(group.level) if group.level is not None else None
        if limit is not None and group.level is not None and group.level >= 0 and group.rest:
            limit = cutter.rest_depth(limit, self.limits.get(group.level + 1, limit))
        links = group.moves[self.motions.links[group.moves]]
        removed = self.sweeping.volumes
        air, rubbing = time_shares(group.moves, self.minutes, removed, self.motions, cutter.radius)
        return LevelRemoval(
            index=group.level,
            rest=group.rest,
            tool=group.tool,
            removed=float(removed[group.moves].sum()),
            deepest=deepest,
            depths=depths.depths,
            over_limit=None if limit is None else max((deepest.value if deepest else 0.0) - limit, 0.0),
            over_allowed=scallop + self.grid.cell / 2,
            air_time_share=air,
            rubbing_time_share=rubbing,
            links=float(removed[links].sum()),
            link_depth=self._deepest(links),
        )

    def _deepest(self, moves: Int[ndarray, " m"]) -> Spot | None:
        """The deepest cut of some rapids or links; None where none cuts."""
        depths = self.sweeping.depths[moves]
        if not depths.any():
            return None
        return self._spot(float(depths.max()), int(moves[np.argmax(depths)]))

    def _nearer(self, known: Clearance, pieces: Pieces, cutter: Cutter, clamping: Clamping) -> Clearance:
        """The clearance from a clamping where it is less than is `known`; the first contact stays."""
        if known.touched:
            return known
        within = known.least.value if known.least else np.inf
        least, move, part, touched = table_clearance(pieces, cutter, clamping, within)
        line = int(self.motions.lines[touched]) if touched >= 0 else 0
        return Clearance(part, self._spot(least, touched if line else move), line) if move >= 0 else known

    def result(self, levels: Sequence[LevelRemoval], tools: Mapping[int, Cutter], post: Post | None) -> Removal:
        """What was found over all levels."""
        removed = self.sweeping.volumes
        rapid = np.where(self.motions.rapid, removed, 0.0)
        over = np.flatnonzero(rapid > RAPID_ALLOWED)
        contact = self._spot(float(rapid[over[0]]), int(over[0])) if len(over) else None
        by_link, moves = link_volumes(removed, self.motions.links)
        most = int(np.argmax(by_link)) if len(by_link) else -1
        reported = most >= 0 and by_link[most] > LINK_ALLOWED
        finest = min(tools[number].radius for number in np.unique(self.motions.tools).tolist())
        left = None
        if self.normal_probes is not None:
            self.normal_probes.measure_the_uncut(self.sweeping.sets, self.grid)
            left = measure_left(self.normal_probes, post, finest, self.motions)
        standing = volumes(self.sweeping.sets)
        return Removal(
            cell=self.grid.cell,
            levels=tuple(levels),
            rapid_volume=float(rapid.sum()),
            rapid_contact=contact,
            link_contact=self._spot(float(by_link[most]), int(moves[most])) if reported else None,
            shank=self._clearance(0),
            holder=self._clearance(1),
            spindle=self._clearance(2),
            table=self.table,
            tailstock=self.tailstock if self.clamping.beside else None,
            left=left,
            volume=float(np.mean(standing)),
            volume_error=float(np.ptp(standing)),
            move_volumes=removed,
            remaining=SimulatedStock(self.sweeping.sets, self.grid, self.normal_probes),
            standing=tuple(self.standing),
            mechanics=mechanics_of(self.loads),
        )

    def _clearance(self, part: int) -> Clearance:
        """What the rays tell of one of PARTS."""
        value, move = self.sweeping.clearance(part)
        touched = self.sweeping.touched(part)
        line = int(self.motions.lines[touched]) if touched >= 0 else 0
        return Clearance(PARTS[part], self._spot(value, move) if move >= 0 else None, line)

    def _standing(self, surface: TriangleMesh, sets: Sequence[RaySet]) -> Float[ndarray, " n"]:
        return stock_heights(surface.vertices, vertex_normals(surface), sets, self.grid, self.grid.cell / 2)

    def _spot(self, value: float, move: int, place: np.ndarray | None = None) -> Spot:
        x, y, z = (float(v) for v in (self.motions.tips[move] if place is None else place))
        return Spot(value, int(self.motions.lines[move]), (x, y, z))
