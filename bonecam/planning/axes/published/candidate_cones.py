"""The candidate sets of Xu et al. (2013), sections 3 to 5: at each contact an oblique elliptic cone of tool axes, from
normal, curvature and the bend of the pass.

The paper leaves open how curvature becomes semi-angles, which curve is offset, and how far. Here, with the ball's
radius r, the length l of an axis that has to be free, and concave curvatures k counted positive:

1. Theta_i = arccos(l k_i / (2 (1 - r k_i))) is the angle from the normal at which an axis, l long from the ball's
   centre, ends on a sphere of the principal curvature k_i, as large as allowed where k_i <= 0.
2. w_i = |ln(|k_i| / H)| / (its 95th percentile), 1 at most, H the mean of |mean curvature|: the semi-angle towards the
   principal direction i is low + (min(Theta_i, high) - low) (1 - w_i / 2).
3. Eq. 20: the cone's middle lies at l n - w r N from the contact, N and k the principal normal and the curvature of
   the pass, w = k / (its 95th percentile), 1 at most: it leans out of the bend.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths, unit
from bonecam.mesh.facets.curvature import Curvature
from bonecam.planning.axes.facets.contact_facets import ContactFacets
from bonecam.tool.path import ContactPath

LENGTH = 3.0
"""Length l of an axis, in radii of the ball: farther out the nearest facet is another contact's (Eq. 21)."""
LOW, HIGH = np.radians([10.0, 60.0])
"""Semi-angles, radians."""
FLAT = 1e-4
"""Curvature (1/mm) added to those whose logarithm is taken: that of a plane has none."""
HIGH_RANK = 95
"""Percentile by which weights are normalised."""
RINGS = ((0.0, 1), (0.5, 8), (1.0, 12))
"""Candidates of a cone: shares of the way to its rim, and how many are there."""


def candidate_axes(facets: ContactFacets) -> Float[ndarray, "v c 3"]:
    """Unit candidates at each vertex of the facets, the middle of its cone first."""
    frames = candidate_frames(facets)
    across = [
        (share * np.cos(turn), share * np.sin(turn))
        for share, count in RINGS
        for turn in 2 * np.pi * np.arange(count) / count
    ]
    factors = np.column_stack([np.ones(len(across)), across])
    axes = np.einsum("cf,vfd->vcd", factors, frames)
    return axes / np.linalg.norm(axes, axis=2, keepdims=True)


def candidate_frames(facets: ContactFacets) -> Float[ndarray, "v 3 3"]:
    """D, U and V of each vertex's cone, in lengths l: its middle and two conjugate semi-diameters, so that its axes go
    along D + share (cos(turn) U + sin(turn) V)."""
    radius = facets.path.cutter.radius
    curvature, normals = facets.curvature, facets.vertex_normals
    along = curvature.direction1
    first = unit(along - dots(along, normals)[:, None] * normals)
    second = np.cross(normals, first)
    middles = normals - weighted_offsets(facets.path)[facets.contact_of] / (LENGTH * radius)
    tangents = np.tan(semi_angles(curvature, radius))
    return np.stack([middles, tangents[:, :1] * first, tangents[:, 1:] * second], axis=1)


def semi_angles(curvature: Curvature, radius: float) -> Float[ndarray, "v 2"]:
    """The semi-angle (radians) towards each principal direction, for a ball of `radius` (mm)."""
    concave = -np.column_stack([curvature.k1, curvature.k2])
    length = LENGTH * radius
    room = 2 * np.maximum(1 - radius * concave, np.finfo(float).eps)
    chord = np.arccos(np.clip(length * concave / room, 0.0, 1.0))
    free = np.where(concave <= 0, HIGH, np.minimum(chord, HIGH))
    mean = np.abs(curvature.mean).mean()
    ratio = np.abs(np.log((np.abs(concave) + FLAT) / (mean + FLAT)))
    return np.maximum(LOW + (free - LOW) * (1 - _share_of_high(ratio) / 2), 0.0)


def weighted_offsets(path: ContactPath) -> Float[ndarray, "n 3"]:
    """w r N of Eq. 20, mm: towards the centre of the pass's bend, longest where it bends most; none at its ends."""
    points = path.contacts
    before = np.diff(points, axis=0)[:-1]
    behind = np.diff(points, axis=0)[1:]
    short, long = lengths(before), lengths(behind)
    inner = (path.pass_index[2:] == path.pass_index[:-2]) & (short > 0) & (long > 0)
    short, long = np.where(inner, short, 1.0)[:, None], np.where(inner, long, 1.0)[:, None]
    bends = np.zeros_like(points)
    bends[1:-1] = 2 * (behind / long - before / short) / (short + long) * inner[:, None]
    return _share_of_high(lengths(bends))[:, None] * path.cutter.radius * unit(bends)


def _share_of_high(values: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
    """Values from 0 as shares of their HIGH_RANK percentile, 1 at most."""
    high = float(np.percentile(values, HIGH_RANK)) if values.size else 0.0
    return np.minimum(values / max(high, np.finfo(float).tiny), 1.0)
