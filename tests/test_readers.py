"""Files with endings that users and packages add: meshes and surfaces like those that ship read."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tsplines import bone_like

from bonecam.batch.run import batch_parts
from bonecam.errors import FileError, JobError, UnitsError
from bonecam.job import Job, MeshJob
from bonecam.mesh import prepare_part, read_mesh
from bonecam.mesh.files.mesh_files import WRITABLE, read_mesh_file, write_mesh
from bonecam.nc import read_dialect
from bonecam.report.outputs import check_ending
from bonecam.surface import load_surface, save_surface
from bonecam.surface.files.surface_input import holds_surface, machined_surface, read_part
from bonecam.surface.files.tspline_text import check_target

MESHES = """
import numpy as np
from bonecam.mesh import TriangleMesh
from bonecam.plugins import Reader

def read(path):
    vertices, index = np.unique(np.loadtxt(path).reshape(-1, 3), axis=0, return_inverse=True)
    return TriangleMesh(vertices, index.reshape(-1, 3).astype(np.int32))

READER = Reader("mesh", read)
"""
SURFACES = """
from bonecam.files import write_whole
from bonecam.plugins import Reader
from bonecam.surface import load_surface, save_surface

def read(path):
    path.with_suffix(".tspline").write_text(path.read_text()[len("mine"):])
    return load_surface(path.with_suffix(".tspline"))

def write(surface, path):
    save_surface(surface, path.with_suffix(".tspline"))
    write_whole(path, "mine" + path.with_suffix(".tspline").read_text())

READER = Reader("surface", read, write)
"""


@pytest.fixture
def readers(tmp_path, monkeypatch):
    """The user's folder of readers, two in it, and one that cannot be loaded."""
    folder = tmp_path / "home" / "readers"
    folder.mkdir(parents=True)
    for name, text in (("tri", MESHES), ("mine", SURFACES), ("broken", "READER = 1 / 0\n")):
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.setenv("BONECAM_HOME", str(tmp_path / "home"))
    return folder


def as_text(path: Path, scale: float = 1.0) -> Path:
    """A bone's triangles as text, a corner a line."""
    mesh = bone_like(8, 6, 2).tessellate(0.05)
    np.savetxt(path, scale * mesh.vertices[mesh.faces].reshape(-1, 3))
    return path


def test_a_mesh_of_the_user_s_is_a_part_like_any_other(readers, tmp_path):
    file = as_text(tmp_path / "bone.TRI")
    write_mesh(read_mesh(file), tmp_path / "bone.ply")
    assert not holds_surface(file)
    part, same = (prepare_part(path, MeshJob()) for path in (file, tmp_path / "bone.ply"))
    np.testing.assert_array_equal(part.mesh.vertices, same.mesh.vertices)
    assert (part.units, read_mesh_file(file).unit) == ("mm", "mm")
    with pytest.raises(UnitsError, match=r"bone\.TRI: states its unit itself and was read in mm"):
        prepare_part(file, MeshJob(units="inch"))
    (tmp_path / "bone.ply").unlink()
    assert [part.file for part in batch_parts([tmp_path], Job())] == [file]


def test_a_surface_of_the_user_s_is_written_and_read_like_any_other(readers, tmp_path):
    surface = bone_like(8, 6, 2)
    check_target(tmp_path / "bone.mine")
    save_surface(surface, tmp_path / "bone.mine")
    assert holds_surface(tmp_path / "bone.mine")
    assert load_surface(tmp_path / "bone.mine").control_points.tobytes() == surface.control_points.tobytes()
    _, fitted = read_part(tmp_path / "bone.mine", Job())
    assert fitted is not None
    assert fitted.surface.volume == pytest.approx(surface.volume, rel=1e-12)
    assert machined_surface(tmp_path / "bone.mine", "mm", 0.1).tmesh.size == surface.tmesh.size
    with pytest.raises(FileError, match=r"bone\.mine: is read as a surface: give a mesh"):
        read_mesh(tmp_path / "bone.mine")


