"""A shell for the second clamping: a cylinder about the Z axis with the form of the finished end in it.

For trying, and for printing: where the part is wider inside than at the opening, print it in two halves.

The second clamping: the parted part, turned over about X, stands with its finished end in a shell on the table.

The shell is cast or printed round the finished end; it is given as a closed mesh in the frame and unit of the part's
file. It has to fit the part: it holds against every push to a side and down into it, and enters the part nowhere.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import MeshError, place_name
from bonecam.job import HoldingJob, Job, field_error
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets import vertex_normals
from bonecam.mesh.files.mesh_files import read_in_mm
from bonecam.mesh.part import Part
from bonecam.mesh.solids import cylinder, solid_difference, solid_union
from bonecam.mesh.triangle_mesh import TriangleMesh, probes, side_by_side

CHORD = 0.05
"""Chord tolerance of the cylinder, mm."""


def shell_round(part: TriangleMesh, covered: float, wall: float, gap: float) -> TriangleMesh:
    """The shell round the upper end of a standing part, its opening down.

    `covered` is the share of the part's height in it, `wall` (mm) its least thickness, `gap` (mm) what it keeps from
    the part. ValueError where these make no shell.
    """
    if not (0 < covered < 1 and wall > 0 and gap >= 0):
        raise ValueError(
            f"covered = {covered:g}, wall = {wall:g}, gap = {gap:g}: give a share between 0 and 1, a positive wall "
            "and no negative gap"
        )
    low, high = part.bounds[:, 2]
    opening = float(high - covered * (high - low))
    inside = TriangleMesh(part.vertices + gap * vertex_normals(part), part.faces)
    held = inside.vertices[inside.vertices[:, 2] > opening]
    radius = float(np.hypot(held[:, 0], held[:, 1]).max()) + wall
    block = cylinder(radius, opening, float(high) + gap + wall, CHORD)
    return solid_difference(block, inside)


GAP = 0.3
"""A shell that is no farther from the part holds it, mm: what a printer or a layer of wax leaves."""
ENTERS = 0.05
"""A shell enters the part by no more, mm: as far as the meshes of either may be off."""
STEEPEST = np.radians(60.0)
"""A face of the part holds against pushes that are within this angle of its normal, radians."""
DIRECTIONS = 24
"""Level pushes that are tried."""
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

    FileError, UnitsError or MeshError where it cannot be read or is not closed, JobError where it does not fit: one of
    the two enters the other, or the part may move to a side or further into the shell.
    """
    file = job.holding.second
    if not file:
        return None
    given = read_in_mm(file, job.mesh.units)
    try:
        shell = solid_union([given], [file]).move(part.transform)
    except MeshError as error:
        raise MeshError(f"[holding] second = {file!r}: {error}", file=file, **error.evidence) from error
    for solid, other in ((part.mesh, shell), (shell, part.mesh)):
        points = probes(other)
        depths = -MeshDistance(solid).signed(points)
        worst = int(np.argmax(depths))
        if depths[worst] > ENTERS:
            what = f"it enters the part by {depths[worst]:.2f} mm near {place_name(points[worst])}"
            raise field_error("holding", "second", file, f"{what}, allowed {ENTERS:g}: take the part out of it")
    vectors = part.mesh.face_vectors
    near = MeshDistance(shell).unsigned(part.mesh.vertices[part.mesh.faces].mean(axis=1), 2 * GAP) <= GAP
    normals = vectors[near] / np.linalg.norm(vectors[near], axis=1)[:, None]
    turns = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    level = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(DIRECTIONS)])
    pushes = np.vstack([level, [[0.0, 0.0, 1.0]]])
    held = (normals @ pushes.T).max(axis=0, initial=-1.0) >= np.cos(STEEPEST)
    if not held.all():
        x, y, z = pushes[np.argmin(held)]
        what = f"it lets the part move towards ({x:.2f}, {y:.2f}, {z:.2f})"
        raise field_error("holding", "second", file, f"{what}: bring its walls there within {GAP:g} mm of the part")
    return shell


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
