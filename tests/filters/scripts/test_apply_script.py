"""Scripts mix both sorts of filters, are checked whole before anything runs, and write all layers or none."""

from pathlib import Path

import numpy as np
import pymeshlab
import pytest

from bonecam.errors import BonecamError, Cancelled, FileError, FilterError, StockError
from bonecam.filters.filter import Registry
from bonecam.filters.meshlab_values import FilterCall, ScriptParameter, converted, write_script
from bonecam.filters.script_on_mesh import read_script
from bonecam.filters.scripting import run_script

REMESH = """ <filter name="Remeshing: Isotropic Explicit Remeshing">
  <Param type="RichInt" value="2" name="Iterations"/>
  <Param type="RichAbsPerc" value="1.2" min="0" max="31.4" name="TargetLen"/>
 </filter>
"""
MOVE = """ <filter name="Generate Offset">
  <Param type="RichPercentage" value="10%" name="distance"/>
  <Param type="RichEnum" value="1" name="how"/>
 </filter>
"""
SECTION = """ <filter name="Compute Planar Section">
  <Param type="RichEnum" value="0" name="planeAxis"/>
 </filter>
"""
SMOOTH = ' <filter name="apply_coord_taubin_smoothing"/>\n'


def script(folder: Path, *filters: str) -> Path:
    path = folder / "script.mlx"
    path.write_text("<!DOCTYPE FilterScript>\n<FilterScript>\n" + "".join(filters) + "</FilterScript>\n")
    return path


def test_a_mixed_script_does_what_the_calls_do(tmp_path: Path, phalanx: Path, registry: Registry) -> None:
    written = run_script(script(tmp_path, REMESH, MOVE, SMOOTH), [phalanx], tmp_path / "out", registry=registry)
    assert [path.name for path in written] == ["moved.ply", "phalanx.ply"]
    by_hand = pymeshlab.MeshSet()
    by_hand.load_new_mesh(str(phalanx))
    by_hand.meshing_isotropic_explicit_remeshing(iterations=2, targetlen=pymeshlab.PureValue(1.2))
    found = pymeshlab.MeshSet()
    found.load_new_mesh(str(tmp_path / "out" / "phalanx.ply"))
    assert np.allclose(found.current_mesh().vertex_matrix(), by_hand.current_mesh().vertex_matrix(), atol=1e-6)
    found.load_new_mesh(str(tmp_path / "out" / "moved.ply"))
    rise = 0.1 * by_hand.current_mesh().bounding_box().diagonal()
    by_hand.compute_matrix_from_translation(axisz=rise)
    by_hand.apply_coord_taubin_smoothing()
    assert np.allclose(found.current_mesh().vertex_matrix(), by_hand.current_mesh().vertex_matrix(), atol=1e-4)


def test_two_runs_write_the_same_bytes(tmp_path: Path, phalanx: Path, registry: Registry) -> None:
    for name in ("first", "second"):
        run_script(script(tmp_path, REMESH, MOVE), [phalanx], tmp_path / name, registry=registry)
    for item in (tmp_path / "first").iterdir():
        assert item.read_bytes() == (tmp_path / "second" / item.name).read_bytes()


