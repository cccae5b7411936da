"""The traverse from one point of the clearance surface to another: the ball centre runs on the surface, the
axis keeps its lean to the surface normal.

A convex stock is missed by the whole tool while the axis stays close enough to the outward normal: the plane
between them separates the two. Each traverse is checked all the same.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import angles_between, unit
from bonecam.machine.limits import MachineLimits, polar_angles, with_polar_angles
from bonecam.planning.links.clearance_surface import ClearanceSurface
from bonecam.planning.links.moves import Pose

SAMPLES = 65
"""Poses a traverse is sampled with, before it is thinned out."""
MAX_STEP = 3.0
"""Length of a rapid move of a traverse, mm."""
MAX_TURN = np.radians(5.0)
"""Turn of the axis in a rapid move of a traverse, radians."""
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class TraverseOptions:
    """How a traverse runs: `rise` (mm) higher in its middle, the `long_way` round the stock's axis, or
    `over_pole`: by the upper pole, where the axis stands upright; `one_azimuth`: the axis keeps the azimuth of the
    pose that leans more, so that an axis about Z stands still."""

    rise: float = 0.0
    long_way: bool = False
    over_pole: bool = False
    one_azimuth: bool = False


def traverse(
    surface: ClearanceSurface, first: Pose, last: Pose, limits: MachineLimits, options: TraverseOptions
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Ball centres and axes from the first pose to the last, both included."""
    a, b = surface.coordinates(first[0]), surface.coordinates(last[0])
    azimuths = [value for value in (a[0], b[0]) if not np.isnan(value)]
    start = azimuths[0] if azimuths else 0.0
    end = azimuths[-1] if not np.isnan(b[0]) else start
    if options.over_pole:
        # The traverse up to the upper pole (approached at an azimuth), where the axis stands upright, and down again
        pole = surface.frames(np.array([start]), np.array([surface.top]), np.array([options.rise]))[0][0], UP
        up = traverse(surface, first, pole, limits, TraverseOptions(options.rise))
        down = traverse(surface, pole, last, limits, TraverseOptions(options.rise))
        return np.vstack([up[0], down[0][1:]]), np.vstack([up[1], down[1][1:]])

    turn = float(np.mod(end - start + np.pi, 2 * np.pi) - np.pi)
    if options.long_way:
        turn -= np.copysign(2 * np.pi, turn)
    f = np.linspace(0, 1, SAMPLES)
    azimuth = start + f * turn
    arc = (1 - f) * a[1] + f * b[1]
    height = (1 - f) * a[2] + f * b[2] + options.rise * np.sin(np.pi * f)
    centres, frames = surface.frames(azimuth, arc, height)

    ends = surface.frames(np.array([start, start + turn]), np.array([a[1], b[1]]), np.array([a[2], b[2]]))[1]
    leans = np.stack([ends[0].T @ first[1], ends[1].T @ last[1]])
    lean = unit((1 - f)[:, None] * leans[0] + f[:, None] * leans[1] + 1e-12)
    axes = np.einsum("nij,nj->ni", frames, lean)
    angles = np.clip(polar_angles(axes), limits.smallest, limits.largest)
    if options.one_azimuth:
        leaning = min(first[1], last[1], key=lambda axis: abs(axis[2]))
        axes = np.repeat(leaning[None], SAMPLES, axis=0)
    axes = unit(with_polar_angles(axes, angles))
    if limits.reached is not None:
        axes = limits.nearest(axes)
    centres[[0, -1]] = [first[0], last[0]]
    axes[[0, -1]] = [first[1], last[1]]

    # Drop poses while the steps since the last kept one amount to less than MAX_STEP or MAX_TURN
    length = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    step = length / MAX_STEP + angles_between(axes[1:], axes[:-1]) / MAX_TURN
    whole = np.floor(np.cumsum(step))
    kept = np.r_[0, 1 + np.flatnonzero(np.diff(whole) > 0), len(centres) - 1]
    kept = kept[np.r_[True, np.diff(kept) > 0]]
    return centres[kept], axes[kept]
