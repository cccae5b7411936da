"""The ball that holds the end of a bull nose or flat end, and the cones that stand for its body."""

import numpy as np
import pytest
from mill import Mill, bull, flat

from bonecam.arrays import lengths
from bonecam.errors import JobError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.planning.collision import cutter_mesh
from bonecam.tool.cutter import Cutter, check_shapes, enveloping_ball, only_balls

PROFILES = {"bull": bull(2.0, 0.5), "flat": flat(2.0)}


def _cutter(shape: str = "bull", **values: float) -> Cutter:
    job = Job().with_values(roughing={"shape": shape, **values})
    return Cutter.from_job(1, "roughing", job.tool("roughing"))


@pytest.mark.parametrize(("shape", "corner"), [("bull", 0.5), ("flat", 0.0)])
@pytest.mark.parametrize("lead", np.radians([10.0, 30.0, 60.0]))
def test_the_ball_touches_where_the_cutter_does_and_has_its_effective_radius(
    shape: str, corner: float, lead: float
) -> None:
    ball = enveloping_ball(2.0, corner, lead)
    mill = Mill(PROFILES[shape], 20.0, 4.0, 30.0)
    normal, feed = np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]])
    axis = np.cos(lead) * normal + np.sin(lead) * feed
    placed = mill.place(np.zeros((1, 3)), normal, axis)
    np.testing.assert_allclose(ball.radius * normal - ball.height * axis, placed.tips, atol=1e-12)
    assert mill.effective_radii(normal, axis, feed)[0] == pytest.approx(ball.radius)


def test_the_ball_of_a_ball_end_is_its_own() -> None:
    ball = enveloping_ball(2.0, 2.0, 0.3)
    assert (ball.radius, ball.height) == (2.0, 2.0)


@pytest.mark.parametrize("shape", PROFILES)
def test_the_ball_holds_the_end_of_the_cutter(shape: str) -> None:
    cutter = _cutter(shape)
    for section in cutter.bull_end:
        for height, radius in ((section.start, section.radius), (section.end, section.end_radius)):
            assert np.hypot(height - cutter.centre_height, radius) <= cutter.envelope_radius + 1e-9


@pytest.mark.parametrize("shape", PROFILES)
def test_the_cones_touch_the_profile_and_hold_it(shape: str) -> None:
    cutter = _cutter(shape)
    mill = Mill(PROFILES[shape], cutter.flute_length, 4.0, 30.0)
    rng = np.random.default_rng(3)
    r, h = rng.uniform(0, 2.2, 4000), rng.uniform(-0.2, 8.2, 4000)
    off = mill.distances(np.column_stack([r, 0 * r, h]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    sine, cosine, bound = cutter.body.T
    held = (np.outer(r, sine) - np.outer(h - cutter.centre_height, cosine) <= bound).all(axis=1)
    assert held[off < 0].all()
    assert not held[off > 0.006].any()


@pytest.mark.parametrize("slack", [0.0, 0.01])
@pytest.mark.parametrize("shape", PROFILES)
def test_the_mesh_for_fcl_lies_inside_the_profile_by_the_slack(shape: str, slack: float) -> None:
    cutter = _cutter(shape)
    mesh = cutter_mesh(cutter, slack)
    mill = Mill(PROFILES[shape], cutter.flute_length, 4.0, 30.0)
    off = mill.distances(mesh.vertices, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    assert off[mesh.vertices[:, 2] < cutter.flute_length - 1e-6].max() == pytest.approx(-slack, abs=1e-9)
    assert (lengths(mesh.face_vectors) > 0).all()


@pytest.mark.parametrize("shape", PROFILES)
def test_a_bull_nose_or_flat_end_only_roughs_the_levels_of_a_morph(shape: str) -> None:
    machine = read_machine("mikron-ucp600")
    bull_nose = {"shape": shape}
    check_shapes(Job().with_values(roughing=bull_nose), machine)
    for values in (
        {"finishing": bull_nose},
        {"roughing": bull_nose, "path": {"strategy": "rotary"}},
        {"roughing": bull_nose, "holding": {"parting": True}},
    ):
        with pytest.raises(JobError, match="give shape = 'ball'"):
            check_shapes(Job().with_values(**values), machine)
    with pytest.raises(JobError, match="a wheel is roughed with a ball"):
        only_balls(Job().with_values(roughing=bull_nose), "a wheel")


def test_flutes_must_reach_the_middle_of_the_ball() -> None:
    with pytest.raises(JobError, match=r"roughing.lead_deg"):
        _cutter(lead_deg=8.0)


def test_a_corner_as_large_as_the_radius_is_refused() -> None:
    with pytest.raises(JobError, match="less than the radius"):
        _cutter(corner_radius=2.0)


def test_centres_and_tips_lie_the_height_of_the_ball_apart_along_each_axis() -> None:
    cutter = _cutter()
    axes = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
    tips = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    centres = cutter.centres_of(tips, axes)
    np.testing.assert_allclose(centres[1], cutter.centre_height * axes[1])
    np.testing.assert_allclose(cutter.tips_of(centres, axes), tips)
    assert cutter.tips_of(centres[0], axes[0]).shape == (3,)