@pytest.mark.parametrize(
    ("bad", "line", "reason"),
    [
        (' <filter name="Generate Nothing"/>\n', 12, "there is no filter 'Generate Nothing'"),
        (' <filter name="Isotropic Remeshing"/>\n', 12, r"did you mean 'meshing_isotropic_explicit_remeshing'\?"),
        (MOVE.replace("distance", "nope"), 13, "generate_offset knows no parameter 'nope'"),
        (MOVE.replace("10%", "ten"), 13, "generate_offset: parameter distance = 'ten': give a number of mm"),
        (MOVE.replace("10%", "21"), 13, r"distance = 21: keep it within 0 \.\. 20 mm"),
        (MOVE.replace('value="1"', 'value="7"'), 14, "how = 7: choose one of up, down"),
        (MOVE.replace('value="1"', 'value="sideways"'), 14, "how = 'sideways': choose one of up, down"),
        (MOVE.replace('value="1"', ""), 14, "parameter how has no value"),
        (MOVE.replace('name="how"', 'name="distance"'), 14, "distance is there twice|give a number"),
        (REMESH.replace("Iterations", "nope"), 13, "meshing_isotropic_explicit_remeshing knows no parameter 'nope'"),
        (REMESH.replace('value="2"', 'value="two"'), 13, "parameter Iterations = 'two': no RichInt"),
        (REMESH.replace('"RichInt" value="2"', '"RichFloat" value="2.5"'), 13, "of another type"),
        (REMESH.replace('"RichInt"', '"RichThing"'), 13, "type 'RichThing' is unknown"),
        (REMESH.replace("1.2", "nan"), 14, "parameter TargetLen = 'nan': no RichAbsPerc"),
        (REMESH.replace("1.2", "120%"), 14, "parameter TargetLen = '120%': no RichAbsPerc"),
        (REMESH.replace("RichAbsPerc", "RichFloat"), 14, "targetlen"),
        (SECTION.replace('"0"', '"99"'), 13, "planeaxis = '99' .RichEnum.: Enum 99 not valid"),
        (SECTION.replace('"0"', '"zzz"'), 13, "'Custom Axis': mend the value"),
    ],
)
def test_wrong_scripts_fail_with_their_line_before_anything_ran(
    tmp_path: Path, registry: Registry, bad: str, line: int, reason: str
) -> None:
    first = MOVE.replace("</filter>", '<Param type="RichSaveFile" value="ran.txt" name="file"/></filter>')
    path = script(tmp_path, REMESH, first, "\n", bad)
    with pytest.raises(FilterError, match=reason) as caught:
        run_script(path, [tmp_path / "missing.ply"], tmp_path / "out", registry=registry)
    assert caught.value.evidence["line"] == line
    assert f"line {line}:" in str(caught.value)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("filters", "kind", "reason"),
    [
        (
            [MOVE.replace("10%", "80%")],
            FilterError,
            r"line 3: generate_offset: parameter distance = 25\.\d+: keep it within",
        ),
        ([SMOOTH, ' <filter name="Recall"/>\n'], FilterError, r"line 4: layer 0 'phalanx.ply' has no distance"),
        (
            [MOVE.replace('name="how"', 'name="fail"').replace("RichEnum", "RichBool")],
            StockError,
            "line 3: the stock is too small",
        ),
        (
            [MOVE.replace("</filter>", '<Param type="RichSaveFile" value="../gone.txt" name="file"/></filter>')],
            FilterError,
            "line 3: file '../gone",
        ),
        ([' <filter name="Delete Current Mesh"/>\n', MOVE], FilterError, "line 4: there is no layer"),
    ],
)
def test_a_run_that_fails_names_the_line_and_writes_nothing(
    tmp_path: Path, phalanx: Path, registry: Registry, filters: list[str], kind: type[BonecamError], reason: str
) -> None:
    path = script(tmp_path, *filters)
    with pytest.raises(kind, match=reason):
        run_script(path, [phalanx], tmp_path / "out", registry=registry)
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_or_broken_mesh_is_a_file_error(tmp_path: Path, registry: Registry) -> None:
    (tmp_path / "text.stl").write_text("no mesh\n")
    for name in ("none.ply", "text.stl", "mesh.docx"):
        with pytest.raises(FileError, match=name):
            run_script(script(tmp_path, SMOOTH), [tmp_path / name], tmp_path / "out", registry=registry)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_refused_before_anything_ran(tmp_path: Path, registry: Registry) -> None:
    path = script(tmp_path, SMOOTH)
    with pytest.raises(FileError, match="is a file: name a folder"):
        run_script(path, [tmp_path / "none.ply"], path, registry=registry)


def test_cancelling_writes_nothing(tmp_path: Path, phalanx: Path, registry: Registry) -> None:
    with pytest.raises(Cancelled):
        run_script(script(tmp_path, SMOOTH), [phalanx], tmp_path / "out", lambda fraction, message: False, registry)
    assert not (tmp_path / "out").exists()


def test_files_of_filters_and_layers_of_one_name_stay_apart(tmp_path: Path, phalanx: Path, registry: Registry) -> None:
    file = MOVE.replace("</filter>", '<Param type="RichSaveFile" value="note.txt" name="file"/></filter>')
    written = run_script(script(tmp_path, file, MOVE), [phalanx, phalanx], tmp_path / "out", registry=registry)
    assert [path.name for path in written] == ["moved.ply", "moved_1.ply", "note.txt", "phalanx.ply", "phalanx_1.ply"]
    assert all(path.is_file() for path in written)


