"""Cutters of any profile touch where they are placed, and sweep as wide as they say: against distances of their own."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mill import CuttingProfile, Mill, ball, bull, drum, flat
from scipy.spatial import KDTree

from bonecam.errors import ToolPathError
from bonecam.job import Job
from bonecam.machine.bodies import Frustum
from bonecam.planning import side_step
from bonecam.tool import Cutter

HEIGHT = 12.0
PROFILES = {"ball": ball(2.0), "flat": flat(2.0), "bull": bull(2.0, 0.5), "drum": drum(3.0, 20.0, 1.0, over=0.1)}


def mill(profile: CuttingProfile) -> Mill:
    return Mill(profile, HEIGHT, 4.0, 30.0, (Frustum(20.0, 16.0, 24.0),), neck=(1.8, 6.0))


def ball_distance(r: np.ndarray, h: np.ndarray) -> np.ndarray:
    """To a capsule's lower end and its cylinder."""
    return np.hypot(r, h - np.clip(h, 2.0, HEIGHT)) - 2.0


def flat_distance(r: np.ndarray, h: np.ndarray) -> np.ndarray:
    """To a cylinder, as the distance of a box in the half plane."""
    out = np.stack([r - 2.0, np.abs(h - HEIGHT / 2) - HEIGHT / 2])
    return np.linalg.norm(np.maximum(out, 0), axis=0) + np.minimum(out.max(0), 0)


def bull_distance(r: np.ndarray, h: np.ndarray) -> np.ndarray:
    """To the same cylinder with edges rounded by 0.5 (also above, where nothing is asked)."""
    out = np.stack([r - 1.5, np.abs(h - HEIGHT / 2) - (HEIGHT / 2 - 0.5)])
    return np.linalg.norm(np.maximum(out, 0), axis=0) + np.minimum(out.max(0), 0) - 0.5


@cache
def drum_outline() -> KDTree:
    """The outline of nose ball and barrel, sampled: a ball of 1 mm inside a circle of 20 mm that bulges to 3 mm."""
    top = np.sqrt(19.0**2 - 17.0**2) + 1.0
    t = np.linspace(0, np.pi, 200_001)
    barrel = np.column_stack([20 * np.sin(t) - 17, top - 20 * np.cos(t)])
    nose = np.column_stack([np.sin(t), 1 - np.cos(t)])
    joint = 1 - np.sqrt(1 - (17 / 19) ** 2)
    barrel = barrel[(barrel[:, 1] > joint) & (barrel[:, 1] < top + 20 * np.sin(0.1))]
    outline = np.vstack([nose[nose[:, 1] < joint], barrel[barrel[:, 0] > 0]])
    return KDTree(outline)


def drum_distance(r: np.ndarray, h: np.ndarray) -> np.ndarray:
    """To the sampled outline, without a sign."""
    return drum_outline().query(np.column_stack([r, h]))[0]


DISTANCES: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "ball": ball_distance,
    "flat": flat_distance,
    "bull": bull_distance,
    "drum": drum_distance,
}


def unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def half_plane(points: np.ndarray, tip: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    away = points - tip
    h = away @ axis
    return np.linalg.norm(np.cross(away, axis), axis=1), h


poses = st.tuples(st.sampled_from(sorted(PROFILES)), st.floats(0.02, 1.5), st.integers(0, 2**32 - 1))


def posed(angle: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A contact, a normal, and an axis that leans from it by the angle."""
    rng = np.random.default_rng(seed)
    contact, normal = rng.normal(size=3), unit(rng.normal(size=3))
    beside = unit(np.cross(normal, rng.normal(size=3)))
    return contact, normal, np.cos(angle) * normal + np.sin(angle) * beside


@settings(max_examples=60)
@given(poses)
def test_the_contact_is_on_the_cutter_and_the_plane_through_it_is_not_cut(pose: tuple) -> None:
    name, angle, seed = pose
    contact, normal, axis = posed(angle, seed)
    placed = mill(PROFILES[name]).place(contact[None], normal[None], axis[None])
    tip = placed.tips[0]
    on = DISTANCES[name](*half_plane(contact[None], tip, axis))
    assert abs(on[0]) < (2e-4 if name == "drum" else 1e-9)
    # the support of the body along the normal, from its outline: nothing lies below the tangent plane
    cosine, sine = np.cos(angle), np.sin(angle)
    lowest = {"ball": 2 * cosine - 2.0, "flat": -2 * sine, "bull": 0.5 * cosine - 1.5 * sine - 0.5}
    if name in lowest:
        assert (tip - contact) @ normal + lowest[name] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", PROFILES)
def test_distances_are_those_of_the_body(name: str) -> None:
    rng = np.random.default_rng(5)
    tip, axis = rng.normal(size=3), unit(rng.normal(size=3))
    points = tip + axis * rng.uniform(-2, 8, (4000, 1)) + rng.uniform(-4, 4, (4000, 3))
    r, h = half_plane(points, tip, axis)
    low = h < (5.5 if name != "drum" else 9.0)
    found = mill(PROFILES[name]).distances(points[low], tip, axis)
    wanted = DISTANCES[name](r[low], h[low])
    near = np.abs(wanted) < 1.0
    if name == "drum":
        found = np.abs(found)
    np.testing.assert_allclose(found[near], wanted[near], atol=2e-4 if name == "drum" else 1e-9)


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize("turn", [0.0, 0.6, 1.3])
def test_a_pass_is_as_wide_as_its_effective_radius(name: str, turn: float) -> None:
    """The lowest points of the body, swept over a plane, beside the contact: depth y^2 / (2 R_eff)."""
    normal, contact = np.array([0.0, 0.0, 1.0]), np.zeros(3)
    angle = 0.35 if name != "drum" else 1.3
    axis = np.array([np.sin(angle), 0.0, np.cos(angle)])
    feed = np.array([np.cos(turn), np.sin(turn), 0.0])
    tool = mill(PROFILES[name])
    tip = tool.place(contact[None], normal[None], axis[None]).tips[0]
    radius = tool.effective_radii(normal[None], axis[None], feed[None])[0]

    beside = np.cross(normal, feed)
    step = 0.02 * radius
    heights = []
    for y in (-step, step):
        low, high = 0.0, step
        for _ in range(24):  # the height at which a line along the feed touches the body
            middle = (low + high) / 2
            along = np.linspace(-8 * step, 8 * step, 40_001)[:, None] * feed
            r, h = half_plane(y * beside + middle * normal + along, tip, axis)
            inside = _inside(name, r, h).any()
            low, high = (low, middle) if inside else (middle, high)
        heights.append(high)
    assert np.mean(heights) == pytest.approx(step**2 / (2 * radius), rel=0.03)
    cusp = side_step(radius, step**2 / (2 * radius), np.zeros(1))[0]
    assert cusp == pytest.approx(2 * step, rel=0.01)


def _inside(name: str, r: np.ndarray, h: np.ndarray) -> np.ndarray:
    if name != "drum":
        return DISTANCES[name](r, h) < 0
    top = np.sqrt(19.0**2 - 17.0**2) + 1.0
    joint = 1 - np.sqrt(1 - (17 / 19) ** 2)
    in_barrel = (np.hypot(r + 17, h - top) < 20) & (h > joint)
    return in_barrel | (np.hypot(r, h - 1) < 1)


def test_a_ball_stands_where_the_cutter_of_a_job_does() -> None:
    cutter = Cutter.from_job(1, "roughing", Job().tool("roughing"))
    contact, normal, axis = posed(0.4, 7)
    placed = mill(ball(cutter.radius)).place(contact[None], normal[None], axis[None])
    np.testing.assert_allclose(placed.centres[0], contact + cutter.radius * normal)
    np.testing.assert_allclose(placed.tips[0], contact + cutter.radius * normal - cutter.radius * axis)


def test_upright_flat_bottoms_touch_with_their_middle_and_cut_without_cusps() -> None:
    z = np.array([[0.0, 0.0, 1.0]])
    for profile in (flat(2.0), bull(2.0, 0.5)):
        tool = mill(profile)
        np.testing.assert_array_equal(tool.place(np.zeros((1, 3)), z, z).tips, np.zeros((1, 3)))
        assert tool.effective_radii(z, z, np.array([[1.0, 0.0, 0.0]]))[0] == np.inf


def test_sections_follow_one_another_to_the_holder() -> None:
    sections = mill(drum(3.0, 20.0, 1.0)).sections
    assert [section.name for section in sections] == ["cutter", "neck", "shank", "holder"]
    assert [section.start for section in sections[1:]] == [section.end for section in sections[:-1]]
    assert sections[-1].taper == pytest.approx(0.2)


@pytest.mark.parametrize(
    "make",
    [
        lambda: ball(0.0),
        lambda: flat(-1.0),
        lambda: bull(2.0, 2.0),
        lambda: drum(3.0, 2.0, 1.0),
        lambda: drum(3.0, 20.0, 1.0, over=2.0),
        lambda: Mill(ball(2.0), 1.0, 4.0, 30.0),
        lambda: Mill(ball(2.0), 8.0, 4.0, 8.0),
        lambda: Mill(ball(2.0), 8.0, 4.0, 30.0, neck=(5.0, 3.0)),
    ],
)
def test_impossible_cutters_are_refused(make: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match="give"):
        make()


def test_an_axis_that_leans_too_far_is_refused() -> None:
    with pytest.raises(ToolPathError, match=r"contact 0.*flat cutter touches up to 90"):
        mill(flat(2.0)).place(np.zeros((1, 3)), np.eye(3)[:1], -np.eye(3)[:1])
