"""The second clamping: the parted part, turned over about X, stands with its finished end in a shell on the table.

The shell is a file: a closed mesh in the frame and unit of the part's file, cast or printed round the finished end. It
holds the part against every push to a side and down into it, and enters it nowhere (`check_shell`).

`printed_shell` makes one to print: an upright cylinder about the axis of the bar in two halves that two screws draw up.
The plane between the halves goes through the axis. What the halves would catch under when they are drawn off, straight
away from that plane, is taken out of them: of the cavity's volume K on the side y > 0 all

    {(x, y, z): 0 <= y <= y', (x, y', z) in K}

becomes cavity. Of the turns of the plane about the axis the one is taken of which that takes least. A flat on the side
and a pin in the base, on the axis, are the datum: the pin gives X and Y, the flat the turn, rim or table the height. An
arrow on the rim points to the flat. Screws are M3 (ISO 4762; hole of 3.4 mm: ISO 273, medium; core of 2.5 mm).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.errors import MeshError, place_name
from bonecam.job import HoldingJob, Job, field_error
from bonecam.job.holding_section import FLATS, NO_FLAT
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets import vertex_normals
from bonecam.mesh.files.mesh_files import read_in_mm
from bonecam.mesh.part import Part
from bonecam.mesh.solids import (
    half_edges,
    pieces_of,
    prism,
    segments_around,
    solid_difference,
    solid_intersection,
    solid_union,
)
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces, probes, side_by_side

CHORD = 0.05
"""Chord tolerance of the shell's cylinder and holes, mm."""
SPLITS = 36
"""So many planes through the axis are tried as the one between the halves."""
SCREW_LENGTH = 10.0
"""Length of the two screws under their heads, mm: M3 x 10, ISO 4762."""
SCREW_HOLE, SCREW_CORE, SCREW_HEAD = 3.4, 2.5, 6.5
"""Diameters of the hole for the screw, of that for its thread, and of that for its head (5.5 mm), mm."""
SEAT, HEAD_HEIGHT = 4.0, 3.0
"""The head lies so far from the plane between the halves, and is so high, mm."""
BESIDE_SCREW = 1.5
"""Least material beside the hole of a screw, mm."""
PIN_DIAMETER, PIN_DEPTH = 4.0, 6.0
"""Pin in the base, mm: 4 m6, ISO 8734."""
FLAT_DEPTH = 1.5
"""So far the flat lies inside the cylinder, mm."""
ARROW_LENGTH, ARROW_WIDTH, ARROW_DEPTH = 4.0, 3.0, 0.6
"""Size of the arrow in the rim, and its depth: three layers of a print, mm."""
OVER = 1.0
"""Bodies that are taken out of the shell go so far beyond it, mm."""
CHIP = 1e-4
"""Corners of the shell nearer to one another are one, mm: a printer's file has six digits."""
LEVEL = 1e-9
"""A unit normal that leans by less looks to no side: what rounding leaves."""
APART = 5.0
"""Distance of the two halves on the printer's bed, mm."""


@dataclass(frozen=True, eq=False)
class PrintedShell:
    """A shell in two closed `halves`, mm, round the upper end of a standing part, its opening down.

    `split` is the level unit vector across the plane between them, towards the first half, in which the heads of the
    screws are; `flat` is where the flat faces behind the turn-over (one of FLATS), `pin` (mm) the diameter of the pin,
    `relieved` (mm^3) what was taken out for the halves to come off.
    """

    halves: tuple[TriangleMesh, TriangleMesh]
    split: Float[ndarray, "3"]
    flat: str
    pin: float
    relieved: float

    @cached_property
    def solid(self) -> TriangleMesh:
        """The shell: both halves round the standing part, as one closed mesh of two pieces, mm."""
        return side_by_side(self.halves)

    @property
    def to_print(self) -> TriangleMesh:
        """The shell on a printer's bed, mm: each half with its base down on z = 0, APART from the other along X."""
        turn = np.eye(4)
        down = np.array([0.0, 0.0, -1.0])
        turn[:3, :3] = np.stack([self.split, np.cross(down, self.split), down])
        laid = []
        for half, away in zip(self.halves, (APART / 2, -APART / 2), strict=True):
            low, high = half.move(turn).bounds
            beside = away - float(low[0] if away > 0 else high[0])
            laid.append(half.move(_shift(beside, 0.0, -float(low[2])) @ turn))
        return side_by_side(laid)


