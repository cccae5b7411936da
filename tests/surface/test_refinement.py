"""Refinement leaves every surface what it is: rational, non-standard, closed, with holes; and so do rows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rows_to_general import as_general
from tsplines import bone_like, inner_samples, random_tspline, torus_text

from bonecam.errors import SurfaceError
from bonecam.surface import OpenRowTMesh, TMesh, TSpline, fit, read_iga, read_tsm, skin, write_iga, write_tsm

seeds = st.integers(0, 10_000)


def assert_same(first: TSpline, second: TSpline, seed: int = 0, order: int = 1) -> None:
    s, t = inner_samples(second, seed, 400)
    for a, b, tolerance in zip(first.evaluate(s, t, 2), second.evaluate(s, t, 2), [1e-13] + [2e-12] * 2 + [1e-10] * 3):
        np.testing.assert_allclose(a, b, atol=tolerance * max(1.0, abs(a).max()))


@pytest.mark.parametrize("name", ["simple", "fan", "Bike", "mouse", "face", "gearbox2-9"])
def test_the_models_stay_what_they_are(shared, name):
    surface = read_tsm(shared / "tspline" / "tsm" / f"{name}.tsm")
    s, t = inner_samples(surface, 1, 2000)
    expected, size = surface.evaluate(s, t), np.ptp(surface.control_points, axis=0).max()
    for k, directions in enumerate(("st", "s", "t")):
        finer = surface.refine(*inner_samples(surface, k + 2, 3), directions=directions)
        assert len(finer.tmesh.face_boxes) > len(surface.tmesh.face_boxes)
        surface = finer
        np.testing.assert_allclose(surface.evaluate(s, t), expected, atol=1e-13 * size)


def test_every_face_of_the_notched_model_can_be_cut(shared):
    surface = read_tsm(shared / "tspline" / "tsm" / "mouse.tsm")
    s, t = inner_samples(surface, 1, 500)
    expected = surface.evaluate(s, t)
    for box in surface.tmesh.face_boxes[::2]:
        finer = surface.refine(box[[0]] * 0.6 + box[[1]] * 0.4, box[[2]] * 0.3 + box[[3]] * 0.7)
        np.testing.assert_allclose(finer.evaluate(s, t), expected, atol=1e-11)


@settings(max_examples=8)
@given(seeds, st.booleans(), st.sampled_from(["s", "t", "st"]))
def test_random_tsplines_stay_what_they_are(seed, closed, directions):
    surface = random_tspline(seed, closed)
    finer = surface.refine(*inner_samples(surface, seed + 9, 2), directions)
    assert len(finer.tmesh.face_boxes) > len(surface.tmesh.face_boxes)
    assert_same(surface, finer, seed)


@settings(max_examples=8)
@given(seeds)
def test_derivatives_of_random_tsplines_agree_with_finite_differences(seed):
    surface = random_tspline(seed, seed % 2 == 0)
    boxes = surface.elements().boxes
    rng = np.random.default_rng(seed)
    box, (u, v) = boxes[rng.integers(0, len(boxes), 100)], rng.uniform(0.05, 0.95, (2, 100))
    s, t = box[:, 0] + (box[:, 1] - box[:, 0]) * u, box[:, 2] + (box[:, 3] - box[:, 2]) * v
    h = 1e-4 * (boxes[:, 1::2] - boxes[:, ::2]).min()
    _, Ss, St, Sss, Sst, Stt = surface.evaluate(s, t, 2)
    right, left, up, down = (surface.evaluate(s + a, t + b, 1) for a, b in ((h, 0), (-h, 0), (0, h), (0, -h)))
    pairs = (
        (Ss, right[0], left[0]),
        (St, up[0], down[0]),
        (Sss, right[1], left[1]),
        (Sst, up[1], down[1]),
        (Stt, up[2], down[2]),
    )
    for exact, ahead, back in pairs:
        np.testing.assert_allclose((ahead - back) / (2 * h), exact, atol=1e-5 * max(1.0, abs(exact).max()))


def element_widths(surface: TSpline, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The extent in s of the element that holds each place of a tube with the period 1."""
    boxes = surface.elements().boxes
    s, t = np.where(s < boxes[:, 0].min(), s + 1, s)[:, None], t[:, None]
    holds = (boxes[:, 0] <= s) & (s < boxes[:, 1]) & (boxes[:, 2] <= t) & (t < boxes[:, 3])
    return np.asarray(np.diff(boxes[:, :2])[holds.argmax(axis=1), 0])


