"""An impeller or rotor from the sections of one blade and the flow paths of hub and shroud, as closed solids."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.solids.revolution import revolve, revolve_ring, segments_around
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.blades.blade_solid import blade_solid
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
    beside = np.column_stack([np.hypot(solid.vertices[:, 0], solid.vertices[:, 1]), solid.vertices[:, 2]])
    inner, outer = (_thinned(_beside(curve, beside), chord_tolerance / 2) for curve in (hub, shroud))
    around = segments_around(float(max(inner[:, 0].max(), outer[:, 0].max())), chord_tolerance)
    return Impeller(
        _hub(inner, wall, around),
        revolve_ring(_wall(outer, inner, wall), around),
        tuple(_turned(solid, 2 * np.pi * k / count) for k in range(count)),
    )


def _beside(curve: Float[ndarray, "n 2"], points: Float[ndarray, "k 2"]) -> Float[ndarray, "m 2"]:
    """The stretch of a flow path beside the points, and MARGIN more at either end."""
    lengths = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    along = np.r_[0.0, np.cumsum(lengths)]
    start, step = curve[:-1], np.diff(curve, axis=0)
    shares = np.clip(np.einsum("kni,ni->kn", points[:, None] - start, step) / lengths**2, 0.0, 1.0)
    away = np.linalg.norm(points[:, None] - start - shares[:, :, None] * step, axis=2)
    nearest = np.argmin(away, axis=1)
    places = along[nearest] + shares[np.arange(len(points)), nearest] * lengths[nearest]
    low = max(places.min() - MARGIN, 0.0)
    high = min(places.max() + MARGIN, along[-1])
    inside = along[(along > low) & (along < high)]
    return np.column_stack([np.interp(np.r_[low, inside, high], along, curve[:, k]) for k in (0, 1)])


def _thinned(curve: Float[ndarray, "n 2"], tolerance: float) -> Float[ndarray, "m 2"]:
    """The fewest points of a curve that halving it where it is farthest from its chord leaves, within `tolerance` mm
    (Douglas & Peucker 1973)."""
    chord = curve[-1] - curve[0]
    share = np.clip((curve - curve[0]) @ chord / max(float(chord @ chord), np.finfo(float).tiny), 0.0, 1.0)
    away = np.linalg.norm(curve - curve[0] - share[:, None] * chord, axis=1)
    worst = int(np.argmax(away))
    if away[worst] <= tolerance:
        return curve[[0, -1]]
    return np.vstack([_thinned(curve[: worst + 1], tolerance)[:-1], _thinned(curve[worst:], tolerance)])


def _hub(curve: Float[ndarray, "n 2"], wall: float, around: int) -> TriangleMesh:
    """The solid inside a hub's curve, with a back below it."""
    upward = curve if curve[-1, 1] >= curve[0, 1] else curve[::-1]
    back = float(upward[:, 1].min() - wall)
    radii = np.r_[upward[0, 0], upward[:, 0]]
    heights = np.r_[back, upward[:, 1]]
    return revolve(radii, heights, (back, float(upward[-1, 1])), around)


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


def _turned(mesh: TriangleMesh, angle: float) -> TriangleMesh:
    """The mesh turned about the Z axis."""
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return mesh.move(pose)
