"""The tool paths of the channel between two blades of a wheel, from the blank down to the hub.

The levels are an open morph from the hub to the blank. The ball follows each level as far as the blades beside it let
it, which keep an allowance for their own cut. All channels are cut to one level before any is cut to the next, so that
what stands is, everywhere, no higher than the level before, which is what shank and holder keep off.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from bonecam.job import Job
from bonecam.levels.measure.level import Level, MachinedLevel, machined_levels
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.remeshing import split_edges
from bonecam.mesh.solids.booleans import solid_union
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.lead import check_lead
from bonecam.planning.collision.scene import Scene
from bonecam.planning.layers.height_mesh import HeightMesh
from bonecam.planning.level_cutters import cutter_of
from bonecam.planning.oriented_path import orient
from bonecam.planning.passes.contacts import candidate_contacts, contact_path
from bonecam.planning.strategies.channel_walls import wall_contacts, wall_cusp
from bonecam.setup.capsule import Capsule
from bonecam.surface.blades.channel import Channel
from bonecam.surface.blades.meridian import revolved
from bonecam.tool.path import ToolPath
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import Post

PLACES = 0.8
"""Places of what stands are no farther apart, mm."""
CHORD = 0.1
"""Chord tolerance of the bodies under levels, and of the blades on them, mm."""


@dataclass(frozen=True, eq=False)
class _Body:
    """A closed mesh, out of which what stands reaches by a `deviation` at most, mm."""

    mesh: TriangleMesh
    deviation: float

    @property
    def material(self) -> HeightMesh:
        """What links between passes are held against."""
        return HeightMesh(split_edges(self.mesh, PLACES), self.deviation)


@dataclass(frozen=True, eq=False)
class ChannelPlanner:
    """What the paths of all levels of a channel share; `capsule` encloses the blank."""

    channel: Channel
    job: Job
    limits: MachineLimits
    post: Post
    capsule: Capsule

    def paths(self, levels: Sequence[Level]) -> tuple[list[ToolPath], HeightMesh]:
        """The paths of one channel in machining order, one a level, and what stands after them in all channels;
        `levels` begin at the hub and end at the blank."""
        paths = []
        above = _Body(revolved(self.channel.blank, CHORD, self.channel.wheel.count), CHORD)
        for level in machined_levels(levels)[::-1]:
            left = self._left(level)
            paths.append(self._path(level, left, above))
            above = left
        return paths, above.material

    def _left(self, level: MachinedLevel) -> "_Body":
        """What is left where all channels are cut to a level: the blades with their allowance, and what lies under
        the level."""
        if not level.index:
            return _Body(self._finished, self._blade_chord + wall_cusp(self.job))
        profile, above = self.channel.under(level.surface)
        under = revolved(profile, CHORD, self.channel.wheel.count)
        return _Body(solid_union([under, self._finished]), above + CHORD + wall_cusp(self.job))

    @cached_property
    def _finished(self) -> TriangleMesh:
        """Hub and others, and the blades with their allowance."""
        wheel = self.channel.wheel
        chord = self._blade_chord
        blades = wheel.grown_blades(self.job.levels.finishing_depth - 2 * chord, chord)
        return solid_union([revolved(wheel.profile, CHORD, wheel.count), *blades, *wheel.others])

    @property
    def _blade_chord(self) -> float:
        """Chord tolerance of the blades with their allowance, mm."""
        return min(CHORD, self.job.levels.finishing_depth / 4)

    def _path(self, level: MachinedLevel, left: "_Body", before: "_Body") -> ToolPath:
        """The path of a level that leaves one body of another."""
        job = self.job
        cutter = cutter_of(level.index, self.job, self.limits.bodies)
        check_lead(cutter, job.path.lead_deg)
        distance = MeshDistance(left.mesh)
        scene = Scene(
            level=left.mesh,
            material=before.mesh,
            material_deviation=before.deviation,
            stock=self.capsule,
            post=self.post,
            known_level_distance=distance,
            clamping=clamping_of(job.holding, self.limits.bodies.table),
        )
        walls = wall_contacts(level.surface, distance, cutter.radius)
        candidates = candidate_contacts(level, [distance], cutter, self.post, job.path, walls=walls)
        contacts = contact_path(candidates)
        return orient(contacts, scene, self.limits, job.path, job.nc, material=before.material)
