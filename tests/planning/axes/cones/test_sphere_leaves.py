"""The triangles of the sphere: each lies in its cone, in the one it was divided from, and all cover the sphere once."""

import numpy as np
import pytest

from bonecam.planning.axes.free_axes import leaf_centres, sphere_leaves


def corners() -> np.ndarray:
    leaves = sphere_leaves()[1]
    return leaves.vertices[leaves.leaves]


def test_triangles_lie_in_the_cones_of_all_that_they_were_divided_from() -> None:
    triangles, _ = sphere_leaves()
    counts = np.diff(triangles.starts)
    assert counts.tolist() == [320, 1280, 5120]
    for level, start in enumerate(triangles.starts[:-1]):
        holder = start + np.arange(5120) // 4 ** (2 - level)
        cosine = np.einsum("nci,ni->nc", corners(), triangles.centres[holder])
        if level == 2:
            assert (cosine >= np.cos(triangles.caps[holder])[:, None]).all()
        assert np.degrees(np.arccos(cosine.min())) < [11.0, 5.6, 2.75][level]


def test_leaves_cover_the_sphere_once() -> None:
    a, b, c = corners().transpose(1, 0, 2)
    volume = np.linalg.det(corners())
    assert volume.min() > 0
    angle = 2 * np.arctan2(volume, 1 + (a * b).sum(1) + (b * c).sum(1) + (c * a).sum(1))
    assert angle.sum() == pytest.approx(4 * np.pi)
    leaves = sphere_leaves()[1]
    for ends, beside in zip(leaves.edges, leaves.beside):
        assert set(ends) == set(leaves.leaves[beside[0]]) & set(leaves.leaves[beside[1]])
    assert np.einsum("nci,ni->nc", corners(), leaf_centres()).min() > 0.998
