"""General T-meshes in .tsm files: round trips, files of Fusion, and broken ones; in STEP files and as B-splines.

Bezier extraction files: partition of unity, round trips, broken files.
"""

from dataclasses import replace

import numpy as np
import pytest
from bonecam_plugins.tsplines import TMesh, diagnose, read_iga, read_tsm, write_iga, write_tsm
from bonecam_plugins.tsplines.any_degree import ElementsOfDegree
from bonecam_plugins.tsplines.iga import raise_degree
from bonecam_plugins.tsplines.tsm import tsm_text, with_mirrored_borders
from general_tsplines import grid, inner_samples, random_tspline, torus_text, with_damage
from tsplines import bone_like

from bonecam.errors import FileError, SurfaceError, UnitsError
from bonecam.mesh import read_in_mm, read_mesh
from bonecam.mesh.files.cad import occ, read_shape, tessellate_shape
from bonecam.surface import TSpline, load_surface, save_surface
from bonecam.surface.files.bspline import to_bspline
from bonecam.surface.files.cad import write_step
from bonecam.surface.files.surface_input import machined_surface
from bonecam.surface.files.tspline_text import rows_text

MODELS = ("simple", "fan", "Bike", "mouse", "face", "gearbox2-9")


ARRAYS = ("s_lines", "t_lines", "vertices", "along_s", "along_t", "inside")


@pytest.mark.parametrize("homogeneous", [False, True])
@pytest.mark.parametrize("name", MODELS)
def test_a_tsm_round_trip_is_bit_equal(shared, tmp_path, name, homogeneous):
    first = read_tsm(shared / "tspline" / "tsm" / f"{name}.tsm", homogeneous=homogeneous)
    write_tsm(first, tmp_path / "a.tsm", homogeneous=homogeneous)
    again = read_tsm(tmp_path / "a.tsm", homogeneous=homogeneous)
    for key in ARRAYS:
        np.testing.assert_array_equal(getattr(again.tmesh, key), getattr(first.tmesh, key))
    assert again.control_points.tobytes() == first.control_points.tobytes()
    assert again.weights.tobytes() == first.weights.tobytes()
    write_tsm(again, tmp_path / "b.tsm", homogeneous=homogeneous)
    assert (tmp_path / "a.tsm").read_bytes() == (tmp_path / "b.tsm").read_bytes()


BROKEN = {
    "tsm/simple.tsm": [
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
        ("0g 30 30 -2.3707438010214226 1\n", "", "0g 22: it is missing, or belongs to two places"),
        ("0m gvp 3\n", "", "cg|no control point"),
        ("0m cg 1 4 1 0 0 0 7", "0m cg 1 4 1 0 0 0 8", "cg 1: control point 8"),
        ("0m cg 1 4 1 0 0 0 7", "0m cg 1 4 1 1 0 0 7", "cg 1: extents"),
        ("v 2 EAST", "v 2 UP", "EAST, NORTH"),
        ("degree 3", "degree 4", "degree '4'"),
        ("degree 3", "degree", "degree ''"),
    ],
    "iga/square_structured.iga": [
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
        ("node 0 0 0 1\n", "node 1e300 0 0 1\n", "control point 0 is not finite or not below"),
        (
            "\n0.25 0 0 0 0 0 0 0 0",
            "\n1e6 0 0 0 0 0 0 0 0",
            "a coefficient of 1e\\+06: those of blending functions lie in 0",
        ),
    ],
}


@pytest.mark.parametrize(("name", "change"), [(name, change) for name, changes in BROKEN.items() for change in changes])
def test_a_broken_file_names_the_record(shared, tmp_path, name, change):
    old, new, match = change
    read = read_tsm if name.endswith("tsm") else read_iga
    with pytest.raises(FileError, match=match):
        read(with_damage(shared / "tspline" / name, tmp_path, old, new))


def test_a_fusion_torus_is_closed_both_ways(tmp_path):
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


