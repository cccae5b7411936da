"""The channel between two neighbouring blades of a wheel: the hub between them as an open surface, and the blank's
contour over it, which the blades' tips lie on.

Lines s = const of both follow the blade's mean line, so that passes run through the channel; those of all pitches
cover the hub beside the blades without a gap. The blank is turned: hub, contour and the straight ends between them.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.sparse.linalg import spsolve

from bonecam.arrays import unit
from bonecam.errors import SurfaceError, place_name
from bonecam.surface.blades.impeller import thinned
from bonecam.surface.blades.meridian import lengths_along, mean_line, meridional, places_on, point_at, stretch
from bonecam.surface.blades.wheel import Wheel
from bonecam.surface.skinning.skin import skin
from bonecam.surface.tspline import TSpline

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
        inner = thinned(curve - below * _outward(curve), THINNED)
        base = float(inner[:, 1].min()) - BELOW
        closed = np.vstack([[[0.0, base], [inner[0, 0], base]], inner, [[0.0, inner[-1, 1]]]])
        return closed, above + below + 2 * THINNED


def channel_of(wheel: Wheel, reach: float) -> Channel:
    """The channel from the first blade to the next; floor and roof reach this far (mm) beyond the blades' edges,
    straight on where the hub ends. SurfaceError where the blades stand out of the blank that their tips give."""
    foot, tip = (mean_line(_section(wheel.blade, end)) for end in wheel.blade.domain[1])
    blade = meridional(wheel.coarse_blade.vertices)
    contour = _contour(tip, blade)

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

    across = np.linspace(0.0, wheel.pitch, ACROSS)
    surface = _finer(skin(_rows(point_at(floor, lengths), azimuths, across), TOLERANCE, closed=False))
    return Channel(wheel, surface, _roof(surface, contour), blank)


def _finer(floor: TSpline) -> TSpline:
    """The unchanged floor with twice as many control points along t, for levels that the roof forms too."""
    (left, right), (low, high) = floor.domain
    t = np.linspace(low, high, 4 * ROWS)
    return floor.refine(np.full(len(t), (left + right) / 2), t, "t")


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


def _section(blade: TSpline, t: float) -> Float[ndarray, "n 3"]:
    """Points of a closed section of the blade."""
    left, right = blade.domain[0]
    s = np.linspace(left, right, SECTION_POINTS, endpoint=False)
    return blade.positions(s, np.full(len(s), t))


def _contour(tip: Float[ndarray, "m 3"], blade: Float[ndarray, "v 2"]) -> Float[ndarray, "k 2"]:
    """The contour of the blank over the blades, straight on at both ends: the tip's mean line, from below, as far off
    that no point of the `blade` lies above it."""
    curve = tip[:, :2] if tip[0, 1] <= tip[-1, 1] else tip[::-1, :2]
    reach = EXTENDED * lengths_along(curve)[-1]
    first, last = ((ends[0] - ends[1]) / np.linalg.norm(ends[0] - ends[1]) for ends in (curve[:2], curve[:-3:-1]))
    curve = np.vstack([curve[0] + reach * first, curve, curve[-1] + reach * last])
    return curve + _above(curve, blade) * _outward(curve)


def _outward(curve: Float[ndarray, "k 2"]) -> Float[ndarray, "k 2"]:
    """Unit normals of a curve, away from a hub that it runs round from below."""
    along = unit(np.gradient(curve, axis=0))
    return np.column_stack([along[:, 1], -along[:, 0]])


def _above(curve: Float[ndarray, "k 2"], points: Float[ndarray, "v 2"]) -> float:
    """How far the points stand out of a curve at most, mm."""
    lengths = places_on(curve, points)
    along = lengths_along(curve)
    normals = _outward(curve)
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


def _rows(
    curve: Float[ndarray, "m 2"], azimuths: Float[ndarray, " m"], across: Float[ndarray, " n"]
) -> Float[ndarray, "m n 3"]:
    """Points of the surface of revolution of a curve, each row across the channel from its own azimuth on."""
    angle = azimuths[:, None] + across
    radius, height = curve.T[:, :, None]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.broadcast_to(height, angle.shape)], axis=2)
