"""STEP and IGES parts as triangles."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mesh_bodies import check_refused, is_closed

from bonecam.errors import FileError, UnitsError
from bonecam.mesh import read_in_mm, read_mesh
from bonecam.mesh.files import cad
from bonecam.mesh.files.cad import occ, read_and_tessellate, tessellate_shape
from bonecam.progress import silent
from bonecam.runtime import worker

pytest.importorskip("OCP", reason="OpenCASCADE's wheel is not installed: pip install 'bonecam[cad]'")


def write(shape: Any, path: Path, unit: str = "MM") -> Path:
    """A shape as STEP or IGES by OpenCASCADE's own writers."""
    lib = occ()
    if path.suffix == ".iges":
        writer = lib.IGESControl.IGESControl_Writer(unit, 0)
        writer.AddShape(shape)
        writer.ComputeModel()
    else:
        writer = lib.STEPControl.STEPControl_Writer()
        lib.Interface.Interface_Static.SetCVal_s("write.step.unit", unit)
        writer.Transfer(shape, lib.STEPControl.STEPControl_StepModelType.STEPControl_AsIs)
        lib.Interface.Interface_Static.SetCVal_s("write.step.unit", "MM")
    writer.Write(str(path))
    return path


def cylinder() -> Any:
    return occ().BRepPrimAPI.BRepPrimAPI_MakeCylinder(4.0, 20.0).Shape()


@pytest.fixture
def without_child(monkeypatch):
    """Files are read in this process, for tests of what is read: a child loads OpenCASCADE for 1.6 s."""

    def call(work, *given, **_):
        return worker.function_of(work)(*given, silent)

    monkeypatch.setattr(cad, "call_in_child", call)


@pytest.mark.usefixtures("without_child")
@pytest.mark.parametrize("name", ["part.step", "part.stp", "part.iges", "part.igs"])
def test_a_cylinder_is_one_closed_outward_mesh(name, tmp_path):
    write(cylinder(), tmp_path / "a.iges" if "ig" in name else tmp_path / "a.step").rename(tmp_path / name)
    mesh = read_mesh(tmp_path / name)
    assert is_closed(mesh)
    assert mesh.volume == pytest.approx(np.pi * 16 * 20, rel=0.01)


def test_the_chord_tolerance_is_kept(tmp_path):
    file = write(occ().BRepPrimAPI.BRepPrimAPI_MakeSphere(10.0).Shape(), tmp_path / "ball.step")
    for tolerance in (0.1, 0.02):
        mesh = read_and_tessellate(file, tolerance).mesh
        radius = np.linalg.norm(mesh.vertices[mesh.faces].mean(axis=1), axis=1)
        assert 10 - tolerance < radius.min() <= radius.max() <= 10
        assert is_closed(mesh)


def ball_on_a_stick() -> Any:
    make = occ().BRepPrimAPI
    stick = make.BRepPrimAPI_MakeCylinder(3.0, 25.0).Shape()
    return occ().BRepAlgoAPI.BRepAlgoAPI_Fuse(make.BRepPrimAPI_MakeSphere(10.0).Shape(), stick).Shape()


def ring() -> Any:
    return occ().BRepPrimAPI.BRepPrimAPI_MakeTorus(10.0, 3.0).Shape()


def cone() -> Any:
    return occ().BRepPrimAPI.BRepPrimAPI_MakeCone(5.0, 0.0, 20.0).Shape()


@pytest.mark.parametrize("part", [cylinder, ball_on_a_stick, ring, cone])
@pytest.mark.parametrize("tolerance", [None, 0.1, 0.03])
def test_no_part_of_a_face_is_lost(part, tolerance):
    shape = part()
    found = occ().GProp.GProp_GProps()
    occ().BRepGProp.BRepGProp.VolumeProperties_s(shape, found)
    mesh = tessellate_shape(shape, tolerance)
    assert is_closed(mesh)
    assert abs(mesh.volume - found.Mass()) < (tolerance or 0.03) * mesh.area


def test_a_part_too_small_to_be_tessellated_is_told(tmp_path):
    speck = write(occ().BRepPrimAPI.BRepPrimAPI_MakeBox(1e-5, 1e-5, 1e-5).Shape(), tmp_path / "speck.step")
    with pytest.raises(FileError, match=r"speck.step: .* mm from corner to corner: it cannot be .*: export it"):
        read_and_tessellate(speck)
    with pytest.raises(FileError, match="give a larger tolerance"):
        tessellate_shape(cylinder(), np.nan)


