"""Probing and roughness of what a program leaves, from its text: a ball that touches the machined surface, profiles.

The line of the part that is probed: places evenly spaced by length on a line s = const of its surface.

The back of a bone is its least hollow side: of LINES lines the one that lies nearest to its own convex hull, seen as
distance from the Z axis over z.

The surface that a program leaves, exact at any places of the part: the balls of its text, and what bending keeps.

Normal probes stand at the places as those of the simulation do (`removal/normal_probes.py`) and are cut by all balls
and flutes of the text; where nothing came near, the height is that of the simulated rays. The error that bending keeps
is that of the nearest triangle of the simulated part.

Roughness of what a program leaves: Ra and Rz (ISO 4287) of profiles along and across the feed.

At places of the part that the finishing cutter has cut last a profile of SAMPLING lengths is laid out either way, as
the balls leave it (cusps), and along the feed with the marks of the edges: each cuts an arc of the ball
every feed per tooth f, which leaves f^2 (1/R + k) / 8, k the curvature along the feed. Form is taken off each sampling
length as a parabola. Left out: run-out (f is then that of a turn, four times the height with two flutes), chatter, the
radius of the edge, and what the material does.

The probe of Gan et al. (2014, section 5.3): a ruby ball of 1 mm touches the machined surface at points of a line.

Round each point a patch of the machined surface is laid out, its nodes SPACING apart, exact at every
node. The ball comes along the nominal normal. The deviation is the signed distance of its centre from
the nominal surface less its radius.

A measuring program for a probe in the spindle: the points of a line, each approached along its nominal normal.

Words as the controls' public descriptions have them: Heidenhain TCH PROBE 4 (measuring in 3-D), Siemens MEAS with
$AA_MW and WRITE (CYCLE978 touches along one axis only), Fanuc G31 with #5061 to #5063 and DPRNT. None of it has run on
a machine: the programs say that they are unproved. The tool axis is Z with the rotary axes at zero; points at which the
stem above the ball would touch the part are left out. Program zero is that of the NC program, positions are those of
the ball's centre.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import ConvexHull

from bonecam.arrays import dots, lengths, perpendicular, unit
from bonecam.errors import JobError, MachineError
from bonecam.machine import Machine
from bonecam.mesh import MeshDistance, TriangleMesh, barycentric, exact_closest
from bonecam.nc import Dialect, Motions, read_program
from bonecam.planning import at_post
from bonecam.surface import TSpline
from bonecam.tool import Cutter
from bonecam.verify import NormalProbes, Removal, feed_minutes, groups_of, straight_pieces
from bonecam.workholding import Post

LINES = 72
"""Lines among which the back is looked for: every 5 degrees."""
DENSE = 1000
"""Points by which lines are measured."""
POLE_MARGIN = 0.02
"""Share of the t-range at each pole where no line is judged: all of them meet there."""


@dataclass(frozen=True, eq=False)
class ProbeLine:
    """Places (n, 3) on the line `s` with outward unit `normals`, and how far along the line each lies, mm."""

    s: float
    places: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    along: Float[ndarray, " n"]


def probe_line(part: TSpline, post: Post, radius: float, count: int = 100, s: float | None = None) -> ProbeLine:
    """So many places of the line `s` (None: the back) where a ball of this `radius` (mm) is clear of the post.

    JobError where the line is not on the part, or all of it is at the post, and for fewer than two places.
    """
    first, last = part.domain[0].tolist()
    check_line(count, s, first, last)
    line = back_of(part) if s is None else s
    low, high = part.domain[1].tolist()
    t = np.linspace(low, high, DENSE)
    across = np.full(DENSE, line)
    points, normals = part.positions(across, t), part.normals(across, t)
    along = np.r_[0.0, lengths(np.diff(points, axis=0)).cumsum()]
    free = along[~at_post(points, normals, post, radius)]
    if not len(free):
        raise JobError(f"line {line:g} lies at the post, where no ball goes: give another line")
    wanted = np.linspace(free[0], free[-1], 2 * count + 1)[1::2]
    t = np.interp(wanted, along, t)
    across = np.full(count, line)
    return ProbeLine(line, part.positions(across, t), part.normals(across, t), wanted)


def check_line(count: int, s: float | None, first: float = 0.0, last: float = 1.0) -> None:
    """JobError for fewer than two places, or a line that is not on a part whose parameter s goes from `first` to
    `last`, by default those of a fitted surface."""
    if count < 2:
        raise JobError(f"{count} points make no line: give 2 or more")
    if s is not None and not first <= s <= last:
        raise JobError(f"line {s:g} is off the part: give a parameter s from {first:g} to {last:g}")


def back_of(part: TSpline) -> float:
    """The line s of the part's least hollow side."""
    first, last = part.domain[0].tolist()
    s = first + (last - first) * np.arange(LINES) / LINES
    low, high = part.domain[1].tolist()
    margin = POLE_MARGIN * (high - low)
    t = np.linspace(low + margin, high - margin, DENSE)
    return float(min(s, key=lambda one: _hollow(part.positions(np.full(DENSE, one), t))))


