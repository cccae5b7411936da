"""The mesh of a body of revolution about the Z axis."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh


def segments_around(radius: float, chord_tolerance: float) -> int:
    """How many segments keep a circle's polygon within half the chord tolerance (mm) of it; 12 at least."""
    return max(12, int(np.ceil(np.pi / half_angle(radius, chord_tolerance))))


def half_angle(radius: float, chord_tolerance: float) -> float:
    """Half the angle (radians) of an arc whose chord is half the chord tolerance (mm) from it."""
    return float(np.arccos(max(1 - chord_tolerance / (2 * radius), 0.0)))


def revolve(
    radii: Float[ndarray, " r"], heights: Float[ndarray, " r"], ends: tuple[float, float], around: int
) -> TriangleMesh:
    """The closed outward mesh of rings of `around` vertices about the Z axis and a pole at either end.

    `radii` and `heights` (rising) are those of the rings, `ends` the heights of the poles; mm.
    """
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(around)])
    points = radii[:, None, None] * ring + heights[:, None, None] * np.array([0.0, 0.0, 1.0])
    poles = np.array([[0, 0, end] for end in ends])
    return TriangleMesh(np.vstack([points.reshape(-1, 3), poles]), ring_faces(len(radii), around))


def revolve_profile(profile: Float[ndarray, "r 2"], around: int) -> TriangleMesh:
    """The closed mesh of `around` segments of a profile, rows (radius, height) from its lower pole on the Z axis to its
    upper one; mm."""
    inner = profile[1:-1]
    return revolve(inner[:, 0], inner[:, 1], (float(profile[0, 1]), float(profile[-1, 1])), around)


def cylinder(radius: float, bottom: float, top: float, chord_tolerance: float) -> TriangleMesh:
    """A closed outward cylinder about the Z axis, its vertices on the surface, its faces within `chord_tolerance` of it
    and of nearly one size; mm."""
    around = segments_around(radius, chord_tolerance)
    step = 2 * np.pi * radius / around
    disc = np.linspace(0, radius, max(2, int(np.ceil(radius / step))) + 1)[1:]
    rises = np.linspace(bottom, top, max(2, int(np.ceil((top - bottom) / step))) + 1)
    radii = np.concatenate([disc, np.full(len(rises) - 2, radius), disc[::-1]])
    heights = np.concatenate([np.full(len(disc), bottom), rises[1:-1], np.full(len(disc), top)])
    return revolve(radii, heights, (bottom, top), around)


def revolve_ring(profile: Float[ndarray, "r 2"], around: int) -> TriangleMesh:
    """The closed outward mesh that a closed polygon of (radius, height) about the Z axis, counter-clockwise with the
    radius to the right and the height upward, sweeps in `around` steps; mm."""
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(around)])
    points = profile[:, :1, None] * ring + profile[:, 1:, None] * np.array([0.0, 0.0, 1.0])
    index = np.arange(len(profile) * around).reshape(-1, around)
    return TriangleMesh(points.reshape(-1, 3), _band_faces(index, np.roll(index, -1, axis=0)).astype(np.int32))


def _band_faces(lower: ndarray, upper: ndarray) -> ndarray:
    """Triangles (m, 3) between rings of vertices (r, around) and the rings above them."""
    a, b = lower.ravel(), np.roll(lower, -1, axis=1).ravel()
    c, d = np.roll(upper, -1, axis=1).ravel(), upper.ravel()
    return np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def ring_faces(rings: int, around: int) -> ndarray:
    """Triangles (m, 3) between neighbouring rings and to the poles, whose vertices follow those of the rings."""
    index = np.arange(rings * around).reshape(rings, around)
    turned = np.roll(index, -1, axis=1)
    lower_pole = np.full(around, rings * around)
    upper_pole = lower_pole + 1
    bottom = np.column_stack([lower_pole, turned[0], index[0]])
    top = np.column_stack([upper_pole, index[-1], turned[-1]])
    faces = np.vstack([_band_faces(index[:-1], index[1:]), bottom, top])
    return faces.astype(np.int32)
