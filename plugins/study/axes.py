"""The choice of tool axes as published (Xu et al. 2013, sections 3 to 5), for comparison.

The candidate sets of Xu et al. (2013), sections 3 to 5: at each contact an oblique elliptic cone of tool axes, from
normal, curvature and the bend of the pass.

The paper leaves open how curvature becomes semi-angles, which curve is offset, and how far. Here, with the ball's
radius r, the length l of an axis that has to be free, and concave curvatures k counted positive:

1. Theta_i = arccos(l k_i / (2 (1 - r k_i))) is the angle from the normal at which an axis, l long from the ball's
   centre, ends on a sphere of the principal curvature k_i, as large as allowed where k_i <= 0.
2. w_i = |ln(|k_i| / H)| / (its 95th percentile), 1 at most, H the mean of |mean curvature|: the semi-angle towards the
   principal direction i is low + (min(Theta_i, high) - low) (1 - w_i / 2).
3. Eq. 20: the cone's middle lies at l n - w r N from the contact, N and k the principal normal and the curvature of
   the pass, w = k / (its 95th percentile), 1 at most: it leans out of the bend.

The tool axes of Xu et al. (2013): of each contact's candidates those of least elastic energy on the facets (Eq. 22)
that are above them (Eq. 21) and do not collide.

The paper leaves open how candidates are compared. Here steps that fair all axes at once,

    (A + tau H) x = A a

with the Voronoi areas A, the matrix H of the energy, and tau the mean area of a cell, or to what has the least energy
at each contact between its neighbours, take turns with the choice of the allowed candidate nearest to x, as long as the
energy falls. The chosen ones are put before the planner's own proof of collision, in place of the intersection of NURBS
surfaces (Eq. 23); where one collides the choice goes on without it.

Eq. 22 is taken with its membrane alone (alpha = 1, beta = 0; the paper gives no weights),

    E = 1 / 2 int |grad r|^2

over the surface, not over its parameters, which stretch it: with linear values on the faces r L r / 2, L the cotangent
Laplacian (Pinkall & Polthier 1993).
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import splu

from bonecam.arrays import dots, lengths, unit
from bonecam.job import PathJob
from bonecam.machine import MachineLimits, polar_angles
from bonecam.mesh import (
    Curvature,
    TriangleMesh,
    cotangent_weights,
    heights_above,
    mls_curvature,
    vertex_normals,
    voronoi_areas,
)
from bonecam.planning import SINGULAR_CONE, CollisionChecker, ContactFacets, Scene, contact_facets, within_limits
from bonecam.surface import TSpline
from bonecam.tool import ContactPath

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
    curvature, normals = mls_curvature(facets.mesh, few_allowed=True), vertex_normals(facets.mesh)
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


SWEEPS = 12
"""Steps of fairing for one choice, at most."""


def published_axes(
    path: ContactPath, surface: TSpline, scene: Scene, limits: MachineLimits, job: PathJob
) -> Float[ndarray, "n 3"]:
    """A unit axis for each contact of a path on a surface; where all candidates are refused the middle one, which the
    planner then refuses too. Contacts that all lie on a line have no facets: they get the surface's normals."""
    facets = contact_facets(path, surface)
    if facets is None:
        return path.normals
    checker = CollisionChecker(scene, path.cutter)
    rows = facets.contact_of
    candidates = candidate_axes(facets)
    count, each = candidates.shape[:2]
    flat = candidates.reshape(-1, 3)
    allowed = within_limits(flat, np.repeat(path.normals[rows], each, axis=0), limits, np.radians(job.max_tilt_deg))
    allowed &= polar_angles(flat) >= SINGULAR_CONE

    # Whether the ends of these axes, `length` (mm) from their vertices, are above the facets (Eq. 21).
    length = LENGTH * path.cutter.radius
    which = np.flatnonzero(allowed)
    vertex = which // (len(flat) // len(facets.contact_of))
    locations = facets.mesh.vertices[vertex] + length * flat[which]
    outward = dots(vertex_normals(facets.mesh)[vertex], flat[which]) > 0
    allowed[allowed] = outward & (heights_above(locations, facets.mesh) > 0)

    def free(vertices: Int[ndarray, " k"], axes: Float[ndarray, "k 3"]) -> Bool[ndarray, " k"]:
        return checker.free_by_distance(path.centres[rows[vertices]], axes)

    energy = elastic_energy(facets.mesh)
    chosen = choose(candidates, allowed.reshape(count, each), energy, voronoi_areas(facets.mesh), free)
    axes = candidates[np.arange(count), chosen]
    return np.where(facets.found[:, None], axes[facets.vertex_of], path.normals)


def elastic_energy(mesh: TriangleMesh) -> csr_array:
    """The symmetric H (v, v) of the membrane, E = r H r / 2, on the faces of a mesh, open or closed."""
    weights = cotangent_weights(mesh)
    return (diags_array(weights.sum(axis=1)) - weights).tocsr()


def choose(
    candidates: Float[ndarray, "v c 3"],
    allowed: Bool[ndarray, "v c"],
    energy: csr_array,
    areas: Float[ndarray, " v"],
    free: Callable[[Int[ndarray, " k"], Float[ndarray, "k 3"]], Bool[ndarray, " k"]],
) -> Int[ndarray, " v"]:
    """Which candidate each vertex takes: of those allowed that are `free`, the choice of least elastic energy that is
    found; the first candidate where there is none."""
    allowed = allowed.copy()
    proven = np.zeros_like(allowed)
    step = splu((diags_array(areas) + float(np.mean(areas)) * energy).tocsc())
    every = np.arange(len(candidates))
    chosen = allowed.argmax(axis=1)

    def energy_of(choice: Int[ndarray, " v"]) -> float:
        axes = candidates[every, choice]
        return float((axes * (energy @ axes)).sum())

    while True:
        first = allowed.argmax(axis=1)
        chosen = np.where(allowed[every, chosen], chosen, first)
        least = energy_of(chosen)
        for _ in range(SWEEPS):
            axes = candidates[every, chosen]
            wanted = step.solve(areas[:, None] * axes), energy.diagonal()[:, None] * axes - energy @ axes
            towards = [np.einsum("vcd,vd->vc", candidates, unit(each)) for each in wanted]
            best = min((np.where(allowed, each, -2.0).argmax(axis=1) for each in towards), key=energy_of)
            best_energy = energy_of(best)
            if best_energy >= least:
                break
            chosen, least = best, best_energy
        asked = np.flatnonzero(allowed[every, chosen] & ~proven[every, chosen])
        if not len(asked):
            return np.where(allowed.any(axis=1), chosen, 0)
        is_free = free(asked, candidates[asked, chosen[asked]])
        proven[asked[is_free], chosen[asked[is_free]]] = True
        blocked = asked[~is_free]
        allowed[blocked, chosen[blocked]] = False
