"""Scripts mix both sorts of filters, are checked whole before anything runs, and write all layers or none.

A script stays in its folder: MeshLab's filters and ours write there only, over nothing that is another's, and
read what is beside the script or an input.
"""

import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pymeshlab
import pytest
from bonecam_plugins.meshlab import MeshSet, apply_script, run_script
from bonecam_plugins.meshlab.meshlab_values import CAMERAS, ScriptParameter, converted, free_texts
from bonecam_plugins.meshlab.scripts import NAMES, READ, TEXTS, TEXTURES
from small_parts import PAINTED_PLY

from bonecam.cli import main
from bonecam.errors import Cancelled, FileError, FilterError, StockError

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


def test_a_mixed_script_does_what_the_calls_do(tmp_path, phalanx, registry):
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


def test_two_runs_write_the_same_bytes(tmp_path, phalanx, registry):
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
def test_wrong_scripts_fail_with_their_line_before_anything_ran(tmp_path, registry, bad, line, reason):
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
def test_a_run_that_fails_names_the_line_and_writes_nothing(tmp_path, phalanx, registry, filters, kind, reason):
    path = script(tmp_path, *filters)
    with pytest.raises(kind, match=reason):
        run_script(path, [phalanx], tmp_path / "out", registry=registry)
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_made_is_refused_before_anything_ran(tmp_path, registry):
    path = script(tmp_path, SMOOTH)
    with pytest.raises(FileError, match="is a file: name a folder"):
        run_script(path, [tmp_path / "none.ply"], path, registry=registry)


def test_cancelling_writes_nothing(tmp_path, phalanx, registry):
    with pytest.raises(Cancelled):
        run_script(script(tmp_path, SMOOTH), [phalanx], tmp_path / "out", lambda fraction, message: False, registry)
    assert not (tmp_path / "out").exists()


def test_files_of_filters_and_layers_of_one_name_stay_apart(tmp_path, phalanx, registry):
    file = MOVE.replace("</filter>", '<Param type="RichSaveFile" value="note.txt" name="file"/></filter>')
    written = run_script(script(tmp_path, file, MOVE), [phalanx, phalanx], tmp_path / "out", registry=registry)
    assert [path.name for path in written] == ["moved.ply", "moved_1.ply", "note.txt", "phalanx.ply", "phalanx_1.ply"]
    assert all(path.is_file() for path in written)


def test_values_of_meshlab_s_types_are_converted():
    def value(kind, **attributes):
        return converted(ScriptParameter("p", kind, attributes))

    assert value("RichBool", value="true") is True
    assert value("RichMesh", value="1") == 1
    assert value("RichEnum", value="Quadric Fitting") == "Quadric Fitting"
    assert isinstance(value("RichColor", r="1", g="2", b="3"), pymeshlab.Color)
    assert np.array_equal(value("RichPoint3f", x="1", y="2", z="3"), [1, 2, 3])  # type: ignore[arg-type]
    assert np.array_equal(value("RichMatrix44f", **{f"val{i}": str(i) for i in range(16)}), np.arange(16).reshape(4, 4))  # type: ignore[arg-type]
    assert value("RichAbsPerc", value="3").value() == 3.0  # type: ignore[attr-defined]
    assert isinstance(value("RichAbsPerc", value="3%"), pymeshlab.PercentageValue)


def test_a_script_that_meshlab_saved_runs_to_the_same_mesh(tmp_path, phalanx, registry):
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


def test_a_cad_part_is_a_layer_like_a_mesh(tmp_path, registry):
    pytest.importorskip("ezdxf", reason="ezdxf is not installed: pip install 'bonecam[cad]'")
    from ezdxf.acis import api
    from ezdxf.render import forms

    (tmp_path / "block.sat").write_text("\n".join(api.export_sat([api.body_from_mesh(forms.cube().scale(10, 10, 20))])))
    (written,) = run_script(script(tmp_path, SMOOTH), [tmp_path / "block.sat"], tmp_path / "out", registry=registry)
    assert written.name == "block.ply"


