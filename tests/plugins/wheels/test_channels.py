"""A path repeated about the Z axis is the same path at every pitch."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bonecam.tool import Cutter, FreeCones, MoveKind, ToolPath
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.wheels.channels import indexed

RNG = np.random.default_rng(7)
ROWS = 6


def path(cutter: Cutter) -> ToolPath:
    """A pass of four cuts between two safe points over Z."""
    up = np.array([0.0, 0.0, 1.0])
    axes = RNG.normal(size=(ROWS, 3)) + 3 * up
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    axes[[0, -1]] = up
    tips = RNG.normal(size=(ROWS, 3)) + np.array([20.0, 0.0, 0.0])
    tips[[0, -1]] = 50 * up
    cut = np.array([False, True, True, True, True, False])
    contacts = np.where(cut[:, None], tips + 1.0, np.nan)
    shapes = EllipticCones.circular(axes[1:3], np.full(2, 0.1))
    cones = FreeCones(tips[1:3], shapes, np.array([-1, 0, 0, 1, 1, -1]))
    return ToolPath(
        level=2,
        cutter=cutter,
        kinds=np.where(cut, int(MoveKind.CUT), int(MoveKind.RAPID)),
        pass_index=np.where(cut, 0, -1),
        parameters=contacts[:, :2],
        contacts=contacts,
        tips=tips,
        axes=axes,
        feed_rates=np.full(ROWS, 1000.0),
        uncut=np.array([[20.0, 1.0, 2.0]]),
        reasons=("gouge",),
        trimmed=2.0,
        blocked_by={"shank": 1},
        cones=cones,
        lifts=np.array([[1, 2]]),
    )


@pytest.fixture
def cutter():
    import bonecam

    return Cutter.from_job(1, "roughing", bonecam.Job().tool("roughing"), ())


def test_each_copy_is_turned_by_a_pitch_more(cutter):
    one = path(cutter)
    made = indexed(one, 5)
    for k in range(5):
        turn = Rotation.from_euler("z", 72.0 * k, degrees=True).as_matrix()
        rows = slice(k * ROWS, (k + 1) * ROWS)
        for name in ("tips", "axes", "contacts"):
            np.testing.assert_allclose(getattr(made, name)[rows], getattr(one, name) @ turn.T, atol=1e-12)
        assert made.pass_index[rows].max() == k
        assert (made.lifts[k] == one.lifts[0] + k * ROWS).all()
        assert made.cones is not None
        assert one.cones is not None
        places = made.cones.cone_of[rows][1:5]
        np.testing.assert_allclose(made.cones.apexes[places], one.cones.apexes[[0, 0, 1, 1]] @ turn.T, atol=1e-12)
        np.testing.assert_allclose(
            made.cones.shapes.axes[places], one.cones.shapes.axes[[0, 0, 1, 1]] @ turn.T, atol=1e-12
        )
    assert (made.reasons, made.trimmed, made.blocked_by) == (("gouge",) * 5, 10.0, {"shank": 5})
    assert (made.kinds.reshape(5, ROWS) == one.kinds).all()


def test_a_path_that_does_not_end_over_the_axis_is_not_repeated(cutter):
    one = path(cutter)
    aside = replace(one, tips=one.tips + np.array([0.5, 0.0, 0.0]))
    with pytest.raises(ValueError, match="over Z"):
        indexed(aside, 3)
