"""An impeller or rotor from the sections of one blade and the flow paths of hub and shroud, as closed solids."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.solids.revolution import revolve_profile, revolve_ring, segments_around
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.blades.blade_solid import blade_solid
from bonecam.surface.blades.meridian import lengths_along, meridional, places_on, stretch
from bonecam.surface.tspline import TSpline

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
    return Impeller(
        revolve_profile(profile_over(inner, wall), around),
        revolve_ring(_wall(outer, inner, wall), around),
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


def _wall(curve: Float[ndarray, "n 2"], hub: Float[ndarray, "h 2"], wall: float) -> Float[ndarray, "m 2"]:
    """The polygon, counter-clockwise, of a shroud's curve and the curve `wall` mm off it, away from the hub."""
    tangent = np.gradient(curve, axis=0)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    middle = len(curve) // 2
    nearest = hub[np.argmin(np.linalg.norm(hub - curve[middle], axis=1))]
    away = 1.0 if normal[middle] @ (curve[middle] - nearest) > 0 else -1.0
    polygon = np.vstack([curve, (curve + away * wall * normal)[::-1]])
    x, y = polygon.T
    area = np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    return polygon if area > 0 else polygon[::-1]


def turned(mesh: TriangleMesh, angle: float) -> TriangleMesh:
    """The mesh turned about the Z axis by an angle in radians."""
    return mesh.move(pose_about_z(angle))


def pose_about_z(angle: float) -> Float[ndarray, "4 4"]:
    """The rigid transform that turns about the Z axis by an angle in radians."""
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return pose
