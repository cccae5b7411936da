"""Walls that face each other across a narrow hollow go less; everything else goes all its way."""

import numpy as np

from bonecam.levels.problem.energies.medial_ball import LEAST, medial_ball_share

NARROW = 2.0


def plane(
    origin: tuple[float, float, float], along: tuple[float, float, float], normal: tuple[float, float, float]
) -> tuple:
    """Points 0.1 mm apart on a square of 6 mm whose sides are `along` and Y, and their normals."""
    u, v = (k.ravel() for k in np.meshgrid(np.arange(0, 6, 0.1), np.arange(0, 6, 0.1), indexing="ij"))
    points = np.array(origin) + u[:, None] * np.array(along) + v[:, None] * np.array([0.0, 1.0, 0.0])
    return points, np.tile(np.array(normal, dtype=float), (len(u), 1))


def shares(*planes: tuple) -> np.ndarray:
    return medial_ball_share(np.vstack([x for x, _ in planes]), np.vstack([n for _, n in planes]), NARROW)


def test_a_plane_and_a_ball_are_unhindered() -> None:
    rng = np.random.default_rng(1)
    n = rng.normal(size=(4000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    assert np.array_equal(medial_ball_share(3 * n, n, NARROW), np.ones(len(n)))
    assert np.array_equal(shares(plane((0, 0, 0), (1, 0, 0), (0, 0, 1))), np.ones(3600))


def test_walls_wait_the_more_the_narrower_their_slot_is() -> None:
    found = []
    for gap in (5.0, 3.0, 1.5):
        found.append(
            shares(plane((0, 0, 0), (1, 0, 0), (0, 0, 1)), plane((0, 0, gap), (1, 0, 0), (0, 0, -1)))
        )
    assert np.array_equal(found[0], np.ones(7200))
    np.testing.assert_allclose(found[1], LEAST**0.5, rtol=0.02)
    np.testing.assert_allclose(found[2], LEAST, rtol=0.02)


def test_the_sides_of_a_groove_go_as_its_bottom_does() -> None:
    """A depth along the groove's middle is its cosine along the sides' own normals; far up they go all the
    way."""
    c = np.sqrt(0.5)
    x, n = zip(plane((0, 0, 0), (c, 0, c), (-c, 0, c)), plane((0, 0, 0), (-c, 0, c), (c, 0, c)))
    x, n = np.vstack(x), np.vstack(n)
    share, up = medial_ball_share(x, n, NARROW), np.hypot(x[:, 0], x[:, 2])
    inner = (x[:, 1] > 2) & (x[:, 1] < 4)
    np.testing.assert_allclose(share[inner & (up > 0.3) & (up < 0.9)], c, atol=0.02)
    assert (share[inner & (up > 2.2)] == 1).all()
