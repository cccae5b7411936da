"""B-splines of CAD systems as T-splines."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.files.bspline import BSplineSurface, Knots, from_bspline, to_bspline
from bonecam.surface.files.cad import bsplines_in, write_iges, write_step
from bonecam.surface.tmesh import OpenRowTMesh, RowTMesh
from bonecam.surface.tspline import TSpline

CLAMPED = np.repeat([0.0, 1.0], 4)


@pytest.mark.parametrize(("spread", "poles"), [(0.0, True), (0.2, True), (0.2, False)])
def test_there_and_back_is_the_same_surface(
    bone_like: Callable[..., TSpline], samples: Callable[..., tuple[ndarray, ndarray]], spread: float, poles: bool
) -> None:
    surface = bone_like(9, 7, 3, spread=spread, poles=poles)
    again = from_bspline(to_bspline(surface))
    s, t = samples(5000)
    np.testing.assert_allclose(again.evaluate(s, t), surface.evaluate(s, t), rtol=0, atol=1e-13)
    assert again.tmesh.poles == (poles, poles)


@pytest.mark.parametrize("name", ["a.step", "a.iges"])
@pytest.mark.parametrize("spread", [0.0, 0.2])
def test_a_file_gives_the_periodic_surface_with_its_poles(
    bone_like: Callable[..., TSpline],
    samples: Callable[..., tuple[ndarray, ndarray]],
    name: str,
    spread: float,
    tmp_path: Path,
) -> None:
    pytest.importorskip("OCP", reason="OpenCASCADE's wheel is not installed: pip install 'bonecam[cad]'")
    surface = bone_like(9, 7, 3, spread=spread)
    (write_step if name == "a.step" else write_iges)(surface, tmp_path / name)
    (spline,) = bsplines_in(tmp_path / name)
    again = from_bspline(spline)
    s, t = samples(5000)
    assert isinstance(again.tmesh, RowTMesh)
    assert again.tmesh.poles == (True, True)
    np.testing.assert_allclose(again.evaluate(s, t), surface.evaluate(s, t), rtol=0, atol=1e-12)
    assert again.volume == pytest.approx(surface.volume, rel=1e-12)


def test_an_open_patch_stays_open_and_its_parameters_come_to_0_1(
    samples: Callable[..., tuple[ndarray, ndarray]],
) -> None:
    rng = np.random.default_rng(1)
    knots = Knots(np.array([2.0, 3.0, 5.0]), np.array([4, 1, 4]), False)
    spline = BSplineSurface(
        knots,
        Knots(np.array([0.0, 10.0]), np.array([4, 4]), False),
        rng.normal(size=(5, 4, 3)),
        rng.uniform(1, 2, (5, 4)),
    )
    surface = from_bspline(spline)
    s, t = samples(1000)
    assert isinstance(surface.tmesh, OpenRowTMesh)
    np.testing.assert_allclose(surface.evaluate(s, t), spline.evaluate(2 + 3 * s, 10 * t), rtol=0, atol=1e-13)


def test_a_tube_with_a_crease_at_its_seam_stays_open() -> None:
    angle = np.linspace(0, 2 * np.pi, 9)
    ring = np.column_stack([(1 + 0.2 * np.abs(angle - np.pi)) * np.cos(angle), np.sin(angle), 0 * angle])
    ring[-1] = ring[0]
    points = np.concatenate([ring + np.array([0, 0, height]) for height in range(4)])
    knots = np.concatenate([[0.0] * 4, np.arange(1, 6) / 6, [1.0] * 4])
    surface = TSpline(OpenRowTMesh.from_rows(CLAMPED, [knots] * 4), points, np.ones(len(points)))
    assert isinstance(from_bspline(to_bspline(surface)).tmesh, OpenRowTMesh)


def test_what_no_t_mesh_holds_is_refused() -> None:
    ring, line = (
        Knots(np.arange(5) / 4, np.ones(5, dtype=np.int64), True),
        Knots(np.array([0.0, 1.0]), np.array([4, 4]), False),
    )
    with pytest.raises(SurfaceError, match="closed along t"):
        from_bspline(BSplineSurface(line, ring, np.zeros((4, 4, 3)), np.ones((4, 4))))
    twice = Knots(np.arange(3) / 2, np.array([2, 2, 2]), True)
    with pytest.raises(SurfaceError, match="repeated knots"):
        from_bspline(BSplineSurface(twice, line, np.zeros((4, 4, 3)), np.ones((4, 4))))
