"""The removal of the program of one surface that is machined alone, from the stock that stands before it is finished:
the solids, and on the surface as much material as its finishing cut is deep."""

from dataclasses import dataclass, replace

import numpy as np

from bonecam.errors import ToolPathError, knowing
from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.material.solid_rays import lay_solids
from bonecam.mechanics.workpiece import workpiece_of
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.healing.topology import half_edges
from bonecam.mesh.solids.revolution import cylinder
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.planning.holding.surface_post import carrying_solid
from bonecam.progress import Progress, silent
from bonecam.surface.tspline import TSpline
from bonecam.verify.removal.normal_probes import normal_probes_on
from bonecam.verify.removal.of_job import ACCURACY, check_removal_of_job, cutters_of
from bonecam.verify.removal.result import Removal
from bonecam.verify.removal.simulate import simulate_further
from bonecam.verify.removal.sweeping import SimulatedStock
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import Post, post_below

CHORD = 0.01
"""Chord tolerance of the layer on the surface, of the post, and of the surface on which is told what stands, mm."""
SUNK = 0.02
"""The layer reaches so far into the solid below it, mm: both are tessellated."""


@dataclass(frozen=True, eq=False)
class SurfaceRemoval:
    """What the text of a surface's program removes, and why force and bending are not known, "" where they are."""

    removal: Removal
    unknown: str


def prove_surface_removal(
    text: str,
    machine: Machine,
    dialect: Dialect,
    job: Job,
    surface: TSpline,
    solid: TriangleMesh,
    progress: Progress = silent,
    *,
    mechanics: bool = True,
) -> SurfaceRemoval:
    """What the posted `text` removes from the stock before it, where a `surface` and the `solid` of everything that
    must not be gouged stand on the post of the job. Errors as in `check_removal_of_job`, for an
    assumed stock."""
    carrying = carrying_solid(surface, solid)
    clamping = clamping_of(job.holding, machine.table)
    post = Post(job.holding.diameter / 2, float(solid.bounds[0, 2]))
    shown = surface.tessellate(CHORD)
    unknown, work = "", None
    if mechanics:
        try:
            post = post_below(carrying, job.holding)
            work = replace(workpiece_of(job, post, clamping), body=carrying)
        except ToolPathError as error:
            unknown = f"force and bending are not known, since {error}"

    # What stands before the surface is finished, on post and stub, with the normal probes of the surface
    columns = [cylinder(column.radius, column.bottom, column.top, CHORD) for column in clamping.carried(post)]
    solids = [solid, layer_on(surface, job.levels.finishing_depth), *columns]
    sets, grid = lay_solids(solids, ACCURACY.cell, ACCURACY.memory_mb)
    removal = simulate_further(
        text,
        machine,
        dialect=dialect,
        material=SimulatedStock(sets, grid, normal_probes_on(surface)),
        post=post,
        cutters=cutters_of(job, machine),
        clamping=clamping,
        limits={0: job.levels.finishing_depth},
        surfaces={0: shown},
        workpiece=work,
        progress=progress,
    )
    over = float(MeshDistance(solid).signed(shown.vertices).max(initial=0.0))
    with knowing(removal.sections):
        check_removal_of_job(removal, job, over, assumed=True)
    return SurfaceRemoval(removal, unknown)


def layer_on(surface: TSpline, depth: float) -> TriangleMesh:
    """The closed mesh of a layer of material that is `depth` mm thick on a surface, along its normals."""
    tessellation = surface.tessellate_with_parameters(CHORD)
    s, t = tessellation.parameters.T
    normals = surface.normals(s, t)
    faces = tessellation.mesh.faces
    points = tessellation.mesh.vertices
    count = len(tessellation.mesh.vertices)
    edges = half_edges(tessellation.mesh).reshape(-1, 2).astype(np.int64)
    forward, backward = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    a, b = edges[~np.isin(forward, backward)].T
    walls = np.vstack([np.column_stack([a + count, b + count, b]), np.column_stack([a + count, b, a])])
    closed = np.vstack([faces, faces[:, ::-1] + count, walls])
    both = np.vstack([points + depth * normals, points - SUNK * normals])
    return TriangleMesh(both, closed.astype(np.int32))
