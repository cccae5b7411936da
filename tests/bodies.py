"""Small closed T-splines about the Z axis, standing over a post, for tests of tool paths and axes."""

from collections.abc import Callable

import numpy as np
from numpy import ndarray

from bonecam.job import FINISHING, ROUGHING, HoldingJob
from bonecam.levels.measure.level import Level
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Capsule
from bonecam.surface.tmesh.rows import RowTMesh
from bonecam.surface.tspline import TSpline
from bonecam.toolpath.cutter import Cutter

ROUGH, FINE = Cutter.from_job(1, "roughing", ROUGHING), Cutter.from_job(2, "finishing", FINISHING)
HOLDING = HoldingJob(diameter=2.0, length=30.0)


def body(
    radius: Callable[[ndarray, ndarray], ndarray],
    low: float = 31.0,
    high: float = 43.0,
    rows: int = 12,
    around: int = 12,
) -> TSpline:
    """Control points at `radius`(height share 0..1, azimuth), heights from `low` to `high`; the first and
    last row are poles."""
    t = np.r_[[0.0] * 4, np.linspace(0, 1, rows - 2)[1:-1], [1.0] * 4]
    share = np.array([t[j + 1 : j + 4].mean() for j in range(rows)])
    knots = [np.zeros(1)] + [np.arange(around) / around] * (rows - 2) + [np.zeros(1)]
    points = []
    for j, row in enumerate(knots):
        azimuth = 2 * np.pi * row
        r = radius(np.full(len(row), share[j]), azimuth)
        r = r * 0 if len(row) == 1 else r
        points.append(
            np.column_stack(
                [r * np.cos(azimuth), r * np.sin(azimuth), np.full(len(row), low + share[j] * (high - low))]
            )
        )
    points[1][:, 2], points[-2][:, 2] = low, high
    return TSpline(RowTMesh.from_rows(t, knots), np.vstack(points), np.ones(sum(map(len, knots))))


def pebble(extra: float = 0.0) -> TSpline:
    """A smooth convex lump about 8 mm wide and 12 mm high, grown by about `extra`."""
    return body(
        lambda share, azimuth: (
            (3.6 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 2, 0)) + 0.8 + extra)
            * (1 + 0.1 * np.cos(2 * azimuth))
        ),
        31.0 - extra,
        43.0 + extra,
    )


def waist(depth: float, extra: float = 0.0) -> TSpline:
    """A lump with a groove of about `depth` round its middle."""

    def radius(share: ndarray, azimuth: ndarray) -> ndarray:
        full = 3.6 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 2, 0)) + 0.8 + extra
        return full - depth * np.exp(-(((share - 0.5) / 0.08) ** 2)) + 0 * azimuth

    return body(radius, 31.0 - extra, 43.0 + extra, rows=28)


def mesh_of(surface: TSpline, around: int = 96, along: int = 120) -> TriangleMesh:
    """A closed outward grid mesh with its vertices on the surface."""
    s, t = (v.ravel() for v in np.meshgrid(np.arange(around) / around, np.linspace(0, 1, along + 1)[1:-1]))
    points = np.vstack([surface.evaluate(s, t), surface.evaluate(np.zeros(2), np.array([0.0, 1.0]))])
    index = np.arange(len(s)).reshape(along - 1, around)
    following = np.roll(index, -1, axis=1)
    a, b, c, d = (v.ravel() for v in (index[:-1], following[:-1], following[1:], index[1:]))
    bottom = np.column_stack([np.full(around, len(s)), following[0], index[0]])
    top = np.column_stack([np.full(around, len(s) + 1), index[-1], following[-1]])
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d]), bottom, top])
    return TriangleMesh(points, faces.astype(np.int32))


def stock() -> Capsule:
    """A capsule that holds the bodies."""
    return Capsule(np.array([0.0, 0.0, 36.0]), np.array([0.0, 0.0, 38.0]), 6.6)


def level_of(surface: TSpline, index: int = 0, limit: float = 0.0) -> Level:
    """A level without measures."""
    return Level(index, surface, mesh_of(surface), limit, 0.0, 0.0, 0.0, 0)
