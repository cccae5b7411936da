"""What is measured on one cut, between a level (outer) and the level before it (inner).

- *Depth*: how far points of the outer level lie from the inner one, which is what the cutter on the inner level
  removes; the *reverse depth* is how far points of the inner level lie from the outer one.
- *Nesting*: how far inside the outer level the inner one lies.
- *Outside*: how far the outer level leaves the stock.

The points are the vertices of the tessellations and the surface points in the middle of every face. Nearest
points are sought on the tessellations, distances are taken to the surfaces (`measured_surface.py`), the signed
distance of a stock is exact. Faces that cut each other are those of the outer tessellation.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh

FULL_DEPTH = 1.0
"""Depths that must be left above a point of the inner level for it to count in `full_depth_mean`."""
BINS = 20
"""Even bins of the shares of area by depth, from 0 to the limit."""


@dataclass(frozen=True, eq=False)
class Measures:
    """One cut as measured; lengths in mm, and the places where the worst values are.

    `depth_max` and `depth_mean` (over its area) are of the outer level, `reverse_depth_max` of the inner one.
    `full_depth_mean` is the mean reverse depth where at least a full depth of material was left to the stock,
    over `full_depth_area` mm^2 of the inner level; the limit where that area is empty. `depth_shares` are the
    shares of the outer level's area by depth, in even bins from 0 to the limit. `nesting_min` is negative where
    a point of the inner level lies outside the outer one, `outside` negative where no point leaves the stock.
    `crossing_faces` are faces of the outer mesh that cut others. `near_limits` are parameters (s, t) of places
    that use half a tolerance or more, or where the level cuts itself.
    """

    depth_max: float
    depth_mean: float
    reverse_depth_max: float
    full_depth_mean: float
    full_depth_area: float
    depth_shares: tuple[float, ...]
    nesting_min: float
    outside: float
    depth_place: Float[ndarray, "3"]
    reverse_depth_place: Float[ndarray, "3"]
    nesting_place: Float[ndarray, "3"]
    outside_place: Float[ndarray, "3"]
    crossing_faces: Int[ndarray, " x"]
    near_limits: Float[ndarray, "k 2"]

    @property
    def self_intersections(self) -> int:
        """The number of faces of the outer mesh that cut others."""
        return len(self.crossing_faces)

    def watching(self, parameters: Float[ndarray, "n 2"]) -> "Measures":
        """The measures with more parameters among `near_limits`."""
        return replace(self, near_limits=np.vstack([self.near_limits, parameters]))


NO_CUT = Measures(
    depth_max=0.0,
    depth_mean=0.0,
    reverse_depth_max=0.0,
    full_depth_mean=0.0,
    full_depth_area=0.0,
    depth_shares=(),
    nesting_min=0.0,
    outside=0.0,
    depth_place=np.zeros(3),
    reverse_depth_place=np.zeros(3),
    nesting_place=np.zeros(3),
    outside_place=np.zeros(3),
    crossing_faces=np.empty(0, dtype=np.int64),
    near_limits=np.empty((0, 2)),
)
"""The measures of a level that no cut ends at."""


@dataclass(frozen=True, eq=False)
class CutSamples:
    """Points of the two levels of a cut and what was found there, mm; of each level the vertices of its mesh
    first, then one point a face.

    `depth` and `outside` belong to the `outer_points`; `reverse_depth`, `nesting` (signed, positive inside the
    outer level) and `remaining` (the distance to the stock) to the `inner_points`.
    """

    outer_points: Float[ndarray, "n 3"]
    inner_points: Float[ndarray, "m 3"]
    depth: Float[ndarray, " n"]
    outside: Float[ndarray, " n"]
    reverse_depth: Float[ndarray, " m"]
    nesting: Float[ndarray, " m"]
    remaining: Float[ndarray, " m"]


def measures_of(
    samples: CutSamples,
    inner: TriangleMesh,
    outer: TriangleMesh,
    limit: float,
    crossing_faces: Int[ndarray, " x"],
    near_limits: Float[ndarray, "k 2"] = NO_CUT.near_limits,
) -> Measures:
    """The worst values and the means over the areas of the two meshes; `limit` is the depth of the cut, mm."""
    inner_areas = np.linalg.norm(inner.face_vectors, axis=1) / 2
    outer_areas = np.linalg.norm(outer.face_vectors, axis=1) / 2
    face_depth = samples.depth[len(outer.vertices) :]
    face_reverse_depth = np.abs(samples.reverse_depth[len(inner.vertices) :])
    full = samples.remaining[len(inner.vertices) :] >= FULL_DEPTH * limit
    return Measures(
        depth_max=float(samples.depth.max()),
        depth_mean=float(np.average(face_depth, weights=outer_areas)),
        reverse_depth_max=float(samples.reverse_depth.max()),
        full_depth_mean=float(np.average(face_reverse_depth[full], weights=inner_areas[full])) if full.any() else limit,
        full_depth_area=float(inner_areas[full].sum()),
        depth_shares=depth_shares(face_depth, outer_areas, limit),
        nesting_min=float(samples.nesting.min()),
        outside=float(samples.outside.max()),
        depth_place=samples.outer_points[np.argmax(samples.depth)],
        reverse_depth_place=samples.inner_points[np.argmax(samples.reverse_depth)],
        nesting_place=samples.inner_points[np.argmin(samples.nesting)],
        outside_place=samples.outer_points[np.argmax(samples.outside)],
        crossing_faces=crossing_faces,
        near_limits=near_limits,
    )


def depth_shares(depth: Float[ndarray, " f"], areas: Float[ndarray, " f"], limit: float) -> tuple[float, ...]:
    """The shares of the area in BINS even bins of depth from 0 to `limit` (mm); what is deeper counts in the
    last bin."""
    shares = np.histogram(np.minimum(depth, limit), bins=BINS, range=(0, limit), weights=areas / areas.sum())[0]
    return tuple(float(share) for share in shares)