@pytest.mark.parametrize(
    ("name", "trouble"),
    [
        ("none.ply", ""),
        ("text.stl", ""),
        ("mesh.docx", ""),
        ("scans", "is a folder: give a file in it"),
        ("notes.md", "Unknown format for load: md: give a readable"),
    ],
)
def test_what_is_no_mesh_is_refused_by_its_name(name, trouble, tmp_path, registry):
    (tmp_path / "scans").mkdir()
    for text in ("text.stl", "notes.md"):
        (tmp_path / text).write_text("no mesh\n")
    with pytest.raises(FileError, match=rf"{name}: {trouble}"):
        run_script(script(tmp_path, MOVE), [tmp_path / name], tmp_path / "out", registry=registry)
    assert not (tmp_path / "out").exists()


OURS = '<filter name="generate_offset"><Param type="RichSaveFile" value="{}" name="file"/></filter>'
CAMERAS_OUT = '<filter name="save_active_raster_cameras"><Param type="RichString" value="{}" name="newName"/></filter>'
TEXTURE = """<filter name="compute_texcoord_parametrization_triangle_trivial_per_wedge"/>
<filter name="compute_color_by_function_per_vertex"/>
<filter name="compute_texmap_from_color"><Param type="RichString" value="{}" name="textName"/></filter>"""
PICTURE = """<filter name="compute_texcoord_parametrization_triangle_trivial_per_wedge"/>
<filter name="set_texture_per_mesh"><Param type="RichOpenFile" value="{}" name="textName"/></filter>"""
CSV = """<filter name="compute_color_from_scalar_using_transfer_function_per_vertex">
<Param type="RichString" value="{}" name="csvFileName"/></filter>"""
CUBE = '<filter name="create_cube"/>'


@pytest.fixture
def folder(tmp_path):
    """A folder for the script and its mesh, which is that of the process in none of the tests."""
    (tmp_path / "given").mkdir()
    return tmp_path / "given"


def cube_script(folder: Path, *filters: str) -> Path:
    path = folder / "script.mlx"
    path.write_text("<FilterScript>\n" + "\n".join([CUBE, *filters]) + "\n</FilterScript>\n")
    return path


def files(folder: Path) -> set[str]:
    found = {str(item.relative_to(folder)) for item in folder.rglob("*") if item.is_file()}
    return {name for name in found if not name.endswith(".bonecam-files")}


@pytest.mark.parametrize("writes", [OURS, CAMERAS_OUT, TEXTURE], ids=["ours", "cameras", "texture"])
@pytest.mark.parametrize("name", ["../evil", "a/../../evil", "{}/evil", "/dev/shm/evil"])
def test_no_script_writes_outside_the_folder_of_outputs(writes, name, folder, tmp_path, registry):
    path = cube_script(folder, writes.format(name.format(tmp_path)))
    with pytest.raises(FilterError, match=r"leads out of the folder of outputs: .*--allow-outside") as caught:
        run_script(path, [], tmp_path / "out", registry=registry)
    assert "script.mlx, line " in str(caught.value)
    assert files(tmp_path) == {"given/script.mlx"}


@pytest.mark.parametrize(("writes", "written"), [(OURS, "b/in"), (CAMERAS_OUT, "b/in.out"), (TEXTURE, "b/in.png")])
def test_what_a_script_names_is_written_into_the_folder(writes, written, folder, tmp_path, registry, monkeypatch):
    monkeypatch.chdir(folder)
    name = written if writes is not CAMERAS_OUT else "b/in"
    run_script(cube_script(folder, writes.format(name)), [], tmp_path / "out", registry=registry)
    assert written in files(tmp_path / "out")
    assert files(folder) == {"script.mlx"}


def test_a_file_that_meshlab_names_by_itself_is_written_into_the_folder(folder, tmp_path, registry, monkeypatch):
    monkeypatch.chdir(folder)
    run_script(
        cube_script(folder, '<filter name="save_active_raster_cameras"/>'), [], tmp_path / "out", registry=registry
    )
    assert "cameras.out" in files(tmp_path / "out")
    assert files(folder) == {"script.mlx"}


