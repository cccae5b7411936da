"""A wheel of equal blades round a hub of revolution, from one of its blades; its channels and its blank.

Curves of a wheel in its meridional plane are rows (radius, height) in mm about the Z axis.

An impeller or rotor from the sections of one blade and the flow paths of hub and shroud, as closed solids.

The channel between two neighbouring blades of a wheel: the hub between them as an open surface, and the blank's
contour over it, which the blades' tips lie on.

Lines s = const of both follow the blade's mean line, so that passes run through the channel; those of all pitches
cover the hub beside the blades without a gap. The blank is turned: hub, contour and the straight ends between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.sparse.linalg import spsolve

from bonecam.arrays import unit
from bonecam.errors import MeshError, SurfaceError, place_name
from bonecam.mesh import MeshDistance, TriangleMesh, vertex_normals
from bonecam.mesh.rows import Isolines, lengths_along
from bonecam.mesh.solids import band_faces, revolve, segments_around, solid_union
from bonecam.mesh.triangle_mesh import side_by_side
from bonecam.surface import TSpline, blade_solid, skin

REVOLVED = 0.1
"""A solid is a body of revolution where its vertices lie so near to the one of its section, mm: the chord tolerance of
a coarse mesh."""
OFF = 1e-4
"""The section passes so far beside the axis, as a share of the solid's width: through no pole of its mesh."""
MEAN_POINTS = 64
"""Points of a mean line."""


def hub_profile(hub: TriangleMesh, name: str) -> Float[ndarray, "n 2"]:
    """The curve that a solid hub is the body of revolution of, from its lower pole (on the axis) to its upper one.

    SurfaceError where the hub has a bore or is no body of revolution; messages say `name` for it.
    """
    width = float(np.ptp(hub.vertices[:, 1]))
    try:
        loop = Isolines.of(hub, hub.vertices[:, 1]).loop(OFF * width)
    except MeshError as error:
        remedy = "give it solid, without bore and bolt holes, its axis Z"
        raise SurfaceError(f"{name}: the hub has no plain section through its axis: {remedy}") from error
    first = int(np.argmax((loop[:, 0] > 0) & (np.roll(loop[:, 0], 1) <= 0)))
    loop = np.roll(loop, -first, axis=0)
    half = loop[loop[:, 0] > 4 * OFF * width]
    curve = np.column_stack([np.hypot(half[:, 0], half[:, 1]), half[:, 2]])
    curve = curve if curve[0, 1] < curve[-1, 1] else curve[::-1]
    low, high = curve[0], curve[-1]
    whole = np.vstack([[0.0, low[1]], curve, [0.0, high[1]]])
    moved = np.r_[True, np.linalg.norm(np.diff(whole, axis=0), axis=1) > 1e-6]
    whole = whole[moved]
    distance = MeshDistance(revolved(whole, REVOLVED / 2))
    off = distance.unsigned(hub.vertices)
    if off.max() > REVOLVED:
        place = hub.vertices[np.argmax(off)]
        raise SurfaceError(
            f"{name}: the hub is no body of revolution about Z: it lies {off.max():.2f} mm off one at "
            f"{place_name(place)}: give it without blades, keyways and holes",
            place=place,
            error=float(off.max()),
        )
    return whole


def revolved(profile: Float[ndarray, "n 2"], chord_tolerance: float, count: int = 1) -> TriangleMesh:
    """The closed mesh of a body of revolution whose profile runs from the lower pole to the upper one; turned by a
    `count`-th of a turn it is the same."""
    around = segments_around(float(profile[:, 0].max()), chord_tolerance)
    return revolve_profile(profile, count * -(-around // count))


def revolve_profile(profile: Float[ndarray, "r 2"], around: int) -> TriangleMesh:
    """The closed mesh of `around` segments of a profile, rows (radius, height) from its lower pole on the Z axis to its
    upper one; mm."""
    inner = profile[1:-1]
    return revolve(inner[:, 0], inner[:, 1], (float(profile[0, 1]), float(profile[-1, 1])), around)


def revolve_ring(profile: Float[ndarray, "r 2"], around: int) -> TriangleMesh:
    """The closed outward mesh that a closed polygon of (radius, height) about the Z axis, counter-clockwise with the
    radius to the right and the height upward, sweeps in `around` steps; mm."""
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(around)])
    points = profile[:, :1, None] * ring + profile[:, 1:, None] * np.array([0.0, 0.0, 1.0])
    index = np.arange(len(profile) * around).reshape(-1, around)
    upper = np.roll(index, -1, axis=0)
    return TriangleMesh(points.reshape(-1, 3), band_faces(index, upper).astype(np.int32))


