"""Material removal simulated from the posted text: what each move removes, what stays, and what touches; and what of
it refuses a program: rapids and links that cut, a tool that touches what it may not, a ball in the part, a cut too
deep.

The text is read back and run through the machine's kinematics. Between blocks the control moves as
`machine/control.py` says; the path of the ball's centre is divided until it is straight within 1 um, and each piece
removes its capsule from the stock, which is held as intervals on three sets of rays (Benouamer & Michelucci 1997).
Post and stub are part of the material, above what holds them, and so is what holds the free end. Of a move from an
unknown place, after a retract or a tool change, only the end is run.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import BodiesError, VerifyError, knowing, place_name
from bonecam.job import Job
from bonecam.kernels.rays import RaySet
from bonecam.kernels.removal import Pieces
from bonecam.levels.measure import Level, morph_surfaces
from bonecam.machine.machine import Machine
from bonecam.material.dexels import copy_of, cut_depths, move_through
from bonecam.mechanics.loads import Loads, Workpiece, stump_workpiece, workpiece_of
from bonecam.mechanics.result import mechanics_of
from bonecam.mesh.facets import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.motions import Motions
from bonecam.nc.path_words import machine_limits
from bonecam.nc.reading import read_program
from bonecam.planning.blank import CUSP, bar_of, blank_depth
from bonecam.planning.contacts import at_post
from bonecam.planning.stump import parting_cutters
from bonecam.progress import Progress, report, silent
from bonecam.setup.stock import Stock
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.surface.tspline import TSpline
from bonecam.text.numbers import told_apart
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import BESIDE, BLANK, PARTING
from bonecam.verify.clearances import NEAR, body_clearance, nearest_body, shell_clearance, table_clearance
from bonecam.verify.clearances import TOUCHING as BODIES_NEAR
from bonecam.verify.findings import (
    LINK_ALLOWED,
    RAPID_ALLOWED,
    Clearance,
    GivenSurface,
    LevelRemoval,
    Removal,
    Spot,
    beside_limits,
    measure_given,
    measure_left,
)
from bonecam.verify.gouge import Gouge
from bonecam.verify.sweeping import (
    PARTS,
    Accuracy,
    Group,
    SimulatedStock,
    StockHeights,
    Sweeping,
    feed_minutes,
    groups_of,
    link_volumes,
    material_of,
    parted_bridge,
    stock_heights,
    straight_pieces,
    time_shares,
    tools_of,
    volumes,
)
from bonecam.workholding.clamping import Clamping, clamping_of
from bonecam.workholding.post import Column, Post, post_below

REMEDIES = {
    "shank": "give a slimmer shank, or a larger overhang or flute length",
    "holder": "give a slimmer holder, or a larger overhang",
    "spindle": "give a longer holder or a longer post (holding.length)",
    "tailstock": "give a longer pin (holding.tailstock_length) or a farther column (holding.tailstock_reach)",
    "bodies": "give a longer post (holding.length) or overhang, or narrower limits_deg of the axis that brings them "
    "together, as paths are planned round nose and table alone",
    "shell": "end the shell farther up the part, or give a longer overhang",
}
"""What to do where a part of the tool enters material, and where the tool meets tailstock or shell."""


def check_removal(
    removal: Removal, gouge_tolerance: float = 0.01, bridge: float = 0.0, *, limited: bool = True
) -> None:
    """VerifyError, with `line` and `place`, where a rapid removes material or the moves between two passes more
    than LINK_ALLOWED, shank, holder or spindle enter what stands, the tool meets table, chuck, tailstock or shell,
    a body of the machine meets anything (BodiesError), a ball goes into the part by more than `gouge_tolerance` mm
    or too deep into the mesh as given, or a cut is deeper than its limit by more than is allowed (`over_allowed`);
    where a level is cut after the parting; and where nothing, or less than a `bridge` of this diameter (mm, within
    two cells), is left of a post that is parted: the part drops.

    Leftovers are told in the report and refuse nothing; nor do depths where they are not `limited`.
    """
    if removal.rapid_contact:
        _refuse(
            removal.rapid_contact,
            f"a rapid removes {removal.rapid_contact.value:.4f} mm3",
            "make it a feed, or retract farther before it; for a program of bonecam try a larger path.clearance",
        )
    for part in (removal.shank, removal.holder, removal.spindle):
        _check_clearance(part, "enters material", REMEDIES[part.part])
    _check_clearance(removal.table, "meets table or chuck", "give a longer post (holding.length) or overhang")
    if removal.tailstock is not None:
        _check_clearance(removal.tailstock, "meets the tailstock", REMEDIES["tailstock"])
    if removal.bodies is not None:
        what = f"comes within {BODIES_NEAR:g} mm of the {removal.bodies.other}"
        _check_clearance(removal.bodies, what, REMEDIES["bodies"], BodiesError)
    if removal.shell is not None:
        _check_clearance(removal.shell, f"comes within {NEAR:g} mm of the shell", REMEDIES["shell"])
    if removal.link_contact:
        _refuse(
            removal.link_contact,
            f"the moves from one pass to the next remove {removal.link_contact.value:.4f} mm3, "
            f"allowed {LINK_ALLOWED:g},",
            "lift them, or mark them as a cut; for a program of bonecam try another path.pattern",
        )
    if removal.left is not None and removal.left.deepest_gouge.value > gouge_tolerance:
        depth, most = told_apart(removal.left.deepest_gouge.value, gouge_tolerance, decimals=4)
        _refuse(
            removal.left.deepest_gouge,
            f"the tool goes {depth} mm into the part, allowed {most},",
            "lift the path there; for a program of bonecam try a smaller path.chord_tolerance, a larger tip or a "
            "longer post (holding.length)",
        )
    for level in removal.levels if limited else ():
        if level.deepest and level.over_limit is not None and level.over_limit > level.over_allowed:
            name = f"the {BESIDE[level.index]}" if level.index in BESIDE else f"level {level.index}"
            _refuse(
                level.deepest,
                f"a cut of {name} is {level.deepest.value:.3f} mm deep, {level.over_limit:.3f} over its "
                f"limit, allowed {level.over_allowed:.3f},",
                "cut the levels in their order; for a program of bonecam try a smaller scallop of the cutter before",
            )
    # VerifyError where a level is cut after the parting.
    parted = False
    for level in removal.levels:
        if parted and level.index != PARTING and level.deepest:
            what = "a cut follows the parting, on a part that only the bridge holds,"
            _refuse(level.deepest, what, "part at the end of the program")
        parted |= level.index == PARTING
    if removal.given is not None:
        removal.given.check()
    if removal.bridge is not None and not removal.bridge > max(bridge - 2 * removal.cell, 0.0):
        raise VerifyError(
            f"parting: {removal.bridge:.2f} mm of the post hold the part, {bridge:g} mm are wanted: write the "
            "program again, or give a larger holding.parting_core",
            error=bridge - removal.bridge,
        )


def _refuse(spot: Spot, what: str, remedy: str) -> None:
    """The VerifyError of what was found at a spot."""
    raise VerifyError(
        f"line {spot.line}: {what} at {place_name(spot.place)}: {remedy}",
        line=spot.line,
        place=spot.place,
        error=spot.value,
    )


def _check_clearance(clearance: Clearance, what: str, remedy: str, kind: type[VerifyError] = VerifyError) -> None:
    """The error of this kind where this part of the tool touches."""
    if clearance.touched and clearance.least:
        place = clearance.least.place
        raise kind(
            f"line {clearance.touched}: the {clearance.part} {what} at {place_name(place)}: {remedy}",
            line=clearance.touched,
            place=place,
            error=-clearance.least.value,
        )


def simulate_removal(
    text: str,
    machine: Machine,
    dialect: Dialect,
    stock: Stock | SimulatedStock,
    post: Post | None,
    cutters: Sequence[Cutter],
    *,
    clamping: Clamping | None = None,
    part: TSpline | None = None,
    limits: Mapping[int, float] | None = None,
    scallops: Mapping[int, float] | None = None,
    surfaces: Mapping[int, TriangleMesh] | None = None,
    accuracy: Accuracy | None = None,
    workpiece: Workpiece | None = None,
    bar: Column | None = None,
    progress: Progress = silent,
) -> Removal:
    """What the program `text` removes from `stock` on its `post`, what it leaves on `part`, and what its
    tools touch. A stock in rays is changed; it holds what is carried already, and the normal probes on the part.

    `cutters` are the tools with shank, holder and spindle nose, by number; `clamping` is what stands below (None: a
    table that nothing may go below); `limits` the largest depth (mm) of the cut on each level, `scallops` what it may
    leave (mm; by default that of its tool); `surfaces` the meshes that levels leave, on which is told what stands;
    force and bending of the `workpiece` are told if there is one; `bar` is what stock and neck are milled from.
    ProgramError where the text cannot be read or calls another tool, JobError where the rays need too much memory,
    MachineError as in `body_clearance`.
    """
    clamping = clamping or Clamping()
    if not isinstance(stock, SimulatedStock):
        assert post is not None
        clamping = clamping.with_pin(post)
        carried = [
            Cylinder(one.radius, one.bottom, one.top, (one.x, one.y))
            for one in (*clamping.carried(post), *([bar] if bar else []))
        ]
        stock = material_of([stock, *carried], part, accuracy or Accuracy())
    report(progress, 0.0, "reading the program for the simulation")
    motions = read_program(text, machine, dialect)
    tools = tools_of(motions, cutters)
    bodies = body_clearance(motions, machine, list(tools.values()), clamping, stock.bounds)
    simulation = _Simulation(motions, stock, clamping, limits or {}, surfaces or {}, workpiece)
    groups = list(groups_of(text, motions, dialect))
    levels = []
    for count, group in enumerate(groups):
        report(progress, count / len(groups), f"simulating level {group.level}")
        before = [one for one in groups[:count] if one.level != group.level]
        left = {one.level: tools[one.tool].scallop for one in before[-1:]} | dict(scallops or {})
        scallop = left[before[-1].level] if before else 0.0
        levels.append(simulation.run(group, tools[group.tool], scallop))
    sets = simulation.sweeping.sets
    bridge = parted_bridge(groups, motions, tools, post, sets, grid=stock.grid) if post else None
    return replace(simulation.result(levels, tools, post), bridge=bridge, bodies=bodies)


@dataclass(eq=False)
class _Simulation:
    """One program being run; what stands lies in `sweeping`."""

    motions: Motions
    material: SimulatedStock
    clamping: Clamping
    limits: Mapping[int, float]
    surfaces: Mapping[int, TriangleMesh]
    workpiece: Workpiece | None

    def __post_init__(self) -> None:
        material = self.material
        self.grid, self.normal_probes = material.grid, material.normal_probes
        self.sweeping = Sweeping(material.sets, self.grid, material.bounds, len(self.motions.tips))
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
        below = self.clamping.below  # while the blank is milled the bar is one, and what is cut
        stands = replace(below, stub=None) if group.level == BLANK else below
        self.table = self._nearer(self.table, whole, cutter, stands)
        if self.clamping.beside:
            self.tailstock = self._nearer(self.tailstock, whole, cutter, self.clamping.above)
        depths = cut_depths(self.sweeping.sets, before, self.grid)
        deepest = None
        if len(depths.depths):
            place = depths.places[depths.deepest]
            move = move_through(place, pieces, cutter.radius)
            deepest = self._spot(float(depths.depths[depths.deepest]), move, place)
        limit = self.limits.get(group.level) if group.level is not None else None
        if limit is not None and group.level is not None and group.level >= 0 and group.rest:
            limit = cutter.rest_depth(limit, self.limits.get(group.level + 1, limit))
        links = group.moves[self.motions.links[group.moves]]
        link_depths = self.sweeping.depths[links]
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
            link_depth=(
                self._spot(float(link_depths.max()), int(links[np.argmax(link_depths)])) if link_depths.any() else None
            ),
        )

    def _nearer(self, known: Clearance, pieces: Pieces, cutter: Cutter, clamping: Clamping) -> Clearance:
        """The clearance from a clamping where it is less than is `known`; the first contact stays."""
        if known.touched:
            return known
        within = known.least.value if known.least else np.inf
        least, move, part, touched = table_clearance(pieces, cutter, clamping, within)
        line = int(self.motions.lines[touched]) if touched >= 0 else 0
        if move < 0:
            return known
        nearest = touched if line else move
        there = Pieces._make(column[pieces.moves == nearest] for column in pieces)
        return Clearance(part, self._spot(least, nearest), line, other=nearest_body(there, cutter, clamping))

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


ACCURACY = Accuracy(cell=0.1, coarser=True)
"""Of the simulation in `convert`. Against cells of 0.05 mm the phalanx's depths change by 0.01 mm, its clearances by
0.003 mm, leftovers and gouges not at all, in half of the time."""


def cutters_of(job: Job, machine: Machine) -> list[Cutter]:
    """The cutters of a job in the machine's spindle."""
    return [
        Cutter.from_job(number, name, job.tool(name), machine.bodies.nose)
        for number, name in enumerate(job.cutter_names, 1)
    ]