def printed_shell(part: TriangleMesh, covered: float, wall: float, gap: float) -> PrintedShell:
    """The shell to print round the upper end of a standing part.

    `covered` is the share of the part's height in it, `wall` (mm) its least thickness, `gap` (mm) what it keeps from
    the part; the halves are two gaps apart, so that the screws draw them onto the part. ValueError where these make no
    shell.
    """
    if not (0 < covered < 1 and wall > 0 and gap >= 0):
        raise ValueError(
            f"covered = {covered:g}, wall = {wall:g}, gap = {gap:g}: give a share between 0 and 1, a positive wall "
            "and no negative gap"
        )
    low, high = part.bounds[:, 2].tolist()
    opening = high - covered * (high - low)
    inside = TriangleMesh(part.vertices + gap * vertex_normals(part), part.faces)
    base = high + gap + max(wall, PIN_DEPTH + wall / 2)

    # Across the plane between the halves, and the direction of the flat, in the second half: the one of FLATS that is
    # nearest to it keeps the flat off the plane
    turns = np.pi * np.arange(SPLITS) / SPLITS
    across = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(SPLITS)])
    split = across[int(np.argmin([_caught(inside, each, opening) for each in across]))]
    flat = min(FLATS, key=lambda name: float(_standing(name) @ split))
    faces_to = _standing(flat)

    # In a frame whose Y axis is `split` halves and cavity are cut exactly at y = 0
    turn = np.eye(4)
    turn[:3, :3] = [np.cross(split, [0.0, 0.0, 1.0]), split, [0.0, 0.0, 1.0]]
    turned, facing = inside.move(turn), turn[:2, :2] @ faces_to[:2]
    held = turned.vertices[turned.vertices[:, 2] > opening][:, :2]
    screws = [end + np.sign(end) * (BESIDE_SCREW + SCREW_HOLE / 2) for end in (held[:, 0].max(), held[:, 0].min())]
    radius = max(
        float(lengths(held).max()) + wall,
        float(np.hypot(np.abs(screws).max() + SCREW_HEAD / 2, SEAT + HEAD_HEIGHT)),
        float((held @ facing).max()) + ARROW_LENGTH + 2 * OVER + FLAT_DEPTH,
    )
    middle = (opening + base) / 2

    around = 2 * np.pi * np.arange(segments_around(radius, CHORD)) / segments_around(radius, CHORD)
    circle = _clipped(radius * np.column_stack([np.cos(around), np.sin(around)]), -facing, FLAT_DEPTH - radius)
    pin = _rod(PIN_DIAMETER + 2 * gap, base - PIN_DEPTH, base + OVER)
    tip = radius - FLAT_DEPTH - OVER
    arrow = _arrow(facing, tip, opening)
    halves, relieved = [], 0.0
    for side in (1.0, -1.0):
        body = prism(_clipped(circle, np.array([0.0, side]), gap), opening, base)
        block = prism(
            _clipped(2 * radius * np.array([[-1.0, -1.0], [1, -1], [1, 1], [-1, 1]]), np.array([0.0, side]), 0.0),
            opening,
            base,
        )
        kept = solid_intersection(turned, block)
        cavity = _without_undercuts(kept, side)
        relieved += cavity.volume - kept.volume
        holes = [_rod(SCREW_HOLE if side > 0 else SCREW_CORE, -OVER, 2 * radius, side)]
        holes += [_rod(SCREW_HEAD, SEAT, 2 * radius, side)] if side > 0 else []
        bored = [hole.move(_shift(x, 0.0, middle)) for x in screws for hole in holes]
        taken = solid_union([cavity, pin, *bored, *([arrow] if side < 0 else [])])
        halves.append(_one_piece(solid_difference(body, taken)).move(turn.T))
    return PrintedShell((halves[0], halves[1]), split, flat, PIN_DIAMETER, relieved)


