"""Local refinement leaves every surface what it is: rational, non-standard, closed, with holes."""

import numpy as np
import pytest
from bonecam_plugins.tsplines import TMesh, diagnose, read_iga, read_tsm, write_iga, write_tsm
from general_tsplines import inner_samples, random_tspline, torus_text
from hypothesis import given, settings
from hypothesis import strategies as st
from rows_to_general import as_general
from tsplines import assert_unchanged_by_refinement, bone_like, open_rows, own_surfaces, rows_apart_by_rounding

from bonecam.errors import SurfaceError
from bonecam.surface import TSpline

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
    assert diagnose(finer).semi_standard


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


def test_rows_apart_by_rounding_are_refined_there():
    surface = rows_apart_by_rounding()
    s, t = np.random.default_rng(1).random((2, 500))
    finer = as_general(surface).refine(s[:3], t[:3], "t").refine(s[:2], t[:2])
    np.testing.assert_allclose(finer.evaluate(s, t), surface.evaluate(s, t), atol=1e-13 * 28)


def faces_and_points(surface: TSpline[TMesh]) -> int:
    """Grows with each refinement: a face that is cut where its rows have a knot already needs no control point."""
    return surface.tmesh.size + len(surface.tmesh.faces)


def test_every_surface_made_here_is_refined_without_change():
    for name, surface in own_surfaces().items():
        assert_unchanged_by_refinement(name, as_general(surface), faces_and_points)


def test_what_has_no_t_mesh_cannot_be_refined(tmp_path):
    write_iga(random_tspline(1), tmp_path / "a.iga")
    with pytest.raises(SurfaceError, match=r"\(\.iga\) cannot be refined: read the surface from a \.tsm"):
        read_iga(tmp_path / "a.iga").refine(np.array([0.5]), np.array([0.5]))


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