MOST_LAYERS = 2000
"""More layers than a strategy ever has: those of the thinnest roughing cuts of a bone."""


def depth_limits(text: str, machine: Machine, dialect: Dialect, job: Job, limits: Iterable[float]) -> dict[int, float]:
    """The largest depth (mm) of the cut on each level, of which `limits` tells, or on each layer of a `text` in layers,
    and of PARTING."""
    if job.path.strategy == "morph":
        of_path = dict(enumerate(limits))
    else:
        of_path = layer_limits(text, read_program(text, machine, dialect), dialect, job)
    deepest = max(blank_depth(cutter) for cutter in parting_cutters(job, machine.bodies))
    return of_path | {PARTING: job.levels.layer_depth, BLANK: deepest}


def layer_limits(text: str, motions: Motions, dialect: Dialect, job: Job) -> dict[int, float]:
    """The largest depth (mm) of the cut on each layer of a program: that of the cutter, as its `text` and its `motions`
    tell."""
    depths = {"roughing": job.levels.layer_depth, "finishing": job.levels.finishing_depth}
    limit_of = {number: depths[name] for number, name in enumerate(job.cutter_names, 1) if name in depths}
    groups = groups_of(text, motions, dialect)
    return {one.level: limit_of[one.tool] for one in groups if one.level is not None and one.tool in limit_of}