def _standing(flat: str) -> Float[ndarray, "3"]:
    """Where a flat that faces so behind the turn-over about X faces before it."""
    direction = FLATS[flat]
    return np.array([direction[0], -direction[1], 0.0])


def _caught(solid: TriangleMesh, across: Float[ndarray, "3"], opening: float) -> float:
    """How much material (mm^3) two halves of a shell round what of a solid is over `opening` have behind its sides that
    look to the plane through the Z axis `across` which they are drawn off; what lies behind two sides counts twice."""
    middles = solid.vertices[solid.faces].mean(axis=1)
    off = middles @ across
    shadow = -np.sign(off) * dots(solid.face_vectors / 2, np.broadcast_to(across, middles.shape))
    return float((np.maximum(shadow, 0.0) * np.abs(off))[middles[:, 2] > opening].sum())


def _without_undercuts(solid: TriangleMesh, side: float) -> TriangleMesh:
    """A closed solid on one side of the plane y = 0 (`side` is the sign of y there) with all that is between it and the
    plane: its faces that look to the plane are moved there, with walls from their edges."""
    vectors = solid.face_vectors
    looks = side * vectors[:, 1] < -LEVEL * lengths(vectors)
    on_plane = (np.abs(solid.vertices[:, 1]) == 0)[solid.faces].all(axis=1)
    under = looks & ~on_plane
    if not under.any():
        return solid
    count = len(solid.vertices)
    foot = solid.vertices * [1.0, 0.0, 1.0]
    edges = half_edges(solid)[under].reshape(-1, 2)
    inner = {(int(a), int(b)) for a, b in edges}
    rim = np.array([(a, b) for a, b in inner if (b, a) not in inner], dtype=np.int32).reshape(-1, 2)
    a, b = rim.T
    walls = np.vstack([np.column_stack([a, b, b + count]), np.column_stack([a, b + count, a + count])])
    faces = np.vstack([solid.faces[~under], solid.faces[under] + count, walls])
    return solid_union([TriangleMesh(np.vstack([solid.vertices, foot]), faces.astype(np.int32))])


def _clipped(outline: Float[ndarray, "n 2"], inward: Float[ndarray, "2"], least: float) -> Float[ndarray, "m 2"]:
    """What of a convex outline is not less than `least` (mm) along the unit vector `inward`."""
    kept = []
    for here, there in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        one, other = float(here @ inward) - least, float(there @ inward) - least
        if one >= 0:
            kept.append(here)
        if (one > 0) != (other > 0) and one != 0 and other != 0:
            kept.append(here + one / (one - other) * (there - here))
    return np.array(kept)


def _rod(diameter: float, low: float, high: float, side: float = 0.0) -> TriangleMesh:
    """A rod from `low` to `high` (mm) whose sides lie round a cylinder about the Z axis, or, with a `side`, about the Y
    axis on that side of y = 0."""
    count = segments_around(diameter / 2, CHORD)
    around = 2 * np.pi * (np.arange(count) + 0.5) / count
    outer = diameter / 2 / np.cos(np.pi / count)
    rod = prism(outer * np.column_stack([np.cos(around), np.sin(around)]), low, high)
    if not side:
        return rod
    pose = np.eye(4)
    pose[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.0, side], [0.0, -side, 0.0]]
    return rod.move(pose)


