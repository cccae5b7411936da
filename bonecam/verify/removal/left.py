"""What normal probes tell in the end: what stays on the part, and where a ball went into it."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from bonecam.arrays import angles_between
from bonecam.machine.limits import MachineLimits
from bonecam.nc.reading.motions import Motions
from bonecam.planning.passes.contacts import at_post
from bonecam.verify.removal.normal_probes import NormalProbes
from bonecam.verify.removal.result import Left, Spot
from bonecam.workholding.post import Post

LEFT = 0.02
"""More material than this is left over, mm: twice the scallop height of a default finishing cutter."""
HEIGHTS = (LEFT, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
"""What keeps more than each of these is told as an area, mm."""
ENTERS = 0.01
"""A ball on a place that enters the part beside it by more does not fit there, mm: the gouge tolerance of a job."""


def measure_left(normal_probes: NormalProbes, post: Post | None, radius: float, motions: Motions) -> Left:
    """What stays; the post, if there is one, and the fillet stay that a ball of `radius` (mm, the smallest) leaves
    round it."""
    at_lower = held = np.zeros(len(normal_probes.points), dtype=bool)
    if post is not None:
        held = at_post(normal_probes.points, normal_probes.normals, post, radius)
        at_lower = at_post(normal_probes.points, normal_probes.normals, post.alone, radius)
    over = normal_probes.heights > LEFT
    away = np.where(held, -np.inf, normal_probes.heights)
    highest = int(np.argmax(away))
    lowest = int(np.argmin(normal_probes.heights))
    standing = np.flatnonzero(over & ~held)

    # Whether a ball that touches the part at these normal probes would enter it at another normal probe
    centres = normal_probes.points[standing] + radius * normal_probes.normals[standing]
    nearest, _ = cKDTree(normal_probes.points).query(centres)
    hollow = nearest < radius - ENTERS

    return Left(
        mesh=normal_probes.mesh,
        heights=normal_probes.heights,
        highest=_spot(float(normal_probes.heights[highest]), highest, normal_probes, motions),
        deepest_gouge=_spot(-float(normal_probes.heights[lowest]), lowest, normal_probes, motions),
        areas_over={
            height: float(normal_probes.areas[~held & (normal_probes.heights > height)].sum()) for height in HEIGHTS
        },
        by_reason={
            "post": float(normal_probes.areas[over & at_lower].sum()),
            "tailstock": float(normal_probes.areas[over & held & ~at_lower].sum()),
            "gouge": float(normal_probes.areas[standing[hollow]].sum()),
            "reachable": float(normal_probes.areas[standing[~hollow]].sum()),
        },
        reachable=standing[~hollow],
    )


def beside_limits(left: Left, normal_probes: NormalProbes, limits: MachineLimits, tilt: float) -> Left:
    """What stays, with the reason `limits` of the places where the ball fits, but no tool axis of the machine is within
    `tilt` (rad) of the normal: the ends of a part on a machine that lays its tool across them."""
    normals = normal_probes.normals[left.reachable]
    beyond = angles_between(normals, limits.nearest(normals)) > tilt
    areas = normal_probes.areas[left.reachable]
    by_reason = {"reachable": float(areas[~beyond].sum()), "limits": float(areas[beyond].sum())}
    return replace(left, by_reason=left.by_reason | by_reason, reachable=left.reachable[~beyond])


def _spot(value: float, normal_probe: int, normal_probes: NormalProbes, motions: Motions) -> Spot:
    """A figure at a normal probe, and the line of the move that cut it lowest (0: none did)."""
    x, y, z = (float(v) for v in normal_probes.points[normal_probe])
    owner = int(normal_probes.owners[normal_probe])
    return Spot(value, int(motions.lines[owner]) if owner >= 0 else 0, (x, y, z))