def _hollow(points: Float[ndarray, "n 3"]) -> float:
    """How far a line lies below its convex hull at most, seen as distance from the Z axis over z, mm."""
    out = points[:, :2].mean(axis=0)
    out /= max(float(np.linalg.norm(out)), np.finfo(float).tiny)
    seen = np.column_stack([points[:, 2], points[:, :2] @ out])
    facets = ConvexHull(seen).equations
    above = facets[facets[:, 1] > 0]
    return float((-(seen @ above[:, :2].T + above[:, 2]).max(axis=1)).max())


@dataclass(frozen=True, eq=False)
class Machined:
    """Places (n, 3) of the part with outward unit `normals`; how high the surface lies above each as it is cut
    (`cut`, mm) and as it comes out when what was bent springs back (`kept`, mm; the same where bending was not asked);
    `owners`: the move of the text that cut it last, negative where none has."""

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    cut: Float[ndarray, " n"]
    kept: Float[ndarray, " n"]
    owners: Int[ndarray, " n"]


@dataclass(frozen=True, eq=False)
class PostedProgram:
    """A program as text, the machine and the control that run it, its cutters, the part that it makes, and what its
    simulation tells."""

    text: str
    machine: Machine
    dialect: Dialect
    cutters: tuple[Cutter, ...]
    part: TSpline
    removal: Removal

    def motions(self) -> Motions:
        """The moves of the text."""
        return read_program(self.text, self.machine, self.dialect)

    def cutter(self, number: int) -> Cutter:
        """The cutter of a number of the text."""
        return next(cutter for cutter in self.cutters if cutter.number == number)

    def machined(self, places: Float[ndarray, "n 3"]) -> Machined:
        """The machined surface at the places of the part that are nearest to some `places`, mm."""
        s, t = self.part.project(places).parameters.T
        points, normals = self.part.positions(s, t), self.part.normals(s, t)
        probes = NormalProbes(_NO_MESH, points, normals, np.zeros(len(points)))
        motions = self.motions()
        for group in groups_of(self.text, motions, self.dialect):
            cutter = self.cutter(group.tool)
            # The pieces with all of their flutes
            pieces = straight_pieces(motions, group.moves, cutter)
            reach = np.full(len(pieces.starts), max(cutter.flute_length - cutter.radius, 0.0))
            probes.cut(pieces._replace(reach=reach), cutter.radius)
        standing = self.removal.remaining
        probes.measure_the_uncut(standing.sets, standing.grid)
        return Machined(points, normals, probes.heights, probes.heights + self._bent(points), probes.owners)

    def _bent(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """The error that bending keeps at places of the part, mm; 0 where that is not known."""
        error = self.removal.mechanics.error if self.removal.mechanics else None
        if error is None:
            return np.zeros(len(points))
        footpoints, faces = exact_closest(error.mesh, points)
        corners = error.mesh.faces[faces]
        weights = barycentric(error.mesh.vertices[corners], footpoints)
        return dots(weights, np.nan_to_num(error.errors)[corners])


_NO_MESH = TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))


