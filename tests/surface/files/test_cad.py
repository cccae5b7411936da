"""T-splines in STEP and IGES files, proved by reading them back through OpenCASCADE."""

import re
import sys
from typing import Any

import numpy as np
import pytest
from mesh_bodies import is_closed
from tsplines import bone_like, samples

from bonecam.errors import FileError
from bonecam.mesh import read_mesh
from bonecam.mesh.files.cad import faces_of, occ, read_shape, tessellate_shape
from bonecam.surface.files import cad
from bonecam.surface.files.cad import bsplines_in, read_bsplines, shape_of, write_iges, write_step

pytest.importorskip("OCP", reason="OpenCASCADE's wheel is not installed: pip install 'bonecam[cad]'")
WRITERS = {"part.step": write_step, "part.iges": write_iges}


def volume_of(shape: Any) -> float:
    found = occ().GProp.GProp_GProps()
    occ().BRepGProp.BRepGProp.VolumeProperties_s(shape, found, 1e-9, False, False)
    return float(found.Mass())


def is_valid(shape: Any) -> bool:
    return bool(occ().BRepCheck.BRepCheck_Analyzer(shape).IsValid())


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize(("spread", "poles"), [(0.0, True), (0.2, True), (0.2, False)])
def test_a_file_holds_one_b_spline_equal_to_the_t_spline_to_rounding(name, spread, poles, tmp_path):
    surface = bone_like(10, 7, 3, spread=spread, poles=poles)
    assert WRITERS[name](surface, tmp_path / name) == 1
    (spline,) = bsplines_in(tmp_path / name)
    s, t = samples(10_000)
    assert np.abs(spline.evaluate(s, t) - surface.evaluate(s, t)).max() < 1e-12 * spline.size
    assert spline.rational == (spread > 0)
    assert is_valid(read_shape(tmp_path / name))


def test_opencascade_itself_evaluates_the_same_points(tmp_path):
    surface = bone_like(10, 7, 3)
    write_step(surface, tmp_path / "a.step")
    (face,) = faces_of(read_shape(tmp_path / "a.step"))
    geometry = occ().BRep.BRep_Tool.Surface_s(face)
    s, t = samples(2000)
    found = np.array([(p.X(), p.Y(), p.Z()) for p in map(geometry.Value, s.tolist(), t.tolist())])
    assert np.abs(found - surface.evaluate(s, t)).max() < 1e-12 * 28


def test_step_keeps_the_direction_round_the_part_periodic(tmp_path):
    write_step(bone_like(8, 5, 1), tmp_path / "a.step")
    (spline,) = read_bsplines(tmp_path / "a.step")
    assert spline.s_knots.closed
    assert spline.watertight
    assert spline.s_knots.multiplicities.max() == 1


@pytest.mark.parametrize("name", WRITERS)
def test_a_closed_surface_is_a_valid_solid_of_the_same_volume(name, tmp_path):
    surface = bone_like(8, 6, 2)
    WRITERS[name](surface, tmp_path / name)
    solid = read_shape(tmp_path / name)
    assert solid.ShapeType() == occ().TopAbs.TopAbs_ShapeEnum.TopAbs_SOLID
    assert is_valid(solid)
    assert volume_of(solid) == pytest.approx(surface.volume, rel=1e-8)


def degenerate_edges(face: Any) -> int:
    lib = occ()
    explorer, count = lib.TopExp.TopExp_Explorer(face, lib.TopAbs.TopAbs_ShapeEnum.TopAbs_EDGE), 0
    while explorer.More():
        count += lib.BRep.BRep_Tool.Degenerated_s(lib.TopoDS.TopoDS.Edge(explorer.Current()))
        explorer.Next()
    return count


def test_each_pole_is_a_degenerate_edge():
    (face,) = faces_of(shape_of(bone_like(8, 6, 2)))
    assert degenerate_edges(face) == 2
    (face,) = faces_of(shape_of(bone_like(8, 6, 2, poles=False)))
    assert degenerate_edges(face) == 0


@pytest.mark.parametrize("name", WRITERS)
def test_a_surface_is_written_as_the_same_bytes_whenever_and_under_any_name(name, tmp_path):
    surface = bone_like(8, 6, 2)
    for file in (f"one_{name}", f"two_{name}"):
        WRITERS[name](surface, tmp_path / file)
    text = (tmp_path / f"one_{name}").read_text()
    assert text == (tmp_path / f"two_{name}").read_text()
    assert not re.search(r"20[2-9]\d-?[01]\d-?[0-3]\d", text[:600])
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"one_{name}", f"two_{name}"]


