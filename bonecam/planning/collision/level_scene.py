"""What stands round the tool on a level of a morph, taken as the levels have it: no more than the level before."""

from collections.abc import Sequence

from bonecam.job import Job
from bonecam.levels.measure.level import Level, morph_surfaces
from bonecam.machine.bodies import MachineBodies
from bonecam.material.in_process_mesh import DEVIATION
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.collision.scene import TANGENT_SLACK, Scene
from bonecam.planning.passes.gouge_lifts import flute_slack
from bonecam.setup.capsule import enclosing_capsule
from bonecam.setup.stock import Stock
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import post_below

CHORD = 0.002
"""Chord tolerance of the level that the ball touches, mm."""


def level_scene(levels: Sequence[Level], index: int, stock: Stock, job: Job, bodies: MachineBodies) -> Scene:
    """The scene in which level `index` is cut; material stands as high as the level before, scallops and what it left
    uncut are not in it. ValueError where no path follows that level."""
    surfaces = morph_surfaces(levels)
    if not 0 <= index < len(surfaces):
        raise ValueError(f"level {index}: give 0 to {len(surfaces) - 1}")
    part = MeshDistance(surfaces[0].tessellate(CHORD))
    level = part if not index else MeshDistance(surfaces[index].tessellate(CHORD))
    return Scene(
        level=level.mesh,
        material=levels[index + 1].mesh,
        stock=enclosing_capsule(stock),
        post=post_below(part.mesh, job.holding),
        material_deviation=DEVIATION,
        known_level_distance=level,
        part_distance=part if index else None,
        clamping=clamping_of(job.holding, bodies.table),
        tangent_slack=TANGENT_SLACK if index else flute_slack(job.path.gouge_tolerance),
    )
