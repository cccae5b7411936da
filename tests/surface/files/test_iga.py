"""Bezier extraction files: partition of unity, round trips, broken files."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from bonecam.errors import FileError, SurfaceError
from bonecam.surface.files.iga import raise_degree, read_iga, write_iga
from bonecam.surface.tspline import TSpline

NAMES = ("arch_nurbs", "arch_tsplines", "plate_with_hole", "square_structured", "square_unstructured")


@pytest.mark.parametrize("name", NAMES)
def test_columns_sum_to_one_but_near_the_extraordinary_point(shared: Path, name: str) -> None:
    elements = read_iga(shared / "tspline" / "iga" / f"{name}.iga").elements()
    sums = np.add.reduceat(elements.coefficients, elements.starts[:-1], axis=0)
    worst = np.abs(sums - 1).max(axis=1)
    if name == "square_unstructured":
        assert elements.degree == 4
        assert 5.1e-3 < worst.max() < 5.3e-3
        assert (worst > 1e-12).sum() <= 24
    else:
        assert worst.max() <= 1e-12


def test_quartic_derivatives_agree_with_finite_differences(
    inner_samples: Callable[..., tuple[ndarray, ndarray]], shared: Path
) -> None:
    surface = read_iga(shared / "tspline" / "iga" / "square_unstructured.iga")
    s, t = inner_samples(surface, 1, 300)
    s, t, h = np.floor(s) + 0.01 + 0.98 * (s % 1), 0.01 + 0.98 * t, 1e-5
    _, Ss, St, Sss, Sst, Stt = surface.evaluate(s, t, 2)
    right, left, up, down = (surface.evaluate(s + a, t + b, 1) for a, b in ((h, 0), (-h, 0), (0, h), (0, -h)))
    for exact, ahead, back in (
        (Ss, right[0], left[0]),
        (St, up[0], down[0]),
        (Sss, right[1], left[1]),
        (Sst, up[1], down[1]),
        (Stt, up[2], down[2]),
    ):
        np.testing.assert_allclose((ahead - back) / (2 * h), exact, atol=1e-8)


def test_raising_the_degree_changes_nothing(
    random_tspline: Callable[..., TSpline], inner_samples: Callable[..., tuple[ndarray, ndarray]]
) -> None:
    surface = random_tspline(3)
    elements = surface.elements()
    high = raise_degree(elements.coefficients.reshape(-1, 4, 4), 5).reshape(-1, 36)
    finer = type(elements)(elements.boxes, elements.starts, elements.functions, high)
    s, t = inner_samples(surface, 2, 200)
    patches = finer.patches(surface.control_points, surface.weights)
    for a, b in zip(surface.evaluate(s, t, 2), finer.derivatives(patches, *finer.place(s, t), 2)):
        np.testing.assert_allclose(a, b, atol=1e-11 * max(1.0, abs(a).max()))


def test_a_round_trip_is_bit_equal(random_tspline: Callable[..., TSpline], shared: Path, tmp_path: Path) -> None:
    for first in (read_iga(shared / "tspline" / "iga" / "square_unstructured.iga"), random_tspline(5)):
        write_iga(first, tmp_path / "a.iga")
        again = read_iga(tmp_path / "a.iga")
        assert again.control_points.tobytes() == first.control_points.tobytes()
        assert again.weights.tobytes() == first.weights.tobytes()
        assert again.elements().coefficients.tobytes() == first.elements().coefficients.tobytes()
        assert again.elements().functions.tobytes() == first.elements().functions.tobytes()
        assert again.area == pytest.approx(first.area, rel=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("type plane", "type volume", "line 12: type"),
        ("nodeN 25", "nodeN 26", "announces"),
        ("node 0 0 0 1\n", "node 0 0 0 0\n", "node 0: weight 0"),
        ("node 0 0 0 1\n", "node 0 0 1\n", "expected 4"),
        ("node 0 0 0 1\n", "node 0 0 0 1_0\n", "'1_0' is not a number"),
        ("belem 16 3 3", "belem 15 3 3", "expected 15"),
        ("1 2 3 5 6 7 9", "1 2 3 5 6 7 99", "names function 99"),
        ("1 2 3 5 6 7 9", "1 2 3 5 6 7 7", "different from one another"),
        ("1 2 3 5 6 7 9", "1 2 3 5 6 7 1e20", r"line \d+: .*where a number should stand \('1e20'"),
        ("node 0 0 0 1\n", "nod 0 0 0 1\n", "unknown record 'nod'"),
    ],
)
def test_a_broken_file_is_refused(
    damaged: Callable[..., Path], shared: Path, tmp_path: Path, old: str, new: str, match: str
) -> None:
    with pytest.raises(FileError, match=match):
        read_iga(damaged(shared / "tspline" / "iga" / "square_structured.iga", tmp_path, old, new))


def test_what_needs_a_chart_or_cubics_says_so(shared: Path) -> None:
    surface = read_iga(shared / "tspline" / "iga" / "square_unstructured.iga")
    with pytest.raises(SurfaceError, match="degree 4"):
        surface.project(np.zeros((1, 3)))
    assert surface.diagnose().kind == "non-standard"
