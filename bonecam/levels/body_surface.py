"""The T-spline of a smooth convex body: fitted by least squares to the points of the body nearest to those on
the meridians of a capsule round it.

Where a surface with even knots is not near enough, the knots are placed where the points bend.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.ndimage import gaussian_filter1d

from bonecam.errors import LevelError, place_name
from bonecam.levels.problem.factorisation import factorise
from bonecam.setup.capsule import Capsule, enclosing_capsule
from bonecam.setup.stock import Stock
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

TOLERANCE = 0.002
"""How far (mm) a surface may be off its body, measured between the points it is fitted to."""

ROW_STEP = 0.4
"""Distance (mm) along a meridian of the rows of control points, at first."""

MIN_ROWS = 40
"""Fewest rows of control points, at first."""

MAX_ROWS = 160
"""Most rows of control points, at first."""

AROUND_ROUND = 32
"""Control points of a row, at first, where no body has flats."""

AROUND_FLAT = 96
"""Control points of a row, at first, where a body has flats."""

SAMPLES = 3
"""Points in each knot interval that the surface is fitted to."""

CHECKS = 2
"""Places in a patch, each way, at which its distance from the body is measured: between the fitted points."""

FINER = 1.3
"""Factor on the control points each way from one try to the next, where a surface is off."""

MAX_TRIES = 4
"""Most tries with knots where the points bend."""

LEAST_DENSITY = 0.3
"""Least density of knots, share of their mean density."""

SMOOTHING = SAMPLES / 2
"""Standard deviation of the Gaussian, in points, that smooths the steps between points."""

POLE_WEIGHT = 100.0
"""Weight of the poles, beside one of every other point: a single control point shapes each."""


def meridians(capsule: Capsule, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """Points of an upright capsule: s turns round the axis, t is the share of the arc from the lower to the
    upper pole."""
    quarter = capsule.radius * np.pi / 2
    straight = capsule.length - 2 * capsule.radius
    arc = t * (2 * quarter + straight) - quarter
    rise = np.clip(arc, 0, straight)
    angle = (arc - rise) / capsule.radius
    across = capsule.radius * np.cos(angle)
    local = [across * np.cos(2 * np.pi * s), across * np.sin(2 * np.pi * s), rise + capsule.radius * np.sin(angle)]
    return capsule.start + np.column_stack(local)


def body_surfaces(bodies: Sequence[Stock]) -> list[TSpline]:
    """The surfaces of smooth convex bodies, lower pole first, all on one T-mesh, within TOLERANCE as
    measured.

    LevelError with the distance and the place where they are farther off with the most control points.
    """
    around = AROUND_FLAT if any(body.has_flats for body in bodies) else AROUND_ROUND
    capsules = [enclosing_capsule(body) for body in bodies]
    arc = max(np.pi * capsule.radius + capsule.length for capsule in capsules)
    rows = int(np.clip(np.ceil(arc / ROW_STEP), MIN_ROWS, MAX_ROWS))
    distance = np.inf
    place = np.zeros(3)
    for s_knots, t_knots, smooth in _knots_to_try(bodies, capsules, around, rows):
        surfaces = _fit(bodies, capsules, s_knots, t_knots, smooth)
        distance, place = max(
            (_largest_distance(body, surface) for body, surface in zip(bodies, surfaces)), key=lambda one: one[0]
        )
        if distance <= TOLERANCE:
            return surfaces
    raise LevelError(
        f"the surface of the rounded stock is {distance:.4f} mm off it at {place_name(place)}, more than "
        f"{TOLERANCE} mm: give a larger "
        "stock, whose edges can be rounder, or a capsule",
        distance=distance,
        place=place,
    )


def _knots_to_try(
    bodies: Sequence[Stock], capsules: Sequence[Capsule], around: int, rows: int
) -> Iterator[tuple[ndarray, ndarray, bool]]:
    """Knots round and along the bodies, and whether steps are smoothed: first even ones, then where the
    bodies bend, more and more."""
    yield np.arange(around) / around, np.linspace(0, 1, rows - 2), False
    s = np.arange(SAMPLES * around) / (SAMPLES * around)
    t = np.linspace(0, 1, SAMPLES * rows)
    grids = [_points_of_body(body, capsule, s, t) for body, capsule in zip(bodies, capsules)]
    along_s = np.max([_knot_density(grid.swapaxes(0, 1)) for grid in grids], axis=0)
    along_t = np.max([_knot_density(grid) for grid in grids], axis=0)
    for finer in FINER ** np.arange(MAX_TRIES):
        yield (
            _knots_by_density(np.append(along_s, along_s[0]), int(finer * around))[:-1],
            _knots_by_density(along_t, int(finer * rows) - 3),
            True,
        )


def _points_of_body(
    body: Stock, capsule: Capsule, s: Float[ndarray, " a"], t: Float[ndarray, " b"]
) -> Float[ndarray, "b a 3"]:
    """The points of the body nearest to those of the capsule at all pairs of s and t."""
    ss, tt = (v.ravel() for v in np.meshgrid(s, t))
    return body.closest_points(meridians(capsule, ss, tt)).reshape(len(t), len(s), 3)


def _smooth(body: Stock, grid: Float[ndarray, "b a 3"]) -> Float[ndarray, "b a 3"]:
    """Points of the body without the jumps that their steps have at the ends of flats: after such a jump a
    spline oscillates, and may turn over."""
    wide = int(4 * SMOOTHING)
    over_poles = np.pad(grid, ((wide, wide), (0, 0), (0, 0)), mode="reflect", reflect_type="odd")
    smooth = gaussian_filter1d(gaussian_filter1d(over_poles, SMOOTHING, axis=0), SMOOTHING, axis=1, mode="wrap")[
        wide:-wide
    ]
    return body.closest_points(smooth.reshape(-1, 3)).reshape(grid.shape)


def _knot_density(grid: Float[ndarray, "b a 3"]) -> Float[ndarray, " b"]:
    """The density of knots along the first index that makes the error of a fit even: the root of the largest
    second difference there."""
    second = np.linalg.norm(np.diff(grid, 2, axis=0), axis=2).max(1)
    density = np.sqrt(np.concatenate([second[:1], second, second[-1:]]))
    return np.maximum(density, LEAST_DENSITY * density.mean())


def _knots_by_density(density: Float[ndarray, " b"], count: int) -> Float[ndarray, " k"]:
    """The ends of `count` intervals of [0, 1], each with the same share of the density."""
    share = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
    return np.interp(np.linspace(0, share[-1], count + 1), share, np.linspace(0, 1, len(density)))


def _places_between(knots: Float[ndarray, " k"], count: int) -> Float[ndarray, " n"]:
    """The last knot, and before it `count` evenly spaced places from each knot on."""
    return np.interp(np.arange(count * (len(knots) - 1) + 1) / count, np.arange(len(knots)), knots)


def _fit(
    bodies: Sequence[Stock],
    capsules: Sequence[Capsule],
    s_knots: Float[ndarray, " a"],
    t_knots: Float[ndarray, " b"],
    smooth: bool,
) -> list[TSpline]:
    """The surfaces of the bodies on the T-mesh with these knots, by least squares; `smooth` fits them to
    points whose steps are smoothed."""
    rows = len(t_knots) + 2
    clamped = np.concatenate([np.zeros(3), t_knots, np.ones(3)])
    tmesh = RowTMesh.from_rows(clamped, [np.zeros(1), *[s_knots] * (rows - 2), np.zeros(1)])
    spline = TSpline(tmesh, np.zeros((tmesh.size, 3)), np.ones(tmesh.size))
    s = _places_between(np.append(s_knots, 1.0), SAMPLES)[:-1]
    t = _places_between(t_knots, SAMPLES)
    ss, tt = (v.ravel() for v in np.meshgrid(s, t))
    R = spline.basis(ss, tt)[0]
    weighted = sp.csr_array(R.T @ sp.diags_array(np.where((tt == 0) | (tt == 1), POLE_WEIGHT, 1.0)))
    fit = factorise(sp.csc_array(weighted @ R))
    grids = [_points_of_body(body, capsule, s, t) for body, capsule in zip(bodies, capsules)]
    targets = [(_smooth(body, grid) if smooth else grid).reshape(-1, 3) for body, grid in zip(bodies, grids)]
    return [spline.with_control_points(fit.solve(np.asarray(weighted @ target))) for target in targets]


def _largest_distance(body: Stock, surface: TSpline) -> tuple[float, Float[ndarray, "3"]]:
    """How far the surface is off the body at most, at places of every patch and at the poles, and where."""
    assert isinstance(surface.tmesh, RowTMesh)
    s = _places_between(np.append(surface.tmesh.s_knots[1], 1.0), 2 * CHECKS)
    t = _places_between(surface.tmesh.t_knots[3:-3], 2 * CHECKS)
    ss, tt = np.meshgrid(s[1::2], np.concatenate([t[:1], t[1::2], t[-1:]]))
    points = surface.positions(ss.ravel(), tt.ravel())
    distance = np.abs(body.signed_distance(points))
    worst = int(np.argmax(distance))
    return float(distance[worst]), points[worst]