def test_parsed_steps_and_written_calls_agree(tmp_path: Path, registry: Registry) -> None:
    calls = [
        FilterCall("generate_offset", (ScriptParameter("distance", "RichPercentage", {"value": "2.5"}),)),
        FilterCall("Apply Turn"),
    ]
    write_script(calls, tmp_path / "script.mlx")
    steps = read_script(tmp_path / "script.mlx", registry)
    assert [(step.name, step.values) for step in steps] == [("generate_offset", {"distance": 2.5}), ("apply_turn", {})]


def test_values_of_meshlab_s_types_are_converted() -> None:
    def value(kind: str, **attributes: str) -> object:
        return converted(ScriptParameter("p", kind, attributes))

    assert value("RichBool", value="true") is True
    assert value("RichMesh", value="1") == 1
    assert value("RichEnum", value="Quadric Fitting") == "Quadric Fitting"
    assert isinstance(value("RichColor", r="1", g="2", b="3"), pymeshlab.Color)
    assert np.array_equal(value("RichPoint3f", x="1", y="2", z="3"), [1, 2, 3])  # type: ignore[arg-type]
    assert np.array_equal(value("RichMatrix44f", **{f"val{i}": str(i) for i in range(16)}), np.arange(16).reshape(4, 4))  # type: ignore[arg-type]
    assert value("RichAbsPerc", value="3").value() == 3.0  # type: ignore[attr-defined]
    assert isinstance(value("RichAbsPerc", value="3%"), pymeshlab.PercentageValue)


def test_a_script_that_meshlab_saved_runs_to_the_same_mesh(tmp_path: Path, phalanx: Path, registry: Registry) -> None:
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(phalanx))
    meshes.compute_matrix_from_rotation(angle=10)
    meshes.compute_selection_by_condition_per_vertex(condselect="z > 3")
    meshes.compute_color_by_function_per_vertex()
    meshes.apply_coord_taubin_smoothing(lambda_=0.4)
    meshes.compute_curvature_principal_directions_per_vertex(method="Quadric Fitting")
    meshes.compute_color_from_scalar_per_vertex()
    meshes.meshing_decimation_quadric_edge_collapse(targetperc=0.5)
    meshes.set_matrix(transformmatrix=np.diag([2.0, 2.0, 2.0, 1.0]))
    meshes.save_filter_script(str(tmp_path / "native.mlx"))
    run_script(tmp_path / "native.mlx", [phalanx], tmp_path / "out", registry=registry)
    found = pymeshlab.MeshSet()
    found.load_new_mesh(str(tmp_path / "out" / "phalanx.ply"))
    assert np.allclose(found.current_mesh().vertex_matrix(), meshes.current_mesh().vertex_matrix(), atol=1e-5)


def test_a_cad_part_is_a_layer_like_a_mesh(tmp_path: Path, registry: Registry) -> None:
    pytest.importorskip("ezdxf", reason="ezdxf is not installed: pip install 'bonecam[cad]'")
    from ezdxf.acis import api
    from ezdxf.render import forms

    (tmp_path / "block.sat").write_text("\n".join(api.export_sat([api.body_from_mesh(forms.cube().scale(10, 10, 20))])))
    (written,) = run_script(script(tmp_path, SMOOTH), [tmp_path / "block.sat"], tmp_path / "out", registry=registry)
    assert written.name == "block.ply"


def test_what_is_no_mesh_is_refused_by_its_name(tmp_path: Path, registry: Registry) -> None:
    (tmp_path / "scans").mkdir()
    (tmp_path / "notes.md").write_text("no mesh")
    for name, trouble in (
        ("scans", "is a folder: give a file in it"),
        ("notes.md", r"Unknown format for load: md: give a readable"),
    ):
        with pytest.raises(FileError, match=rf"{name}: {trouble}"):
            run_script(script(tmp_path, MOVE), [tmp_path / name], tmp_path / "out", registry=registry)
    assert not (tmp_path / "out").exists()
