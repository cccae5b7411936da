"""A script stays in its folder: MeshLab's filters and ours write there only, over nothing that is another's, and
read what is beside the script or an input."""

import subprocess
import sys
from functools import partial
from pathlib import Path

import pymeshlab
import pytest

from bonecam.cli import main
from bonecam.errors import FileError, FilterError
from bonecam.filters.filter import Registry
from bonecam.filters.meshlab_values import CAMERAS, free_texts
from bonecam.filters.meshset import MeshSet
from bonecam.filters.script_on_mesh import apply_script
from bonecam.filters.scripting import run_script
from bonecam.filters.scripts import NAMES, READ, TEXTS, TEXTURES

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
def folder(tmp_path: Path) -> Path:
    """A folder for the script and its mesh, which is that of the process in none of the tests."""
    (tmp_path / "given").mkdir()
    return tmp_path / "given"


def script(folder: Path, *filters: str) -> Path:
    path = folder / "script.mlx"
    path.write_text("<FilterScript>\n" + "\n".join([CUBE, *filters]) + "\n</FilterScript>\n")
    return path


def files(folder: Path) -> set[str]:
    found = {str(item.relative_to(folder)) for item in folder.rglob("*") if item.is_file()}
    return {name for name in found if not name.endswith(".bonecam-files")}


@pytest.mark.parametrize("writes", [OURS, CAMERAS_OUT, TEXTURE], ids=["ours", "cameras", "texture"])
@pytest.mark.parametrize("name", ["../evil", "a/../../evil", "{}/evil", "/dev/shm/evil"])
def test_no_script_writes_outside_the_folder_of_outputs(
    writes: str, name: str, folder: Path, tmp_path: Path, registry: Registry
) -> None:
    path = script(folder, writes.format(name.format(tmp_path)))
    with pytest.raises(FilterError, match=r"leads out of the folder of outputs: .*--allow-outside") as caught:
        run_script(path, [], tmp_path / "out", registry=registry)
    assert "script.mlx, line " in str(caught.value)
    assert files(tmp_path) == {"given/script.mlx"}


