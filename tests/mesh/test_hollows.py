""""""

from itertools import pairwise

import numpy as np
import pytest
from mesh_bodies import ellipsoid, solid

from bonecam.job import Job, MeshJob
from bonecam.mesh import TriangleMesh, fill_pits, prepare_part, self_intersections
from bonecam.mesh.hollows import CHORD, LEAST, SHALLOW
from bonecam.mesh.meshlab import split_edges

pytestmark = pytest.mark.whole


ROUNDING = 1e-9
SIDE = np.array([4.0, 0.0, 0.0])
"""Where the ellipsoid has its pit, mm."""
RADIUS = 1.0
SIDES = 24
MOUTH = 0.4
TOP = 15.2
PORE = [(MOUTH, TOP), (0.3, 14.8), (1.0, 14.0), (1.0, 13.0)]
"""A pore in the upper end: wider inside than at its mouth."""


@pytest.fixture(scope="module")
def bone():
    return ellipsoid(5, 4, 14, rings=60, columns=80)


fine = ellipsoid(4, 3, 4, rings=60, columns=120)


def pitted(width: float, depth: float) -> TriangleMesh:
    """Makes an ellipsoid with a pit in its side at SIDE, about `width` mm wide and `depth` mm deep."""
    v = np.array(fine.vertices)
    away = np.linalg.norm(v - SIDE, axis=1) / (width / 2)
    v[:, 0] -= depth * np.exp(-(away**4))
    return solid(v, fine.faces)


@pytest.fixture(scope="module")
def pored():
    return turned([(3, 5), (4, 7), (4, 13), (3, 15), *PORE], SIDES)


@pytest.fixture(scope="module")
def groove():
    return fill_pits(split_edges(grooved(90, 1.0, 4, 16), 3.0), 1.0)


def turned(outline: list[tuple[float, float]], sides: int = 24) -> TriangleMesh:
    """A body turned about Z from an outline of (radius, height), between two poles on the axis."""
    angles = 2 * np.pi * np.arange(sides) / sides
    rings = [np.column_stack([r * np.cos(angles), r * np.sin(angles), np.full(sides, z)]) for r, z in outline]
    low, high = outline[0][1] - 1.0, outline[-1][1] + 1.0
    vertices = np.vstack([*rings, [[0, 0, low], [0, 0, high]]])
    faces = []
    for i in range(sides):
        j = (i + 1) % sides
        for k in range(len(outline) - 1):
            a, b, c, d = k * sides + i, k * sides + j, (k + 1) * sides + j, (k + 1) * sides + i
            faces += [(a, b, c), (a, c, d)]
        top = (len(outline) - 1) * sides
        faces += [(j, i, len(vertices) - 2), (top + i, top + j, len(vertices) - 1)]
    return TriangleMesh(vertices, np.array(faces, dtype=np.int32))


def grooved(angle_deg: float, depth: float, radius: float, sides: int) -> TriangleMesh:
    """A turned body of this radius with a V groove of this opening angle round it, at height 0."""
    half = depth * np.tan(np.radians(angle_deg) / 2)
    upper = [(radius, half), (radius, half + 2), (radius - 1, half + 3)]
    lower = [(r, -height) for r, height in reversed(upper)]
    return turned([*lower, (radius - depth, 0), *upper], sides)


def left_by_ball(angle_deg: float, depth: float, radius: float) -> float:
    """How far a ball that lies in a straight V groove stays off its bottom, mm."""
    half = np.radians(angle_deg) / 2
    width = depth * np.tan(half)
    if radius * np.cos(half) <= width:
        return float(radius / np.sin(half) - radius)
    return float(depth - radius + np.sqrt(radius**2 - width**2))


def signed_distances(mesh: TriangleMesh, points: np.ndarray) -> np.ndarray:
    import igl

    return np.asarray(igl.signed_distance(points, np.array(mesh.vertices), mesh.faces.astype(np.int64))[0])


