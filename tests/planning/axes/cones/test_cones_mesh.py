"""The mesh of cones holds what it should: closed cones at the contacts' balls, inside the cones they show."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bonecam.arrays import angles_between, perpendicular, unit
from bonecam.errors import OrientationError
from bonecam.planning import cones_mesh
from bonecam.report.pictures import is_closed
from bonecam.tool import FreeCones, ToolPath
from bonecam.tool.elliptic_cones import EllipticCones

LENGTH = 2.0


@pytest.fixture
def path(path_of: Callable[..., ToolPath]) -> ToolPath:
    """Ten points, of which those with odd numbers have a cone."""
    tips = np.column_stack([np.arange(10.0), np.zeros(10), np.zeros(10)])
    axes = unit(np.column_stack([np.linspace(-1, 1, 10), np.ones(10), np.ones(10)]))
    made = path_of(tips, axes)
    which = np.where(np.arange(10) % 2, np.arange(10) // 2, -1)
    angles = np.column_stack([np.linspace(0.1, 0.6, 5), np.linspace(0.1, 0.3, 5)])
    shapes = EllipticCones(axes[1::2], perpendicular(axes[1::2]), angles)
    return replace(made, cones=FreeCones(made.balls[1::2], shapes, which))


def test_each_cone_stands_at_its_ball_and_is_as_wide_as_it_is_proven(path: ToolPath) -> None:
    mesh = cones_mesh(path, 10, LENGTH)
    assert is_closed(mesh)
    assert mesh.volume == pytest.approx(
        np.pi / 3 * LENGTH**3 * np.tan(path.cones.shapes.angles).prod(axis=1).sum(), rel=0.02
    )
    corners = mesh.vertices.reshape(5, -1, 3)
    for k, row in enumerate(range(1, 10, 2)):
        away = corners[k] - path.balls[row]
        apex = np.linalg.norm(away, axis=1) < 1e-12
        assert apex.sum() == 1
        off = angles_between(unit(away[~apex]), np.broadcast_to(path.axes[row], away[~apex].shape))
        assert off[off > 0].min() < off.max() == pytest.approx(path.cones.shapes.angles[k, 0])
        held = path.cones.shapes.take(np.full(len(off), k)).off(unit(away[~apex]))
        assert held.max() == pytest.approx(path.cones.shapes.mean_angles[k])


def test_fewer_cones_are_chosen_evenly(path: ToolPath) -> None:
    three = cones_mesh(path, 3, LENGTH)
    firsts = three.vertices.reshape(3, -1, 3)[:, 0]
    assert np.allclose(firsts, path.balls[[1, 5, 9]])


def test_a_path_without_cones_says_what_to_do(path: ToolPath) -> None:
    nowhere = replace(path.cones, cone_of=np.full(10, -1))
    for bare in (replace(path, cones=None), replace(path, cones=nowhere)):
        with pytest.raises(OrientationError, match=r"path\.orientation = 'cones'"):
            cones_mesh(bare)