@pytest.mark.parametrize(("writes", "written"), [(OURS, "b/in"), (CAMERAS_OUT, "b/in.out"), (TEXTURE, "b/in.png")])
def test_what_a_script_names_is_written_into_the_folder(
    writes: str, written: str, folder: Path, tmp_path: Path, registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    name = written if writes is not CAMERAS_OUT else "b/in"
    run_script(script(folder, writes.format(name)), [], tmp_path / "out", registry=registry)
    assert written in files(tmp_path / "out")
    assert files(folder) == {"script.mlx"}


def test_a_file_that_meshlab_names_by_itself_is_written_into_the_folder(
    folder: Path, tmp_path: Path, registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    run_script(script(folder, '<filter name="save_active_raster_cameras"/>'), [], tmp_path / "out", registry=registry)
    assert "cameras.out" in files(tmp_path / "out")
    assert files(folder) == {"script.mlx"}


def test_what_cannot_take_its_place_is_refused_before_anything_ran(
    folder: Path, tmp_path: Path, registry: Registry
) -> None:
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
                script(folder, OURS.format(name)),
                [],
                out,
                registry=registry,
                force=True,
                allow_outside=True,
                progress=lambda share, message: ran.append(message),
            )
    assert not ran
    with pytest.raises(FilterError, match="exists already"):
        run_script(script(folder, OURS.format("file")), [], out, registry=registry)
    assert not files(other)


def test_a_file_that_is_there_is_written_over_by_force_only_or_where_a_run_wrote_it(
    folder: Path, tmp_path: Path, registry: Registry
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    for name in ("note.txt", "moved.ply"):
        (out / name).write_text("mine")
    for name, kind, place in (("note.txt", FilterError, "line 3: file 'note.txt': "), ("new.txt", FileError, "moved")):
        with pytest.raises(kind, match=f"{place}.*exists already: .*--force"):
            run_script(script(folder, OURS.format(name)), [], out, registry=registry)
        assert {(out / name).read_text() for name in ("note.txt", "moved.ply")} == {"mine"}
    for force in (True, False):
        run_script(script(folder, OURS.format("note.txt")), [], out, registry=registry, force=force)
        assert (out / "note.txt").read_text() == "moved\n"
    (out / "note.txt").write_text("changed")
    with pytest.raises(FilterError, match="exists already"):
        run_script(script(folder, OURS.format("note.txt")), [], out, registry=registry)


@pytest.mark.parametrize("reads", [PICTURE, CSV], ids=["picture", "csv"])
def test_a_script_reads_what_is_beside_it_and_nothing_else(
    reads: str, folder: Path, tmp_path: Path, registry: Registry
) -> None:
    (tmp_path / "t.png").write_bytes(b"")
    for name in ("../t.png", str(tmp_path / "t.png"), "/etc/passwd"):
        with pytest.raises(FilterError, match=r"is not in the folder of the script or of an input"):
            run_script(script(folder, reads.format(name)), [], tmp_path / "out", registry=registry)
    (folder / "link.png").symlink_to(tmp_path / "t.png")
    with pytest.raises(FilterError, match=r"is not in the folder"):
        run_script(script(folder, reads.format("link.png")), [], tmp_path / "out", registry=registry)
    with pytest.raises(FilterError, match=r"does not exist"):
        run_script(script(folder, reads.format("none.png")), [], tmp_path / "out", registry=registry)
    assert not (tmp_path / "out").exists()


def test_a_texture_beside_the_script_is_read(folder: Path, tmp_path: Path, registry: Registry) -> None:
    run_script(script(folder, TEXTURE.format("t.png")), [], tmp_path / "first", registry=registry)
    (folder / "t.png").write_bytes((tmp_path / "first" / "t.png").read_bytes())
    run_script(script(folder, PICTURE.format("t.png")), [], tmp_path / "out", registry=registry)
    assert "t.png" in files(tmp_path / "out")


TRIANGLE = "mtllib {}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl skin\nf 1/1 2/1 3/1\n"


@pytest.mark.parametrize("kind", ["ply", "materials", "texture"])
@pytest.mark.parametrize("name", ["../t.png", "..\\t.png", "{}/t.png", "link.png", "cwd.png"])
def test_an_input_brings_no_file_of_another_folder(
    kind: str,
    name: str,
    painted_ply: str,
    folder: Path,
    tmp_path: Path,
    registry: Registry,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "first").mkdir()
    run_script(script(tmp_path, TEXTURE.format("t.png")), [], tmp_path / "first", registry=registry)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    for place in (tmp_path / "t.png", tmp_path / "elsewhere" / "cwd.png"):
        place.write_bytes((tmp_path / "first" / "t.png").read_bytes())
    (folder / "link.png").symlink_to(tmp_path / "t.png")
    named = name.format(tmp_path)
    given = folder / ("a.ply" if kind == "ply" else "a.obj")
    given.write_text(painted_ply.format(named) if kind == "ply" else TRIANGLE.format("a.mtl"))
    (folder / "a.mtl").write_text(f"newmtl skin\nmap_Kd {named}\n")
    if kind == "materials":
        given.write_text(TRIANGLE.format(named))
    run = partial(run_script, script(folder), [given], tmp_path / "out", registry=registry)
    with pytest.raises(FileError, match=r"line \d: '.*' is not in the folder of the script or of an input"):
        run()
    assert not (tmp_path / "out").exists()
    if kind == "ply":
        run(allow_outside=True)
        assert any(name.endswith(".png") for name in files(tmp_path / "out"))


def test_an_input_of_a_kind_that_names_files_is_allowed_by_name_only(
    folder: Path, tmp_path: Path, registry: Registry
) -> None:
    (folder / "a.gltf").write_text("{}")
    for allowed, what in ((False, "may name files anywhere: .*--allow-outside"), (True, "Failed opening gltf")):
        with pytest.raises(FileError, match=rf"a\.gltf: .*{what}"):
            run_script(script(folder), [folder / "a.gltf"], tmp_path / "out", registry=registry, allow_outside=allowed)


def test_the_command_line_allows_both(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "evil.out").write_text("old")
    call = ["script", str(script(folder, CAMERAS_OUT.format("../evil.out"))), "-o", str(tmp_path / "out"), "-q"]
    assert main(call) == 2
    assert "--allow-outside" in capsys.readouterr().err
    place = str(tmp_path / "evil")
    path = script(folder, CAMERAS_OUT.format(place))
    assert main(["script", str(path), "-o", str(tmp_path / "out"), "-q", "--allow-outside", "--force"]) == 0
    assert (tmp_path / "evil.out").read_text() != "old"


def test_a_mesh_set_s_scripts_stay_in_its_folder(folder: Path, tmp_path: Path, registry: Registry) -> None:
    meshes = MeshSet(registry=registry, folder=tmp_path)
    meshes.load_filter_script(str(script(folder, OURS.format("../evil"))))
    with pytest.raises(FilterError, match=r"script\.mlx, line 3: file '../evil' leads out"):
        meshes.apply_filter_script()
    with pytest.raises(FilterError, match=r"leads out"):
        apply_script(meshes, script(folder, OURS.format("../evil")))
    assert meshes.layers.count == 0
    meshes.load_filter_script(str(script(folder, OURS.format("note.txt"))))
    meshes.apply_filter_script()
    assert (tmp_path / "note.txt").read_text() == "moved\n"
    with pytest.raises(FilterError, match=r"exists already"):
        meshes.apply_filter_script()


def test_nothing_is_sent_away(folder: Path, tmp_path: Path, registry: Registry) -> None:
    with pytest.raises(FilterError, match=r"line 3: export_mesh_to_sketchfab sends the mesh"):
        run_script(script(folder, '<filter name="export_mesh_to_sketchfab"/>'), [], tmp_path / "out", registry=registry)


@pytest.mark.parametrize("name", sorted(CAMERAS))
def test_a_filter_on_which_pymeshlab_ends_the_process_is_refused(
    name: str, folder: Path, tmp_path: Path, registry: Registry
) -> None:
    with pytest.raises(FilterError, match=r"takes a camera"):
        run_script(script(folder, f'<filter name="{name}"/>'), [], tmp_path / "out", registry=registry)


def test_every_free_text_of_meshlab_is_known() -> None:
    order = "import sys; from bonecam.filters.meshlab_values import free_texts; free_texts(sys.argv[1])"
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
