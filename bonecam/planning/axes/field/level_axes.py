"""The smooth axes of a level, from those of the level round it."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial

from bonecam.job import PathJob
from bonecam.levels.measure.level import MachinedLevel
from bonecam.machine.limits import MachineLimits
from bonecam.planning.axes.cones.admissible_cones import admissible_cones
from bonecam.planning.axes.facets.contact_facets import contact_facets
from bonecam.planning.axes.field.axis_field import FieldDomain
from bonecam.planning.axes.field.smooth_axes import SmoothAxes, machine_minutes, smooth_axes, soonest
from bonecam.planning.collision.scene import Scene
from bonecam.tool.path import ContactPath

SLOW = 1.15
"""Axes with which the cuts take more than this many times what they take at the feed are sought anew: those of outer
levels, of which little is cut, lead inner ones astray (scaphoid: 8.1 min on level 0, anew 5.6)."""


def level_axes(
    contacts: ContactPath,
    level: MachinedLevel,
    scene: Scene,
    limits: MachineLimits,
    job: PathJob,
    before: SmoothAxes | None,
) -> SmoothAxes | None:
    """Smooth axes of a level in elliptic cones of free ones, from the field of the level `before`; where the machine is
    too SLOW for these, the soonest of these, of those in circular cones, and of those made anew. None where the job
    wants none, and for a bull nose, whose cusps are known only where it leans along the feed. Where no contact has a
    cone there is nothing to smooth."""
    if job.orientation != "cones" or contacts.cutter.is_bull or not len(contacts.contacts):
        return before
    with ThreadPoolExecutor(1) as thread:
        meanwhile = thread.submit(contact_facets, contacts, level.surface)
        cones = admissible_cones(contacts, scene, limits, job)
    if not cones.found.any():
        return before
    domain = FieldDomain.of(level.surface)
    start = before.field if before else None
    facets = meanwhile.result()
    make = partial(smooth_axes, domain=domain, limits=limits, job=job, preset="membrane", facets=facets)
    smooth = make(cones, start=start)
    at_feed = machine_minutes(contacts, smooth.axes, MachineLimits(limits.largest))
    if machine_minutes(contacts, smooth.axes, limits) > SLOW * at_feed:
        others = [(cones.as_circles(), start), *([(cones, None)] if start else [])]
        smooth = soonest([smooth, *(make(shapes, start=from_) for shapes, from_ in others)], limits)
    return smooth if job.certify == "distances" else smooth.verified(scene)