def places_on(curve: Float[ndarray, "n 2"], points: Float[ndarray, "k 2"]) -> Float[ndarray, " k"]:
    """Length along a curve up to its point nearest to each of the `points`, mm."""
    along = lengths_along(curve)
    start = curve[:-1]
    step = np.diff(curve, axis=0)
    lengths = np.linalg.norm(step, axis=1)
    shares = np.clip(np.einsum("kni,ni->kn", points[:, None] - start, step) / lengths**2, 0.0, 1.0)
    away = np.linalg.norm(points[:, None] - start - shares[:, :, None] * step, axis=2)
    nearest = np.argmin(away, axis=1)
    return along[nearest] + shares[np.arange(len(points)), nearest] * lengths[nearest]


def point_at(curve: Float[ndarray, "n 2"], places: Float[ndarray, " k"]) -> Float[ndarray, "k 2"]:
    """The points of a curve at these lengths along it."""
    along = lengths_along(curve)
    return np.column_stack([np.interp(places, along, curve[:, k]) for k in range(2)])


def stretch(curve: Float[ndarray, "n 2"], low: float, high: float) -> Float[ndarray, "m 2"]:
    """The part of a curve between two lengths along it, its own points between them included."""
    along = lengths_along(curve)
    return point_at(curve, np.r_[low, along[(along > low) & (along < high)], high])


def meridional(points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2"]:
    """(radius, height) of each point."""
    return np.column_stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]])


def mean_line(section: Float[ndarray, "n 3"]) -> Float[ndarray, "m 3"]:
    """The line midway between the two sides of a closed section of a blade, from edge to edge, as rows (radius, height,
    azimuth in radians, continuous). The edges are the two points farthest apart."""
    away = np.linalg.norm(section[:, None] - section, axis=2)
    start, end = sorted(int(i) for i in np.unravel_index(np.argmax(away), away.shape))
    sides = section[start : end + 1], np.vstack([section[end:], section[: start + 1]])[::-1]
    resampled = []
    for side in sides:
        along = lengths_along(side)
        at = np.linspace(0.0, along[-1], MEAN_POINTS)
        azimuth = np.unwrap(np.arctan2(side[:, 1], side[:, 0]))
        rows = np.column_stack([meridional(side), azimuth])
        resampled.append(np.column_stack([np.interp(at, along, rows[:, k]) for k in range(3)]))
    turns = np.round((resampled[1][0, 2] - resampled[0][0, 2]) / (2 * np.pi))
    resampled[1][:, 2] -= 2 * np.pi * turns
    return (resampled[0] + resampled[1]) / 2


MARGIN = 1.0
"""Hub and shroud reach beyond the blade by so much along their curves, mm."""


@dataclass(frozen=True, eq=False)
class Impeller:
    """Closed outward solids about the Z axis, mm; `blades[0]` is the one whose sections were given, the others
    follow counter-clockwise."""

    hub: TriangleMesh
    shroud: TriangleMesh
    blades: tuple[TriangleMesh, ...]


