"""The tool axes of Xu et al. (2013): of each contact's candidates those of least elastic energy on the facets (Eq. 22)
that are above them (Eq. 21) and do not collide.

The paper leaves open how candidates are compared. Here steps that fair all axes at once,

    (A + tau H) x = A a

with the Voronoi areas A, the matrix H of the energy, and tau the mean area of a cell, or to what has the least energy
at each contact between its neighbours, take turns with the choice of the allowed candidate nearest to x, as long as the
energy falls. The chosen ones are put before the planner's own proof of collision, in place of the intersection of NURBS
surfaces (Eq. 23); where one collides the choice goes on without it.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import splu

from bonecam.arrays import dots, unit
from bonecam.job import PathJob
from bonecam.machine.limits import MachineLimits, polar_angles
from bonecam.mesh.facets.energy.voronoi_areas import voronoi_areas
from bonecam.mesh.facets.side import heights_above
from bonecam.planning.axes.admissible import Free, within_limits
from bonecam.planning.axes.facets.contact_facets import contact_facets
from bonecam.planning.axes.published.candidate_cones import LENGTH, candidate_axes
from bonecam.planning.axes.singularity import SINGULAR_CONE
from bonecam.planning.collision.checker import CollisionChecker
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import ContactPath

SWEEPS = 12
"""Steps of fairing for one choice, at most."""


def published_axes(
    path: ContactPath, surface: TSpline, checker: CollisionChecker, limits: MachineLimits, job: PathJob
) -> Float[ndarray, "n 3"]:
    """A unit axis for each contact of a path on a surface; where all candidates are refused the middle one, which the
    planner then refuses too. Contacts that all lie on a line have no facets: they get the surface's normals."""
    facets = contact_facets(path, surface)
    if facets is None:
        return path.normals
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
    outward = dots(facets.vertex_normals[vertex], flat[which]) > 0
    allowed[allowed] = outward & (heights_above(locations, facets.mesh) > 0)

    def free(vertices: Int[ndarray, " k"], axes: Float[ndarray, "k 3"]) -> Bool[ndarray, " k"]:
        return checker.free_by_distance(path.centres[rows[vertices]], axes)

    weights = (job.membrane, job.thin_plate) if job.membrane or job.thin_plate else (1.0, 0.0)
    energy = facets.energy.matrix(*weights)
    chosen = choose(candidates, allowed.reshape(count, each), energy, voronoi_areas(facets.mesh), free)
    axes = candidates[np.arange(count), chosen]
    return np.where(facets.found[:, None], axes[facets.vertex_of], path.normals)


def choose(
    candidates: Float[ndarray, "v c 3"],
    allowed: Bool[ndarray, "v c"],
    energy: csr_array,
    areas: Float[ndarray, " v"],
    free: Free,
) -> Int[ndarray, " v"]:
    """Which candidate each vertex takes: of those allowed that are `free`, the choice of least elastic energy that is
    found; the first candidate where there is none."""
    allowed = allowed.copy()
    proven = np.zeros_like(allowed)
    step = splu((diags_array(areas) + float(np.mean(areas)) * energy).tocsc())
    every = np.arange(len(candidates))
    chosen = allowed.argmax(axis=1)
    while True:
        first = allowed.argmax(axis=1)
        chosen = np.where(allowed[every, chosen], chosen, first)
        chosen = _faired(candidates, allowed, chosen=chosen, energy=energy, areas=areas, solve=step.solve)
        asked = np.flatnonzero(allowed[every, chosen] & ~proven[every, chosen])
        if not len(asked):
            return np.where(allowed.any(axis=1), chosen, 0)
        is_free = free(asked, candidates[asked, chosen[asked]])
        proven[asked[is_free], chosen[asked[is_free]]] = True
        blocked = asked[~is_free]
        allowed[blocked, chosen[blocked]] = False


def _faired(
    candidates: Float[ndarray, "v c 3"],
    allowed: Bool[ndarray, "v c"],
    chosen: Int[ndarray, " v"],
    energy: csr_array,
    areas: Float[ndarray, " v"],
    solve: Callable[[ndarray], ndarray],
) -> Int[ndarray, " v"]:
    """The choice after steps of fairing, from one."""
    every = np.arange(len(candidates))

    def energy_of(choice: Int[ndarray, " v"]) -> float:
        axes = candidates[every, choice]
        return float((axes * (energy @ axes)).sum())

    least = energy_of(chosen)
    for _ in range(SWEEPS):
        axes = candidates[every, chosen]
        wanted = solve(areas[:, None] * axes), energy.diagonal()[:, None] * axes - energy @ axes
        tried = [
            np.where(allowed, np.einsum("vcd,vd->vc", candidates, unit(each)), -2.0).argmax(axis=1) for each in wanted
        ]
        best = min(tried, key=energy_of)
        best_energy = energy_of(best)
        if best_energy >= least:
            break
        chosen, least = best, best_energy
    return chosen
