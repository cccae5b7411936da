"""Small parts and tool paths for every stage."""

from collections.abc import Callable
from functools import cache, lru_cache

import numpy as np
from numpy import ndarray

from bonecam.job import HoldingJob, ToolJob
from bonecam.levels import MorphLevel, PartLevel
from bonecam.levels.measure import NO_CUT
from bonecam.machine.bodies import Frustum
from bonecam.mesh import TriangleMesh
from bonecam.setup import Capsule
from bonecam.surface import RowTMesh, TSpline
from bonecam.tool import Cutter, MoveKind, ToolPath


def revolved(
    radius: Callable[[ndarray, ndarray], ndarray],
    low: float = 31.0,
    high: float = 43.0,
    rows: int = 12,
    around: int = 12,
) -> TSpline:
    """A closed T-spline about Z with control points at `radius`(height share 0..1, azimuth) and heights from
    `low` to `high` (mm); the first and the last row are poles."""
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


PAINTED_PLY = """ply
format ascii 1.0
comment TextureFile {}
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
property list uchar float texcoord
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2 6 0 0 1 0 0 1
"""
"""A PLY file of one triangle whose texture is the file {}."""


@cache
def pebble(extra: float = 0.0) -> TSpline:
    """Makes a smooth convex lump about 8 mm wide and 12 mm high, larger by about `extra` (mm); the same one each time,
    with all that was computed of it."""
    return revolved(
        lambda share, azimuth: (
            (3.6 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 2, 0)) + 0.8 + extra) * (1 + 0.1 * np.cos(2 * azimuth))
        ),
        31.0 - extra,
        43.0 + extra,
    )


@cache
def grooved_pebble(depth: float, extra: float = 0.0) -> TSpline:
    """Makes a lump with a groove of about `depth` round its middle, larger by about `extra` (mm); the same one each
    time."""

    def radius(share: ndarray, azimuth: ndarray) -> ndarray:
        full = 3.6 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 2, 0)) + 0.8 + extra
        return full - depth * np.exp(-(((share - 0.5) / 0.08) ** 2)) + 0 * azimuth

    return revolved(radius, 31.0 - extra, 43.0 + extra, rows=28)


@lru_cache(maxsize=32)
def mesh_of(surface: TSpline, around: int = 96, along: int = 120) -> TriangleMesh:
    """Makes the closed outward grid mesh of a closed surface, its vertices on the surface; the same one each time."""
    s, t = (v.ravel() for v in np.meshgrid(np.arange(around) / around, np.linspace(0, 1, along + 1)[1:-1]))
    points = np.vstack([surface.evaluate(s, t), surface.evaluate(np.zeros(2), np.array([0.0, 1.0]))])
    index = np.arange(len(s)).reshape(along - 1, around)
    following = np.roll(index, -1, axis=1)
    a, b, c, d = (v.ravel() for v in (index[:-1], following[:-1], following[1:], index[1:]))
    bottom = np.column_stack([np.full(around, len(s)), following[0], index[0]])
    top = np.column_stack([np.full(around, len(s) + 1), index[-1], following[-1]])
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d]), bottom, top])
    return TriangleMesh(points, faces.astype(np.int32))


def level_of(surface: TSpline, index: int = 0, limit: float = 0.0) -> PartLevel | MorphLevel:
    """Makes a level without measures of a surface."""
    mesh = mesh_of(surface)
    return MorphLevel(index, surface, mesh, limit, NO_CUT) if index else PartLevel(surface, mesh, NO_CUT)


UPRIGHT_CAPSULE = Capsule(np.array([0.0, 0.0, 36.0]), np.array([0.0, 0.0, 38.0]), 6.6)
"""A stock that holds the pebbles."""


ROUGHING_CUTTER = Cutter.from_job(1, "roughing", ToolJob(spindle=4500.0, feed=900.0))


FINISHING_CUTTER = Cutter.from_job(
    2,
    "finishing",
    ToolJob(radius=1.0, flute_length=4.0, shank_diameter=2.0, overhang=25.0, scallop=0.01, spindle=4500.0, feed=900.0),
)
"""A ball of 2 mm diameter on a straight shank."""
HOLDING = HoldingJob(diameter=2.0, length=30.0)
"""A post of 2 mm under the part."""


CAPSULE_BOTTOM, CAPSULE_TOP, CAPSULE_RADIUS = 45.0, 65.0, 5.0