def level_scallops(job: Job, levels: int) -> dict[int, float]:
    """The scallop (mm) that the path of each of so many levels may leave; none of layers, which leave those of their
    cutters."""
    if job.path.strategy != "morph":
        return {}
    return {index: job.scallop(index) for index in range(levels)} | {BLANK: CUSP}


def followed_surfaces(job: Job, meshes: Mapping[int, TriangleMesh]) -> dict[int, TriangleMesh]:
    """The mesh of each level that a path follows; of layers, which follow no level, that of the part. `meshes` are
    those of all levels by number."""
    if job.path.strategy == "morph":
        return {index: mesh for index, mesh in meshes.items() if index < max(meshes)}
    return dict.fromkeys(range(MOST_LAYERS), meshes[0])


def with_limits(removal: Removal, machine: Machine, job: Job) -> Removal:
    """The removal with what it leaves where no tool axis of the machine is within path.max_tilt_deg of the normal."""
    assert removal.left is not None
    tilt = float(np.radians(job.path.max_tilt_deg))
    return replace(removal, left=beside_limits(removal.left, removal.remaining.probes, machine_limits(machine), tilt))


def prove_removal(
    text: str,
    machine: Machine,
    dialect: Dialect,
    job: Job,
    stock: Stock,
    levels: Sequence[Level],
    progress: Progress = silent,
    given: GivenSurface | None = None,
    *,
    mechanics: bool = True,
    check: bool = True,
) -> Removal:
    """What the posted `text` of a job removes from its stock; `levels` are those it cuts, `given` is the part as it was
    given. Without `mechanics` force and bending are left out. Errors as in `simulate_removal`, and as in
    `check_removal`: without the `check` what a program may not do is told, not refused.
    """
    post = post_below(levels[0].mesh, job.holding)
    clamping = clamping_of(job.holding, machine.table)
    removal = simulate_removal(
        text,
        machine,
        dialect,
        stock,
        post,
        cutters_of(job, machine),
        clamping=clamping,
        part=morph_surfaces(levels)[0],
        limits=depth_limits(text, machine, dialect, job, (level.limit for level in levels[1:])),
        scallops=level_scallops(job, len(levels)),
        surfaces=followed_surfaces(job, {level.index: level.mesh for level in levels}),
        accuracy=ACCURACY,
        workpiece=workpiece_of(job, post, clamping) if mechanics else None,
        bar=bar_of(stock, job.holding),
        progress=progress,
    )
    removal = with_limits(removal, machine, job)
    removal = removal if given is None else beside_given(removal, given, post, job)
    if check:
        with knowing(removal.sections):
            check_removal_of_job(removal, job)
    return removal


