"""General T-meshes in .tsm files: round trips, files of Fusion, and broken ones."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bonecam.errors import FileError, SurfaceError
from bonecam.surface.files.tsm import tsm_text, with_mirrored_borders
from bonecam.surface.files.tspline_text import read_tsm, write_tsm
from bonecam.surface.tmesh import TMesh
from bonecam.surface.tspline import TSpline

MODELS = ("simple", "fan", "Bike", "mouse", "face", "gearbox2-9")
ARRAYS = ("s_lines", "t_lines", "vertices", "along_s", "along_t", "inside")


@pytest.mark.parametrize("homogeneous", [False, True])
@pytest.mark.parametrize("name", MODELS)
def test_a_tsm_round_trip_is_bit_equal(shared: Path, tmp_path: Path, name: str, homogeneous: bool) -> None:
    first = read_tsm(shared / "tspline" / "tsm" / f"{name}.tsm", homogeneous=homogeneous)
    write_tsm(first, tmp_path / "a.tsm", homogeneous=homogeneous)
    again = read_tsm(tmp_path / "a.tsm", homogeneous=homogeneous)
    for key in ARRAYS:
        np.testing.assert_array_equal(getattr(again.tmesh, key), getattr(first.tmesh, key))
    assert again.control_points.tobytes() == first.control_points.tobytes()
    assert again.weights.tobytes() == first.weights.tobytes()
    write_tsm(again, tmp_path / "b.tsm", homogeneous=homogeneous)
    assert (tmp_path / "a.tsm").read_bytes() == (tmp_path / "b.tsm").read_bytes()


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("#TS0200", "#TS9900", "first line"),
        ("l 11 14 1 0 0 0 0", "l 11 14 1 0 0 0", "line 29"),
        ("l 11 14 1 0 0 0 0", "l 11 14 99 0 0 0 0", "l 0: link 99 does not exist"),
        ("l 11 14 1 0 0 0 0", "l 12 14 1 0 0 0 0", "l 0: previous link"),
        ("l 11 14 1 0 0 0 0", "l 11 14 1 0 0 0 1", "direction contradicts|corners"),
        ("e 2 0.5", "e 2 -0.5", "negative: knots must not decrease"),
        ("e 2 0.5", "e 2 0.7", "do not add up"),
        ("e 2 0.5", "e 2 nan", "finite"),
        ("0g 15 0 0 1", "0g 15 0 0 0", "0g 2: weight 0"),
        ("0g 15 0 0 1", "0g 15 0 0", "expected 4 finite numbers"),
        ("0m gvp 3\n", "", "cg|no control point"),
        ("0m cg 1 4 1 0 0 0 7", "0m cg 1 4 1 0 0 0 8", "cg 1: control point 8"),
        ("0m cg 1 4 1 0 0 0 7", "0m cg 1 4 1 1 0 0 7", "cg 1: extents"),
        ("v 2 EAST", "v 2 UP", "EAST, NORTH"),
        ("degree 3", "degree 4", "degree '4'"),
        ("degree 3", "degree", "degree ''"),
    ],
)
def test_a_broken_tsm_names_the_record(
    damaged: Callable[..., Path], shared: Path, tmp_path: Path, old: str, new: str, match: str
) -> None:
    with pytest.raises(FileError, match=match):
        read_tsm(damaged(shared / "tspline" / "tsm" / "simple.tsm", tmp_path, old, new))


def test_a_fusion_torus_is_closed_both_ways(torus_text: Callable[..., str], tmp_path: Path) -> None:
    (tmp_path / "torus.tsm").write_text(torus_text())
    surface = read_tsm(tmp_path / "torus.tsm", to_mm=True)
    assert surface.tmesh.period == (5.0, 6.0)
    s, t = np.random.default_rng(1).uniform(-6, 12, (2, 300))
    np.testing.assert_allclose(surface.evaluate(s, t), surface.evaluate(s + 5, t - 6), atol=1e-12)
    np.testing.assert_allclose(surface.basis(s, t)[0].sum(axis=1), 1, atol=1e-14)
    assert 0.3 < surface.volume / (2 * np.pi**2 * 30 * 100) < 1
    write_tsm(surface, tmp_path / "again.tsm")
    again = read_tsm(tmp_path / "again.tsm")
    assert again.control_points.tobytes() == surface.control_points.tobytes()
    assert again.tmesh.period == surface.tmesh.period


def test_a_closed_direction_of_three_knots_is_refused(torus_text: Callable[..., str], tmp_path: Path) -> None:
    (tmp_path / "thin.tsm").write_text(torus_text(3, 6))
    with pytest.raises(FileError, match="3 distinct knots"):
        read_tsm(tmp_path / "thin.tsm")
    (tmp_path / "odd.tsm").write_text(torus_text(units="1 cubits"))
    with pytest.raises(FileError, match="cubits"):
        read_tsm(tmp_path / "odd.tsm", to_mm=True)


def test_a_border_without_its_control_points_is_refused(shared: Path, tmp_path: Path) -> None:
    lines = (shared / "tspline" / "tsm" / "simple.tsm").read_text().splitlines()
    grips = [line for line in lines if line.startswith("0g ")]
    plain = [line for line in lines if not line.startswith(("0m", "0g", "ec"))]
    (tmp_path / "open.tsm").write_text("\n".join([*plain, *grips[:8], ""]))
    with pytest.raises(FileError, match="all functions vanish"):
        read_tsm(tmp_path / "open.tsm")
    (tmp_path / "short.tsm").write_text("\n".join([*plain, *grips[:7], ""]))
    with pytest.raises(FileError, match="8 vertices need as many control points"):
        read_tsm(tmp_path / "short.tsm")


def fusion_patch(grid: Callable[..., TMesh], points: np.ndarray, ends: str = "SUBD_CREASES") -> str:
    """An open grid of control points (a, b, 3) the way Fusion writes it: no 0m records, one 0g a vertex."""
    a, b = points.shape[:2]
    text = tsm_text(TSpline(grid(np.arange(float(a)), np.arange(float(b))), points.reshape(-1, 3), np.ones(a * b)))
    lines = [line for line in text.splitlines() if not line.startswith(("0m", "force-bezier"))]
    return "\n".join([*lines[:2], f"end-conditions {ends}", "star-knot-rule NURCCS", *lines[2:], ""])


def subdivided(points: np.ndarray) -> np.ndarray:
    """One round of Catmull-Clark along the first axis of a grid whose border is a crease: ends stay."""
    found = np.empty((2 * len(points) - 1, *points.shape[1:]))
    found[1::2] = (points[1:] + points[:-1]) / 2
    found[2:-1:2] = (points[2:] + 6 * points[1:-1] + points[:-2]) / 8
    found[[0, -1]] = points[[0, -1]]
    return found


def limit(points: np.ndarray) -> np.ndarray:
    """Where the vertices of a subdivided grid end, along its first axis."""
    return np.concatenate([points[:1], (points[2:] + 4 * points[1:-1] + points[:-2]) / 6, points[-1:]])


@pytest.mark.parametrize("shape", [(5, 4), (3, 6), (2, 2)])
def test_an_open_fusion_border_is_that_of_the_subdivision_surface(
    grid: Callable[..., TMesh], tmp_path: Path, shape: tuple[int, int]
) -> None:
    points = np.random.default_rng(3).normal(size=(*shape, 3))
    (tmp_path / "open.tsm").write_text(fusion_patch(grid, points))
    surface = read_tsm(tmp_path / "open.tsm")
    assert np.array_equal(surface.control_points[: points.size // 3], points.reshape(-1, 3))
    finer = subdivided(subdivided(points).swapaxes(0, 1)).swapaxes(0, 1)
    expected = limit(limit(finer).swapaxes(0, 1)).swapaxes(0, 1)
    s, t = np.meshgrid(np.arange(2 * shape[0] - 1) / 2, np.arange(2 * shape[1] - 1) / 2, indexing="ij")
    np.testing.assert_allclose(surface.evaluate(s.ravel(), t.ravel()), expected.reshape(-1, 3), atol=1e-13)
    assert np.array_equal(surface.domain, [[0, shape[0] - 1], [0, shape[1] - 1]])
    assert surface.diagnose().standard
    assert len(surface.tessellate(0.05).faces)


def test_other_open_fusion_borders_are_refused(grid: Callable[..., TMesh], tmp_path: Path) -> None:
    points = np.random.default_rng(3).normal(size=(5, 4, 3))
    (tmp_path / "open.tsm").write_text(fusion_patch(grid, points, "MULTIPLE_KNOTS"))
    with pytest.raises(FileError, match="all functions vanish"):
        read_tsm(tmp_path / "open.tsm")
    mesh = grid(np.arange(5.0), np.arange(4.0))
    homogeneous = np.column_stack([points.reshape(-1, 3), np.ones(20)])
    cut = mesh.along_t.copy()
    cut[1, 0] = False
    kept = (mesh.vertices != [1, 0]).any(axis=1)
    for changed, values, match in (
        ({"along_t": cut, "vertices": mesh.vertices[kept]}, homogeneous[kept], "a line ends beside"),
        ({"inside": np.pad(np.ones((3, 3), dtype=bool), ((0, 1), (0, 0)))}, homogeneous, "no rectangle"),
        ({}, homogeneous * np.where(mesh.vertices[:, :1] == 1, [[1, 1, 1, 3]], 1), "fall to -1"),
    ):
        with pytest.raises(SurfaceError, match=match):
            with_mirrored_borders(replace(mesh, **changed), values)


def test_wrong_grids_are_refused(grid: Callable[..., TMesh]) -> None:
    lines = np.array([0.0, 0, 1, 2, 2])
    mesh = grid(lines, lines)
    parts = [mesh.s_lines, mesh.t_lines, mesh.vertices, mesh.along_s, mesh.along_t, mesh.inside]
    for k, value, match in (
        (0, np.array([0.0, 0, 1, 0.5, 2]), "s-line 3 is less"),
        (1, np.array([0.0, 0, 1, 1 + 1e-15, 2]), "differ by rounding only"),
        (2, np.vstack([mesh.vertices[:-1], [[0, 0]]]), "crossing of its own"),
        (2, np.vstack([mesh.vertices[:-1], [[0, 9]]]), "crossing of its own"),
        (4, np.where(np.indices((5, 4))[0] == 2, np.indices((5, 4))[1] < 2, mesh.along_t), "not a rectangle"),
        (5, np.zeros((4, 4), dtype=bool), "no face"),
    ):
        changed = [*parts]
        changed[k] = value
        if k == 4:
            changed[3] = np.where(np.indices((4, 5))[1] == 2, np.indices((4, 5))[0] < 2, mesh.along_s)
        with pytest.raises(SurfaceError, match=match):
            TMesh(*changed)
    with pytest.raises(SurfaceError, match="all functions vanish"):
        _ = grid(np.arange(6.0), lines).elements
    with pytest.raises(SurfaceError, match="3 distinct knots"):
        grid(np.arange(3.0), lines, (3.0, 0.0))
    with pytest.raises(SurfaceError, match="period"):
        grid(np.arange(5.0), lines, (4.0, 0.0))
