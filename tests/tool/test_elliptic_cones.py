"""An oblique elliptic cone and its upright form hold the same directions; what is off is measured alike in both."""

import numpy as np

from bonecam.arrays import angles_between, dots, unit
from bonecam.planning.axes.cones import ObliqueEllipticCone, elliptic_cone
from bonecam.tool.elliptic_cones import EllipticCones

RANDOM = np.random.default_rng(8)
COUNT = 40


def oblique_frames() -> np.ndarray:
    """Axes D and conjugate semi-diameters U, V."""
    axes = unit(RANDOM.normal(size=(COUNT, 3)))
    return np.stack([axes, *0.5 * RANDOM.normal(size=(2, COUNT, 3))], axis=1)


def test_the_upright_form_holds_the_directions_of_the_oblique_one():
    frames = oblique_frames()
    cones = EllipticCones.oblique(frames, np.arange(COUNT) % 5 > 0)
    assert np.array_equal(cones.found, np.arange(COUNT) % 5 > 0)
    directions = unit(RANDOM.normal(size=(2000, 3)))
    for k in np.flatnonzero(cones.found):
        given = ObliqueEllipticCone(np.zeros(3), *frames[k])
        many = cones.take(np.full(len(directions), k))
        assert np.array_equal(many.off(directions) <= many.mean_angles, given.contains(directions))
        assert np.array_equal(
            elliptic_cone(np.zeros(3), cones, int(k), 2.0).contains(directions), given.contains(directions)
        )
    assert (cones.angles[cones.found, 0] >= cones.angles[cones.found, 1]).all()
    assert np.abs(dots(cones.axes, cones.sides)).max() < 1e-9


def test_off_is_the_angle_in_a_circular_cone_and_the_mean_angle_at_any_rim():
    axes = unit(RANDOM.normal(size=(COUNT, 3)))
    angles = RANDOM.uniform(0.05, 1.0, (COUNT, 2))
    directions = unit(RANDOM.normal(size=(COUNT, 3)))
    circular = EllipticCones.circular(axes, angles[:, 0])
    assert np.allclose(circular.off(directions), angles_between(directions, axes))
    cones = EllipticCones(circular.axes, circular.sides, -np.sort(-angles, axis=1))
    rims = cones.rims(RANDOM.uniform(0, 2 * np.pi, COUNT))
    assert np.allclose(cones.off(rims), cones.mean_angles)
    assert np.allclose(np.tan(cones.mean_angles) ** 2, np.tan(angles).prod(axis=1))
    assert np.allclose(cones.off(axes), 0)
    assert (cones.off(-axes) > np.pi / 2).all()


def test_the_largest_angle_is_that_to_the_farthest_rim():
    axes = unit(RANDOM.normal(size=(COUNT, 3)))
    cones = EllipticCones.circular(axes, np.full(COUNT, 0.4))
    directions = unit(axes + 0.2 * RANDOM.normal(size=axes.shape))
    expected = angles_between(axes, directions) + 0.4
    assert np.abs(cones.largest_angles(directions) - expected).max() < 0.01
    assert np.allclose(cones.largest_angles(axes), 0.4)


def test_a_place_without_a_cone_holds_nothing():
    cones = EllipticCones.circular(np.eye(3), np.array([0.3, -1.0, 0.3])).scaled(np.array([1.0, 1.0, -1.0]))
    assert cones.found.tolist() == [True, False, False]
    assert (cones.off(np.eye(3)) <= cones.mean_angles).tolist() == [True, False, False]
    one = cones.with_rows(np.array([1]), EllipticCones.circular(np.eye(3)[:1], np.array([0.2])))
    assert one.found.tolist() == [True, True, False]
