"""A wheel of equal blades round a hub of revolution, from one of its blades."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.errors import SurfaceError, place_name
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.solids.booleans import solid_union
from bonecam.mesh.triangle_mesh import TriangleMesh, side_by_side
from bonecam.surface.blades.blade_solid import blade_solid
from bonecam.surface.blades.impeller import limits_beside, turned
from bonecam.surface.blades.meridian import meridional, places_on, point_at, revolved
from bonecam.surface.tspline import TSpline

MOST_BLADES = 100
"""A wheel has no more."""
REPEATS = 0.1
"""Other solids may lie so far off after a turn by one pitch, mm: the chord tolerance of a coarse mesh."""
COARSE = 0.05
"""Chord tolerance of the blades beside the first one, mm; they are grown by as much."""


@dataclass(frozen=True, eq=False)
class Wheel:
    """The `blade` (closed round s, from hub to tip along t), `count` of them a pitch apart, and the `profile` of the
    solid hub, rows (radius, height) in mm from its lower pole to its upper one. `others` are further closed solids that
    repeat as the blades do, such as splitters. `edge` is the width of a blunt edge of the blades that was rounded,
    mm."""

    blade: TSpline
    count: int
    profile: Float[ndarray, "n 2"]
    others: tuple[TriangleMesh, ...] = field(default=())
    edge: float = 0.0

    @property
    def pitch(self) -> float:
        """The angle from one blade to the next, radians."""
        return 2 * np.pi / self.count

    @cached_property
    def coarse_blade(self) -> TriangleMesh:
        """The solid of the blade within COARSE."""
        return blade_solid(self.blade, COARSE)

    @cached_property
    def flow(self) -> tuple[float, float]:
        """The lengths along the profile between which the blades stand, with a margin."""
        return limits_beside(self.profile, meridional(self.coarse_blade.vertices))

    def off_hub(self, t: float) -> Float[ndarray, " n"]:
        """How far points of the blade's section at t are from the hub's profile, mm."""
        left, right = self.blade.domain[0]
        s = np.linspace(left, right, 40, endpoint=False)
        points = meridional(self.blade.positions(s, np.full(len(s), t)))
        on_hub = point_at(self.profile, places_on(self.profile, points))
        return np.linalg.norm(points - on_hub, axis=1)

    def lift(self, height: float) -> "Wheel":
        """The wheel moved up, mm."""
        points = self.blade.control_points + np.array([0.0, 0.0, height])
        pose = np.eye(4)
        pose[2, 3] = height
        others = tuple(solid.move(pose) for solid in self.others)
        blade = self.blade.with_control_points(points)
        profile = self.profile + np.array([0.0, height])
        return replace(self, blade=blade, profile=profile, others=others)

    def grown_blades(self, allowance: float, chord_tolerance: float = COARSE) -> list[TriangleMesh]:
        """Blades that hold the true ones and `allowance` mm on them everywhere, in the order of their azimuth; meshed
        within the chord tolerance, mm."""
        solid = blade_solid(self.blade, chord_tolerance)
        grown = solid.vertices + (allowance + chord_tolerance) * unit(vertex_normals(solid))
        mesh = TriangleMesh(grown, solid.faces)
        return [turned(mesh, k * self.pitch) for k in range(self.count)]

    def solid(self, chord_tolerance: float) -> TriangleMesh:
        """Hub, blades and others as one closed mesh, hub and first blade within the chord tolerance (mm); the other
        blades are coarser and grown by their own."""
        hub = revolved(self.profile, chord_tolerance, self.count)
        first = blade_solid(self.blade, chord_tolerance)
        return solid_union([hub, first, *self.grown_blades(0.0)[1:], *self.others])

    def with_one_blade(self, chord_tolerance: float) -> TriangleMesh:
        """Hub, first blade and others as one closed mesh within the chord tolerance, mm."""
        hub = revolved(self.profile, chord_tolerance, self.count)
        return solid_union([hub, blade_solid(self.blade, chord_tolerance), *self.others])

    def gap(self) -> tuple[float, Float[ndarray, "3"]]:
        """The least distance between two neighbours outside the hub, mm, and its place. SurfaceError where they
        overlap."""
        solid = self.coarse_blade
        hub = MeshDistance(revolved(self.profile, COARSE))
        points = turned(solid, self.pitch).vertices
        points = points[~hub.inside(points)]
        if not len(points):
            raise SurfaceError("the blade lies inside the hub: give both in one frame and one unit")
        away = MeshDistance(solid).signed(points)
        worst = int(np.argmin(away))
        if away[worst] <= 0:
            raise SurfaceError(
                f"{self.count} blades overlap their neighbours, at {place_name(points[worst])}: give fewer blades, or "
                "the blade about the wheel's axis Z",
                place=points[worst],
                error=-float(away[worst]),
            )
        return float(away[worst]), points[worst]


def repeated(mesh: TriangleMesh, count: int) -> TriangleMesh:
    """The mesh and its copies at every pitch, side by side."""
    return side_by_side([turned(mesh, 2 * np.pi * k / count) for k in range(count)])


def wheel_of(
    blade: TSpline, profile: Float[ndarray, "n 2"], count: int, others: Sequence[TriangleMesh] = (), edge: float = 0.0
) -> Wheel:
    """The wheel of `count` blades, whose blunt edge of this width was rounded. SurfaceError where the blade is not
    closed round, the `others` do not repeat from pitch to pitch, or neighbours overlap."""
    if not 2 <= count <= MOST_BLADES:
        raise SurfaceError(f"{count} blades: give from 2 to {MOST_BLADES}")
    if not blade.closed_in_s or all(blade.poles):
        raise SurfaceError(
            "the blade is not closed round from hub to tip: give sections that run round both of its sides"
        )
    wheel = Wheel(blade, count, profile, tuple(others), edge)
    foot, tip = (np.median(wheel.off_hub(end)) for end in blade.domain[1])
    if not foot < tip:
        raise SurfaceError("the blade's sections run from its tip to the hub: give them from the hub on")
    wheel.gap()
    if wheel.others:
        _require_repeating(wheel)
    return wheel


def _require_repeating(wheel: Wheel) -> None:
    """SurfaceError where the others, turned by a pitch, do not lie on the wheel."""
    blades = [turned(wheel.coarse_blade, k * wheel.pitch) for k in range(wheel.count)]
    whole = side_by_side([revolved(wheel.profile, COARSE), *blades, *wheel.others])
    points = turned(side_by_side(wheel.others), wheel.pitch).vertices
    points = points[~MeshDistance(revolved(wheel.profile, COARSE)).inside(points)]
    if not len(points):
        return
    off = MeshDistance(whole).unsigned(points)
    worst = int(np.argmax(off))
    if off[worst] > REPEATS:
        raise SurfaceError(
            f"the wheel does not repeat from blade to blade: turned by {np.degrees(wheel.pitch):.2f} degrees an "
            f"obstacle lies {off[worst]:.2f} mm off at {place_name(points[worst])}: give all of its copies, or the "
            "true number of blades",
            place=points[worst],
            error=float(off[worst]),
        )