def impeller(
    blade: TSpline,
    hub: Float[ndarray, "h 2"],
    shroud: Float[ndarray, "k 2"],
    count: int,
    *,
    wall: float = 4.0,
    chord_tolerance: float = 0.02,
) -> Impeller:
    """The impeller of `count` blades between the flow paths of `hub` and `shroud`, rows (radius, height) along the
    flow.

    The hub is solid, with a back of `wall` mm below its lowest point; the shroud is `wall` mm thick. Both are cut
    off MARGIN beyond the blade. ValueError where a size is not positive.
    """
    if count < 1 or not (wall > 0 and chord_tolerance > 0):
        raise ValueError(f"{count} blades, wall {wall:g}, chord {chord_tolerance:g} mm: give positive ones")
    solid = blade_solid(blade, chord_tolerance)
    beside = meridional(solid.vertices)
    # The stretch of a flow path beside the points, and MARGIN more at either end
    inner, outer = (
        thinned(stretch(curve, *limits_beside(curve, beside)), chord_tolerance / 2) for curve in (hub, shroud)
    )
    around = segments_around(float(max(inner[:, 0].max(), outer[:, 0].max())), chord_tolerance)
    # The polygon, counter-clockwise, of a shroud's curve and the curve `wall` mm off it, away from the hub
    tangent = np.gradient(outer, axis=0)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    middle = len(outer) // 2
    nearest = inner[np.argmin(np.linalg.norm(inner - outer[middle], axis=1))]
    away = 1.0 if normal[middle] @ (outer[middle] - nearest) > 0 else -1.0
    polygon = np.vstack([outer, (outer + away * wall * normal)[::-1]])
    x, y = polygon.T
    area = np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    return Impeller(
        revolve_profile(profile_over(inner, wall), around),
        revolve_ring((polygon if area > 0 else polygon[::-1]), around),
        tuple(turned(solid, 2 * np.pi * k / count) for k in range(count)),
    )


def limits_beside(curve: Float[ndarray, "n 2"], points: Float[ndarray, "k 2"]) -> tuple[float, float]:
    """The lengths along a flow path between which the points lie beside it, and MARGIN more at either end, mm."""
    lengths = places_on(curve, points)
    low = max(float(lengths.min()) - MARGIN, 0.0)
    return low, min(float(lengths.max()) + MARGIN, float(lengths_along(curve)[-1]))


def thinned(curve: Float[ndarray, "n 2"], tolerance: float) -> Float[ndarray, "m 2"]:
    """The fewest points of a curve that halving it where it is farthest from its chord leaves, within `tolerance` mm
    (Douglas & Peucker 1973)."""
    chord = curve[-1] - curve[0]
    share = np.clip((curve - curve[0]) @ chord / max(float(chord @ chord), np.finfo(float).tiny), 0.0, 1.0)
    away = np.linalg.norm(curve - curve[0] - share[:, None] * chord, axis=1)
    worst = int(np.argmax(away))
    if away[worst] <= tolerance:
        return curve[[0, -1]]
    return np.vstack([thinned(curve[: worst + 1], tolerance)[:-1], thinned(curve[worst:], tolerance)])


def profile_over(curve: Float[ndarray, "n 2"], wall: float) -> Float[ndarray, "m 2"]:
    """The profile, from pole to pole, of the solid inside a hub's curve with a back `wall` mm below it."""
    upward = curve if curve[-1, 1] >= curve[0, 1] else curve[::-1]
    back = float(upward[:, 1].min() - wall)
    return np.vstack([[[0.0, back], [upward[0, 0], back]], upward, [[0.0, upward[-1, 1]]]])


def turned(mesh: TriangleMesh, angle: float) -> TriangleMesh:
    """The mesh turned about the Z axis by an angle in radians."""
    return mesh.move(pose_about_z(angle))


def pose_about_z(angle: float) -> Float[ndarray, "4 4"]:
    """The rigid transform that turns about the Z axis by an angle in radians."""
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return pose


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
    # How far the sections at both ends are from the hub's profile
    left, right = blade.domain[0]
    s = np.linspace(left, right, 40, endpoint=False)
    off = []
    for end in blade.domain[1]:
        points = meridional(blade.positions(s, np.full(len(s), end)))
        off.append(np.median(np.linalg.norm(points - point_at(profile, places_on(profile, points)), axis=1)))
    if not off[0] < off[1]:
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


TURNED_CHORD = 0.02
"""Chord tolerance round the axis, mm."""


@dataclass(frozen=True, eq=False)
class TurnedBlank:
    """The body of revolution about Z of a `profile`, rows (radius, height) in mm from its lower pole to its upper
    one."""

    profile: Float[ndarray, "n 2"]

    @property
    def diameter(self) -> float:
        """mm."""
        return 2 * float(self.profile[:, 0].max())

    @property
    def mesh(self) -> TriangleMesh:
        """The closed mesh of the blank."""
        return revolve_profile(self.profile, segments_around(self.diameter / 2, TURNED_CHORD))

    @property
    def text(self) -> str:
        """What is to be mounted."""
        low, high = self.profile[:, 1].min(), self.profile[:, 1].max()
        return f"blank: turned to the blades' tips, diameter {self.diameter:.2f} mm, from Z {low:.2f} to Z {high:.2f}"


