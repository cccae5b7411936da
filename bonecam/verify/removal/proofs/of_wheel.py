"""The removal of the program of a wheel from its turned blank."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bonecam.errors import knowing
from bonecam.job import Job
from bonecam.levels.measure.level import Level, morph_surfaces
from bonecam.machine.machine import Machine
from bonecam.material.solid_rays import lay_solids
from bonecam.mechanics.workpiece import workpiece_of
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.solids.revolution import cylinder
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces, side_by_side
from bonecam.nc.dialect import Dialect
from bonecam.planning.strategies.channel_walls import wall_cusp
from bonecam.progress import Progress, silent
from bonecam.setup.turned_blank import TurnedBlank
from bonecam.surface.blades.impeller import pose_about_z
from bonecam.surface.blades.meridian import meridional, places_on, point_at, revolved
from bonecam.surface.blades.wheel import Wheel, repeated
from bonecam.surface.tspline import TSpline
from bonecam.verify.removal.normal_probes import NormalProbes, normal_probes_on
from bonecam.verify.removal.of_job import ACCURACY, cutters_of, level_scallops
from bonecam.verify.removal.result import Removal
from bonecam.verify.removal.simulate import simulate_further
from bonecam.verify.removal.sweeping import SimulatedStock
from bonecam.verify.removal.verdicts import check_removal
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import Post

ABOVE = 0.1
"""The hub is bare where no blade is this far above it, mm."""
ROUGH = 0.05
"""The floor of a channel lies so near to the hub that it stands for, mm: within the facets of the hub's mesh."""
DEEP = 0.3
"""Probes stand so far from the hub's edges, mm: beside one a ball that cuts no hub crosses their lines."""
CHORD = 0.01
"""Chord tolerance, mm, of the blades at whose vertices normal probes stand, and of what holds the wheel."""


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
    columns = clamping.carried(post)
    held = [cylinder(column.radius, column.bottom, column.top, CHORD) for column in columns]
    sets, grid = lay_solids([blank.mesh, *held], ACCURACY.cell, ACCURACY.memory_mb)
    probes = wheel_probes(wheel, morph_surfaces(levels)[0])
    removal = simulate_further(
        text,
        machine,
        dialect=dialect,
        material=SimulatedStock(sets, grid, probes),
        post=None,
        cutters=cutters_of(job, machine),
        clamping=clamping,
        limits={index: levels[index + 1].limit for index in range(len(levels) - 1)},
        scallops=_scallops(job, len(levels)),
        surfaces=surfaces,
        workpiece=workpiece_of(job, post, clamping) if mechanics else None,
        progress=progress,
    )
    with knowing(removal.sections):
        check_removal(removal, job.path.gouge_tolerance)
        if removal.mechanics is not None:
            removal.mechanics.check()
    return removal


def _scallops(job: Job, levels: int) -> dict[int, float]:
    """What each of so many levels may leave, mm: the paths of level 0, which follow level 1, meet on the blades what
    stands between all levels."""
    scallops = level_scallops(job, levels)
    return scallops | {1: max(scallops[1], wall_cusp(job))}


def wheel_surfaces(wheel: Wheel, solid: TriangleMesh, levels: Sequence[Level]) -> dict[int, TriangleMesh]:
    """The meshes that the levels leave in all channels, by number; level 0 leaves the `solid` of the wheel."""
    return {0: solid} | {level.index: repeated(level.mesh, wheel.count) for level in levels[1:]}


def wheel_probes(wheel: Wheel, floor: TSpline) -> NormalProbes:
    """Normal probes on both sides of every blade and on the hub between them; `floor` is the surface of that in one
    channel, which reaches beyond the hub's ends."""
    one = _side_by_side(normal_probes_on(wheel.blade, CHORD), _hub_probes(wheel, floor))
    moved = [one.move(pose_about_z(2 * np.pi * k / wheel.count)) for k in range(wheel.count)]
    points, normals = np.vstack([each.points for each in moved]), np.vstack([each.normals for each in moved])
    return NormalProbes(repeated(one.mesh, wheel.count), points, normals, np.tile(one.areas, wheel.count))


def _hub_probes(wheel: Wheel, floor: TSpline) -> NormalProbes:
    """Normal probes on the hub itself below a `floor`, where no blade stands on it; none where the floor, which goes
    straight on beyond the blades, is no longer on the hub."""
    on_floor = normal_probes_on(floor, CHORD)
    curve = meridional(on_floor.points)
    lengths = places_on(wheel.profile, curve)
    foot = point_at(wheel.profile, lengths)
    points = np.column_stack([on_floor.points[:, :2] * (foot[:, :1] / curve[:, :1]), foot[:, 1]])
    low, high = wheel.flow
    bare = (lengths > low) & (lengths < high) & (np.linalg.norm(curve - foot, axis=1) < ROUGH)
    hub = MeshDistance(revolved(wheel.profile, CHORD))
    bare[bare] = hub.signed((points - DEEP * on_floor.normals)[bare]) < -0.8 * DEEP
    beside = MeshDistance(repeated(wheel.coarse_blade, wheel.count))
    bare[bare] = ~beside.inside((points + ABOVE * on_floor.normals)[bare])
    faces = bare[on_floor.mesh.faces].all(axis=1)
    used = np.unique(on_floor.mesh.faces[faces])
    mesh = keep_faces(replace(on_floor.mesh, vertices=points), faces)
    return NormalProbes(mesh, points[used], on_floor.normals[used], on_floor.areas[used])


def _side_by_side(*probes: NormalProbes) -> NormalProbes:
    """Normal probes that nothing has cut, of several surfaces."""
    return NormalProbes(
        side_by_side([each.mesh for each in probes]),
        np.vstack([each.points for each in probes]),
        np.vstack([each.normals for each in probes]),
        np.hstack([each.areas for each in probes]),
    )
