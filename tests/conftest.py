"""Data beside the checkout, small parts and tool paths for every stage, and the run-time check of array shapes."""

from collections.abc import Callable
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest
from numpy import ndarray
from run_time_types import check_stages

STAGES = [
    *"machine tool mesh workholding setup surface levels material mechanics planning nc verify".split(),
    *"report.page report.sheet report.pictures report.summary report.axis_comparison".split(),
]
hypothesis.settings.register_profile("bonecam", deadline=None)  # other work on the machine takes time too
hypothesis.settings.load_profile("bonecam")
check_stages([f"bonecam.{stage}" for stage in STAGES])

from bonecam.job import HoldingJob, ToolJob  # noqa: E402
from bonecam.levels.measure import NO_CUT, MorphLevel, PartLevel  # noqa: E402
from bonecam.machine.bodies import Frustum  # noqa: E402
from bonecam.mesh.triangle_mesh import TriangleMesh  # noqa: E402
from bonecam.setup.capsule import Capsule  # noqa: E402
from bonecam.surface.tmesh import RowTMesh  # noqa: E402
from bonecam.surface.tspline import TSpline  # noqa: E402
from bonecam.tool.cutter import Cutter  # noqa: E402
from bonecam.tool.path import MoveKind, ToolPath  # noqa: E402

pytest_plugins = ["tests.machine.chains"]
SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    if not (SHARED / "meshes").is_dir():
        pytest.skip("the measuring data beside the checkout (../shared) is absent")
    return SHARED