def test_names_are_refused_with_the_endings_of_the_user_s(readers, tmp_path):
    (tmp_path / "a.foo").write_text("x")
    with pytest.raises(FileError, match=r"unknown ending '\.foo'.*\.dat, .*\.mine, \.tri"):
        read_mesh(tmp_path / "a.foo")
    with pytest.raises(FileError, match=r"give a surface that passes can follow \(.*\.tspline, .*\.mine, \.tri"):
        machined_surface(tmp_path / "a.foo", "mm", 0.1)
    with pytest.raises(FileError, match=r"unknown ending '\.foo': end the name in one of \.tspline, .*\.mine"):
        check_target(tmp_path / "a.foo")
    with pytest.raises(FileError, match=r"a\.tri: is no file to write: \.tri is read"):
        check_target(tmp_path / "a.tri")
    with pytest.raises(FileError, match=r"programs do not end in \.mine"):
        check_ending(tmp_path / "a.mine", read_dialect("heidenhain"))
    with pytest.raises(FileError, match=r"a\.tri: is read as a mesh: give a surface"):
        load_surface(as_text(tmp_path / "a.tri"))
    with pytest.raises(FileError, match=r"none\.tri: cannot be read"):
        read_mesh(tmp_path / "none.tri")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("READER = Reader('mesh', lambda path: 1 / 0)", r"bad\.py: line 2: fails: ZeroDivisionError"),
        ("READER = Reader('mesh', lambda path: [])", r"bad\.py: fails: TypeError: it makes a list .*no TriangleMesh"),
        ("READERS = 1", r"bad\.py: cannot be loaded: AttributeError"),
    ],
)
def test_a_reader_that_fails_is_one_line(text, why, readers, tmp_path):
    (readers / "bad.py").write_text(f"from bonecam.plugins import Reader\n{text}\n", encoding="utf-8")
    with pytest.raises(JobError, match=why) as caught:
        read_mesh(as_text(tmp_path / "a.bad"))
    assert "\n" not in str(caught.value)


def test_only_the_reader_of_a_file_is_loaded_and_none_of_what_ships_is_replaced(readers, tmp_path):
    for name in ("ply", "tspline", "nrrd"):
        (readers / f"{name}.py").write_text("READER = 1 / 0\n", encoding="utf-8")
    surface = bone_like(8, 6, 2)
    save_surface(surface, tmp_path / "a.tspline")
    write_mesh(surface.tessellate(0.1), tmp_path / f"a{WRITABLE[0]}")
    assert load_surface(tmp_path / "a.tspline").tmesh.size == surface.tmesh.size
    assert not holds_surface(tmp_path / "a.nrrd")
    assert len(read_mesh(tmp_path / "a.ply").faces)
    with pytest.raises(JobError, match=r"broken\.py: line 1: cannot be loaded: ZeroDivisionError"):
        read_mesh(as_text(tmp_path / "a.broken"))


ALONE = """
from pathlib import Path
from bonecam.errors import FileError
from bonecam.mesh import read_mesh
from bonecam.surface import save_surface, load_surface, skin
import numpy as np
turn = np.arange(12) * np.pi / 6
surface = skin([np.column_stack([np.cos(turn), np.sin(turn), np.full(12, float(z))]) for z in range(6)], 0.01)
save_surface(surface, "a.tspline")
print(load_surface("a.tspline").tmesh.size == surface.tmesh.size)
for name in ("a.tsm", "a.iga"):
    Path(name).write_text("x")
    for call in (lambda: save_surface(surface, name), lambda: read_mesh(name)):
        try:
            call()
        except FileError as error:
            print(error)
"""


def test_without_plugins_their_files_are_refused_in_one_line(tmp_path):
    alone = {**os.environ, "BONECAM_NO_PLUGINS": "1", "BONECAM_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", ALONE], cwd=tmp_path, env=alone, capture_output=True, text=True, check=True
    )
    first, *told = done.stdout.splitlines()
    assert first == "True"
    assert len(told) == 4
    for line, name in zip(told, ("a.tsm", "a.tsm", "a.iga", "a.iga"), strict=True):
        assert line.startswith(f"{name}: has the unknown ending '{Path(name).suffix}'")
