"""The tool path of one surface, closed or open, beside solids that must not be gouged: one level, one cutter."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from bonecam.job import Job, PathJob, field_error
from bonecam.levels.measure import NO_CUT, PartLevel
from bonecam.machine.bodies import MachineBodies
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones import admissible_cones
from bonecam.planning.axes.field import HASTES, AxisField, FieldDomain, contact_facets, smooth_axes, soonest
from bonecam.planning.axes.lead import check_lead
from bonecam.planning.axes.tool_axes import WantedAxes, added_axes
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.contacts import candidate_contacts, contact_path, flute_slack
from bonecam.planning.layers import HeightMesh
from bonecam.planning.oriented_path import orient
from bonecam.planning.patterns import CLOSED_PATTERNS
from bonecam.planning.post_length import GOUGE, SampledContacts, least_lifts, shortest_post
from bonecam.planning.scene import Scene
from bonecam.setup.capsule import smallest_capsule
from bonecam.setup.placement import TALL
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath, ToolPath
from bonecam.workholding.clamping import Clamping, clamping_of
from bonecam.workholding.post import Post

SAMPLED = 40
"""Places along s and along t from which the length of the post is found."""
ALLOWANCE = 0.5
"""The capsule that links keep out of is so much larger than the solids, mm."""


@dataclass(frozen=True, eq=False)
class Workpiece:
    """A surface to machine and the `solid` of everything that must not be gouged, on a post of this `length`, mm; the
    table is z = 0."""

    surface: TSpline
    solid: TriangleMesh
    length: float

    def stand(self, length: float) -> "Workpiece":
        """The workpiece on a post of another length."""
        shift = np.array([0.0, 0.0, length - self.solid.bounds[0, 2]])
        pose = np.eye(4)
        pose[:3, 3] = shift
        points = self.surface.control_points + shift
        return Workpiece(self.surface.with_control_points(points), self.solid.move(pose), length)

    def scene(self, job: Job, clamping: Clamping) -> Scene:
        """The obstacles: all of the solid, with the last cut's depth of material on it, and the post."""
        capsule = smallest_capsule(self.solid.vertices, ALLOWANCE)
        post = Post(job.holding.diameter / 2, self.length)
        depth = job.levels.finishing_depth
        return Scene(
            level=self.solid,
            material=self.solid,
            stock=capsule,
            post=post,
            material_deviation=depth,
            known_level_distance=MeshDistance(self.solid),
            clamping=clamping,
            tangent_slack=flute_slack(job.path.gouge_tolerance),
        )


def stand_workpiece(surface: TSpline, solid: TriangleMesh, job: Job, limits: MachineLimits) -> Workpiece:
    """The workpiece on its post; one of length 0 in the job is the shortest with which all that the tool can reach is
    reached. OrientationError where that is too long, JobError where the job wants to be parted from it."""
    if job.holding.parting:
        raise field_error("holding", "parting", True, "a surface that is finished alone is not parted: leave it out")
    given = Workpiece(surface, solid, 0.0)
    if job.holding.length:
        return given.stand(job.holding.length)
    tall = given.stand(TALL)
    cutter = finishing_cutter(job, limits.bodies)
    s, t = (np.linspace(low, high, SAMPLED) for low, high in tall.surface.domain)
    parameters = np.stack(np.meshgrid(s, t, indexing="ij"), axis=2).reshape(-1, 2)
    normals = tall.surface.normals(parameters[:, 0], parameters[:, 1])
    centres = tall.surface.positions(parameters[:, 0], parameters[:, 1]) + cutter.radius * normals
    scene = tall.scene(job, Clamping((), closed=False, clearance=job.holding.clearance))
    fits = scene.level_distance.signed(centres, cutter.radius) >= cutter.radius - GOUGE
    contacts = SampledContacts(CollisionChecker(scene, cutter), centres[fits], normals[fits])
    clamping = clamping_of(job.holding, limits.bodies.table)
    return given.stand(shortest_post(least_lifts(contacts, clamping, job, limits), TALL, clamping))


def finishing_cutter(job: Job, bodies: MachineBodies) -> Cutter:
    """The finishing cutter of the job; JobError where it cannot lean by the lead angle."""
    cutter = Cutter.from_job(2, "finishing", job.tool("finishing"), bodies.nose)
    check_lead(cutter, job.path.lead_deg)
    return cutter


def surface_contacts(workpiece: Workpiece, scene: Scene, job: Job, cutter: Cutter) -> ContactPath:
    """The contacts of the surface that the ball fits on, ToolPathError where there are none; JobError where the
    pattern is one for closed surfaces with poles, and this is none."""
    pattern = job.path.pattern
    if pattern in CLOSED_PATTERNS and not all(workpiece.surface.poles):
        bound = "this surface has edges: give along, round or fastest"
        raise field_error("path", "pattern", pattern, bound)
    level = PartLevel(workpiece.surface, workpiece.solid, NO_CUT)
    return contact_path(candidate_contacts(level, [scene.level_distance], cutter, scene.post, job.path))


def plan_surface(
    workpiece: Workpiece, scene: Scene, job: Job, limits: MachineLimits, material: HeightMesh | None = None
) -> ToolPath:
    """The path of the finishing cutter over the surface in its scene; `limits` are the machine's, `material` is what
    stands before, if that is known.

    JobError, ToolPathError or OrientationError where there is none.
    """
    cutter = finishing_cutter(job, limits.bodies)
    contacts = surface_contacts(workpiece, scene, job, cutter)
    fixed = added_axes(contacts, workpiece.surface, scene, limits, job.path)
    return orient(
        contacts,
        scene,
        limits=limits,
        job=job.path,
        nc=job.nc,
        wanted=wanted_axes(workpiece, contacts, scene, limits, job.path),
        material=material,
        fixed=fixed,
        explained=fixed is None,
    )


def wanted_axes(
    workpiece: Workpiece, contacts: ContactPath, scene: Scene, limits: MachineLimits, job: PathJob
) -> WantedAxes | None:
    """The smooth axes of the contacts; None where the job wants them to lean by the lead angle.

    Round a closed surface they either turn with the normals or swing about one direction and back, and the better ones
    may be smoother than the feed asks: those are taken that cost the fewest minutes for each contact certified free,
    and of these the smoothest.
    """
    if job.orientation != "cones":
        return None
    cones = admissible_cones(contacts, scene, limits, job)
    domain = FieldDomain.of(workpiece.surface)
    starts: list[AxisField | None] = [None]
    if domain.closed:
        # a constant field of winding 0: the direction that is free at most contacts
        contacts_of_node = np.bincount(cones.free.net.node_of, minlength=len(cones.shapes))
        direction = cones.free.directions[(contacts_of_node @ cones.free.free).argmax()]
        starts.append(AxisField.constant(domain, direction))
    facets = contact_facets(contacts, workpiece.surface)
    make = partial(smooth_axes, cones, domain, limits, job, facets=facets)
    best = soonest([make(start=start) for start in starts], limits)
    candidates = [best]
    for haste in HASTES:
        # the weights of cells would leave more contacts outside their cones
        candidates.append(make(start=candidates[-1].field, haste=haste, facets=None))
    best = soonest(candidates, limits)
    return (best if job.certify == "distances" else best.verified(scene)).wanted