CUT_OFF = 0.8
"""A sampling length, mm: ISO 4288 for Ra from 0.1 to 2 um."""
SAMPLING = 3
"""Sampling lengths in a profile: bones have no room for the five of the standard everywhere."""
NODE = 0.01
"""Nodes of a profile are so far apart, mm."""
PLACES = 60
"""Profiles of each direction."""
UM = 1000.0


@dataclass(frozen=True, eq=False)
class Roughness:
    """Ra and Rz (um) of each of n profiles `along` the feed and `across` it (n, 2); `marks` (n,): height of the marks
    of the edges, um."""

    along: Float[ndarray, "n 2"]
    across: Float[ndarray, "n 2"]
    marks: Float[ndarray, " n"]

    @property
    def report(self) -> dict[str, Any]:
        """`roughness` of the report: medians, um; null where the last cutter cut nothing."""
        figures: dict[str, Any] = {"profiles": len(self.marks)}
        for name, values in (("along", self.along), ("across", self.across)):
            medians = np.median(values, axis=0).round(3).tolist() if len(values) else [None, None]
            figures |= {f"ra_{name}_um": medians[0], f"rz_{name}_um": medians[1]}
        return {**figures, "feed_marks_um": round(float(np.median(self.marks)), 3) if len(self.marks) else None}


