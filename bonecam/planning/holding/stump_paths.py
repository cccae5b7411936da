"""The tool paths of the second clamping: the stump of the post is cut off the part that stands turned over in a shell.

The tool keeps one direction, LEAN off the Z axis, so that the ball cuts beside its tip: of several round the axis the
one from which most of what stayed at the post is seen.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import OrientationError
from bonecam.job import Job, field_error
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.part import Part
from bonecam.mesh.triangle_mesh import side_by_side
from bonecam.planning.collision.scene import Scene
from bonecam.planning.layers.chart import FlatChart
from bonecam.planning.layers.drop import Ball
from bonecam.planning.layers.finishing_layers import unreached
from bonecam.planning.layers.height_field import DEVIATION, HeightField
from bonecam.planning.layers.height_mesh import HeightMesh
from bonecam.planning.layers.stump import off_part, stump_chart, stump_layers
from bonecam.planning.oriented_path import orient
from bonecam.planning.passes.contacts import at_post
from bonecam.planning.passes.gouge_lifts import flute_slack
from bonecam.progress import Progress, report, silent
from bonecam.setup.capsule import smallest_capsule
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ToolPath
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import Post
from bonecam.workholding.shell import SecondClamping, read_shell

LEAN = np.radians(15.0)
"""Angle of the tool from the Z axis, radians: on a level place the ball cuts a quarter of its radius off its tip."""
AROUND = 12
"""So many directions round the axis are tried."""
ALLOWANCE = 0.5
"""The capsule that links keep out of is so much larger than part and shell, mm."""

STEP = 0.2
"""Places along a stump at the free end are so far apart, mm."""

Fields = Callable[[FlatChart, float, float], HeightField]
"""The material on the lines of a chart between two heights, the upper one first, mm."""


@dataclass(frozen=True, eq=False)
class StumpPlaces:
    """Places of the part that stayed at the post, and their unit normals."""

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]


def check_second(part: Part, post: Post, job: Job) -> None:
    """Errors of `read_shell`, and JobError where the shell leaves no room for a ball on the places that stay at the
    post."""
    shell = read_shell(job, part)
    if shell is None:
        return
    radius = job.tool("finishing").radius

    # The vertices of the part that a ball of `radius` (mm) leaves at the post, not at what holds the free end
    normals = vertex_normals(part.mesh)
    held = at_post(part.mesh.vertices, normals, post.alone, radius)
    places = StumpPlaces(part.mesh.vertices[held], normals[held])

    centres = places.points + radius * places.normals
    around = MeshDistance(shell)
    least = float((around.signed(centres) - radius).min())
    if least < job.path.clearance:
        what = f"it comes within {least:.2f} mm of the ball that cuts the stump off"
        remedy = f"end it farther up the part, {job.path.clearance:g} mm (path.clearance) off that ball"
        raise field_error("holding", "second", job.holding.second, f"{what}: {remedy}")
    if post.pin is not None:
        # JobError where what stays uncut at the free end enters the shell: the fillet that a ball of `radius` (mm)
        # leaves round pin or upper neck, and the stump of this, which is sawn off a diameter above the part
        wide = post.pin.radius + radius
        heights = np.arange(post.pin.bottom, min(post.pin.bottom + 2 * post.pin.radius + radius, post.pin.top), STEP)
        along = np.column_stack([np.full(len(heights), post.pin.x), np.full(len(heights), post.pin.y), heights])
        least = float(around.signed(along).min()) - wide
        if least < 0:
            what = f"what stays at the tailstock, up to {heights[-1]:.2f} mm, enters it by {-least:.2f} mm"
            raise field_error("holding", "second", job.holding.second, f"{what}: leave a hole there of {2 * wide:g} mm")


def second_paths(
    clamping: SecondClamping,
    places: StumpPlaces,
    top: float,
    fields: Fields,
    job: Job,
    limits: MachineLimits,
    progress: Progress = silent,
) -> list[ToolPath]:
    """The paths in machining order, the last one numbered 0. `top` (mm) is the highest that material stands on the Z
    axis, `places` and `fields` tell what is to be cut, after the turn-over; the job's [holding] is that of the shell.

    OrientationError where the machine cannot lean its tool so, or no contact is reached.
    """
    report(progress, 0.0, "planning the second clamping")
    around = MeshDistance(clamping.solids)
    post = Post(job.holding.diameter / 2, float(clamping.part.bounds[0, 2]))
    roughing = Cutter.from_job(1, "roughing", job.tool("roughing"), limits.bodies.nose)
    finishing = Cutter.from_job(2, "finishing", job.tool("finishing"), limits.bodies.nose)
    fine = Ball(finishing.radius, 0.0, around, post)
    axis, missed = _best_axis(places, fine, roughing.radius, top, limits)
    chart = stump_chart(axis, places.points, roughing.radius)
    heights = _heights(axis, places, top, job.holding.diameter)
    stump = off_part(fields(chart, *heights), around, job.levels.finishing_depth)
    layers = stump_layers(stump, around, post=post, places=places.points, cutters=(roughing, finishing), job=job)
    stands = clamping_of(job.holding, limits.bodies.table)
    paths = []
    capsule = smallest_capsule(np.vstack([clamping.solids.vertices, stump.mesh().vertices]), ALLOWANCE)
    for count, layer in enumerate(layers):
        level = len(layers) - 1 - count
        report(progress, (count + 1) / (len(layers) + 1), f"second clamping: path of layer {level}")
        path = replace(layer.path, level=level)
        if not level:
            reasons = *path.reasons, *("hidden",) * int(missed.sum())
            path = replace(path, uncut=np.vstack([path.uncut, places.points[missed]]), reasons=reasons)
        standing = HeightMesh(layer.material.mesh())
        material = side_by_side([clamping.solids, standing.mesh])
        scene = Scene(
            level=around.mesh,
            material=material,
            stock=capsule,
            post=post,
            material_deviation=DEVIATION,
            known_level_distance=around,
            clamping=stands,
            tangent_slack=flute_slack(job.path.gouge_tolerance),
        )
        paths.append(orient(path, scene, limits, job.path, job.nc, fixed=layer.axes, material=standing))
    return paths


def _best_axis(
    places: StumpPlaces, ball: Ball, radius: float, top: float, limits: MachineLimits
) -> tuple[Float[ndarray, "3"], ndarray]:
    """The direction of the tool from which fewest of the places are hidden, and which are."""
    turns = 2 * np.pi * np.arange(AROUND) / AROUND
    tried = np.column_stack([np.sin(LEAN) * np.cos(turns), np.sin(LEAN) * np.sin(turns), np.full(AROUND, np.cos(LEAN))])
    tried = tried[limits.allow(tried)]
    if not len(tried):
        raise OrientationError(
            f"the second clamping needs a tool axis {np.degrees(LEAN):g} deg off the Z axis, which this machine does "
            "not reach: take another machine, or leave out holding.second"
        )
    hidden_from = []
    for axis in tried:
        chart = stump_chart(axis, places.points, radius)
        high, low = _heights(axis, places, top, 2 * radius)
        extent = float(chart.b[0]), float(chart.b[-1])
        hidden_from.append(
            unreached(places.points, places.normals, chart=chart, ball=ball, heights=(high, low), extent=extent)
        )
    best = int(np.argmin([hidden.sum() for hidden in hidden_from]))
    return tried[best], hidden_from[best]


def _heights(axis: Float[ndarray, "3"], places: StumpPlaces, top: float, width: float) -> tuple[float, float]:
    """Heights (mm) along a direction above all of a stump that is `width` wide, and below all of its places."""
    along = places.points @ axis
    return float(max(top * axis[2] + width, along.max() + 1.0)), float(along.min() - 1.0)