@settings(max_examples=8)
@given(seeds, st.booleans())
def test_random_tsplines_come_back_from_their_files(tmp_path_factory, seed, closed):
    path = tmp_path_factory.mktemp("tsm") / "a.tsm"
    surface = random_tspline(seed, closed)
    write_tsm(surface, path)
    again = read_tsm(path)
    assert again.control_points.tobytes() == surface.control_points.tobytes()
    np.testing.assert_array_equal(again.tmesh.knot_lines[0], surface.tmesh.knot_lines[0])
    np.testing.assert_array_equal(again.tmesh.knot_lines[1], surface.tmesh.knot_lines[1])
    assert again.tmesh.s_lines.tobytes() == surface.tmesh.s_lines.tobytes()


@settings(max_examples=10)
@given(seeds, st.integers(6, 12), st.integers(4, 9), st.sampled_from(["s", "t", "st"]), st.booleans())
def test_rows_stay_what_they_are(seed, rows, around, directions, poles):
    surface = bone_like(rows, around, seed, poles=poles)
    s, t = np.random.default_rng(seed).random((2, 3))
    finer = surface.refine(s, t, directions)
    assert type(finer.tmesh) is type(surface.tmesh)
    assert finer.tmesh.size > surface.tmesh.size
    s, t = np.random.default_rng(seed + 1).random((2, 500))
    np.testing.assert_allclose(finer.evaluate(s, t), surface.evaluate(s, t), atol=1e-13 * 28)


@settings(max_examples=8)
@given(seeds, st.booleans())
def test_rows_are_a_general_tmesh(seed, poles):
    surface = bone_like(8, 6, seed, poles=poles)
    general = as_general(surface)
    s, t = np.random.default_rng(seed).random((2, 500))
    width = np.minimum(element_widths(surface, s, t), element_widths(general, s, t))
    rounding = 1e-11 + 4 * np.finfo(float).eps / width**2  # of a second derivative on an element so wide
    for a, b in zip(surface.evaluate(s, t, 2), general.evaluate(s, t, 2)):
        assert (abs(a - b).max(axis=1) <= rounding * abs(a).max()).all()
    np.testing.assert_allclose(
        general.refine(s[:1], t[:1], "s").evaluate(s, t), surface.evaluate(s, t), atol=1e-13 * 28
    )


def test_a_torus_is_refined_across_both_seams(tmp_path):
    (tmp_path / "torus.tsm").write_text(torus_text())
    surface = read_tsm(tmp_path / "torus.tsm", to_mm=True)
    finer = surface.refine(np.array([4.9, 0.2]), np.array([5.9, 0.1]))
    s, t = np.random.default_rng(1).uniform(0, 5, (2, 400))
    np.testing.assert_allclose(finer.evaluate(s, t), surface.evaluate(s, t), atol=1e-13 * 80)
    assert finer.diagnose().semi_standard


def test_a_wrong_call_is_refused():
    surface = random_tspline(1)
    with pytest.raises(ValueError, match="directions"):
        surface.refine(np.zeros(1), np.zeros(1), "x")
    with pytest.raises(ValueError, match="s must be in"):
        surface.refine(np.array([-1.0]), np.zeros(1))


