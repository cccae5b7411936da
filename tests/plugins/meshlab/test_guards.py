"""MeshLab's readers work in a child, and open nothing that lies elsewhere."""

import os

import matplotlib.pyplot as plt
import numpy as np
import pymeshlab
import pytest
from bonecam_plugins.meshlab import MeshSet
from bonecam_plugins.meshlab.guards import write_layers
from small_parts import PAINTED_PLY

from bonecam.errors import FileError
from bonecam.runtime import worker

COLOURED_OBJ = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nv 0 0 1 1 1 1\n"
COLOURED_OBJ += "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def test_layers_have_the_colours_and_labels_that_meshlab_gives_them(tmp_path):
    (tmp_path / "a.obj").write_text(COLOURED_OBJ)
    native = pymeshlab.MeshSet()
    ours = MeshSet()
    for meshset in (native, ours):
        meshset.load_new_mesh(str(tmp_path / "a.obj"))
        meshset.load_new_mesh(str(tmp_path / "a.obj"))
    assert [layer.label() for layer in ours] == [layer.label() for layer in native] == ["a.obj", "a(1).obj"]
    for name in ("vertex_matrix", "face_matrix", "vertex_color_matrix", "vertex_normal_matrix"):
        assert np.array_equal(getattr(ours.current_mesh(), name)(), getattr(native.current_mesh(), name)()), name


def test_options_of_meshlabs_reader_are_taken(tmp_path):
    corners = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    facet = f"facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n"
    (tmp_path / "a.stl").write_text(f"solid a\n{facet}{facet}endsolid a\n")
    meshes = MeshSet()
    meshes.load_new_mesh(str(tmp_path / "a.stl"), unify_vertices=False)
    assert meshes.current_mesh().vertex_number() == 6


def test_damaged_and_special_files_are_refused_before_meshlab_sees_them(tmp_path, monkeypatch):
    monkeypatch.setattr(worker, "CHILD", "import os; os.abort()")
    (tmp_path / "far.obj").write_text(COLOURED_OBJ.replace("f 2 3 4", "f 2 3 1000000000"))
    (tmp_path / "device.obj").write_text("mtllib /dev/zero\n" + COLOURED_OBJ)
    (tmp_path / "painted.obj").write_text("mtllib none.mtl skin.mtl\n" + COLOURED_OBJ)
    (tmp_path / "skin.mtl").write_text("newmtl skin\nmap_Kd .\\paint.png\n")
    (tmp_path / "painted.ply").write_text(PAINTED_PLY.format("paint.png"))
    os.mkfifo(tmp_path / "paint.png")
    os.mkfifo(tmp_path / "pipe.gltf")
    for name, what in (
        ("far.obj", "line 7: a face names vertex 1000000000 of 4"),
        ("device.obj", "line 1: '/dev/zero' is no regular file: remove the line"),
        ("painted.obj", r"skin\.mtl: line 2: '.*paint\.png' is no regular file: remove the line"),
        ("painted.ply", r"painted\.ply: line 3: '.*paint\.png' is no regular file: remove the line"),
        ("pipe.gltf", "it is a pipe"),
        ("none.dae", "No such file"),
    ):
        with pytest.raises(pymeshlab.PyMeshLabException, match=what) as caught:
            MeshSet().load_new_mesh(str(tmp_path / name))
        assert isinstance(caught.value, FileError)


@pytest.mark.parametrize("kind", ["a.ply", "a.obj"])
def test_a_texture_of_another_folder_is_not_opened(kind, tmp_path):
    """What a mesh of a stranger names: beside it, or below its folder, it is its texture; elsewhere it is not."""
    folder = tmp_path / "given"
    (folder / "skins").mkdir(parents=True)
    picture = tmp_path / "paint.png"
    for place in (picture, folder / "skins" / "paint.png"):
        plt.imsave(place, np.zeros((2, 2, 3)))

    def load(name, *, allow_outside=False):
        (folder / "a.mtl").write_text(f"newmtl skin\nmap_Kd {name}\n")
        (folder / kind).write_text(PAINTED_PLY.format(name) if kind == "a.ply" else "mtllib a.mtl\n" + COLOURED_OBJ)
        meshes = MeshSet(allow_outside=allow_outside)
        meshes.load_new_mesh(str(folder / kind))
        return meshes

    assert load("skins/paint.png").current_mesh().face_number()
    for name in ("../paint.png", str(picture)):
        with pytest.raises(FileError, match=r"line \d: '.*paint\.png' is not in the folder of the mesh: put it"):
            load(name)
        assert load(name, allow_outside=True).current_mesh().face_number()


def test_what_meshlab_refuses_is_one_line(tmp_path):
    (tmp_path / "a.unknown").write_text("0 0 0")
    with pytest.raises(FileError, match=r"a\.unknown: .*: give a readable mesh file"):
        write_layers(str(tmp_path / "a.unknown"), str(tmp_path), {})


def test_a_name_that_is_not_in_utf_8_is_read(tmp_path):
    file = tmp_path / os.fsdecode(b"bone\xe9.obj")
    file.write_text(COLOURED_OBJ)
    meshes = MeshSet()
    meshes.load_new_mesh(str(file))
    assert meshes.current_mesh().face_number() == COLOURED_OBJ.count("f ")