def beside_given(
    removal: Removal, given: GivenSurface, post: Post | None, job: Job, ball: Gouge | None = None
) -> Removal:
    """The removal with what it leaves beside the part as it was `given`, which stands on this `post`; `ball` is where
    one goes deepest into that, if it was measured."""
    probes = removal.remaining.probes
    held = np.zeros(len(probes.points), dtype=bool)
    if post is not None:
        held = at_post(probes.points, probes.normals, post, job.smallest_ball)
    return replace(removal, given=measure_given(probes, held, given, ball))


def simulate_stump(
    text: str,
    machine: Machine,
    dialect: Dialect,
    job: Job,
    material: SimulatedStock,
    part: TriangleMesh,
    shell: TriangleMesh,
    progress: Progress = silent,
    *,
    mechanics: bool = True,
) -> Removal:
    """What the `text` of a second clamping removes from the `material` that the first program left, which it changes,
    what stands on the turned `part`, and how near it comes to the `shell`; the job's [holding] is that of the shell.

    Errors as in `simulate_removal`; force and bending are left out without `mechanics`.
    """
    motions = read_program(text, machine, dialect)
    limits = layer_limits(text, motions, dialect, job)
    cutters = cutters_of(job, machine)
    removal = simulate_removal(
        text,
        machine,
        dialect,
        material,
        None,
        cutters,
        clamping=clamping_of(job.holding, machine.table),
        limits=limits,
        surfaces=dict.fromkeys(limits, part),
        workpiece=stump_workpiece(job, part, shell) if mechanics else None,
        progress=progress,
    )
    return replace(removal, shell=shell_clearance(motions, cutters, shell))


def check_removal_of_job(removal: Removal, job: Job, deviation: float = 0.0, *, assumed: bool = False) -> None:
    """VerifyError as in `check_removal`, with the tolerance and the bridge of a job, and where the text does not part
    though the job wants it. Slices and sections of the part promise no depth: what they leave between them is told.
    A second clamping keeps the depths of its cutters, and parts nothing. What bends more than the job allows is refused
    too, if that was asked. Where the part is the solid under a surface, that lies up to a `deviation` (mm) over it;
    `assumed` as in `Mechanics.check`."""
    if removal.shell is not None:
        check_removal(removal, job.path.gouge_tolerance)
    else:
        if job.holding.parting and removal.bridge is None:
            raise VerifyError(
                "[holding] parting = true: no section of the program parts the post: give the whole program, or "
                "parting = false"
            )
        limited = job.path.strategy == "morph"
        check_removal(removal, job.path.gouge_tolerance + deviation, job.holding.bridge, limited=limited)
    if removal.mechanics is not None:
        removal.mechanics.check(assumed=assumed)