def open_rows(seed: int) -> TSpline[OpenRowTMesh]:
    """Six open rows with random knots, one of them twice, and random weights."""
    rng = np.random.default_rng(seed)
    inner = [np.sort(np.append(rng.uniform(0.1, 0.9, j % 3), [0.5] * (j // 2))) for j in range(6)]
    t = np.concatenate([np.zeros(4), [0.3, 0.6], np.ones(4)])
    rows = OpenRowTMesh.from_rows(t, [np.concatenate([np.zeros(4), k, np.ones(4)]) for k in inner])
    return TSpline(rows, rng.standard_normal((rows.size, 3)), rng.uniform(0.8, 1.2, rows.size))


def test_open_rows_are_a_general_tmesh_and_can_be_refined_there():
    surface = open_rows(1)
    general = as_general(surface)
    s, t = np.random.default_rng(2).random((2, 500))
    boxes = general.elements().boxes
    x = np.where(s < boxes[:, 0].min(), s + 1, s)
    holds = (
        (boxes[:, 0] <= x[:, None])
        & (x[:, None] < boxes[:, 1])
        & (boxes[:, 2] <= t[:, None])
        & (t[:, None] < boxes[:, 3])
    )
    width = np.diff(boxes[:, :2])[holds.argmax(axis=1), 0]
    rounding = 1e-11 + 4 * np.finfo(float).eps / width**2  # of a second derivative on an element so wide
    for a, b in zip(surface.evaluate(s, t, 2), general.evaluate(s, t, 2)):
        assert (abs(a - b).max(axis=1) <= rounding * abs(a).max()).all()
    finer = general.refine(s[:2], t[:2])
    np.testing.assert_allclose(finer.evaluate(s, t), surface.evaluate(s, t), atol=1e-13 * 5)


@settings(max_examples=10)
@given(seeds, st.sampled_from(["s", "t", "st"]))
def test_open_rows_stay_what_they_are(seed, directions):
    surface = open_rows(seed)
    finer = surface.refine(*np.random.default_rng(seed).random((2, 3)), directions)
    assert isinstance(finer.tmesh, OpenRowTMesh)
    assert finer.tmesh.size > surface.tmesh.size
    s, t = np.concatenate([np.random.default_rng(seed + 1).random((2, 500)), [[0, 1, 0.5], [1, 1, 0]]], axis=1)
    np.testing.assert_allclose(finer.evaluate(s, t), surface.evaluate(s, t), atol=1e-13 * 5)


def test_knots_of_rows_that_differ_by_rounding_are_one():
    surface = bone_like(9, 6, 3)
    rows = [row.copy() for row in surface.tmesh.s_knots]
    rows[3][2], rows[4][2] = rows[5][2] + 1e-16, rows[5][2] - 1e-16
    rows[3][-1], rows[4][0] = 1 - 2e-16, 0.0
    surface = TSpline(
        type(surface.tmesh).from_rows(surface.tmesh.t_knots, rows), surface.control_points, surface.weights
    )
    s, t = np.random.default_rng(1).random((2, 500))
    for first in (surface, as_general(surface)):
        finer = first.refine(s[:3], t[:3], "t").refine(s[:2], t[:2])
        np.testing.assert_allclose(finer.evaluate(s, t), surface.evaluate(s, t), atol=1e-13 * 28)


def own_surfaces() -> dict[str, TSpline]:
    """What bonecam makes: fitted (levels keep its T-mesh), skinned closed, with and without poles, and
    open."""
    fitted = fit(bone_like(8, 8).tessellate(0.3), 0.3).surface
    angle = 2 * np.pi * np.arange(40) / 40
    rings = [
        np.column_stack([(2 + z % 3) * np.cos(angle), 3 * np.sin(angle) + z, np.full(40, float(z))])
        for z in range(1, 8)
    ]
    poles = np.array([[0.0, 0, 0], [0, 8, 8]])
    skinned = skin(rings, 0.01, poles=poles), skin(rings, 0.01), skin(rings, 0.01, closed=False)
    return dict(zip(("fitted", "poles", "tube", "sheet"), (fitted, *skinned)))


def faces_and_points(surface: TSpline) -> int:
    """Grows with each refinement: a face that is cut where its rows have a knot already needs no control
    point."""
    return surface.tmesh.size + (len(surface.tmesh.faces) if isinstance(surface.tmesh, TMesh) else 0)


def test_every_surface_made_here_is_refined_without_change():
    for name, surface in own_surfaces().items():
        s, t = np.random.default_rng(1).random((2, 1000))
        expected, size = surface.evaluate(s, t), np.ptp(surface.control_points, axis=0).max()
        for first in (surface, as_general(surface)):
            for seed, order in enumerate((("st", "s"), ("t", "st"))):
                finer = first
                for k, directions in enumerate(order):
                    coarse, finer = (
                        finer,
                        finer.refine(*np.random.default_rng(10 * seed + k).random((2, 1)), directions),
                    )
                    assert faces_and_points(finer) > faces_and_points(coarse), name
                np.testing.assert_allclose(finer.evaluate(s, t), expected, atol=1e-13 * size, err_msg=name)


def test_what_half_edges_cannot_hold_is_said_and_goes_into_an_iga_file(shared, tmp_path):
    surface = read_tsm(shared / "tspline" / "tsm" / "mouse.tsm")
    expected = surface.area
    for face in (0, 11):
        box = surface.tmesh.face_boxes[face]
        surface = surface.refine(box[[0]] * 0.6 + box[[1]] * 0.4, box[[2]] * 0.5 + box[[3]] * 0.5)
    with pytest.raises(SurfaceError, match="cannot hold"):
        write_tsm(surface, tmp_path / "a.tsm")
    assert not (tmp_path / "a.tsm").exists()
    write_iga(surface, tmp_path / "a.iga")
    assert read_iga(tmp_path / "a.iga").area == pytest.approx(expected, rel=1e-9)