def surface_of_revolution(
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


@pytest.fixture(scope="session")
def revolved() -> Callable[..., TSpline]:
    """Makes a closed T-spline about Z from a radius by height share and azimuth."""
    return surface_of_revolution


@pytest.fixture(scope="session")
def painted_ply() -> str:
    """A PLY file of one triangle whose texture is the file {}."""
    return """ply
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


@pytest.fixture(scope="session")
def pebble() -> Callable[..., TSpline]:
    """Makes a smooth convex lump about 8 mm wide and 12 mm high, larger by about `extra` (mm); the same one each time,
    with all that was computed of it."""

    @cache
    def build(extra: float = 0.0) -> TSpline:
        return surface_of_revolution(
            lambda share, azimuth: (
                (3.6 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 2, 0)) + 0.8 + extra) * (1 + 0.1 * np.cos(2 * azimuth))
            ),
            31.0 - extra,
            43.0 + extra,
        )

    return build


@pytest.fixture(scope="session")
def grooved_pebble() -> Callable[..., TSpline]:
    """Makes a lump with a groove of about `depth` round its middle, larger by about `extra` (mm); the same one each
    time."""

    @cache
    def build(depth: float, extra: float = 0.0) -> TSpline:
        def radius(share: ndarray, azimuth: ndarray) -> ndarray:
            full = 3.6 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 2, 0)) + 0.8 + extra
            return full - depth * np.exp(-(((share - 0.5) / 0.08) ** 2)) + 0 * azimuth

        return surface_of_revolution(radius, 31.0 - extra, 43.0 + extra, rows=28)

    return build


@pytest.fixture(scope="session")
def mesh_of() -> Callable[..., TriangleMesh]:
    """Makes the closed outward grid mesh of a closed surface, its vertices on the surface; the same one each time."""

    @lru_cache(maxsize=32)
    def build(surface: TSpline, around: int = 96, along: int = 120) -> TriangleMesh:
        s, t = (v.ravel() for v in np.meshgrid(np.arange(around) / around, np.linspace(0, 1, along + 1)[1:-1]))
        points = np.vstack([surface.evaluate(s, t), surface.evaluate(np.zeros(2), np.array([0.0, 1.0]))])
        index = np.arange(len(s)).reshape(along - 1, around)
        following = np.roll(index, -1, axis=1)
        a, b, c, d = (v.ravel() for v in (index[:-1], following[:-1], following[1:], index[1:]))
        bottom = np.column_stack([np.full(around, len(s)), following[0], index[0]])
        top = np.column_stack([np.full(around, len(s) + 1), index[-1], following[-1]])
        faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d]), bottom, top])
        return TriangleMesh(points, faces.astype(np.int32))

    return build


@pytest.fixture(scope="session")
def level_of(mesh_of: Callable[..., TriangleMesh]) -> Callable[..., PartLevel | MorphLevel]:
    """Makes a level without measures of a surface."""

    def build(surface: TSpline, index: int = 0, limit: float = 0.0) -> PartLevel | MorphLevel:
        mesh = mesh_of(surface)
        return MorphLevel(index, surface, mesh, limit, NO_CUT) if index else PartLevel(surface, mesh, NO_CUT)

    return build


@pytest.fixture(scope="session")
def upright_capsule() -> Capsule:
    """A stock that holds the pebbles."""
    return Capsule(np.array([0.0, 0.0, 36.0]), np.array([0.0, 0.0, 38.0]), 6.6)


@pytest.fixture(scope="session")
def roughing_cutter() -> Cutter:
    return Cutter.from_job(1, "roughing", ToolJob(spindle=4500.0, feed=900.0))


@pytest.fixture(scope="session")
def finishing_cutter() -> Cutter:
    """A ball of 2 mm diameter on a straight shank."""
    shape = {"radius": 1.0, "flute_length": 4.0, "shank_diameter": 2.0, "overhang": 25.0, "scallop": 0.01}
    return Cutter.from_job(2, "finishing", ToolJob(**shape, spindle=4500.0, feed=900.0))


@pytest.fixture(scope="session")
def holding() -> HoldingJob:
    """A post of 2 mm under the part."""
    return HoldingJob(diameter=2.0, length=30.0)


CAPSULE_BOTTOM, CAPSULE_TOP, CAPSULE_RADIUS = 45.0, 65.0, 5.0


@pytest.fixture(scope="session")
def path_capsule() -> tuple[float, float, float]:
    """The upright capsule that `capsule_path` cuts: heights of its two centres and its radius (mm)."""
    return CAPSULE_BOTTOM, CAPSULE_TOP, CAPSULE_RADIUS


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


@pytest.fixture(scope="session")
def capsule_path(path_of: Callable[..., ToolPath]) -> Callable[..., ToolPath]:
    """Makes a helix round the upright capsule in three passes joined by a link and a rapid; the axis is the
    normal turned upwards by `lift_deg` at most."""

    def build(
        level: int = 0,
        radius: float = 1.0,
        number: int = 1,
        offset: float = 0.0,
        turns: float = 6.0,
        count: int = 900,
        lift_deg: float = 30.0,
    ) -> ToolPath:
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

    return build


@pytest.fixture(scope="session")
def path_of() -> Callable[..., ToolPath]:
    """Makes a tool path of given tips and axes; one pass of cuts begun by a rapid where nothing else is said."""

    def build(tips, axes, kinds=None, passes=None, feeds=None, tool=None, level=0) -> ToolPath:
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

    return build


@pytest.fixture(scope="session")
def deepest_entry() -> Callable[..., ndarray]:
    """Tells how deep (mm) a cutter is in what it must stay out of in a scene, with these ball centres and axes:
    the balls in it about its axis and points of its ends, with open3d's own distances to the meshes. The ball's half
    that cuts is left out."""
    import open3d as o3d

    @lru_cache(maxsize=4)
    def rays(mesh: TriangleMesh) -> Any:
        scene = o3d.t.geometry.RaycastingScene()
        scene.add_triangles(
            o3d.core.Tensor(mesh.vertices.astype(np.float32)), o3d.core.Tensor(mesh.faces.astype(np.uint32))
        )
        return scene

    def signed(mesh: TriangleMesh, points: ndarray) -> ndarray:
        scene = rays(mesh)
        found = scene.compute_signed_distance(o3d.core.Tensor(points.astype(np.float32))).numpy().astype(float)
        # one ray may run through an edge: what is said to be inside is asked again by eleven
        inside = np.flatnonzero(found < 0)
        again = o3d.core.Tensor(points[inside].astype(np.float32))
        found[inside] = scene.compute_signed_distance(again, nsamples=11).numpy()
        return found

    def deepest(scene: Any, cutter: Cutter, centres: ndarray, axes: ndarray) -> ndarray:
        side = np.where(np.abs(axes[:, :1]) < 0.9, np.array([[1.0, 0, 0]]), np.array([[0.0, 1, 0]]))
        x = np.cross(side, axes)
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        frames = np.stack([x, np.cross(axes, x), axes], axis=2)
        worst = np.full(len(axes), -np.inf)
        angle = np.arange(24) * (np.pi / 12)
        rim = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
        for section in cutter.profile:
            start, end = section.start, section.end
            discs = [f * section.radius * rim + [0, 0, start] for f in (0.2, 0.5, 0.8, 1.0)]
            discs += [section.radius * rim + [0, 0, min(start + f * section.radius, end)] for f in (0.3, 0.6)]
            discs.append(section.end_radius * rim + [0, 0, end])
            count = max(3, int(8 * (end - start) / max(section.radius, section.end_radius)))
            along = np.linspace(start, end, count)
            radius = section.radius + section.taper * (along - start)
            balls = np.minimum(radius / np.hypot(1, section.taper), np.minimum(along - start, end - along))
            points = np.vstack([*discs, along[:, None] * [0, 0, 1.0]]) - [0, 0, cutter.radius]
            thick = np.concatenate([np.zeros(len(discs) * len(rim)), balls])
            placed = (np.einsum("nij,kj->nki", frames, points) + centres[:, None]).reshape(-1, 3)
            around = scene.around(section.name, cutter.radius)
            distance = scene.stock.signed_distance(placed)
            near = distance < np.tile(thick, len(axes)) + 0.5
            distance[near] = signed(around.mesh, placed[near])
            for column in around.columns:
                distance = np.minimum(distance, column.distance(placed))
            if scene.clamping.closed:
                distance = np.minimum(distance, placed[:, 2] - scene.clamping.clearance)
            worst = np.maximum(worst, (thick - distance.reshape(len(axes), -1)).max(axis=1))
        return worst

    return deepest
