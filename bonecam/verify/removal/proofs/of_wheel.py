"""The removal of the program of a wheel from its turned blank."""

from collections.abc import Sequence

import numpy as np

from bonecam.job import Job
from bonecam.levels.measure.level import Level, morph_surfaces
from bonecam.machine.machine import Machine
from bonecam.material.solid_rays import lay_solids
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.solids.revolution import cylinder
from bonecam.mesh.triangle_mesh import keep_faces, side_by_side
from bonecam.nc.dialect import Dialect
from bonecam.progress import Progress, silent
from bonecam.setup.turned_blank import TurnedBlank
from bonecam.surface.blades.impeller import pose_about_z
from bonecam.surface.blades.meridian import meridional, places_on
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
) -> Removal:
    """What the posted `text` removes from the blank, and what it leaves on all blades; `levels` are those of a channel.
    Errors as in `simulate_removal` and `check_removal`."""
    post = Post(job.holding.diameter / 2, float(blank.profile[:, 1].min()))
    clamping = clamping_of(job.holding, machine.table)
    columns = clamping.carried(post)
    held = [cylinder(column.radius, column.bottom, column.top, CHORD) for column in columns]
    sets, grid = lay_solids([blank.mesh, *held], ACCURACY.cell, ACCURACY.memory_mb)
    probes = wheel_probes(wheel, morph_surfaces(levels)[0])
    removal = simulate_further(
        text,
        machine,
        dialect,
        SimulatedStock(sets, grid, probes),
        None,
        cutters_of(job, machine),
        clamping=clamping,
        limits={index: levels[index + 1].limit for index in range(len(levels) - 1)},
        scallops=level_scallops(job, len(levels)),
        progress=progress,
    )
    check_removal(removal, job.path.gouge_tolerance)
    return removal


def wheel_probes(wheel: Wheel, floor: TSpline) -> NormalProbes:
    """Normal probes on both sides of every blade and on the hub between them; `floor` is the surface of that in one
    channel, which reaches beyond the hub's ends."""
    blade, hub = normal_probes_on(wheel.blade, CHORD), normal_probes_on(floor, CHORD)
    low, high = wheel.flow
    places = places_on(wheel.profile, meridional(hub.points))
    bare = (places > low) & (places < high)
    beside = MeshDistance(repeated(wheel.coarse_blade, wheel.count))
    above = hub.points + ABOVE * hub.normals
    bare[bare] = ~beside.inside(above[bare])
    faces = bare[hub.mesh.faces].all(axis=1)
    used = np.unique(hub.mesh.faces[faces])
    mesh = side_by_side([blade.mesh, keep_faces(hub.mesh, faces)])
    points = np.vstack([blade.points, hub.points[used]])
    normals = np.vstack([blade.normals, hub.normals[used]])
    one = NormalProbes(mesh, points, normals, np.r_[blade.areas, hub.areas[used]])
    moved = [one.move(pose_about_z(2 * np.pi * k / wheel.count)) for k in range(wheel.count)]
    points, normals = np.vstack([each.points for each in moved]), np.vstack([each.normals for each in moved])
    return NormalProbes(repeated(mesh, wheel.count), points, normals, np.tile(one.areas, wheel.count))
