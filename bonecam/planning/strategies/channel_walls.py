"""The contacts of a level of a channel whose ball comes as near to the blades as it may.

Lines of a pattern end wherever a blade begins, so that what they leave beside it is up to a side step thick. These
lines follow the blades, and run round their edges where passes go on beyond them.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.job import Job
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.passes.patterns.post_ring import LineContacts, feeds_along
from bonecam.planning.passes.patterns.sampling import ROUND, contact_frames
from bonecam.planning.strategies.slices import contour_lines
from bonecam.surface.tspline import TSpline

CELL = 0.3
"""Distance of the places on which the lines are found, mm."""
STEP = 0.4
"""Contacts are about so far apart, mm."""
SPARE = 0.03
"""The ball keeps so much more from the blades, mm: what lines between places CELL apart are off by."""
SHORTEST = 1.0
"""A shorter line is left out, mm."""


def wall_cusp(job: Job) -> float:
    """What stands on the blades between two levels beside what the roughing ball touches, mm."""
    radius = job.tool("roughing").radius
    half = job.deepest("roughing") / 2
    return SPARE + radius - float(np.sqrt(max(radius**2 - half**2, 0.0)))


def wall_contacts(surface: TSpline, distance: MeshDistance, radius: float) -> list[LineContacts]:
    """The lines on which a ball of `radius` (mm) that follows an open surface comes nearest to the walls on it."""
    (left, right), (low, high) = surface.domain
    across, along = _lengths(surface)
    s = np.linspace(left, right, int(across / CELL) + 2)
    t = np.linspace(low, high, int(along / CELL) + 2)
    parameters = np.stack(np.meshgrid(s, t, indexing="ij"), axis=2).reshape(-1, 2)
    points, normals, _ = contact_frames(surface, parameters, ROUND)
    least = radius + SPARE
    # walls are beside the ball; the level itself touches it from below, by up to its mesh's deviation
    field = distance.signed(points + (radius + SPARE) * normals, least + CELL) - least
    contours = contour_lines(s, t, np.minimum(field + RESTS, CELL).reshape(len(s), len(t)), 0.0)
    lines = [_contacts(surface, line) for line in contours]
    return [line for line in lines if line is not None]


RESTS = 0.02
"""A ball enters the mesh of its own level by so much, mm."""


def _lengths(surface: TSpline) -> tuple[float, float]:
    """The largest extents of a surface along s and along t, mm, on a few lines."""
    (left, right), (low, high) = surface.domain
    extents = []
    for k in range(2):
        ways = []
        for at in np.linspace(0.0, 1.0, 5):
            u = np.linspace(0.0, 1.0, 65)
            s, t = (u, np.full(65, at)) if k == 0 else (np.full(65, at), u)
            line = surface.positions(left + s * (right - left), low + t * (high - low))
            ways.append(float(lengths(np.diff(line, axis=0)).sum()))
        extents.append(max(ways))
    return extents[0], extents[1]


def _contacts(surface: TSpline, line: Float[ndarray, "n 2"]) -> LineContacts | None:
    """The contacts of a line in (s, t), STEP apart; None where it is short."""
    way = np.r_[0.0, np.cumsum(lengths(np.diff(surface.positions(*line.T), axis=0)))]
    if way[-1] < SHORTEST:
        return None
    at = np.linspace(0.0, way[-1], int(way[-1] / STEP) + 2)
    parameters = np.column_stack([np.interp(at, way, line[:, k]) for k in range(2)])
    points, normals, _ = contact_frames(surface, parameters, ROUND)
    return LineContacts(parameters, points, normals, feeds_along(np.gradient(points, axis=0), normals))