@pytest.mark.parametrize("mirrored", [False, True])
def test_parts_of_an_assembly_stand_in_their_places_and_face_outward(mirrored):
    lib = occ()
    move = lib.gp.gp_Trsf()
    if mirrored:
        move.SetMirror(lib.gp.gp_Ax2(lib.gp.gp_Pnt(50, 0, 0), lib.gp.gp_Dir(1, 0, 0)))
        moved = lib.BRepBuilderAPI.BRepBuilderAPI_Transform(cone(), move).Shape()
    else:
        move.SetTranslation(lib.gp.gp_Vec(100, 0, 0))
        moved = cone().Moved(lib.TopLoc.TopLoc_Location(move))
    build, both = lib.BRep.BRep_Builder(), lib.TopoDS.TopoDS_Compound()
    build.MakeCompound(both)
    for shape in (cone(), moved):
        build.Add(both, shape)
    mesh = tessellate_shape(both, 0.05)
    assert is_closed(mesh)
    assert mesh.volume == pytest.approx(2 * np.pi * 25 * 20 / 3, rel=0.02)
    np.testing.assert_allclose(mesh.bounds[:, 0], [-5, 105], atol=0.05)


def test_a_face_that_cannot_be_tessellated_is_an_error_and_not_a_hole(tmp_path, monkeypatch):
    file = write(cylinder(), tmp_path / "a.step")
    monkeypatch.setattr(cad, "DEFLECTION", 1e3)
    with pytest.raises(FileError, match=r"a\.step: a face of the part cannot be tessellated"):
        read_and_tessellate(file)


@pytest.mark.parametrize(("unit", "name"), [("M", "a.step"), ("INCH", "a.step"), ("M", "a.iges"), ("INCH", "a.iges")])
def test_a_part_stated_in_another_unit_comes_in_mm(unit, name, tmp_path):
    mesh = read_and_tessellate(write(cylinder(), tmp_path / name, unit)).mesh
    assert np.ptp(mesh.vertices[:, 2]) == pytest.approx(20.0, rel=1e-6)
    with pytest.raises(UnitsError, match="leave out --units"):
        read_in_mm(tmp_path / name, "m")


def test_loose_iges_faces_are_sewn(tmp_path):
    lib = occ()
    build, loose = lib.BRep.BRep_Builder(), lib.TopoDS.TopoDS_Compound()
    build.MakeCompound(loose)
    explorer = lib.TopExp.TopExp_Explorer(cylinder(), lib.TopAbs.TopAbs_ShapeEnum.TopAbs_FACE)
    while explorer.More():
        build.Add(loose, lib.BRepBuilderAPI.BRepBuilderAPI_Copy(explorer.Current()).Shape())
        explorer.Next()
    assert is_closed(read_and_tessellate(write(loose, tmp_path / "loose.iges")).mesh)


def test_curves_without_surfaces_are_refused(tmp_path):
    lib = occ()
    edge = lib.BRepBuilderAPI.BRepBuilderAPI_MakeEdge(lib.gp.gp_Pnt(0, 0, 0), lib.gp.gp_Pnt(1, 2, 3)).Edge()
    with pytest.raises(FileError, match=r"edge\.step: holds no surfaces"):
        read_mesh(write(edge, tmp_path / "edge.step"))


@pytest.mark.parametrize("ending", ["step", "iges"])
def test_what_stands_beside_the_faces_of_a_part_is_told(ending, tmp_path):
    lib = occ()
    make, point = lib.BRepBuilderAPI, lib.gp.gp_Pnt
    build, all_of_it = lib.BRep.BRep_Builder(), lib.TopoDS.TopoDS_Compound()
    build.MakeCompound(all_of_it)
    edge = make.BRepBuilderAPI_MakeEdge(point(50, 0, 0), point(51, 2, 3)).Edge()
    build.Add(all_of_it, cylinder())
    build.Add(all_of_it, make.BRepBuilderAPI_MakeWire(edge).Wire())
    build.Add(all_of_it, make.BRepBuilderAPI_MakeVertex(point(0, 60, 0)).Vertex())
    build.Add(all_of_it, make.BRepBuilderAPI_MakeFace(lib.gp.gp_Pln(), 9.0, 12.0, 9.0, 12.0).Face())
    given = read_and_tessellate(write(all_of_it, tmp_path / f"a.{ending}"))
    beside = ("1 face beside its solids, read with them",) if ending == "step" else ()  # IGES has no solids
    assert given.notes == ("left out of its file: 1 curves, 1 points", *beside)
    np.testing.assert_allclose(given.mesh.bounds[1], [12, 12, 20])


def test_faces_of_triangles_in_a_step_file_are_told(tmp_path):
    text = write(cylinder(), tmp_path / "a.step").read_text()
    more = """#9001=COORDINATES_LIST('',4,((0.,0.,0.),(50.,0.,0.),(0.,50.,0.),(0.,0.,50.)));
    #9002=TRIANGULATED_FACE('',#9001,4,((0.,0.,1.)),$,(),((1,3,2),(1,2,4),(2,3,4),(1,4,3)));
    #9003=TESSELLATED_SHELL('',(#9002),$);\n"""
    (tmp_path / "a.step").write_text(more.join(text.rsplit("ENDSEC;", 1)).replace(more, f"{more}ENDSEC;"))
    assert read_and_tessellate(tmp_path / "a.step").notes == ("left out of its file: 1 tessellated faces",)


