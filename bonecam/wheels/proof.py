"""What the posted text of a wheel removes, from its turned blank, and what it leaves on hub and blades."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import knowing
from bonecam.job import Job
from bonecam.levels import Level
from bonecam.levels.measure import morph_surfaces
from bonecam.machine import Machine
from bonecam.mechanics.loads import workpiece_of
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.mesh.triangle_mesh import keep_faces, side_by_side
from bonecam.nc import Dialect
from bonecam.progress import Progress, silent
from bonecam.surface import TSpline
from bonecam.verify import Removal, check_removal, simulate_removal
from bonecam.verify.proof import CHORD, solids_stock
from bonecam.verify.removal import cutters_of, level_scallops
from bonecam.verify.sweeping import NormalProbes, normal_probes_on
from bonecam.wheels.channels import wall_cusp
from bonecam.wheels.wheel import TurnedBlank, Wheel, meridional, places_on, point_at, pose_about_z, repeated, revolved
from bonecam.workholding import Post, clamping_of

ABOVE = 0.1
"""The hub is bare where no blade is this far above it, mm."""
ROUGH = 0.05
"""The floor of a channel lies so near to the hub that it stands for, mm: within the facets of the hub's mesh."""
DEEP = 0.3
"""Probes stand so far from the hub's edges, mm: beside one a ball that cuts no hub crosses their lines."""


def prove_removal_of_wheel(
    text: str,
    machine: Machine,
    dialect: Dialect,
    job: Job,
    blank: TurnedBlank,
    wheel: Wheel,
    levels: Sequence[Level],
    progress: Progress = silent,
    surfaces: Mapping[int, TriangleMesh] | None = None,
    *,
    mechanics: bool = True,
) -> Removal:
    """What the posted `text` removes from the blank, and what it leaves on all blades; `levels` are those of a channel,
    `surfaces` the meshes, by level, on which is told what stands.
    The wheel bends as what stands of it does, its blades do not; without `mechanics` force and bending are left out.
    Errors as in `simulate_removal`, `check_removal` and `Mechanics.check`."""
    post = Post(job.holding.diameter / 2, float(blank.profile[:, 1].min()))
    clamping = clamping_of(job.holding, machine.table)
    probes = wheel_probes(wheel, morph_surfaces(levels)[0])
    # the paths of level 0, which follow level 1, meet on the blades what stands between all levels
    scallops = level_scallops(job, len(levels))
    scallops[1] = max(scallops[1], wall_cusp(job))
    removal = simulate_removal(
        text,
        machine,
        dialect,
        solids_stock([blank.mesh], clamping.carried(post), probes),
        None,
        cutters_of(job, machine),
        clamping=clamping,
        limits=dict(enumerate(level.limit for level in levels[1:])),
        scallops=scallops,
        surfaces=surfaces,
        workpiece=workpiece_of(job, post, clamping) if mechanics else None,
        progress=progress,
    )
    with knowing(removal.sections):
        check_removal(removal, job.path.gouge_tolerance)
        if removal.mechanics is not None:
            removal.mechanics.check()
    return removal


def wheel_surfaces(wheel: Wheel, solid: TriangleMesh, levels: Sequence[Level]) -> dict[int, TriangleMesh]:
    """The meshes that the levels leave in all channels, by number; level 0 leaves the `solid` of the wheel."""
    return {0: solid} | {level.index: repeated(level.mesh, wheel.count) for level in levels[1:]}


def wheel_probes(wheel: Wheel, floor: TSpline) -> NormalProbes:
    """Normal probes on both sides of every blade and on the hub between them; `floor` is the surface of that in one
    channel, which reaches beyond the hub's ends."""
    # On the hub itself below the floor, where no blade stands on it; none where the floor, which goes straight on
    # beyond the blades, is no longer on the hub
    on_floor = normal_probes_on(floor, CHORD)
    curve = meridional(on_floor.points)
    lengths = places_on(wheel.profile, curve)
    foot = point_at(wheel.profile, lengths)
    places = np.column_stack([on_floor.points[:, :2] * (foot[:, :1] / curve[:, :1]), foot[:, 1]])
    low, high = wheel.flow
    bare = (lengths > low) & (lengths < high) & (np.linalg.norm(curve - foot, axis=1) < ROUGH)
    hub = MeshDistance(revolved(wheel.profile, CHORD))
    bare[bare] = hub.signed((places - DEEP * on_floor.normals)[bare]) < -0.8 * DEEP
    beside = MeshDistance(repeated(wheel.coarse_blade, wheel.count))
    bare[bare] = ~beside.inside((places + ABOVE * on_floor.normals)[bare])
    faces = bare[on_floor.mesh.faces].all(axis=1)
    used = np.unique(on_floor.mesh.faces[faces])
    mesh = keep_faces(replace(on_floor.mesh, vertices=places), faces)
    on_hub = NormalProbes(mesh, places[used], on_floor.normals[used], on_floor.areas[used])

    both = normal_probes_on(wheel.blade, CHORD), on_hub
    one = NormalProbes(
        side_by_side([each.mesh for each in both]),
        np.vstack([each.points for each in both]),
        np.vstack([each.normals for each in both]),
        np.hstack([each.areas for each in both]),
    )
    moved = [one.move(pose_about_z(2 * np.pi * k / wheel.count)) for k in range(wheel.count)]
    points, normals = np.vstack([each.points for each in moved]), np.vstack([each.normals for each in moved])
    return NormalProbes(repeated(one.mesh, wheel.count), points, normals, np.tile(one.areas, wheel.count))


@dataclass(frozen=True, eq=False)
class RepeatedDistance:
    """Distances to the union of `count` copies of a body, which is measured once and turned back to."""

    body: MeshDistance
    count: int

    def signed(self, points: Float[ndarray, "n 3"], wanted: float | Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """A lower bound of the signed distance (negative inside) of each point, mm; exact outside where it is below
        `wanted`."""
        least = np.array(np.broadcast_to(np.asarray(wanted, dtype=np.float64), len(points)))
        x, y, z = points.T
        for angle in 2 * np.pi * np.arange(self.count) / self.count:
            back = np.column_stack([x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle), z])
            least = np.minimum(least, self.body.signed(back, least))
        return np.asarray(least)