def probes_of(mesh: TriangleMesh) -> np.ndarray:
    return np.vstack([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1)])


def test_a_part_that_the_ball_reaches_everywhere_comes_back_as_it_is(bone):
    assert fill_pits(bone, 1.0).mesh is bone
    assert fill_pits(pitted(6.0, 0.5), 1.0).repairs == ()


@pytest.mark.parametrize(
    ("angle_deg", "depth", "radius", "sides"),
    [
        *[(20, 0.4, 4, 16), (20, 2.5, 4, 16), (60, 0.4, 4, 16), (60, 1.0, 4, 16)],
        *[(90, 0.4, 4, 16), (90, 2.5, 4, 16), (120, 2.5, 8, 24)],
    ],
)
def test_a_groove_is_filled_by_what_the_ball_leaves_in_it_and_nothing_moves_inward(angle_deg, depth, radius, sides):
    mesh = grooved(angle_deg, depth, radius, sides)
    fill = fill_pits(mesh, 1.0)
    expected = left_by_ball(angle_deg, depth, 1.0)
    # the groove is bent round the body, on which a ball comes deeper by a little than in a straight one
    assert expected * 0.9 - CHORD < fill.depth <= expected * 1.01
    moved = signed_distances(mesh, probes_of(fill.mesh))
    assert moved.min() > -1e-6
    assert moved.max() <= fill.depth + 1e-6
    assert fill.volume > 0
    assert not len(self_intersections(fill.mesh))
    stayed = (fill.mesh.vertices[: len(mesh.vertices)] == mesh.vertices).all(axis=1)
    assert stayed.sum() >= len(mesh.vertices) - sides


def test_a_fill_ends_where_balls_outside_the_part_lie():
    mesh = pitted(0.9, 0.8)
    filled = fill_pits(mesh, 1.0).mesh
    added = filled.vertices[signed_distances(mesh, filled.vertices) > SHALLOW]
    assert len(added) > 20
    step = 0.02
    across = np.arange(-0.8, 0.8, step)
    grid = np.stack(np.meshgrid(np.arange(4.5, 5.3, step), across, across, indexing="ij"), axis=-1).reshape(-1, 3)
    centres = grid[signed_distances(mesh, grid) >= 1.0]
    nearest = np.linalg.norm(added[:, None] - centres[None], axis=2).min(axis=1)
    assert nearest.min() > 1.0 - 1e-4
    assert nearest.max() < 1.0 + 2 * step


def test_a_narrow_pit_is_filled_to_its_rim_and_told_with_depth_area_and_volume():
    mesh = pitted(0.9, 0.8)
    fill = fill_pits(mesh, 1.0)
    assert fill.hollows == 1
    assert 0.5 < fill.depth < 0.8
    assert np.linalg.norm(np.array(fill.place) - SIDE) < 0.3
    assert 0.1 < fill.volume < 0.8
    assert "filled 1 hollow that a ball of 1 mm cannot reach" in str(fill.repairs[0])
    assert fill.repairs[0].outward == fill.depth
    assert fill.repairs[0].inward == 0


def test_nothing_moves_beyond_the_pit_and_its_rim():
    mesh = pitted(0.9, 0.8)
    filled = fill_pits(mesh, 1.0).mesh
    far = np.linalg.norm(mesh.vertices - SIDE, axis=1) > 1.5
    assert (filled.vertices[: len(mesh.vertices)][far] == mesh.vertices[far]).all()


def test_an_undercut_groove_all_the_way_round_is_left_open_and_told():
    rims = [(4, 9.6), (3.4, 9.2), (3.0, 10), (3.4, 10.8), (4, 10.4)]
    mesh = turned([(3, 5), (4, 7), *rims, (4, 13), (3, 15)], 12)
    fill = fill_pits(mesh, 1.0)
    assert fill.mesh is mesh
    assert (fill.hollows, fill.open) == (0, 1)
    assert "left 1 hollow that a ball of 1 mm cannot reach open" in str(fill.repairs[0])


