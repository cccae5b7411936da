"""A script has its time and its memory, and what ends its process is one line; so is it for a MeshSet."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pymeshlab
import pytest
from bonecam_plugins.meshlab import MeshSet, run_script

from bonecam.cli import main
from bonecam.errors import Cancelled, FileError, FilterError

pytestmark = pytest.mark.whole


CUBE = '<filter name="create_cube"/>'
ENDLESS = '<filter name="create_sphere"><Param type="RichInt" value="11" name="subdiv"/></filter>'
"""84 million triangles: half a minute and tens of GB."""


def script(folder: Path, *filters: str) -> Path:
    path = folder / "script.mlx"
    path.write_text("<FilterScript>\n" + "\n".join(filters) + "\n</FilterScript>\n")
    return path


def test_a_script_works_in_a_process_of_its_own(tmp_path):
    seen: list[str] = []
    written = run_script(script(tmp_path, CUBE), [], tmp_path / "out", progress=lambda share, what: seen.append(what))
    assert [path.name for path in written] == ["Box_Cube.ply"]
    assert seen == ["line 2: create_cube"]


def test_a_script_that_takes_too_long_is_stopped(tmp_path):
    with pytest.raises(FilterError, match=r"mlx, line 3: create_sphere: took more than 10 s: .*--time-limit") as caught:
        run_script(script(tmp_path, CUBE, ENDLESS), [], tmp_path / "out", seconds=10.0)
    assert caught.value.evidence == {"filter": "create_sphere", "line": 3}
    assert not (tmp_path / "out").exists()


def test_a_script_that_wants_too_much_memory_is_stopped(tmp_path):
    with pytest.raises(FilterError, match=r"line 3: create_sphere: wanted more memory .*--memory-limit"):
        run_script(script(tmp_path, CUBE, ENDLESS), [], tmp_path / "out", memory=0.6)
    assert not (tmp_path / "out").exists()


def test_the_command_line_tells_and_takes_the_limits(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["script", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert "seconds that the script may take (900)" in told
    assert "memory that its data may take (4)" in told
    call = ["script", str(script(tmp_path, CUBE)), "-o", str(tmp_path / "out"), "-q"]
    assert main([*call, "--memory-limit", "0.01"]) == 2
    assert re.fullmatch(r"bonecam: .*script\.mlx: .*--memory-limit\n", capsys.readouterr().err)
    for value in ("0", "nan", "inf", "much", "1e300"):
        for option in ("--time-limit", "--memory-limit"):
            with pytest.raises(SystemExit):
                main([*call, option, value])
            told = capsys.readouterr().err
            assert f"{option}: invalid number above 0, at most 1,000,000, value: '{value}'" in told
    assert main([*call, "--time-limit", "1e6", "--memory-limit", "1e6"]) == 0


@pytest.mark.parametrize("limit", [{"seconds": 0.0}, {"memory": 1e300}, {"seconds": float("nan")}])
def test_a_limit_that_is_none_is_a_wrong_call(limit, tmp_path):
    with pytest.raises(ValueError, match=rf"{next(iter(limit))} = .*: give a number above 0, at most 1,000,000"):
        run_script(script(tmp_path, CUBE), [], tmp_path / "out", **limit)


def test_a_script_without_filters_and_meshes_prints_nothing(tmp_path, capsys):
    call = ["script", str(script(tmp_path)), "-o", str(tmp_path / "out")]
    assert main([*call, "--time-limit", "0.01"]) == 2
    assert "its beginning: took more than 0.01 s:" in capsys.readouterr().err
    assert main(call) == 0
    assert capsys.readouterr().out == ""


def test_a_script_is_cancelled_by_its_progress(tmp_path):
    with pytest.raises(Cancelled):
        run_script(script(tmp_path, CUBE, ENDLESS), [], tmp_path / "out", progress=lambda share, what: False)
    assert not (tmp_path / "out").exists()


def test_what_ends_meshlab_is_one_line(tmp_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    meshes = MeshSet()
    meshes.create_cube()
    with pytest.raises(pymeshlab.PyMeshLabException, match=r"MeshLab's save_snapshot broke down \(exit -\d+\)"):
        meshes.save_snapshot(imagefilename=str(tmp_path / "a.png"))
    with pytest.raises(FileError, match=r"line 3: .*gpu_generated_image.png: MeshLab's save_snapshot broke down"):
        run_script(script(tmp_path, CUBE, '<filter name="save_snapshot"/>'), [], tmp_path / "out")
    assert sorted(os.listdir(tmp_path)) == ["script.mlx"]


def test_projects_and_rasters_are_tried_in_a_process_of_their_own(tmp_path):
    meshes = MeshSet()
    meshes.create_cube()
    meshes.save_current_mesh(str(tmp_path / "cube.ply"))
    project = '<MeshLabProject><MeshGroup><MLMesh label="a" filename="{}"/></MeshGroup></MeshLabProject>'
    (tmp_path / "sound.mlp").write_text("<!DOCTYPE MeshLabDocument>" + project.format("cube.ply"))
    meshes.load_project(str(tmp_path / "sound.mlp"))
    assert meshes.mesh_number() == 2

    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "no.mlp").write_text("<!DOCTYPE MeshLabDocument>" + project.format("none.ply"))
    for load, name, what in (
        (meshes.load_project, "pipe", "it is a pipe"),
        (meshes.load_project, "no.mlp", "none.ply mesh file not found"),
        (meshes.load_new_raster, "pipe", "it is a pipe"),
        (meshes.load_new_raster, "cube.ply", "Unknown format"),
    ):
        with pytest.raises(pymeshlab.PyMeshLabException, match=what) as caught:
            load(str(tmp_path / name))
        assert isinstance(caught.value, FileError)
    assert meshes.mesh_number() == 2


def test_a_filter_that_may_end_the_process_works_where_it_does_not(tmp_path):
    meshes = MeshSet()
    meshes.create_cube()
    meshes.save_current_mesh(str(tmp_path / "cube.ply"))
    meshes.nxs_build(input_file=str(tmp_path / "cube.ply"), output_file=str(tmp_path / "cube.nxs"))
    assert (tmp_path / "cube.nxs").stat().st_size > 0


@pytest.mark.parametrize(("closed", "printed"), [(">&-", ""), ("<&- 2>&-", "out/Box_Cube.ply\n")])
def test_a_closed_stream_is_as_one_that_leads_nowhere(closed, printed, tmp_path):
    (tmp_path / "a.mlx").write_text('<FilterScript><filter name="create_cube"/></FilterScript>')
    call = f"exec '{sys.executable}' -m bonecam script a.mlx -o out {closed}"
    done = subprocess.run(["sh", "-c", call], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, printed, "")
    assert (tmp_path / "out" / "Box_Cube.ply").exists()
