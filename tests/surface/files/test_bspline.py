"""A T-spline as one tensor-product B-spline.

B-splines of CAD systems as T-splines.
"""

import numpy as np
import pytest
from tsplines import bone_like, samples

from bonecam.errors import SurfaceError
from bonecam.surface import OpenRowTMesh, RowTMesh, TSpline
from bonecam.surface.files.bspline import BSplineSurface, Knots, bezier_grid, from_bspline, to_bspline
from bonecam.surface.files.cad import bsplines_in, write_iges, write_step


def relative_error(spline: BSplineSurface, surface: TSpline) -> float:
    s, t = samples(10_000)
    return float(np.abs(spline.evaluate(s, t) - surface.evaluate(s, t)).max()) / spline.size


@pytest.mark.parametrize("poles", [True, False])
@pytest.mark.parametrize("spread", [0.0, 0.2])
def test_the_b_spline_equals_the_t_spline_to_rounding(spread, poles):
    surface = bone_like(12, 9, 3, spread=spread, poles=poles)
    spline = to_bspline(surface)
    assert relative_error(spline, surface) < 2e-15
    assert spline.rational == (spread > 0)
    assert spline.collapsed == (poles, poles)
    assert (spline.s_knots.multiplicities == 1).all()
    assert spline.watertight == poles


def test_a_repeated_knot_keeps_its_multiplicity():
    t = np.array([0, 0, 0, 0, 0.2, 0.4, 0.4, 0.7, 0.7, 0.7, 1, 1, 1, 1.0])
    rng = np.random.default_rng(2)
    mesh = RowTMesh.from_rows(t, [np.sort(rng.random(6)) for _ in range(len(t) - 4)])
    surface = TSpline(mesh, rng.normal(size=(mesh.size, 3)), rng.uniform(0.5, 2, mesh.size))
    spline = to_bspline(surface)
    assert spline.t_knots.multiplicities.tolist() == [4, 1, 2, 3, 4]
    assert relative_error(spline, surface) < 1e-14


def test_rows_whose_knots_nearly_meet_lose_no_digit():
    rng = np.random.default_rng(5)
    t = np.concatenate([[0.0] * 4, [0.1, 0.1001, 0.5], [1.0] * 4])
    rows = [np.sort(np.concatenate([[0.1, 0.4, 0.7, 0.9], 0.5 + 10.0 ** -rng.uniform(3, 7, 2)])) for _ in range(7)]
    mesh = RowTMesh.from_rows(t, rows)
    surface = TSpline(mesh, rng.normal(size=(mesh.size, 3)), np.ones(mesh.size))
    assert relative_error(to_bspline(surface), surface) < 1e-14


def test_a_domain_with_a_missing_corner_is_refused():
    elements = bone_like(6, 5, 0).elements()
    keep = slice(0, elements.starts[-2])
    part = type(elements)(
        elements.boxes[:-1], elements.starts[:-1], elements.functions[keep], elements.coefficients[keep]
    )
    with pytest.raises(SurfaceError, match="no rectangle"):
        bezier_grid(part, np.ones((len(part.boxes), 16, 4)))


def test_a_closed_direction_of_few_poles_wraps_more_than_once():
    knots = Knots(np.array([0.0, 0.5, 1.0]), np.array([1, 1, 1]), True)
    values, poles = knots.functions(np.linspace(0, 1, 11))
    np.testing.assert_allclose(values.sum(axis=1), 1, rtol=0, atol=1e-15)
    assert poles.max() == 1


def test_poles_that_do_not_fit_the_knots_are_refused():
    spline = to_bspline(bone_like(6, 5, 0))
    with pytest.raises(ValueError, match="the knots need"):
        BSplineSurface(spline.s_knots, spline.t_knots, spline.poles[1:], spline.weights[1:])


CLAMPED = np.repeat([0.0, 1.0], 4)


@pytest.mark.parametrize(("spread", "poles"), [(0.0, True), (0.2, True), (0.2, False)])
def test_there_and_back_is_the_same_surface(spread, poles):
    surface = bone_like(9, 7, 3, spread=spread, poles=poles)
    again = from_bspline(to_bspline(surface))
    s, t = samples(5000)
    np.testing.assert_allclose(again.evaluate(s, t), surface.evaluate(s, t), rtol=0, atol=1e-13)
    assert again.tmesh.poles == (poles, poles)


@pytest.mark.parametrize("name", ["a.step", "a.iges"])
@pytest.mark.parametrize("spread", [0.0, 0.2])
def test_a_file_gives_the_periodic_surface_with_its_poles(name, spread, tmp_path):
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


def test_an_open_patch_stays_open_and_its_parameters_come_to_0_1():
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


def test_a_tube_with_a_crease_at_its_seam_stays_open():
    angle = np.linspace(0, 2 * np.pi, 9)
    ring = np.column_stack([(1 + 0.2 * np.abs(angle - np.pi)) * np.cos(angle), np.sin(angle), 0 * angle])
    ring[-1] = ring[0]
    points = np.concatenate([ring + np.array([0, 0, height]) for height in range(4)])
    knots = np.concatenate([[0.0] * 4, np.arange(1, 6) / 6, [1.0] * 4])
    surface = TSpline(OpenRowTMesh.from_rows(CLAMPED, [knots] * 4), points, np.ones(len(points)))
    assert isinstance(from_bspline(to_bspline(surface)).tmesh, OpenRowTMesh)


def test_what_no_t_mesh_holds_is_refused():
    ring, line = (
        Knots(np.arange(5) / 4, np.ones(5, dtype=np.int64), True),
        Knots(np.array([0.0, 1.0]), np.array([4, 4]), False),
    )
    with pytest.raises(SurfaceError, match="closed along t"):
        from_bspline(BSplineSurface(line, ring, np.zeros((4, 4, 3)), np.ones((4, 4))))
    twice = Knots(np.arange(3) / 2, np.array([2, 2, 2]), True)
    with pytest.raises(SurfaceError, match="repeated knots"):
        from_bspline(BSplineSurface(twice, line, np.zeros((4, 4, 3)), np.ones((4, 4))))