def test_the_files_state_millimetres(tmp_path):
    surface = bone_like(8, 6, 2)
    write_step(surface, tmp_path / "a.step")
    write_iges(surface, tmp_path / "a.iges")
    assert "SI_UNIT(.MILLI.,.METRE.)" in (tmp_path / "a.step").read_text()
    assert ",2,2HMM," in (tmp_path / "a.iges").read_text()


def test_what_is_no_rectangle_is_written_as_sewn_bezier_faces(tmp_path, monkeypatch):
    def refuse(surface):
        raise cad.SurfaceError("no rectangle")

    monkeypatch.setattr(cad, "to_bspline", refuse)
    surface = bone_like(7, 5, 2)
    assert write_step(surface, tmp_path / "a.step") == len(surface.elements().boxes)
    solid = read_shape(tmp_path / "a.step")
    assert solid.ShapeType() == occ().TopAbs.TopAbs_ShapeEnum.TopAbs_SOLID
    assert is_valid(solid)
    assert volume_of(solid) == pytest.approx(surface.volume, rel=1e-6)


def test_the_written_solid_is_read_as_a_watertight_outward_mesh_within_the_tolerance(tmp_path):
    surface = bone_like(8, 6, 2)
    write_iges(surface, tmp_path / "a.igs")
    for tolerance in (0.1, 0.05, 0.03):
        mesh = tessellate_shape(read_shape(tmp_path / "a.igs"), tolerance)
        assert is_closed(mesh)
        assert len(mesh.vertices) - len(mesh.faces) // 2 == 2
        assert abs(mesh.volume - surface.volume) < tolerance * surface.area
        assert surface.project(mesh.vertices).distances.max() < 1e-6
        assert surface.project(mesh.vertices[mesh.faces].mean(axis=1)).distances.max() < tolerance


def test_a_trimmed_face_is_refused(tmp_path):
    lib = occ()
    geometry = lib.BRep.BRep_Tool.Surface_s(faces_of(shape_of(bone_like(7, 5, 1)))[0])
    low, high, start, end = geometry.Bounds()
    cut = lib.BRepBuilderAPI.BRepBuilderAPI_MakeFace(geometry, low, high, start, (start + end) / 2, 1e-7).Face()
    writer = lib.STEPControl.STEPControl_Writer()
    writer.Transfer(cut, lib.STEPControl.STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(tmp_path / "cut.step"))
    with pytest.raises(
        FileError, match=r"cut\.step: a face is trimmed: .* mm\^2 of its surface are in it: cut the surf"
    ):
        bsplines_in(tmp_path / "cut.step")


def test_a_face_on_another_surface_is_refused_by_its_kind(tmp_path):
    lib = occ()
    writer = lib.STEPControl.STEPControl_Writer()
    box = lib.BRepPrimAPI.BRepPrimAPI_MakeBox(10.0, 20.0, 30.0).Shape()
    writer.Transfer(box, lib.STEPControl.STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(tmp_path / "box.step"))
    with pytest.raises(FileError, match=r"box\.step: a face lies on a Plane"):
        read_bsplines(tmp_path / "box.step")


def test_a_folder_that_is_not_there_is_refused_and_nothing_is_left(tmp_path):
    with pytest.raises(FileError, match="choose a folder that exists"):
        write_step(bone_like(6, 5, 2), tmp_path / "nowhere" / "a.step")
    assert not list(tmp_path.iterdir())


def test_without_opencascade_one_line_names_the_extra(tmp_path, monkeypatch):
    from bonecam.mesh.files import cad

    surface = bone_like(6, 5, 2)
    write_step(surface, tmp_path / "a.step")
    cad._packages.cache_clear()
    monkeypatch.setitem(sys.modules, "OCP", None)
    for act in (lambda: write_iges(surface, tmp_path / "b.iges"), lambda: read_mesh(tmp_path / "a.step")):
        with pytest.raises(FileError, match=r"^[^\n]*needs OpenCASCADE: pip install 'bonecam\[cad\]'$"):
            act()
    assert not (tmp_path / "b.iges").exists()
