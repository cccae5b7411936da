"""The tool paths of a strategy that works in layers, with the tool axes that it fixes: iso-height milling from two
sides, sectional rotary milling. They are linked and checked for collisions as the levels of a morph are."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bonecam.errors import OrientationError
from bonecam.job import Job
from bonecam.levels.measure.level import Level
from bonecam.machine.limits import MachineLimits
from bonecam.material.cut_dexels import uncut_rays
from bonecam.planning.collision.held_level import distance_to_part
from bonecam.planning.collision.scene import Scene
from bonecam.planning.holding.parting_paths import parting_paths
from bonecam.planning.layers.height_field import DEVIATION
from bonecam.planning.layers.height_mesh import HeightMesh
from bonecam.planning.oriented_path import orient
from bonecam.planning.passes.gouge_lifts import flute_slack
from bonecam.planning.strategies.iso_height import iso_height_layers
from bonecam.planning.strategies.rotary import rotary_layers
from bonecam.progress import Progress, report, silent
from bonecam.setup.capsule import enclosing_capsule
from bonecam.setup.stock import Stock
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ToolPath
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import post_below

STRATEGIES = {"iso-height": iso_height_layers, "rotary": rotary_layers}
"""What plans the layers of each strategy (`path.strategy`)."""
LEVEL = np.array([[1.0, 0.0, 0.0]])
"""A tool axis that is level, as those of both strategies are."""


def plan_layer_paths(
    levels: Sequence[Level], stock: Stock, job: Job, limits: MachineLimits, progress: Progress = silent
) -> tuple[ToolPath, ...]:
    """The paths of the layers of `job.path.strategy` in machining order, the last one numbered 0; `levels` begin at
    the part, `limits` are the machine's.

    OrientationError where the machine cannot lay its tool axis level, or no contact of a layer is reached.
    """
    if not limits.allow(LEVEL).all():
        raise OrientationError(
            f"path.strategy = {job.path.strategy!r} needs a tool axis at 90 deg to the table, which this machine "
            f"does not reach ({np.degrees(limits.largest):g} deg): take strategy = 'morph' or another machine"
        )
    report(progress, 0.0, "planning layers")
    distance = distance_to_part(levels, job.path.gouge_tolerance)
    post = post_below(distance.mesh, job.holding)
    roughing = Cutter.from_job(1, "roughing", job.tool("roughing"), limits.bodies.nose)
    finishing = Cutter.from_job(2, "finishing", job.tool("finishing"), limits.bodies.nose)
    layers_of = STRATEGIES[job.path.strategy]
    layers, unreached = layers_of(distance, stock, post, roughing=roughing, finishing=finishing, job=job)
    paths = list[ToolPath]()
    rays = uncut_rays(stock)
    for count, layer in enumerate(layers):
        report(progress, 0.3 + 0.7 * count / len(layers), f"path of layer {len(layers) - 1 - count}")
        standing = HeightMesh(layer.material.mesh(), rays=rays)
        scene = Scene(
            level=distance.mesh,
            material=standing.mesh,
            stock=enclosing_capsule(stock),
            post=post,
            material_deviation=DEVIATION,
            known_level_distance=distance,
            part_distance=None,
            clamping=clamping_of(job.holding, limits.bodies.table),
            tangent_slack=flute_slack(job.path.gouge_tolerance),
        )
        path = replace(layer.path, level=len(layers) - 1 - count)
        if not path.level:
            near = post.distance(unreached) < 2 * path.cutter.radius
            reasons = *path.reasons, *np.where(near, "post", "hidden").tolist()
            path = replace(path, uncut=np.vstack([path.uncut, unreached]), reasons=reasons)
        paths.append(orient(path, scene, limits, job.path, job.nc, fixed=layer.axes, material=standing))
        rays = rays.after(paths[-1])
    return *paths, *parting_paths(scene, job, limits)