def roughness_of(program: PostedProgram, flutes: int, count: int = PLACES) -> Roughness:
    """The roughness at so many places that the last cutter has cut, for cutters with so many `flutes`."""
    probes = program.removal.remaining.probes
    motions = program.motions()
    cut = np.flatnonzero((probes.owners >= 0) & (probes.heights < probes.heights[probes.owners >= 0].max()))
    cut = cut[~motions.rapid[probes.owners[cut]]]
    last = motions.tools[probes.owners[cut]] == motions.tools[-1]
    here = cut[last][:: max(1, int(last.sum()) // count)][:count]
    normals = probes.normals[here]

    # Unit direction of the feed at the contact of each move, at right angles to the normals, and the way between two
    # edges there, mm; 0 where the tip stands or nothing turns
    owners = probes.owners[here]
    before = np.maximum(owners - 1, 0)
    moved = motions.tips[owners] - motions.tips[before]
    moved -= dots(moved, normals)[:, None] * normals
    way = lengths(moved)
    teeth = feed_minutes(motions)[owners] * motions.spindle[owners] * flutes
    moves = (teeth > 0) & (way > 0)
    feeds = unit(np.where(moves[:, None], moved, 1.0))
    tooth = np.where(moves, way / np.where(moves, teeth, 1.0), 0.0)

    known = tooth > 0
    here, normals, feeds, tooth = here[known], normals[known], feeds[known], tooth[known]
    steps = np.arange(-SAMPLING * CUT_OFF / 2, SAMPLING * CUT_OFF / 2, NODE)
    radius = program.cutter(int(motions.tools[-1])).radius
    s, t = program.part.project(probes.points[here]).parameters.T
    # Normal curvature (1/mm, > 0: convex) of the part along the feed, by a step of NODE either way.
    at, facing = program.part.positions(s, t), program.part.normals(s, t)
    sagged = np.zeros(len(s))
    for side in (CUT_OFF / 8, -CUT_OFF / 8):
        beside = program.part.project(at + side * feeds).points
        sagged += -dots(beside - at, facing) / side**2
    curved = 1 / radius + sagged
    height = tooth**2 * np.maximum(curved, 0.0) / 8
    phase = np.mod(steps / np.maximum(tooth, np.finfo(float).tiny)[:, None] + 0.5, 1.0) - 0.5
    along = _profiles(program, probes.points[here], feeds, steps) + 4 * height[:, None] * phase**2
    across = _profiles(program, probes.points[here], np.cross(normals, feeds), steps)
    return Roughness(_ra_rz(along), _ra_rz(across), UM * height)


def _profiles(
    program: PostedProgram,
    points: Float[ndarray, "n 3"],
    directions: Float[ndarray, "n 3"],
    steps: Float[ndarray, " k"],
) -> Float[ndarray, "n k"]:
    """Heights (mm) of the machined surface over the part along a direction through each place."""
    nodes = points[:, None] + steps[:, None] * directions[:, None]
    return program.machined(nodes.reshape(-1, 3)).cut.reshape(len(points), -1)


def _ra_rz(profiles: Float[ndarray, "n k"]) -> Float[ndarray, "n 2"]:
    """Ra and Rz (um) of each profile, the mean of its sampling lengths without their form."""
    ra_rz = []
    for piece in np.array_split(profiles, SAMPLING, axis=1):
        x = np.linspace(-1.0, 1.0, piece.shape[1])
        form = np.vander(x, 3)
        rest = piece - (form @ np.linalg.lstsq(form, piece.T, rcond=None)[0]).T
        ra_rz.append(np.column_stack([np.abs(rest).mean(axis=1), np.ptp(rest, axis=1)]))
    return UM * np.mean(ra_rz, axis=0)


RUBY = 0.5
"""Radius of the ruby ball of the paper, mm."""
BAND = 0.05
"""The paper's largest deviation, mm."""
PATCH = 0.6
"""Half the width of a patch in radii of the ball: on a surface that leans by up to 35 degrees it touches within."""
LARGEST = 3.0
"""Largest radius of a ball, mm: its patches have 15,000 nodes each."""
SPACING = 0.03
"""Distance of the nodes of a patch, mm: a cusp between two is missed by 2 um where a ball of 1 mm leaves scallops of
0.01 mm, by 6 um where it leaves 0.1 mm."""


@dataclass(frozen=True, eq=False)
class Probed:
    """The `line` that was probed with a ball of this `radius` (mm), the `centres` (n, 3) of the ball where it touched
    the surface as it comes out, and the deviation (mm) there (`deviation`) and on the surface as if nothing bent
    (`rigid`); NaN where it touched nothing. `patches`: the surface that was touched."""

    line: ProbeLine
    radius: float
    centres: Float[ndarray, "n 3"]
    deviation: Float[ndarray, " n"]
    rigid: Float[ndarray, " n"]
    patches: TriangleMesh

    @cached_property
    def within(self) -> float:
        """Share of the points whose deviation stays within BAND."""
        return float((np.abs(self.deviation) < BAND).mean())

    @property
    def largest(self) -> float:
        """The largest deviation either way, mm; infinite where a point touched nothing."""
        return float(np.abs(np.nan_to_num(self.deviation, nan=np.inf)).max())

    def __str__(self) -> str:
        """What the probe found, in a line."""
        figures = self.report
        summary = "no point touched"
        if figures["touched"]:
            share = 100 * figures["within_0_05_share"]
            summary = (
                f"deviation {figures['min_mm']:g} to {figures['max_mm']:g} mm, {share:.0f} % of the points within "
                f"{BAND:g} mm; as if nothing bent at most {figures['rigid_max_mm']:g} mm"
            )
        return f"{figures['touched']} of {figures['points']} points of line s = {figures['line']:g}: {summary}"

    @property
    def report(self) -> dict[str, Any]:
        """`probe` of the report."""
        known = self.deviation[np.isfinite(self.deviation)]
        return {
            "line": round(self.line.s, 4),
            "points": len(self.deviation),
            "touched": len(known),
            "mean_mm": round(float(known.mean()), 4) if len(known) else None,
            "min_mm": round(float(known.min()), 4) if len(known) else None,
            "max_mm": round(float(known.max()), 4) if len(known) else None,
            "within_0_05_share": round(self.within, 4),
            "rigid_max_mm": round(float(np.nanmax(np.abs(self.rigid))), 4) if len(known) else None,
        }

    @property
    def csv(self) -> str:
        """The points: number, way along the line, nominal place and normal, deviations; mm."""
        head = "number,along,x,y,z,nx,ny,nz,deviation,deviation_rigid"
        rows = np.column_stack([self.line.along, self.line.places, self.line.normals, self.deviation, self.rigid])
        lines = [f"{k}," + ",".join(f"{value:.6f}" for value in row) for k, row in enumerate(rows, 1)]
        return "\n".join([head, *lines]) + "\n"


def probe_surface(program: PostedProgram, line: ProbeLine, radius: float = RUBY) -> Probed:
    """Touch the surface that a program leaves along a `line`, with a ball of this `radius`, mm; JobError for one beyond
    LARGEST."""
    if not 0 < radius <= LARGEST:
        raise JobError(f"a ball of radius {radius:g} mm: give more than 0 and at most {LARGEST:g}")
    side = np.arange(-PATCH * radius, PATCH * radius + SPACING / 2, SPACING)
    # Nodes round each place of a line, in its tangent plane, and the triangles between them.
    first = perpendicular(line.normals)
    second = np.cross(line.normals, first)
    a, b = (each.ravel() for each in np.meshgrid(side, side, indexing="ij"))
    nodes = line.places[:, None] + a[:, None] * first[:, None] + b[:, None] * second[:, None]
    corner = np.arange(len(side) ** 2).reshape(len(side), -1)
    low = corner[:-1, :-1]
    right = corner[1:, :-1]
    up = corner[:-1, 1:]
    far = corner[1:, 1:]
    cells = np.vstack([np.column_stack([x.ravel() for x in three]) for three in ((low, right, far), (low, far, up))])
    faces = np.arange(len(line.places))[:, None, None] * len(a) + cells
    nodes, faces = nodes.reshape(-1, 3), faces.reshape(-1, 3).astype(np.int32)
    machined = program.machined(nodes)
    kept, centres = _touched(machined, machined.kept, faces, line, radius)
    _, rigid = _touched(machined, machined.cut, faces, line, radius)
    part = program.part
    return Probed(
        line,
        radius,
        centres=centres,
        deviation=deviations(part, centres, radius),
        rigid=deviations(part, rigid, radius),
        patches=kept,
    )


def _touched(
    machined: Machined, heights: Float[ndarray, " m"], faces: ndarray, line: ProbeLine, radius: float
) -> tuple[TriangleMesh, Float[ndarray, "n 3"]]:
    """The patches with these heights, and the centres of a ball that touches them."""
    mesh = TriangleMesh(machined.points + heights[:, None] * machined.normals, faces)
    of_point = heights.reshape(len(line.places), -1)
    start, end = of_point.max(axis=1) + 2 * radius, float(heights.min()) - radius
    return mesh, touching_centres(
        MeshDistance(mesh), line.places, normals=line.normals, radius=radius, start=start, end=end
    )


TOUCHES = 1e-6
"""A ball touches what it is nearer to, mm."""
MOST_STEPS = 500
"""A ball that slides past something so often without touching it is where it is."""


def touching_centres(
    surface: MeshDistance,
    places: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    radius: float,
    start: Float[ndarray, " n"],
    end: float,
) -> Float[ndarray, "n 3"]:
    """Centres of the ball where it first touches the `surface` on its way along each normal, from the height `start`
    (mm, of the centre, clear of everything) down to the height `end`; NaN where it touches nothing."""
    heights = np.array(start)
    coming = np.arange(len(places))
    for _ in range(MOST_STEPS):
        gap = surface.unsigned(places[coming] + heights[coming, None] * normals[coming]) - radius
        heights[coming] -= np.maximum(gap, 0.0)
        coming = coming[(gap > TOUCHES) & (heights[coming] > end)]
        if not len(coming):
            break
    centres = places + heights[:, None] * normals
    centres[heights <= end] = np.nan
    return centres


def deviations(part: TSpline, centres: Float[ndarray, "n 3"], radius: float) -> Float[ndarray, " n"]:
    """Signed distance of each centre from the nominal surface less the ball's radius, mm; NaN where there is none."""
    deviation = np.full(len(centres), np.nan)
    known = np.isfinite(centres[:, 0])
    near = part.project(centres[known])
    outside = dots(part.normals(near.s, near.t), centres[known] - near.points) >= 0
    deviation[known] = np.where(outside, near.distances, -near.distances) - radius
    return deviation


CLEAR = 2.0
"""The ball begins and ends its approach so far from the nominal surface, mm."""
BEYOND = 1.0
"""It looks for the surface down to so far below it, mm."""
STEM_SHARE = 0.7
"""Radius of the stem as a share of the ball's, as styli of 1 mm have it."""
STEM_LENGTH = 60.0
"""The stem is looked at up to so far above the ball, mm."""
SAFE = 10.0
"""Height above the part at which the probe goes from point to point, mm."""
FEED, RAPID = 100, 2000
"""Feeds of the approach and between points, mm/min."""
UNPROVED = "UNPROVED - NO MACHINE HAS RUN THIS. CHECK EVERY MOVE, CALIBRATE TO THE BALL CENTRE"

Point = tuple[int, Float[ndarray, "3"], Float[ndarray, "3"]]
"""Number of a point, its place and its outward normal."""


def measuring_program(line: ProbeLine, radius: float, part: MeshDistance, controller: str, name: str = "PROBE") -> str:
    """The text for one of CONTROLLERS, which touches the points of a line with a ball of this `radius`, mm; `part` is
    the nominal one.

    MachineError for another controller, or where the stem is in the way of all points.
    """
    if controller not in CONTROLLERS:
        known = ", ".join(CONTROLLERS)
        raise MachineError(f"no measuring program is known for {controller}: take one of {known}")
    # Whether the part is clear of the stem while the ball touches each place, and of the ball as it comes down to
    # where its approach begins.
    stem = STEM_SHARE * radius
    touching = line.places + radius * line.normals
    beginning = line.places + (radius + CLEAR) * line.normals
    free = _column_is_free(touching, radius, stem, part) & _column_is_free(beginning, 0.0, radius, part)
    if not free.any():
        raise MachineError("the stem of the probe is in the way of every point: give another line")
    points = [(k + 1, line.places[k], line.normals[k]) for k in np.flatnonzero(free).tolist()]
    left = f"{len(points)} OF {len(free)} POINTS - THE STEM IS IN THE WAY OF THE OTHERS"
    safe = float(part.mesh.bounds[1, 2]) + SAFE
    lines = CONTROLLERS[controller](name, left, points, radius, safe)
    return "\n".join(lines) + "\n"


def _column_is_free(foot: Float[ndarray, "n 3"], low: float, radius: float, part: MeshDistance) -> Bool[ndarray, " n"]:
    """Whether a column of this radius above each foot, from the height `low` on, is clear of the part."""
    above = np.arange(low, STEM_LENGTH, radius / 2)
    points = foot[:, None] + above[:, None] * np.array([0.0, 0.0, 1.0])
    return np.asarray((part.signed(points.reshape(-1, 3)).reshape(len(foot), -1) > radius).all(axis=1))


def _stops(point: Point, radius: float) -> tuple[Float[ndarray, "3"], Float[ndarray, "3"]]:
    """Where the ball's centre begins its approach, and where that ends without a touch."""
    _, place, normal = point
    return place + (radius + CLEAR) * normal, place + (radius - BEYOND) * normal


def _words(place: Float[ndarray, "3"], form: str = "{}{:.3f}") -> str:
    return " ".join(form.format(axis, value) for axis, value in zip("XYZ", place, strict=True))


def _heidenhain(name: str, left: str, points: list[Point], radius: float, safe: float) -> Iterator[str]:
    """TCH PROBE 4; deviations are kept in Q1600 and following."""
    body = [f"BEGIN PGM {name} MM", f"; {UNPROVED}", f"; {left}", f"L Z{safe:+.3f} R0 F{RAPID}"]
    for point in points:
        number, place, normal = point
        begin, end = _stops(point, radius)
        signed = "{}{:+.3f}"
        body += [
            f"L X{begin[0]:+.3f} Y{begin[1]:+.3f} R0 F{RAPID}",
            f"L Z{begin[2]:+.3f} R0 F{RAPID}",
            "TCH PROBE 4.0 MEASURING IN 3-D",
            "TCH PROBE 4.1 Q1",
            f"TCH PROBE 4.2 {_words(end - begin, 'I{}{:+.4f}')}",
            f"TCH PROBE 4.3 DIST+{CLEAR + BEYOND:.3f} F{FEED} MB{CLEAR:g} REFERENCE SYSTEM:1",
            f"Q{1599 + number} = ( Q1 - {place[0]:.4f} ) * {normal[0]:.6f} + ( Q2 - {place[1]:.4f} ) * "
            f"{normal[1]:.6f} + ( Q3 - {place[2]:.4f} ) * {normal[2]:.6f} - {radius:g}",
            f"L {_words(begin, signed)} R0 F{RAPID}",
            f"L Z{safe:+.3f} R0 F{RAPID}",
        ]
    body.append(f"END PGM {name} MM")
    for k, text in enumerate(body):
        yield f"{k} {text}"


def _siemens(name: str, left: str, points: list[Point], radius: float, safe: float) -> Iterator[str]:
    """MEAS=1; deviations are written to the file PROBE_DEV."""
    yield from (f"; {name}", f"; {UNPROVED}", f"; {left}", "DEF INT FAULT", "DEF REAL DEV", "G17 G90 G94 G71")

    def touch(point: Point, end: str) -> Iterator[str]:
        number, place, normal = point
        yield f"MEAS=1 G1 {end} F{FEED}"
        yield "STOPRE"
        terms = [
            f"($AA_MW[{axis}]-({value:.4f}))*({lean:.6f})"
            for axis, value, lean in zip("XYZ", place, normal, strict=True)
        ]
        yield f"DEV={'+'.join(terms)}-{radius:g}"
        yield "IF $AC_MEA[1]==0 DEV=999"
        yield f'WRITE(FAULT,"PROBE_DEV","{number} "<<DEV)'

    yield from _iso(points, radius, safe, touch)
    yield "M30"


def _fanuc(name: str, left: str, points: list[Point], radius: float, safe: float) -> Iterator[str]:
    """G31; deviations are printed by DPRNT."""
    yield from ("%", f"O0046 ({name})", f"({UNPROVED})", f"({left})", "G17 G21 G90 G94", "POPEN")

    def touch(point: Point, end: str) -> Iterator[str]:
        number, place, normal = point
        yield f"G31 {end} F{FEED}"
        terms = [
            f"[#{5061 + k}-[{value:.4f}]]*[{lean:.6f}]"
            for k, (value, lean) in enumerate(zip(place, normal, strict=True))
        ]
        yield f"#100={'+'.join(terms)}-{radius:g}"
        yield f"#101={number}"
        yield "DPRNT[K#101[40]D#100[44]]"

    yield from _iso(points, radius, safe, touch)
    yield from ("PCLOS", "M30", "%")


def _iso(
    points: list[Point], radius: float, safe: float, touch: Callable[[Point, str], Iterator[str]]
) -> Iterator[str]:
    """G1 to and from each point, round the blocks that `touch` it on the way to an end."""
    yield f"G1 Z{safe:.3f} F{RAPID}"
    for point in points:
        begin, end = _stops(point, radius)
        yield f"G1 X{begin[0]:.3f} Y{begin[1]:.3f} F{RAPID}"
        yield f"G1 Z{begin[2]:.3f}"
        yield from touch(point, _words(end))
        yield f"G1 {_words(begin)} F{RAPID}"
        yield f"G1 Z{safe:.3f}"


CONTROLLERS: dict[str, Callable[[str, str, list[Point], float, float], Iterator[str]]] = {
    "heidenhain": _heidenhain,
    "siemens-840d": _siemens,
    "fanuc-30i": _fanuc,
}
"""Dialects that have a probe, by name."""