STEP_HEAD = b"ISO-10303-21;\nHEADER;\n"
BAD = {
    "empty.step": (b"", "is empty"),
    "text.stp": (b"a letter", "is no STEP file"),
    "cut.step": (STEP_HEAD + b"FILE_NAME", "is cut short"),
    "hollow.step": (STEP_HEAD + b"ENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n", "nothing in it"),
    "text.igs": (b"a letter", "is no IGES file"),
    "cut.iges": (b"x".ljust(72) + b"S      1\n", "is cut short"),
}


@pytest.mark.usefixtures("without_child")
@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line_that_names_it(name, tmp_path):
    check_refused(tmp_path / name, *BAD[name])


def test_opencascade_says_nothing_on_the_terminal(tmp_path, capfd):
    read_mesh(write(cylinder(), tmp_path / "a.step"))
    read_and_tessellate(tmp_path / "a.step")
    with pytest.raises(FileError):
        read_and_tessellate(tmp_path / "none.step")
    assert capfd.readouterr() == ("", "")


def test_an_error_of_opencascade_itself_is_one_line(tmp_path, monkeypatch):
    """It comes out of the child as it was raised: in Python OpenCASCADE's errors have no base of their own."""

    def fail(*_, **__):
        raise occ().Transfer.Transfer_TransferFailure("Transfer in Error Status")

    file = write(cylinder(), tmp_path / "part.iges")
    monkeypatch.setattr(cad, "call_in_child", fail)
    with pytest.raises(FileError, match=r"part\.iges: is no readable IGES file \(Transfer in Error Status\)"):
        read_mesh(file)


def test_a_shape_without_faces_has_no_mesh():
    nothing = occ().TopoDS.TopoDS_Compound()
    occ().BRep.BRep_Builder().MakeCompound(nothing)
    assert cad._mesh_of(nothing, 0.1, 0.1) is None


def test_a_file_that_ends_opencascade_is_one_line(tmp_path, monkeypatch):
    write(cylinder(), tmp_path / "a.step")
    monkeypatch.setattr(worker, "CHILD", "import os; os.abort()")
    with pytest.raises(
        FileError, match=r"a\.step: OpenCASCADE broke down \(exit -6\)[^\n]*: export the part as STEP again$"
    ):
        read_mesh(tmp_path / "a.step")


@pytest.mark.parametrize("name", ["a part.step", os.fsdecode(b"not in UTF-8 \xe9.step")], ids=["blank", "bytes"])
def test_the_child_hands_back_the_same_mesh(name, tmp_path):
    file = write(cylinder(), tmp_path / "a.step").rename(tmp_path / name)
    assert read_mesh(file).vertices.tobytes() == read_and_tessellate(file).mesh.vertices.tobytes()


@pytest.mark.parametrize(
    ("operator", "told"),
    [
        ("$,$,#9001,1.,$", ""),
        ("$,$,#9001,2.,$", r"a\.step: scales or mirrors a part into its place"),
        ("#9002,$,#9001,$,$", r"a\.step: scales or mirrors a part into its place"),
        ("$,$,#9001,x,$", r"a\.step: is no readable STEP file \(a transformation without its numbers\)"),
    ],
)
def test_a_part_that_is_scaled_or_mirrored_into_its_place_is_refused(operator, told, tmp_path):
    more = f"""#9001=CARTESIAN_POINT('',(0.,0.,0.));
    #9002=DIRECTION('',(-1.,0.,0.));
    #9003=CARTESIAN_TRANSFORMATION_OPERATOR_3D('','',$,{operator});\nENDSEC;"""
    text = write(cylinder(), tmp_path / "a.step").read_text()
    (tmp_path / "a.step").write_text(more.join(text.rsplit("ENDSEC;", 1)))
    if told:
        with pytest.raises(FileError, match=told):
            read_and_tessellate(tmp_path / "a.step")
    else:
        assert len(read_and_tessellate(tmp_path / "a.step").mesh.faces)


def test_a_face_that_is_lost_beside_a_part_in_two_places_is_told(tmp_path):
    lib = occ()
    build, both, move = lib.BRep.BRep_Builder(), lib.TopoDS.TopoDS_Compound(), lib.gp.gp_Trsf()
    move.SetTranslation(lib.gp.gp_Vec(100, 0, 0))
    build.MakeCompound(both)
    one, other = (lib.BRepPrimAPI.BRepPrimAPI_MakeBox(size, 20.0, 20.0).Shape() for size in (20.0, 30.0))
    for shape in (one, one.Moved(lib.TopLoc.TopLoc_Location(move)), other):
        build.Add(both, shape)
    lib.Interface.Interface_Static.SetIVal_s("write.step.assembly", 1)
    text = write(both, tmp_path / "a.step").read_text()
    assert read_and_tessellate(tmp_path / "a.step").mesh.volume == pytest.approx(28000)
    head, _, tail = text.rpartition("PLANE('',")
    (tmp_path / "a.step").write_text(f"{head}DIRECTION('',(1.,0.,0.){tail[tail.index(')') :]}")
    with pytest.raises(FileError, match="11 of its 12 faces could be read"):
        read_and_tessellate(tmp_path / "a.step")
