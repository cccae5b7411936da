"""Roughness of what a program leaves: Ra and Rz (ISO 4287) of profiles along and across the feed.

At places of the part that the finishing cutter has cut last a profile of SAMPLING lengths is laid out either way, as
the balls leave it (`machined.py`: cusps), and along the feed with the marks of the edges: each cuts an arc of the ball
every feed per tooth f, which leaves f^2 (1/R + k) / 8, k the curvature along the feed. Form is taken off each sampling
length as a parabola. Left out: run-out (f is then that of a turn, four times the height with two flutes), chatter, the
radius of the edge, and what the material does.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths, unit
from bonecam.verify.probing.machined import PostedProgram
from bonecam.verify.removal.groups import feed_minutes, tools_of

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
    probes = program.removal.remaining.normal_probes
    motions = program.motions()
    assert probes is not None
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
    radius = tools_of(motions, program.cutters)[int(motions.tools[-1])].radius
    s, t = program.part.project(probes.points[here]).parameters.T
    curved = 1 / radius + _curvature(program, s, t, feeds)
    height = tooth**2 * np.maximum(curved, 0.0) / 8
    phase = np.mod(steps / np.maximum(tooth, np.finfo(float).tiny)[:, None] + 0.5, 1.0) - 0.5
    along = _profiles(program, probes.points[here], feeds, steps) + 4 * height[:, None] * phase**2
    across = _profiles(program, probes.points[here], np.cross(normals, feeds), steps)
    return Roughness(_ra_rz(along), _ra_rz(across), UM * height)


def _curvature(
    program: PostedProgram, s: Float[ndarray, " n"], t: Float[ndarray, " n"], feeds: Float[ndarray, "n 3"]
) -> Float[ndarray, " n"]:
    """Normal curvature (1/mm, > 0: convex) of the part along the feed, by a step of NODE either way."""
    at, normals = program.part.positions(s, t), program.part.normals(s, t)
    sagged = np.zeros(len(s))
    for side in (CUT_OFF / 8, -CUT_OFF / 8):
        beside = program.part.project(at + side * feeds).points
        sagged += -dots(beside - at, normals) / side**2
    return sagged


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
