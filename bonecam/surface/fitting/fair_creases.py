"""A fitted surface smoothed where it bends more sharply than levels can follow, within what it may miss its mesh by.

Creases of the mesh, and cells that the fit squeezed or sheared, leave places with radii of microns, over which levels
fold. Steps of the fit (`steps`) are taken again, in which the shape itself resists the thin-plate energy round such
places, not only its change; a place once sharp is held so until the end. Of the surfaces on the way the one counts
whose least radius is largest and which a dense measurement finds near enough.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.basis.gauss import element_points
from bonecam.surface.fitting.deviation import measure
from bonecam.surface.fitting.fit import Fit
from bonecam.surface.fitting.steps import fair_step, flatten_poles
from bonecam.surface.fitting.target import FitTarget
from bonecam.surface.query.closest_point import rings
from bonecam.surface.tspline import TSpline

WEIGHTS = (3e-3, 1e-3)
"""Weights of the energy round sharp places, times (mean cell side)^4: the first leaves larger radii, the second is
nearer to the mesh."""
ROUNDS = 6
"""Steps with each weight."""
SAMPLES = 20000
"""Samples of the mesh: as many as the dense measurement has, which finds the creases of a mesh between fewer."""
POINTS = 3
"""Gauss points each way an element at which radii are taken."""
GAIN = 1.5
"""Factor on the least radius below which a surface is no smoother."""


def without_creases(found: Fit, mesh: TriangleMesh, radius: float, limit: float) -> Fit | None:
    """The fit with bends of `radius` (mm) and less made wider, `limit` (mm) from the mesh at most; None where it has
    none, or that does not widen them."""
    sharpest = least_radius(found.surface)
    if sharpest >= radius:
        return None
    distance = MeshDistance(mesh)
    tried = [(least_radius(surface), surface) for surface in _fairer(found, mesh, radius, limit)]
    for bend, surface in sorted(tried, key=lambda one: -one[0]):
        if bend < GAIN * sharpest:
            break
        deviation = measure(surface, mesh, distance).deviation
        if deviation.max <= limit:
            reached = deviation.max <= found.tolerance
            return replace(found, surface=surface, deviation=deviation, reached=reached)
    return None


def least_radius(surface: TSpline) -> float:
    """The least radius of curvature (mm) at the Gauss points."""
    return float(_radii(surface).min())


def _fairer(fitted: Fit, mesh: TriangleMesh, radius: float, limit: float) -> Iterator[TSpline]:
    """The surfaces after each step that its samples find within the limit."""
    start = FitTarget.at_feet(mesh, fitted.surface, SAMPLES, fitted.tolerance)
    for weight in WEIGHTS:
        surface = fitted.surface
        target = start
        sharp = np.zeros(len(surface.elements().boxes), dtype=bool)
        for _ in range(ROUNDS):
            sharp |= _radii(surface) < radius
            surface = fair_step(surface, target, fitted.tolerance, sharp, weight)
            target = target.on(surface, fitted.tolerance)
            if target.worst <= limit:
                yield flatten_poles(surface)


def _radii(surface: TSpline) -> Float[ndarray, " e"]:
    """The least radius of curvature (mm) at POINTS Gauss points each way of each element."""
    s, t, _ = element_points(surface.elements().boxes, POINTS)
    bends = surface.curvature(s, np.clip(t, *rings(surface)))
    most = np.maximum(np.abs(bends.k1), np.abs(bends.k2))
    return np.asarray(1 / np.maximum(most, np.finfo(float).tiny)).reshape(-1, POINTS**2).min(axis=1)