PATH_CAPSULE = CAPSULE_BOTTOM, CAPSULE_TOP, CAPSULE_RADIUS
"""The upright capsule that `capsule_path` cuts: heights of its two centres and its radius (mm)."""


HOLDER = (Frustum(50.0, 20.0, 20.0),)


def ball_cutter(number: int = 1, radius: float = 1.0) -> Cutter:
    return Cutter(number, "ball", radius, 4 * radius, 2 * radius, 25.0, HOLDER, 12000.0, 900.0, 0.02)


def capsule_points(turns: float, count: int, offset: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals on a spiral from the lower cap's side to the top pole of a capsule about Z."""
    radius = CAPSULE_RADIUS + offset
    low, arc = -0.2 * radius, 0.97 * np.pi / 2 * radius
    along = np.linspace(low, CAPSULE_TOP - CAPSULE_BOTTOM + arc, count)
    angle = 2 * np.pi * turns * np.linspace(0, 1, count)
    lower, upper = (np.clip(along, None, 0) / radius, np.clip(along - (CAPSULE_TOP - CAPSULE_BOTTOM), 0, None) / radius)
    slope = lower + upper
    normals = np.column_stack([np.cos(slope) * np.cos(angle), np.cos(slope) * np.sin(angle), np.sin(slope)])
    centres = np.column_stack([np.zeros((count, 2)), CAPSULE_BOTTOM + np.clip(along, 0, CAPSULE_TOP - CAPSULE_BOTTOM)])
    return centres + radius * normals, normals


def capsule_path(
    level: int = 0,
    radius: float = 1.0,
    number: int = 1,
    offset: float = 0.0,
    turns: float = 6.0,
    count: int = 900,
    lift_deg: float = 30.0,
) -> ToolPath:
    """Makes a helix round the upright capsule in three passes joined by a link and a rapid; the axis is the
    normal turned upwards by `lift_deg` at most."""
    contacts, normals = capsule_points(turns, count, offset)
    centres = contacts + radius * normals
    up = np.array([0.0, 0.0, 1.0])
    flat = up - (normals @ up)[:, None] * normals
    lean = np.radians(lift_deg) * np.linalg.norm(flat, axis=1)[:, None]
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    axes = np.cos(lean) * normals + np.sin(lean) * flat
    tips = centres - radius * axes
    third = count // 3
    rows, kinds, passes, feeds = [], [], [], []

    def add(tip: np.ndarray, axis: np.ndarray, kind: MoveKind, index: int, feed: float) -> None:
        rows.append((tip, axis))
        kinds.append(kind)
        passes.append(index)
        feeds.append(feed)

    for index in range(3):
        part = range(index * third, (index + 1) * third if index < 2 else count)
        first, last = part[0], part[-1]
        add(tips[first] + 12 * axes[first], axes[first], MoveKind.RAPID, -1, 10000.0)
        add(tips[first] + 2 * axes[first], axes[first], MoveKind.LINK, -1, 1500.0)
        for i in part:
            add(tips[i], axes[i], MoveKind.CUT, index, 900.0)
        add(tips[last] + 2 * axes[last], axes[last], MoveKind.LINK, -1, 1500.0)
        add(tips[last] + 12 * axes[last], axes[last], MoveKind.RAPID, -1, 10000.0)
    return path_of(
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        kinds=np.array(kinds, dtype=np.int64),
        passes=np.array(passes, dtype=np.int64),
        feeds=np.array(feeds),
        tool=ball_cutter(number, radius),
        level=level,
    )


def path_of(tips, axes, kinds=None, passes=None, feeds=None, tool=None, level=0) -> ToolPath:
    """Makes a tool path of given tips and axes; one pass of cuts begun by a rapid where nothing else is said."""
    n = len(tips)
    nan = np.full((n, 3), np.nan)
    if kinds is None:
        kinds = np.full(n, int(MoveKind.CUT))
        kinds[0] = MoveKind.RAPID
    return ToolPath(
        level=level,
        cutter=tool or ball_cutter(),
        kinds=kinds,
        pass_index=np.where(kinds == MoveKind.CUT, 0, -1) if passes is None else passes,
        parameters=nan[:, :2],
        contacts=nan,
        tips=np.asarray(tips, dtype=float),
        axes=np.asarray(axes, dtype=float),
        feed_rates=np.where(kinds == MoveKind.RAPID, 10000.0, 900.0) if feeds is None else feeds,
        uncut=np.zeros((0, 3)),
        reasons=(),
    )
