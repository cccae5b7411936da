"""Certified cones of free tool axes (Xu et al. 2013, section 3): one for every contact, about wanted axes.

The machine's limits and the largest tilt cut the cones by planes. Differs from the paper in:

1. A node of a net stands for the contacts round it: obstacles are nearer by the node's reach, so the tool is free on
   moves between these contacts too, not at the contacts alone.
2. A cone is circular, the widest one that expanding marching proves free about one of the free directions; the
   paper's oblique elliptic cone is `cone.py`.
3. The proof is a lower bound of distances, not a check of sampled axes; FCL is asked afterwards (`verify_cones.py`).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.arrays import angles_between, dots, frozen, unit
from bonecam.job import PathJob
from bonecam.kernels.closest.cone_marching import deepest_cones, proof_slacks
from bonecam.machine.limits import ANGLE_ROUNDING, MachineLimits, polar_angles
from bonecam.planning.axes.cones.cone import ObliqueEllipticCone, circular_cone
from bonecam.planning.axes.cones.free_axes import WIDEST, FreeAxes, free_axes
from bonecam.planning.axes.lead import table_limits
from bonecam.planning.collision.scene import Scene
from bonecam.tool.path import ConeCheck, ContactPath, FreeCones

TRIED = 3
"""Directions that a cone is tried about: those that promise most."""
WIDTH_SHARE = 0.3
"""A cone wider by an angle is preferred even if the wanted axes lie less deep in it by this share of the angle: a field
has more room in it. On four levels of the phalanx the rounds to the end are a fifth fewer than without."""
MOST_SLACK = 1.0
"""No more is sought of what a proof has to spare, mm."""
NO_CONE = -1.0
"""Angle of a node without a cone."""


@dataclass(frozen=True, eq=False)
class AxisCones:
    """Cones about `axes` (k, 3) with semi-angles `angles` (k; NO_CONE where there is none), radians, one for every
    node of `free.net`. The contacts of `path` keep to them, to polar angles `least_polar` .. `largest_polar` (n) and
    within `max_tilt` of their normals, radians. `check` is FCL's word on them, where it was asked."""

    path: ContactPath
    free: FreeAxes
    axes: Float[ndarray, "k 3"]
    angles: Float[ndarray, " k"]
    least_polar: float
    largest_polar: Float[ndarray, " n"]
    max_tilt: float
    check: ConeCheck | None = None

    def __post_init__(self) -> None:
        for name in ("axes", "angles", "largest_polar"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def found(self) -> Bool[ndarray, " n"]:
        """Which contacts have a cone."""
        return np.asarray(self.angles[self.free.net.node_of] > 0)

    @cached_property
    def slacks(self) -> Float[ndarray, " k"]:
        """By how much nearer (mm, MOST_SLACK at most) all obstacles could be for the proof of each cone to hold still;
        0 where there is none."""
        return proof_slacks(self.free.obstacles, self.free.apexes, self.axes, self.angles, MOST_SLACK)

    def depths(self, axes: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """How far inside its contact's cone each axis is, radians; negative outside."""
        node = self.free.net.node_of
        return np.asarray(self.angles[node] - angles_between(axes, self.axes[node]))

    def contain(self, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether the axis of each contact lies in its cone and keeps the limits."""
        polar = polar_angles(axes)
        within = (polar >= self.least_polar - ANGLE_ROUNDING) & (polar <= self.largest_polar + ANGLE_ROUNDING)
        within &= self.free.limits.allow(axes)
        near = dots(axes, self.path.normals) >= np.cos(self.max_tilt)
        return np.asarray(within & near & self.found & (self.depths(axes) >= 0))

    def about(self, axes: Float[ndarray, "n 3"]) -> "AxisCones":
        """The cones that hold these axes best: at each node a wide one in which the mean of its contacts lies
        deep."""
        free = self.free
        node = free.net.node_of
        sums = [np.bincount(node, axes[:, i], len(self.angles)) for i in range(3)]
        means = unit(np.column_stack(sums))
        axes, angles = deepest_cones(
            free.obstacles, free.apexes, means, free.directions, free.room, TRIED, WIDEST, WIDTH_SHARE
        )
        angles[(angles <= 0) | ~free.allowed.any(axis=1)] = NO_CONE
        return replace(self, axes=axes, angles=angles, check=None)

    def blocked(self) -> dict[int, str]:
        """The contacts without any cone, and what is against it: `limits`, or the section of the tool and the obstacle
        that it meets along most directions, as `shank against the material`."""
        nodes = np.flatnonzero(self.angles <= 0)
        why = dict(zip(nodes.tolist(), self.free.blocking(nodes)))
        contacts = np.flatnonzero(~self.found)
        return {int(i): why[int(self.free.net.node_of[i])] for i in contacts}

    def of(self, path: ContactPath) -> FreeCones:
        """The cones of the contacts of a path: those of `path`, or some of them."""
        kept = self.angles > 0
        number = np.where(kept, np.cumsum(kept) - 1, -1)
        away, row = KDTree(self.path.centres).query(path.centres)
        cone_of = np.where(away == 0, number[self.free.net.node_of[row]], -1)
        net = self.free.net
        apexes, axes, angles, slacks = (
            part[kept] for part in (net.places, self.axes, self.angles, self.slacks)
        )
        return FreeCones(apexes, axes, angles, slacks, cone_of, self.check)

    def cone(self, contact: int, length: float = 1.0) -> ObliqueEllipticCone:
        """The cone of a contact with its apex at the ball's centre, to `length` (mm) along its axis. ValueError where
        the contact has none."""
        node = self.free.net.node_of[contact]
        if not self.angles[node] > 0:
            raise ValueError(f"contact {contact} has no cone: see `blocked`")
        return circular_cone(self.path.centres[contact], self.axes[node], self.angles[node], length)


def admissible_cones(path: ContactPath, scene: Scene, limits: MachineLimits, job: PathJob) -> AxisCones:
    """The cones of a path's contacts for its cutter in a scene: the widest of each node.

    OrientationError where a mesh of the scene is not closed, a contact is not finite, or there is none.
    """
    tilt = float(np.radians(job.max_tilt_deg))
    free = free_axes(path, scene, limits, tilt)
    clamping = scene.clamping
    largest = np.full(len(path.centres), limits.largest)
    if clamping.closed:
        largest = np.minimum(largest, table_limits(path.centres, path.cutter, clamping.clearance))
    none = AxisCones(
        path=path,
        free=free,
        axes=free.net.normals,
        angles=np.full(len(free.net.places), NO_CONE),
        least_polar=limits.smallest,
        largest_polar=largest,
        max_tilt=tilt,
    )
    widest = free.directions[np.where(free.free, free.room, -1.0).argmax(axis=1)]
    return none.about(widest[free.net.node_of])