def test_what_cannot_take_its_place_is_refused_before_anything_ran(folder, tmp_path, registry):
    out, other = tmp_path / "out", tmp_path / "other"
    out.mkdir()
    other.mkdir()
    (out / "full").mkdir()
    (out / "note").touch()
    (out / "link").symlink_to(other)
    (out / "file").symlink_to(other / "file")
    ran: list[str] = []
    for name, what in (
        ("link/evil", r".*link/evil: a link leads out of the folder: remove it"),
        ("note/in", ".*note is a file: give another name"),
        ("full", ".*full is a folder: give another name"),
    ):
        with pytest.raises(FilterError, match=rf"script.mlx, line 3: file '{name}': {what}"):
            run_script(
                cube_script(folder, OURS.format(name)),
                [],
                out,
                registry=registry,
                force=True,
                allow_outside=True,
                progress=lambda share, message: ran.append(message),
            )
    assert not ran
    with pytest.raises(FilterError, match="exists already"):
        run_script(cube_script(folder, OURS.format("file")), [], out, registry=registry)
    assert not files(other)


def test_a_file_that_is_there_is_written_over_by_force_only_or_where_a_run_wrote_it(folder, tmp_path, registry):
    out = tmp_path / "out"
    out.mkdir()
    for name in ("note.txt", "moved.ply"):
        (out / name).write_text("mine")
    for name, kind, place in (("note.txt", FilterError, "line 3: file 'note.txt': "), ("new.txt", FileError, "moved")):
        with pytest.raises(kind, match=f"{place}.*exists already: .*--force"):
            run_script(cube_script(folder, OURS.format(name)), [], out, registry=registry)
        assert {(out / name).read_text() for name in ("note.txt", "moved.ply")} == {"mine"}
    for force in (True, False):
        run_script(cube_script(folder, OURS.format("note.txt")), [], out, registry=registry, force=force)
        assert (out / "note.txt").read_text() == "moved\n"
    (out / "note.txt").write_text("changed")
    with pytest.raises(FilterError, match="exists already"):
        run_script(cube_script(folder, OURS.format("note.txt")), [], out, registry=registry)


@pytest.mark.parametrize("reads", [PICTURE, CSV], ids=["picture", "csv"])
def test_a_script_reads_what_is_beside_it_and_nothing_else(reads, folder, tmp_path, registry):
    (tmp_path / "t.png").write_bytes(b"")
    for name in ("../t.png", str(tmp_path / "t.png"), "/etc/passwd"):
        with pytest.raises(FilterError, match=r"is not in the folder of the script or of an input"):
            run_script(cube_script(folder, reads.format(name)), [], tmp_path / "out", registry=registry)
    (folder / "link.png").symlink_to(tmp_path / "t.png")
    with pytest.raises(FilterError, match=r"is not in the folder"):
        run_script(cube_script(folder, reads.format("link.png")), [], tmp_path / "out", registry=registry)
    with pytest.raises(FilterError, match=r"does not exist"):
        run_script(cube_script(folder, reads.format("none.png")), [], tmp_path / "out", registry=registry)
    assert not (tmp_path / "out").exists()


def test_a_texture_beside_the_script_is_read(folder, tmp_path, registry):
    run_script(cube_script(folder, TEXTURE.format("t.png")), [], tmp_path / "first", registry=registry)
    (folder / "t.png").write_bytes((tmp_path / "first" / "t.png").read_bytes())
    run_script(cube_script(folder, PICTURE.format("t.png")), [], tmp_path / "out", registry=registry)
    assert "t.png" in files(tmp_path / "out")


TRIANGLE = "mtllib {}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl skin\nf 1/1 2/1 3/1\n"


@pytest.mark.parametrize("kind", ["ply", "materials", "texture"])
@pytest.mark.parametrize("name", ["../t.png", "..\\t.png", "{}/t.png", "link.png", "cwd.png"])
def test_an_input_brings_no_file_of_another_folder(kind, name, folder, tmp_path, registry, monkeypatch):
    (tmp_path / "first").mkdir()
    run_script(cube_script(tmp_path, TEXTURE.format("t.png")), [], tmp_path / "first", registry=registry)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    for place in (tmp_path / "t.png", tmp_path / "elsewhere" / "cwd.png"):
        place.write_bytes((tmp_path / "first" / "t.png").read_bytes())
    (folder / "link.png").symlink_to(tmp_path / "t.png")
    named = name.format(tmp_path)
    given = folder / ("a.ply" if kind == "ply" else "a.obj")
    given.write_text(PAINTED_PLY.format(named) if kind == "ply" else TRIANGLE.format("a.mtl"))
    (folder / "a.mtl").write_text(f"newmtl skin\nmap_Kd {named}\n")
    if kind == "materials":
        given.write_text(TRIANGLE.format(named))
    run = partial(run_script, cube_script(folder), [given], tmp_path / "out", registry=registry)
    with pytest.raises(FileError, match=r"line \d: '.*' is not in the folder of the script or of an input"):
        run()
    assert not (tmp_path / "out").exists()
    if kind == "ply":
        run(allow_outside=True)
        assert any(name.endswith(".png") for name in files(tmp_path / "out"))