def _arrow(facing: Float[ndarray, "2"], tip: float, opening: float) -> TriangleMesh:
    """The body of the arrow that is engraved upwards at the height `opening`, its tip so far along `facing`, mm."""
    head = np.array([[tip, 0.0], [tip - ARROW_LENGTH / 2, ARROW_WIDTH / 2], [tip - ARROW_LENGTH / 2, -ARROW_WIDTH / 2]])
    back, thin = tip - ARROW_LENGTH, ARROW_WIDTH / 6
    shaft = np.array([[back, -thin], [tip - ARROW_LENGTH / 3, -thin], [tip - ARROW_LENGTH / 3, thin], [back, thin]])
    turn = np.array([[facing[0], -facing[1]], [facing[1], facing[0]]])
    return solid_union([prism(each @ turn.T, opening - OVER, opening + ARROW_DEPTH) for each in (head, shaft)])


def _shift(x: float, y: float, z: float) -> Float[ndarray, "4 4"]:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def _one_piece(solid: TriangleMesh) -> TriangleMesh:
    """The largest piece of a closed solid, corners nearer than CHIP made one."""
    index = np.unique(np.round(solid.vertices / CHIP), axis=0, return_inverse=True)[1].ravel()
    first = np.unique(index, return_index=True)[1]
    faces = index[solid.faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    merged = TriangleMesh(solid.vertices[first], faces[whole].astype(np.int32))
    pieces = pieces_of(merged)
    sizes = np.bincount(pieces, dots(merged.vertices[merged.faces[:, 0]], merged.face_vectors) / 6)
    return keep_faces(merged, pieces == int(np.argmax(sizes)))


GAP = 0.3
"""A shell that is no farther from the part holds it, mm: what a printer or a layer of wax leaves."""
ENTERS = 0.05
"""A shell enters the part by no more, mm: as far as the meshes of either may be off."""
STEEPEST = np.radians(60.0)
"""A face of the part holds against pushes that are within this angle of its normal, radians."""
DIRECTIONS = 24
"""Level pushes that are tried."""
LEAST_FLAT, LEANS = 4.0, np.radians(0.2)
"""A flat is so wide at least, mm: a facet of a round shell is narrower; and leans by no more, radians."""
SIDES = 8
"""Sides of a part on which its shell is asked how high it reaches."""


@dataclass(frozen=True, eq=False)
class SecondClamping:
    """The finished `part` and the `shell` that it stands in after the turn-over, mm, and the `pose` (4, 4) from where
    the part stood on its post, cut off at the height `cut_off` (mm) there; the table is z = 0, the stump points up
    along the Z axis."""

    part: TriangleMesh
    shell: TriangleMesh
    pose: Float[ndarray, "4 4"]
    cut_off: float

    @property
    def top(self) -> float:
        """How high the stump reaches, mm."""
        return float(self.pose[2, 3]) - self.cut_off

    @cached_property
    def solids(self) -> TriangleMesh:
        """Part and shell, which do not enter one another, as one mesh."""
        return side_by_side([self.part, self.shell])


def read_shell(job: Job, part: Part) -> TriangleMesh | None:
    """The shell of a job in the frame of the placed part; None where the job has no second clamping.

    FileError, UnitsError or MeshError where it cannot be read or is not closed, JobError as `check_shell`.
    """
    file = job.holding.second
    if not file:
        return None
    given = read_in_mm(file, job.mesh.units)
    try:
        shell = solid_union([given], [file]).move(part.transform)
    except MeshError as error:
        raise MeshError(f"[holding] second = {file!r}: {error}", file=file, **error.evidence) from error
    check_shell(shell, part.mesh, job.holding)
    return shell


def check_shell(shell: TriangleMesh, part: TriangleMesh, holding: HoldingJob) -> None:
    """JobError where a shell does not fit the standing part: one of the two enters the other, or the part may move to a
    side or further into the shell; or where no such chuck goes round it, or it has no such flat, or no room for such a
    pin, as its holding says."""
    file = holding.second
    for solid, other in ((part, shell), (shell, part)):
        points = probes(other)
        depths = -MeshDistance(solid).signed(points)
        worst = int(np.argmax(depths))
        if depths[worst] > ENTERS:
            what = f"it enters the part by {depths[worst]:.2f} mm near {place_name(points[worst])}"
            raise field_error("holding", "second", file, f"{what}, allowed {ENTERS:g}: take the part out of it")
    around = MeshDistance(shell)
    vectors = part.face_vectors
    near = around.unsigned(part.vertices[part.faces].mean(axis=1), 2 * GAP) <= GAP
    normals = vectors[near] / np.linalg.norm(vectors[near], axis=1)[:, None]
    turns = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    level = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(DIRECTIONS)])
    pushes = np.vstack([level, [[0.0, 0.0, 1.0]]])
    held = (normals @ pushes.T).max(axis=0, initial=-1.0) >= np.cos(STEEPEST)
    if not held.all():
        x, y, z = pushes[np.argmin(held)]
        what = f"it lets the part move towards ({x:.2f}, {y:.2f}, {z:.2f})"
        raise field_error("holding", "second", file, f"{what}: bring its walls there within {GAP:g} mm of the part")
    across = 2 * float(lengths(shell.vertices[:, :2]).max())
    if 0 < holding.second_chuck_diameter < across:
        why = f"it is round the shell, which is {across:.2f} mm across: give more, or 0 for none above the table"
        raise field_error("holding", "second_chuck_diameter", holding.second_chuck_diameter, why)
    if holding.second_flat != NO_FLAT:
        along = _standing(holding.second_flat)
        faces = shell.vertices[shell.faces]
        areas = lengths(shell.face_vectors) / 2
        flat = shell.face_vectors @ along >= 2 * areas * np.cos(LEANS)
        outermost = flat & ((faces @ along).min(axis=1) > float((shell.vertices @ along).max()) - ENTERS)
        tall = float(np.ptp(faces[outermost, :, 2])) if outermost.any() else 1.0
        if areas[outermost].sum() < LEAST_FLAT * tall:
            what = f"the shell has no flat of {LEAST_FLAT:g} mm there"
            raise field_error(
                "holding", "second_flat", holding.second_flat, f"{what}: say where its flat faces, or none"
            )
    if holding.second_pin:
        room = float(around.signed(np.array([[0.0, 0.0, float(shell.bounds[1, 2]) - OVER]]))[0])
        if room < holding.second_pin / 2 - ENTERS:
            what = f"the shell has room for {max(2 * room, 0.0):.2f} mm on the axis of the post"
            raise field_error(
                "holding", "second_pin", holding.second_pin, f"{what}: give its diameter, or 0 for no pin"
            )


