"""Curves of a wheel in its meridional plane, as rows (radius, height) in mm about the Z axis."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import MeshError, SurfaceError, place_name
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.sections.isolines import Isolines
from bonecam.mesh.solids.revolution import revolve_profile, segments_around
from bonecam.mesh.triangle_mesh import TriangleMesh

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


def lengths_along(curve: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
    """Length along a curve up to each of its points, mm."""
    return np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))]


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
        along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(side, axis=0), axis=1))]
        at = np.linspace(0.0, along[-1], MEAN_POINTS)
        azimuth = np.unwrap(np.arctan2(side[:, 1], side[:, 0]))
        rows = np.column_stack([meridional(side), azimuth])
        resampled.append(np.column_stack([np.interp(at, along, rows[:, k]) for k in range(3)]))
    turns = np.round((resampled[1][0, 2] - resampled[0][0, 2]) / (2 * np.pi))
    resampled[1][:, 2] -= 2 * np.pi * turns
    return (resampled[0] + resampled[1]) / 2
