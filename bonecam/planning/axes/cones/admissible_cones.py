"""Certified cones of free tool axes (Xu et al. 2013, section 3): one for every contact, about wanted axes.

The machine's limits and the largest tilt cut the cones by planes. Differs from the paper in:

1. A node of a net stands for the contacts round it: obstacles are nearer by the node's reach, so the tool is free on
   moves between these contacts too, not at the contacts alone.
2. The cone is the largest one in the map of proven directions in which the wanted axis lies deep; the paper says not
   how it finds its own.
3. The proof is a lower bound of distances, not a check of sampled axes; FCL is asked afterwards (`verify_cones.py`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.arrays import dots, frozen, unit
from bonecam.job import PathJob
from bonecam.kernels.closest.largest_ellipses import largest_ellipses
from bonecam.machine.limits import ANGLE_ROUNDING, MachineLimits, polar_angles
from bonecam.planning.axes.cones.cone import ObliqueEllipticCone, elliptic_cone
from bonecam.planning.axes.cones.free_axes import NODES, FreeAxes, free_axes
from bonecam.planning.axes.cones.sphere_leaves import sphere_leaves
from bonecam.planning.axes.lead import table_limits
from bonecam.planning.collision.scene import Scene
from bonecam.runtime.threads import in_pieces
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import ConeCheck, ContactPath, FreeCones

DEEP = 0.6
"""A cone stays where the wanted axis lies no further out in it than this share of the way to its rim: new ones would
hardly differ, and take most of the time of a field."""


@dataclass(frozen=True, eq=False)
class AxisCones:
    """Cones `shapes` (k), one for every node of `free.net`; `circular` ones were sought, or elliptic ones. The contacts
    of `path` keep to them, to the machine's `limits`, to polar angles `least_polar` .. `largest_polar` (n) and within
    `max_tilt` of their normals, radians. `check` is FCL's word on them, where it was asked."""

    path: ContactPath
    free: FreeAxes
    shapes: EllipticCones
    limits: MachineLimits
    least_polar: float
    largest_polar: Float[ndarray, " n"]
    max_tilt: float
    circular: bool = False
    check: ConeCheck | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "largest_polar", frozen(self.largest_polar))

    @property
    def found(self) -> Bool[ndarray, " n"]:
        """Which contacts have a cone."""
        return self.shapes.found[self.free.net.node_of]

    @property
    def shares(self) -> Float[ndarray, " k"]:
        """The part of each node's free directions that its cone holds; 0 where there is none."""
        free = self.free.free
        shapes = self.shapes
        held = np.zeros(len(shapes))
        for k in np.flatnonzero(shapes.found & free.any(axis=1)):
            q = self.free.directions[free[k]] @ shapes.matrices[k].T
            held[k] = ((q[:, 2] > 0) & (q[:, 0] ** 2 + q[:, 1] ** 2 <= q[:, 2] ** 2)).mean()
        return held

    def depths(self, axes: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """How far inside its contact's cone each axis is, radians in a circular cone as wide; negative outside."""
        shapes = self.shapes.take(self.free.net.node_of)
        return shapes.mean_angles - shapes.off(axes)

    def contain(self, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether the axis of each contact lies in its cone and keeps the limits."""
        polar = polar_angles(axes)
        within = (polar >= self.least_polar - ANGLE_ROUNDING) & (polar <= self.largest_polar + ANGLE_ROUNDING)
        within &= self.limits.allow(axes)
        near = dots(axes, self.path.normals) >= np.cos(self.max_tilt)
        return within & near & self.found & (self.depths(axes) >= 0)

    def about(self, axes: Float[ndarray, "n 3"]) -> "AxisCones":
        """The cones that hold these axes best: at each node a large one in which the mean of its contacts lies deep,
        its own where that does."""
        free = self.free
        node = free.net.node_of
        sums = [np.bincount(node, axes[:, i], len(self.shapes)) for i in range(3)]
        means = unit(np.column_stack(sums))
        rows = np.flatnonzero(self.shapes.off(means) > DEEP * self.shapes.mean_angles)
        proven = free.proven[rows]
        wanted = means[rows]
        _, leaves = sphere_leaves()

        def work(piece: slice) -> tuple[ndarray, ndarray]:
            return largest_ellipses(proven[piece], wanted[piece], leaves, free.directions, self.circular)

        frames, has_cone = map(np.concatenate, zip(*in_pieces(work, len(rows), NODES)))
        has_cone &= free.free[rows].any(axis=1)
        cones = EllipticCones.oblique(frames, has_cone)
        return replace(self, shapes=self.shapes.with_rows(rows, cones), check=None)

    def as_circles(self) -> "AxisCones":
        """Without cones as yet, and such that circular ones are sought: their sections across the wanted axes are
        circles."""
        return replace(self, shapes=EllipticCones.none(len(self.shapes)), circular=True, check=None)

    def of(self, path: ContactPath) -> FreeCones:
        """The cones of the contacts of a path: those of `path`, or some of them."""
        kept = self.shapes.found
        number = np.where(kept, np.cumsum(kept) - 1, -1)
        away, row = KDTree(self.path.centres).query(path.centres)
        cone_of = np.where(away == 0, number[self.free.net.node_of[row]], -1)
        apexes = self.free.net.places[kept]
        return FreeCones(apexes, self.shapes.take(kept), cone_of, self.circular, self.check)

    def cone(self, contact: int, length: float = 1.0) -> ObliqueEllipticCone:
        """The cone of a contact with its apex at the ball's centre, to `length` (mm) along its axis. ValueError where
        the contact has none."""
        node = int(self.free.net.node_of[contact])
        if not self.shapes.found[node]:
            raise ValueError(f"contact {contact} has no cone: see `blocked`")
        return elliptic_cone(self.path.centres[contact], self.shapes, node, length)


def admissible_cones(path: ContactPath, scene: Scene, limits: MachineLimits, job: PathJob) -> AxisCones:
    """The cones of a path's contacts for its cutter in a scene: large ones about the mean of each node's free
    directions.

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
        shapes=EllipticCones.none(len(free.net.places)),
        limits=limits,
        least_polar=limits.smallest,
        largest_polar=largest,
        max_tilt=tilt,
    )
    middle = unit(free.free @ free.directions + 1e-9 * free.net.normals)
    return none.about(middle[free.net.node_of])