TOLERANCE = 0.005
"""Of the skins of floor and roof, mm."""
ROWS, ACROSS = 33, 13
"""Points along and across, through which the skins go."""
SECTION_POINTS = 200
"""Points of the blade's sections at hub and tip."""
EXTENDED = 0.5
"""The contour goes on straight by so many of its lengths at either end."""
THINNED = 0.01
"""Profiles of levels keep the points that they need for this, mm."""
BELOW = 0.1
"""The body under a level ends so far below its lowest point, mm, where it is in the hub or in air."""
STRAIGHT = 0.02
"""The floor goes straight on as its ends do over this share of its length."""
FLUSH = 0.02
"""A blade may stand out of the blank by so much, mm: what its sections are rough by."""


@dataclass(frozen=True, eq=False)
class Channel:
    """`floor` (on the hub) and `roof` (on the blank), open surfaces with normals away from the hub, t along the hub's
    profile from below; and the `blank`'s profile, rows (radius, height) from pole to pole, mm."""

    wheel: Wheel
    floor: TSpline
    roof: TSpline
    blank: Float[ndarray, "n 2"]

    def under(self, level: TSpline) -> tuple[Float[ndarray, "n 2"], float]:
        """The profile of a body of revolution that a level between floor and roof leaves whole, and how far what lies
        under the level reaches out of it at most, mm."""
        (left, right), (low, high) = level.domain
        t = np.linspace(low, high, 4 * ROWS)
        curve = meridional(level.positions(np.full(len(t), (left + right) / 2), t))
        rows = [meridional(level.positions(np.full(len(t), s), t)) for s in np.linspace(left, right, ACROSS)]
        points = np.vstack(rows)
        above, below = _above(curve, points), _above(curve[::-1], points)
        inner = thinned(curve - below * _normals_outward(curve), THINNED)
        base = float(inner[:, 1].min()) - BELOW
        closed = np.vstack([[[0.0, base], [inner[0, 0], base]], inner, [[0.0, inner[-1, 1]]]])
        return closed, above + below + 2 * THINNED


def channel_of(wheel: Wheel, reach: float) -> Channel:
    """The channel from the first blade to the next; floor and roof reach this far (mm) beyond the blades' edges,
    straight on where the hub ends. SurfaceError where the blades stand out of the blank that their tips give."""
    left, right = wheel.blade.domain[0]
    s = np.linspace(left, right, SECTION_POINTS, endpoint=False)
    foot, tip = (mean_line(wheel.blade.positions(s, np.full(len(s), end))) for end in wheel.blade.domain[1])
    blade = meridional(wheel.coarse_blade.vertices)

    # The blank over the blades, straight on at both ends: the tip's mean line, from below, as far off that no point of
    # the `blade` lies above it
    curve = tip[:, :2] if tip[0, 1] <= tip[-1, 1] else tip[::-1, :2]
    beyond = EXTENDED * lengths_along(curve)[-1]
    first, last = ((ends[0] - ends[1]) / np.linalg.norm(ends[0] - ends[1]) for ends in (curve[:2], curve[:-3:-1]))
    curve = np.vstack([curve[0] + beyond * first, curve, curve[-1] + beyond * last])
    contour = curve + _above(curve, blade) * _normals_outward(curve)

    # The hub's profile beside the `blade`, and straight on by `reach` mm at either end
    lengths = places_on(wheel.profile, blade)
    curve = stretch(wheel.profile, float(lengths.min()), float(lengths.max()))
    length = float(lengths_along(curve)[-1])
    low, first, last, high = point_at(curve, np.array([0.0, STRAIGHT, 1 - STRAIGHT, 1.0]) * length)
    start, end = low + reach * unit((low - first)[None])[0], high + reach * unit((high - last)[None])[0]
    floor = np.vstack([start, curve, end])

    length = float(lengths_along(floor)[-1])
    lengths = np.linspace(0.0, length, ROWS)
    if not (np.diff(places_on(contour, point_at(floor, lengths))) > 0).all():
        raise SurfaceError("the hub is folded under the blades' tips: give a hub without edges between the blades")

    # The hub's profile with the contour, between its points nearest to the channel's ends, in place of its own curve
    # there
    low, high = wheel.flow
    along = lengths_along(wheel.profile)
    ends = point_at(wheel.profile, np.array([low, high]))
    over = thinned(stretch(contour, *places_on(contour, ends)), THINNED)
    below, above = wheel.profile[along < low], wheel.profile[along > high]
    whole = np.vstack([below, ends[:1], over, ends[1:], above])
    moved = np.r_[True, np.linalg.norm(np.diff(whole, axis=0), axis=1) > 1e-6]
    blank = whole[moved]

    _require_inside(wheel, blank)

    # The azimuth of the blade's mean line at these lengths along the floor; beyond the blade as at its edges
    at = places_on(floor, foot[:, :2])
    order = np.argsort(at, kind="stable")
    azimuths = np.interp(lengths, at[order], foot[order, 2])

    # Points of the hub, each row across the channel from its own azimuth on
    angle = azimuths[:, None] + np.linspace(0.0, wheel.pitch, ACROSS)
    radius, height = point_at(floor, lengths).T[:, :, None]
    flat = radius * np.cos(angle), radius * np.sin(angle)
    rows = np.stack([*flat, np.broadcast_to(height, angle.shape)], axis=2)
    surface = skin(rows, TOLERANCE, closed=False)

    # with twice as many control points along t, for levels that the roof forms too
    (left, right), (low, high) = surface.domain
    t = np.linspace(low, high, 4 * ROWS)
    surface = surface.refine(np.full(len(t), (left + right) / 2), t, "t")
    return Channel(wheel, surface, _roof(surface, contour), blank)