def test_an_input_of_a_kind_that_names_files_is_allowed_by_name_only(folder, tmp_path, registry):
    (folder / "a.gltf").write_text("{}")
    for allowed, what in ((False, "may name files anywhere: .*--allow-outside"), (True, "Failed opening gltf")):
        with pytest.raises(FileError, match=rf"a\.gltf: .*{what}"):
            run_script(
                cube_script(folder), [folder / "a.gltf"], tmp_path / "out", registry=registry, allow_outside=allowed
            )


def test_the_command_line_allows_both(folder, tmp_path, capsys):
    (tmp_path / "evil.out").write_text("old")
    call = ["script", str(cube_script(folder, CAMERAS_OUT.format("../evil.out"))), "-o", str(tmp_path / "out"), "-q"]
    assert main(call) == 2
    assert "--allow-outside" in capsys.readouterr().err
    place = str(tmp_path / "evil")
    path = cube_script(folder, CAMERAS_OUT.format(place))
    assert main(["script", str(path), "-o", str(tmp_path / "out"), "-q", "--allow-outside", "--force"]) == 0
    assert (tmp_path / "evil.out").read_text() != "old"


def test_a_mesh_set_s_scripts_stay_in_its_folder(folder, tmp_path, registry):
    meshes = MeshSet(registry=registry, folder=tmp_path)
    meshes.load_filter_script(str(cube_script(folder, OURS.format("../evil"))))
    with pytest.raises(FilterError, match=r"script\.mlx, line 3: file '../evil' leads out"):
        meshes.apply_filter_script()
    with pytest.raises(FilterError, match=r"leads out"):
        apply_script(meshes, cube_script(folder, OURS.format("../evil")))
    assert meshes.layers.count == 0
    meshes.load_filter_script(str(cube_script(folder, OURS.format("note.txt"))))
    meshes.apply_filter_script()
    assert (tmp_path / "note.txt").read_text() == "moved\n"
    with pytest.raises(FilterError, match=r"exists already"):
        meshes.apply_filter_script()


def test_nothing_is_sent_away(folder, tmp_path, registry):
    with pytest.raises(FilterError, match=r"line 3: export_mesh_to_sketchfab sends the mesh"):
        run_script(
            cube_script(folder, '<filter name="export_mesh_to_sketchfab"/>'), [], tmp_path / "out", registry=registry
        )


@pytest.mark.parametrize("name", sorted(CAMERAS))
def test_a_filter_on_which_pymeshlab_ends_the_process_is_refused(name, folder, tmp_path, registry):
    with pytest.raises(FilterError, match=r"takes a camera"):
        run_script(cube_script(folder, f'<filter name="{name}"/>'), [], tmp_path / "out", registry=registry)


def test_every_free_text_of_meshlab_is_known():
    order = "import sys; from bonecam_plugins.meshlab.meshlab_values import free_texts; free_texts(sys.argv[1])"
    ended = subprocess.run([sys.executable, "-c", order, "set_camera_per_mesh"], capture_output=True, check=False)
    assert ended.returncode != 0
    texts = {(name, key) for name in set(pymeshlab.filter_list()) - CAMERAS for key in free_texts(name)}
    written = {
        (name, key)
        for name, key in texts
        if key not in TEXTS | TEXTURES and name not in NAMES | {"export_mesh_to_sketchfab"} and (name, key) not in READ
    }
    assert written == {
        ("nxs_build", "output_file"),
        ("nxs_compress", "output_file"),
        ("save_active_raster_cameras", "newname"),
        ("save_snapshot", "imagefilename"),
    }
    assert texts >= READ
