"""The evaluator: extraction, basis, derivatives, seam, poles."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tsplines import bone_like, samples

from bonecam.surface import RowTMesh, TSpline, save_surface

seeds = st.integers(0, 10_000)
shapes = st.tuples(st.integers(4, 14), st.integers(4, 12))


@settings(max_examples=25)
@given(seeds, shapes, st.booleans())
def test_basis_is_a_non_negative_partition_of_unity(seed, shape, poles):
    surface = bone_like(max(shape[0], 5), shape[1], seed, poles=poles)
    R, *derivatives = surface.basis(*samples(200, seed), order=2)
    assert R.data.min() >= 0
    np.testing.assert_allclose(R.sum(axis=1), 1, atol=1e-14)
    for D in derivatives:
        np.testing.assert_allclose(D.sum(axis=1), 0, atol=1e-13 * abs(D.data).max())


@settings(max_examples=15)
@given(seeds, shapes)
def test_extraction_agrees_with_the_recurrence(seed, shape):
    surface = bone_like(max(shape[0], 5), shape[1], seed)
    s, t = samples(100, seed)
    B = surface.tmesh.blending(s, t).toarray() * surface.weights
    expected = B / B.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(surface.basis(s, t)[0].toarray(), expected, atol=1e-14)
    np.testing.assert_allclose(surface.evaluate(s, t), expected @ surface.control_points, atol=1e-13 * 28)


@settings(max_examples=15)
@given(seeds, shapes)
def test_derivatives_agree_with_finite_differences(seed, shape):
    surface = bone_like(max(shape[0], 5), shape[1], seed)
    s, t = samples(100, seed)
    t, h = 0.01 + 0.98 * t, 1e-5
    _, Ss, St, Sss, Sst, Stt = surface.evaluate(s, t, 2)
    first = lambda a, b: surface.evaluate(a, b, 1)  # noqa: E731
    right, left, up, down = first(s + h, t), first(s - h, t), first(s, t + h), first(s, t - h)
    for exact, ahead, back in (
        (Ss, right[0], left[0]), (St, up[0], down[0]), (Sss, right[1], left[1]),
        (Sst, up[1], down[1]), (Sst, right[2], left[2]), (Stt, up[2], down[2]),
    ):  # fmt: skip
        np.testing.assert_allclose((ahead - back) / (2 * h), exact, atol=2e-4 * abs(exact).max())


def test_basis_and_evaluate_are_one():
    surface = bone_like(19, 15)
    s, t = samples(500)
    for matrix, value in zip(surface.basis(s, t, 2), surface.evaluate(s, t, 2)):
        np.testing.assert_allclose(matrix @ surface.control_points, value, atol=1e-12 * abs(value).max())
    for order in (0, 1):
        again = surface.evaluate(s, t, order)
        np.testing.assert_allclose(again[0] if order else again, surface.evaluate(s, t, 2)[0], atol=1e-13)


def test_the_seam_is_c2():
    surface = bone_like(12, 9, 3)
    t = np.linspace(0.01, 0.99, 50)
    zero, one = surface.evaluate(np.zeros(50), t, 2), surface.evaluate(np.full(50, np.nextafter(1, 0)), t, 2)
    for a, b in zip(zero, one):
        np.testing.assert_allclose(a, b, atol=1e-11 * abs(a).max())
    np.testing.assert_array_equal(surface.evaluate(np.full(50, -0.25), t), surface.evaluate(np.full(50, 0.75), t))


def test_poles_are_one_point_with_the_limit_normal():
    surface = bone_like(12, 9, 4)
    s = np.linspace(0, 1, 41)
    for t, index, normal in ((0.0, 0, [0, 0, -1]), (1.0, -1, [0, 0, 1])):
        points = surface.evaluate(s, np.full(41, t))
        np.testing.assert_allclose(points, np.broadcast_to(surface.control_points[index], (41, 3)), atol=1e-13)
        np.testing.assert_allclose(surface.normals(s, np.full(41, t)), np.broadcast_to(normal, (41, 3)), atol=1e-9)
        near = surface.normals(s, np.full(41, abs(t - 1e-6)))
        np.testing.assert_allclose(near, np.broadcast_to(normal, (41, 3)), atol=1e-3)


def test_parameters_outside_or_not_finite_are_refused():
    surface = bone_like(8, 6)
    with pytest.raises(ValueError, match="t must be in"):
        surface.evaluate(np.zeros(1), np.array([1.1]))
    with pytest.raises(ValueError, match="sample 1 is not finite"):
        surface.basis(np.array([0.0, np.nan]), np.zeros(2))
    with pytest.raises(ValueError, match="order"):
        surface.evaluate(np.zeros(1), np.zeros(1), 3)


def test_bad_meshes_are_refused_by_row():
    t = np.array([0, 0, 0, 0, 1, 1, 1, 1.0])
    with pytest.raises(ValueError, match="row 1: a closed row"):
        RowTMesh.from_rows(t, [np.zeros(1), np.array([0, 0.3, 0.6]), np.arange(5) / 5, np.zeros(1)])
    with pytest.raises(ValueError, match=r"t-knots .* knot 4 .0. is below"):
        RowTMesh.from_rows(t[::-1], [np.arange(5) / 5] * 4)
    with pytest.raises(ValueError, match=r"row 2: .* knot 1 .0.3. is below"):
        RowTMesh.from_rows(t, [np.arange(5) / 5] * 2 + [np.array([0.4, 0.3, 0.6, 0.8])] * 2)
    with pytest.raises(ValueError, match=r"t-knots .* knot 5 is not finite"):
        RowTMesh.from_rows(np.where(np.arange(8) == 5, np.inf, t), [np.arange(5) / 5] * 4)
    mesh = RowTMesh.from_rows(t, [np.arange(5) / 5] * 4)
    with pytest.raises(ValueError, match="weight 4 is not positive and finite"):
        TSpline(mesh, np.zeros((20, 3)), np.where(np.arange(20) == 4, np.inf, 1.0))
    with pytest.raises(ValueError, match="control point 7 is not finite"):
        TSpline(mesh, np.where(np.arange(20)[:, None] == 7, np.nan, np.zeros((20, 3))), np.ones(20))
    with pytest.raises(ValueError, match=r"\(19, 3\).*20 vertices"):
        TSpline(mesh, np.zeros((19, 3)), np.ones(19))
    with pytest.raises(ValueError, match="weight 3"):
        TSpline(mesh, np.zeros((20, 3)), np.where(np.arange(20) == 3, -1.0, 1.0))


WRONG = {
    "surface.evaluate(np.zeros(3), np.zeros(2))": "s (3,) and t (2,)",
    "surface.basis(np.zeros(3), np.zeros((3, 1)))": "s (3,) and t (3, 1)",
    "surface.curvature(np.zeros(2), np.zeros(3))": "s (2,) and t (3,)",
    "surface.refine(np.zeros(2), np.zeros(3))": "s (2,) and t (3,)",
    "surface.project(np.zeros(3))": "points (3,)",
    "surface.project(np.zeros((4, 2)))": "points (4, 2)",
}


def test_a_knot_that_is_the_seam_but_for_rounding_leaves_no_gap_before_it():
    t = np.concatenate([np.zeros(4), [0.2, 0.4, 0.6, 0.8], np.ones(4)])
    angle = 2 * np.pi * np.arange(5) / 5
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    points = np.vstack([ring + np.array([0, 0, z]) for z in range(8)])
    last = np.nextafter(1.0, 0.0)
    fifths = np.array([0.2, 0.4, 0.6, 0.8])
    surface = TSpline(RowTMesh.from_rows(t, [np.r_[fifths, last]] * 4 + [np.r_[0.0, fifths]] * 4), points, np.ones(40))
    assert surface.domain[0].tolist() == [0.0, 1.0]
    for height in (0.1, 0.5, 0.9):
        sides = surface.positions(np.array([0.0, last, 1.0]), np.full(3, height))
        np.testing.assert_allclose(sides, sides[[0, 0, 0]], atol=1e-12)


def test_arrays_of_wrong_lengths_are_refused_where_no_types_are_checked(tmp_path):
    """In a process of its own, without the tests' own check of shapes."""
    save_surface(bone_like(8, 6), tmp_path / "surface.tspline")
    lines = [
        "import numpy as np",
        "from bonecam.surface import load_surface",
        'surface = load_surface("surface.tspline")',
    ]
    for call in WRONG:
        lines += ["try:", f"    {call}", "except ValueError as e:", "    print(e)"]
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(lines)], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    for line, said in zip(done.stdout.splitlines(), WRONG.values(), strict=True):
        assert line.startswith(said)