def _roof(floor: TSpline, contour: Float[ndarray, "k 2"]) -> TSpline:
    """The surface over the floor's T-mesh whose points lie, at the azimuths of the floor's, on the contour's points
    nearest to those."""
    along = (np.linspace(low, high, 4 * ROWS) for low, high in floor.domain)
    s, t = (x.ravel() for x in np.meshgrid(*along))
    points = floor.positions(s, t)
    on_floor = meridional(points)
    above = point_at(contour, places_on(contour, on_floor))
    wanted = np.column_stack([points[:, :2] * (above[:, :1] / on_floor[:, :1]), above[:, 1]])
    R = sp.csr_array(floor.basis(s, t)[0])
    ways = spsolve(sp.csc_array(R.T @ R), R.T @ (wanted - points))
    return floor.with_control_points(floor.control_points + ways)


def _normals_outward(curve: Float[ndarray, "k 2"]) -> Float[ndarray, "k 2"]:
    """Unit normals of a curve, away from a hub that it runs round from below."""
    along = unit(np.gradient(curve, axis=0))
    return np.column_stack([along[:, 1], -along[:, 0]])


def _above(curve: Float[ndarray, "k 2"], points: Float[ndarray, "v 2"]) -> float:
    """How far the points stand out of a curve at most, mm."""
    lengths = places_on(curve, points)
    along = lengths_along(curve)
    normals = _normals_outward(curve)
    outward = np.column_stack([np.interp(lengths, along, normals[:, k]) for k in range(2)])
    return max(float(((points - point_at(curve, lengths)) * outward).sum(axis=1).max()), 0.0)


def _require_inside(wheel: Wheel, blank: Float[ndarray, "n 2"]) -> None:
    """SurfaceError where a blade stands out of the blank."""
    solid = wheel.coarse_blade.vertices
    points = meridional(solid)

    # Whether points (radius, height) lie inside a profile that is closed along the axis, by crossings
    (r0, z0) = blank[:-1].T[:, :, None]
    (r1, z1) = blank[1:].T[:, :, None]
    r, z = points.T
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = r0 + (z - z0) / (z1 - z0) * (r1 - r0)
    crosses = ((z0 <= z) != (z1 <= z)) & (crossing > r)
    out = np.flatnonzero(~np.asarray(crosses.sum(axis=0) % 2 == 1))
    off = np.linalg.norm(point_at(blank, places_on(blank, points[out])) - points[out], axis=1)
    if off.max(initial=0.0) > FLUSH:
        place = solid[out[np.argmax(off)]]
        raise SurfaceError(
            f"the blade stands {off.max():.2f} mm out of the blank that its tip gives at {place_name(place)}: give "
            "sections that end on one surface of revolution, or a longer hub",
            place=place,
            error=float(off.max()),
        )