def test_a_closed_direction_of_three_knots_is_refused(tmp_path):
    (tmp_path / "thin.tsm").write_text(torus_text(3, 6))
    with pytest.raises(FileError, match="3 distinct knots"):
        read_tsm(tmp_path / "thin.tsm")
    (tmp_path / "odd.tsm").write_text(torus_text(units="1 cubits"))
    with pytest.raises(FileError, match="cubits"):
        read_tsm(tmp_path / "odd.tsm", to_mm=True)


def test_a_border_without_its_control_points_is_refused(shared, tmp_path):
    lines = (shared / "tspline" / "tsm" / "simple.tsm").read_text().splitlines()
    grips = [line for line in lines if line.startswith("0g ")]
    plain = [line for line in lines if not line.startswith(("0m", "0g", "ec"))]
    (tmp_path / "open.tsm").write_text("\n".join([*plain, *grips[:8], ""]))
    with pytest.raises(FileError, match="all functions vanish"):
        read_tsm(tmp_path / "open.tsm")
    (tmp_path / "short.tsm").write_text("\n".join([*plain, *grips[:7], ""]))
    with pytest.raises(FileError, match="8 vertices need as many control points"):
        read_tsm(tmp_path / "short.tsm")


def fusion_patch(points: np.ndarray, ends: str = "SUBD_CREASES") -> str:
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
def test_an_open_fusion_border_is_that_of_the_subdivision_surface(tmp_path, shape):
    points = np.random.default_rng(3).normal(size=(*shape, 3))
    (tmp_path / "open.tsm").write_text(fusion_patch(points))
    surface = read_tsm(tmp_path / "open.tsm")
    assert np.array_equal(surface.control_points[: points.size // 3], points.reshape(-1, 3))
    finer = subdivided(subdivided(points).swapaxes(0, 1)).swapaxes(0, 1)
    expected = limit(limit(finer).swapaxes(0, 1)).swapaxes(0, 1)
    s, t = np.meshgrid(np.arange(2 * shape[0] - 1) / 2, np.arange(2 * shape[1] - 1) / 2, indexing="ij")
    np.testing.assert_allclose(surface.evaluate(s.ravel(), t.ravel()), expected.reshape(-1, 3), atol=1e-13)
    assert np.array_equal(surface.domain, [[0, shape[0] - 1], [0, shape[1] - 1]])
    assert diagnose(surface).standard
    assert len(surface.tessellate(0.05).faces)


def test_other_open_fusion_borders_are_refused(tmp_path):
    points = np.random.default_rng(3).normal(size=(5, 4, 3))
    (tmp_path / "open.tsm").write_text(fusion_patch(points, "MULTIPLE_KNOTS"))
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


def test_wrong_grids_are_refused():
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


NAMES = ("arch_nurbs", "arch_tsplines", "plate_with_hole", "square_structured", "square_unstructured")


@pytest.mark.parametrize("name", NAMES)
def test_columns_sum_to_one_but_near_the_extraordinary_point(shared, name):
    elements = read_iga(shared / "tspline" / "iga" / f"{name}.iga").elements()
    sums = np.add.reduceat(elements.coefficients, elements.starts[:-1], axis=0)
    worst = np.abs(sums - 1).max(axis=1)
    if name == "square_unstructured":
        assert elements.degree == 4
        assert 5.1e-3 < worst.max() < 5.3e-3
        assert (worst > 1e-12).sum() <= 24
    else:
        assert worst.max() <= 1e-12


def test_quartic_derivatives_agree_with_finite_differences(shared):
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


def test_raising_the_degree_changes_nothing():
    surface = random_tspline(3)
    elements = surface.elements()
    high = raise_degree(elements.coefficients.reshape(-1, 4, 4), 5).reshape(-1, 36)
    finer = ElementsOfDegree(elements.boxes, elements.starts, elements.functions, high)
    s, t = inner_samples(surface, 2, 200)
    patches = finer.patches(surface.control_points, surface.weights)
    for a, b in zip(surface.evaluate(s, t, 2), finer.derivatives(patches, *finer.place(s, t), 2)):
        np.testing.assert_allclose(a, b, atol=1e-11 * max(1.0, abs(a).max()))


def test_a_round_trip_is_bit_equal(shared, tmp_path):
    for first in (read_iga(shared / "tspline" / "iga" / "square_unstructured.iga"), random_tspline(5)):
        write_iga(first, tmp_path / "a.iga")
        again = read_iga(tmp_path / "a.iga")
        assert again.control_points.tobytes() == first.control_points.tobytes()
        assert again.weights.tobytes() == first.weights.tobytes()
        assert again.elements().coefficients.tobytes() == first.elements().coefficients.tobytes()
        assert again.elements().functions.tobytes() == first.elements().functions.tobytes()
        assert again.area == pytest.approx(first.area, rel=1e-12)


def test_what_needs_a_chart_or_cubics_says_so(shared):
    surface = read_iga(shared / "tspline" / "iga" / "square_unstructured.iga")
    with pytest.raises(SurfaceError, match="degree 4"):
        surface.project(np.zeros((1, 3)))
    assert diagnose(surface).kind == "non-standard"


@pytest.mark.parametrize(
    ("record", "match"),
    [
        ("0g 1e308 0 0 1", "size below"),
        ("0g 0 0 0 1e-320", "weight 2 is not positive"),
        ("0m gvp 99999999999999999999", "size below"),
        ("#s-knots 0.0 1.0", "its knots are not those that the edges' intervals add up to"),
    ],
)
def test_numbers_that_would_overflow_or_contradict_others_are_refused(tmp_path, record, match):
    write_tsm(random_tspline(1), tmp_path / "a.tsm")
    lines = (tmp_path / "a.tsm").read_text().splitlines()
    kind = record.split()[0]
    places = [k for k, line in enumerate(lines) if line.startswith(f"{kind} ")]
    lines[places[:3][-1]] = record
    (tmp_path / "a.tsm").write_text("\n".join(lines))
    with pytest.raises(FileError, match=match):
        read_tsm(tmp_path / "a.tsm")


def test_a_tsm_is_machined_in_the_unit_that_it_states(shared, tmp_path):
    text = (shared / "tspline" / "tsm" / "simple.tsm").read_text()
    sizes = []
    for unit in ("millimeters", "inches"):
        (tmp_path / "a.tsm").write_text(text.replace("units 0.001 millimeters", f"units 0.001 {unit}"))
        sizes.append(np.ptp(machined_surface(tmp_path / "a.tsm", "stated", 0.1).control_points, axis=0))
    np.testing.assert_allclose(sizes[1], 25.4 * sizes[0])
    (tmp_path / "a.tsm").write_text(text.replace("units 0.001 millimeters", ""))
    with pytest.raises(FileError, match=r"a\.tsm: its unit '\?' is not known: state one of millimeters"):
        machined_surface(tmp_path / "a.tsm", "stated", 0.1)


@pytest.mark.parametrize("model", ["simple", "fan", "gearbox2-9"])
def test_a_general_t_mesh_over_a_rectangle_is_one_b_spline_too(model, shared):
    surface = read_tsm(shared / "tspline" / "tsm" / f"{model}.tsm")
    spline = to_bspline(surface)
    rng = np.random.default_rng(0)
    low, high = surface.domain.T
    s, t = low[:, None] + (high - low)[:, None] * rng.random((2, 10_000))
    assert np.abs(spline.evaluate(s, t) - surface.evaluate(s, t)).max() < 1e-14 * spline.size


@pytest.mark.parametrize("model", ["Bike", "mouse", "face"])
def test_a_t_mesh_with_missing_faces_has_no_such_form(model, shared):
    with pytest.raises(SurfaceError, match="no rectangle"):
        to_bspline(read_tsm(shared / "tspline" / "tsm" / f"{model}.tsm"))


@pytest.mark.parametrize(("model", "faces"), [("simple", 1), ("gearbox2-9", 1), ("mouse", 18), ("Bike", 85)])
def test_general_t_meshes_come_back_with_the_same_area(model, faces, shared, tmp_path):
    pytest.importorskip("OCP", reason="OpenCASCADE's wheel is not installed: pip install 'bonecam[cad]'")
    surface = read_tsm(shared / "tspline" / "tsm" / f"{model}.tsm")
    assert write_step(surface, tmp_path / "a.step") == faces
    shape = read_shape(tmp_path / "a.step")
    found = occ().GProp.GProp_GProps()
    occ().BRepGProp.BRepGProp.SurfaceProperties_s(shape, found, 1e-6)
    assert found.Mass() == pytest.approx(
        surface.area, rel=2e-5
    )  # folded models: both integrate |S_s x S_t| near its zeros
    assert occ().BRepCheck.BRepCheck_Analyzer(shape).IsValid()
    assert tessellate_shape(shape).area == pytest.approx(surface.area, rel=2e-3)


def test_the_ending_decides_how_a_surface_is_saved_and_loaded(tmp_path):
    general = random_tspline(1)
    save_surface(general, tmp_path / "a.tsm")
    assert (tmp_path / "a.tsm").read_text().startswith("#TS0200")
    assert load_surface(tmp_path / "a.tsm").control_points.tobytes() == general.control_points.tobytes()
    save_surface(bone_like(), tmp_path / "a.iga")
    assert read_iga(tmp_path / "a.iga").control_points.tobytes() == bone_like().control_points.tobytes()
    with pytest.raises(FileError, match=r"have no \.tsm form: end the name in \.tspline"):
        save_surface(bone_like(), tmp_path / "b.tsm")
    with pytest.raises(FileError, match=r"have no \.tsm form: end the name in \.iga"):
        save_surface(read_iga(tmp_path / "a.iga"), tmp_path / "b.tsm")
    with pytest.raises(FileError, match=r"only closed rows have a \.tspline form: end the name in one of \.iga, \.tsm"):
        save_surface(general, tmp_path / "b.tspline")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.iga", "a.tsm"]


def test_rows_under_the_name_of_a_general_surface_are_read(tmp_path):
    (tmp_path / "rows.tsm").write_text(rows_text(bone_like(7, 6)))
    assert rows_text(load_surface(tmp_path / "rows.tsm")) == rows_text(bone_like(7, 6))


def test_bezier_elements_are_read_as_a_mesh(tmp_path):
    bone = bone_like(8, 6, 2)
    save_surface(bone, tmp_path / "bone.iga")
    mesh = read_mesh(tmp_path / "bone.iga")
    assert mesh.volume == pytest.approx(bone.volume, rel=2e-3)
    with pytest.raises(FileError, match=r"bone\.iga: is read as a mesh: give a surface"):
        load_surface(tmp_path / "bone.iga")
    save_surface(random_tspline(1), tmp_path / "a.tsm")
    with pytest.raises(FileError, match=r"a\.tsm: is read as a surface: give a mesh"):
        read_mesh(tmp_path / "a.tsm")
    huge = bone.with_control_points(1e6 * bone.control_points)
    save_surface(huge, tmp_path / "huge.iga")
    with pytest.raises(UnitsError, match=r"huge\.iga: .* mm from corner to corner if its unit is mm"):
        read_in_mm(tmp_path / "huge.iga")


def bump() -> TSpline[TMesh]:
    """A smooth open patch, mm."""
    mesh = grid(*(np.r_[0.0, 0.0, np.arange(1, n + 1) / (n + 1), 1.0, 1.0] for n in (5, 4)))
    x, y = mesh.vertices.T
    return TSpline(mesh, np.column_stack([4.0 * x, 4.0 * y, np.sin(x / 3)]), np.ones(mesh.size))


def test_what_can_be_machined_alone_is_an_open_patch_of_either_kind(tmp_path):
    areas = []
    for name in ("a.tsm", "a.iga"):
        save_surface(bump(), tmp_path / name)
        areas.append(machined_surface(tmp_path / name, "stated", 0.02).area)
    assert areas == pytest.approx([bump().area] * 2, rel=1e-3)
    (tmp_path / "torus.tsm").write_text(torus_text())
    with pytest.raises(SurfaceError, match=r"torus\.tsm: closes on itself in t: cut it open there"):
        machined_surface(tmp_path / "torus.tsm", "stated", 0.02)