def test_an_undercut_pore_is_closed_over_at_its_mouth_as_deep_as_the_ball_goes(pored):
    mesh = pored
    fill = fill_pits(mesh, RADIUS)
    assert (fill.hollows, fill.open) == (1, 0)
    assert not len(self_intersections(fill.mesh))
    near_axis = np.linalg.norm(probes_of(fill.mesh)[:, :2], axis=1) < 0.1
    deepest = TOP - (RADIUS - np.sqrt(RADIUS**2 - MOUTH**2))
    found = probes_of(fill.mesh)[near_axis & (probes_of(fill.mesh)[:, 2] > 10), 2]
    assert len(found)
    assert np.abs(found - deepest).max() < SHALLOW + CHORD


def test_a_capped_pore_takes_nothing_off_the_part_and_is_told_with_its_depth_and_volume(pored):
    mesh = pored
    fill = fill_pits(mesh, RADIUS)
    assert signed_distances(mesh, probes_of(fill.mesh)).min() > -1e-6
    rings = [(0.0, 14.0), *reversed(PORE)]
    area = SIDES / 2 * np.sin(2 * np.pi / SIDES)  # of a ring of radius 1
    frustums = [(z - y) * area * (q**2 + q * r + r**2) / 3 for (q, y), (r, z) in pairwise(rings)]
    assert fill.volume == pytest.approx(sum(frustums), abs=0.05)  # but for the lens that the ball reaches
    assert fill.depth > 2.0


def test_a_smaller_ball_goes_in():
    mesh = pitted(1.6, 0.8)
    assert fill_pits(mesh, 0.2).repairs == ()
    assert fill_pits(mesh, 1.5).repairs


def test_pits_are_filled_up_to_the_smallest_ball_of_the_job():
    mesh = pitted(1.6, 0.6)
    job = Job()
    assert job.smallest_ball == job.finishing.radius
    fine = job.with_values(path={"fine_cutter": True})
    assert fine.smallest_ball == job.fine.radius
    for ball in (0.2, 1.5):
        part = prepare_part(mesh, MeshJob(), ball=ball)
        assert part.fill is not None
        assert part.fill.radius == ball


@pytest.mark.parametrize("change", ["split", "moved", "turned", "jittered"])
def test_the_same_surface_is_filled_alike_however_it_is_meshed_and_lies(groove, change):
    mesh, before = split_edges(grooved(90, 1.0, 4, 16), 3.0), groove
    turn, shift = np.eye(3), np.zeros(3)
    other = mesh
    if change == "split":
        other = split_edges(mesh, 1.1)
    elif change == "moved":
        shift = np.array([1000.0, -400.0, 20.0])
    elif change == "turned":
        turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
    else:
        noise = np.random.default_rng(2).uniform(-1e-7, 1e-7, mesh.vertices.shape)
        other = TriangleMesh(mesh.vertices + noise, mesh.faces)
    other = TriangleMesh(other.vertices @ turn.T + shift, other.faces)
    after = fill_pits(other, 1.0)
    back = TriangleMesh((after.mesh.vertices - shift) @ turn, after.mesh.faces)
    assert after.depth == pytest.approx(before.depth, abs=1e-3)
    assert after.volume == pytest.approx(before.volume, rel=0.01)
    # facets of both lie within CHORD of the ball, and margins that are shallower than SHALLOW stay
    assert np.abs(signed_distances(before.mesh, probes_of(back))).max() < SHALLOW + 2 * CHORD


def test_shallow_facets_are_no_pits():
    coarse = turned([(6, 0), (8, 3), (8.2, 8), (8, 14), (6, 20)], sides=10)
    assert fill_pits(coarse, 1.0).repairs == ()
    assert LEAST > SHALLOW > ROUNDING