def turned_over(part: TriangleMesh, shell: TriangleMesh, holding: HoldingJob, cut_off: float) -> SecondClamping:
    """Part and shell turned over about X, the shell's lower end at its height over the table; the post is cut off at
    the height `cut_off`, mm."""
    pose = turn_over(holding.second_height + float(shell.bounds[1, 2]))
    return SecondClamping(part.move(pose), shell.move(pose), pose, cut_off)


def turn_over(zero: float) -> Float[ndarray, "4 4"]:
    """The pose that turns over about X, and takes the table of the first clamping to the height `zero`, mm."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = zero
    return pose


def held_below(part: TriangleMesh, shell: TriangleMesh) -> float:
    """The height (mm) up to which an upright shell lies against a part all round: the lowest, of the sides on which it
    does, of the highest places within GAP; the shell's top where it lies against it nowhere."""
    middles = part.vertices[part.faces].mean(axis=1)
    near = middles[MeshDistance(shell).unsigned(middles, 2 * GAP) <= GAP]
    if not len(near):
        return float(shell.bounds[1, 2])
    away = near[:, :2] - near[:, :2].mean(axis=0)
    side = ((np.arctan2(away[:, 1], away[:, 0]) / (2 * np.pi) + 0.5) * SIDES).astype(np.int64) % SIDES
    return min(float(near[side == one, 2].max()) for one in np.unique(side))
