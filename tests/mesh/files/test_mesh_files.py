import os
import resource
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bonecam_meshes import path as shipped

from bonecam.errors import FileError
from bonecam.mesh.files.mesh_files import read_mesh, read_mesh_file, write_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh

TETRAHEDRON = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
PLY += "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
FACES = ("0 2 1", "0 1 3", "1 2 3", "0 3 2")
OFF = "OFF\n4 4 0\n" + TETRAHEDRON + "".join(f"3 {face}\n" for face in FACES)
OBJ = "".join(f"v {line}\n" for line in TETRAHEDRON.splitlines()) + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def ascii_stl() -> str:
    points = TETRAHEDRON.splitlines()
    loops = ["outer loop\n" + "".join(f"vertex {points[int(k)]}\n" for k in face.split()) + "endloop" for face in FACES]
    return "solid nan\n" + "".join(f"facet normal 0 0 0\n{loop}\nendfacet\n" for loop in loops) + "endsolid nan\n"


GOOD = {
    "a.off": OFF,
    "a.obj": OBJ,
    "a.ply": PLY + TETRAHEDRON + "".join(f"3 {f}\n" for f in FACES),
    "a.stl": ascii_stl(),
}


@pytest.mark.parametrize("name", GOOD)
def test_every_text_format_gives_the_same_solid(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(GOOD[name])
    mesh = read_mesh(tmp_path / name)
    assert (len(mesh.vertices), len(mesh.faces)) == (4, 4)
    assert mesh.volume == pytest.approx(1 / 6)


@pytest.mark.parametrize("ending", [".ply", ".stl"])
def test_what_is_written_is_read_back_and_is_the_same_bytes_twice(
    ellipsoid: Callable[..., TriangleMesh], ending: str, tmp_path: Path
) -> None:
    mesh = ellipsoid(3, 4, 9)
    write_mesh(mesh, tmp_path / f"one{ending}")
    write_mesh(mesh, tmp_path / f"two{ending}")
    assert (tmp_path / f"one{ending}").read_bytes() == (tmp_path / f"two{ending}").read_bytes()
    again = read_mesh(tmp_path / f"one{ending}")
    assert (len(again.vertices), len(again.faces)) == (len(mesh.vertices), len(mesh.faces))
    assert again.volume == pytest.approx(mesh.volume, rel=1e-6)
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"one{ending}", f"two{ending}"]


def test_quality_is_written_to_ply(ellipsoid: Callable[..., TriangleMesh], tmp_path: Path) -> None:
    mesh = ellipsoid(3, 4, 9)
    write_mesh(mesh, tmp_path / "q.ply", quality=mesh.vertices[:, 2])
    assert b"property double quality" in (tmp_path / "q.ply").read_bytes()[:600]
    with pytest.raises(ValueError, match="quality"):
        write_mesh(mesh, tmp_path / "q.ply", quality=np.zeros(3))


def binary_stl(count: int, corners: np.ndarray) -> bytes:
    return (
        b"solid, but binary".ljust(80)
        + struct.pack("<I", count)
        + b"".join(bytes(12) + c.astype("<f4").tobytes() + bytes(2) for c in corners)
    )


TRIANGLES = np.arange(18.0).reshape(2, 9) ** 1.5
BAD = {
    "empty.stl": (b"", "is empty"),
    "text.stl": (b"hello, this is a letter and no mesh", "is text but no STL"),
    "short.stl": (binary_stl(4, TRIANGLES), "header tells of 4 triangles, 2 are there"),
    "nan.stl": (binary_stl(2, np.where(TRIANGLES > 50, np.nan, TRIANGLES)), "not numbers in 1 of 2 triangles"),
    "nan.off": (OFF.replace("1 0 0", "1 nan 0").encode(), "line 4: 'nan' is not a number"),
    "inf.obj": (OBJ.replace("v 1 0 0", "v -inf 0 0").encode(), "line 2: '-inf' is not a number"),
    "nan.ply": (
        GOOD["a.ply"].replace("\n1 0 0", "\n1 0 NaN").encode(),
        "1 of 4 vertices with coordinates that are not numbers, first vertex 1",
    ),
    "far.off": (OFF.replace("1 2 3", "1 2 9").encode(), "line 9: a face names a vertex outside 0..3"),
    "far.obj": (OBJ.replace("f 2 3 4", "f 2 3 99999").encode(), "line 7: a face names vertex 99999 of 4"),
    "zero.obj": (OBJ.replace("f 2 3 4", "f 0 3 4").encode(), "before the first"),
    "short.off": (OFF[:-8].encode(), "is cut short: 4 faces are told of, 3 are there"),
    "face.off": (OFF.replace("3 1 2 3", "3 1 2").encode(), "line 9: 2 numbers are no face of 3 corners"),
    "more.off": (OFF.replace("3 1 2 3", "3 1 2 3 4").encode(), "line 9: 4 numbers are no face of 3 corners"),
    "word.obj": (OBJ.replace("v 1 0 0", "v one 0 0").encode(), "line 2: 'one' is not a number"),
    "huge.obj": (OBJ.replace("v 1 0 0", "v 1e300 0 0").encode(), "a coordinate of 1e+300"),
    "endless.obj": (OBJ.replace("v 1 0 0", "v 1e999 0 0").encode(), "line 2: '1e999' is not a number"),
    "twice.obj": (OBJ.replace("f 2 3 4", "f 2 3 4 4 4 4").encode(), "line 7: a face of 6 corners, 3 of them different"),
    "two.obj": (OBJ.replace("f 2 3 4", "f 2 3").encode(), "line 7: a face of 2 corners"),
    "normal.obj": (OBJ.replace("f 2 3 4", "f 2//9 3//9 4//9").encode(), "line 7: a face names normal 9 of 0"),
    "strange.obj": ((OBJ + "n").encode(), "line 9: 'n' is nothing of an OBJ"),
    "word.stl": (ascii_stl().replace("1 0 0", "1 zero 0", 1).encode(), "'zero' is not a number"),
    "none.stl": (binary_stl(2, TRIANGLES)[:80] + bytes(4) + bytes(100), "header tells of 0 triangles, 2 are there"),
    "all.stl": (binary_stl(2**32 - 1, TRIANGLES), "header tells of 4294967295 triangles, 2 are there"),
    "noend.ply": (PLY[:-30].encode(), "its header has no end"),
    "nameless.ply": (
        (PLY.replace("element face 4", "element 4") + TETRAHEDRON).encode(),
        "line 7: an element without its name or number",
    ),
    "wrong.ply": (
        (PLY.replace("property float y", "propertyfloat y") + TETRAHEDRON).encode(),
        "line 5: 'propertyfloat' is no word",
    ),
    "many.ply": ((PLY.replace("face 4", "face 4000000000") + TETRAHEDRON).encode(), "line 7 tells of more elements"),
    "long.ply": (
        (PLY.replace("face 4", "face 4\nproperty float " + "p" * 2**20) + TETRAHEDRON).encode(),
        "has a header of 1048746 bytes, 1048576 are allowed",
    ),
    "quoted.ply": (
        (PLY.replace("ascii", "ascii" + "1" * 5000) + TETRAHEDRON).encode(),
        "is no readable PLY file (line 2: don't understand format 'ascii111",
    ),
    "short.ply": ((PLY + TETRAHEDRON).encode(), "is no readable PLY file"),
    "word.off": (OFF.replace("3 1 2 3", "3 one 2 3").encode(), "has a word where a number should stand"),
    "points.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "holds no triangles"),
    "mesh.prt": (b"0 0 0", "unknown ending '.prt'"),
    "mesh": (b"0 0 0", "has no ending that tells its kind"),
}


def test_remarks_of_a_ply_are_passed_over(tmp_path: Path) -> None:
    remarks = "comment " + "x" * 2**21 + "\nobj_info a scan\nend_header"
    (tmp_path / "a.ply").write_text(GOOD["a.ply"].replace("end_header", remarks))
    assert len(read_mesh(tmp_path / "a.ply").faces) == 4


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line_that_names_it(
    check_refused: Callable[[Path, bytes | str, str], None], name: str, tmp_path: Path
) -> None:
    check_refused(tmp_path / name, *BAD[name])


def test_a_binary_ply_with_vertices_that_are_no_numbers_is_refused(tmp_path: Path) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, np.nan]], "<f4")
    faces = b"".join(struct.pack("<Biii", 3, *map(int, face.split())) for face in FACES)
    (tmp_path / "nan.ply").write_bytes(
        PLY.replace("ascii", "binary_little_endian").encode() + vertices.tobytes() + faces
    )
    with pytest.raises(FileError, match="not numbers"):
        read_mesh(tmp_path / "nan.ply")


def test_a_missing_file_and_a_missing_folder_are_named(ellipsoid: Callable[..., TriangleMesh], tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"xxx\.stl: cannot be read \(File name too long\)"):
        read_mesh("x" * 300 + ".stl")
    with pytest.raises(FileError, match=r"nowhere\.stl: cannot be read"):
        read_mesh(tmp_path / "nowhere.stl")
    with pytest.raises(FileError, match=r"a\.ply: No such file or directory: choose a folder that exists"):
        write_mesh(ellipsoid(1, 1, 2), tmp_path / "nowhere" / "a.ply")
    with pytest.raises(FileError, match="unknown ending"):
        write_mesh(ellipsoid(1, 1, 2), tmp_path / "a.obj")


def test_a_folder_is_no_part_whatever_its_name(tmp_path: Path) -> None:
    for name in ("scans", "scans.stl"):
        (tmp_path / name).mkdir()
        with pytest.raises(FileError, match=rf"{name}: is a folder: give a file in it"):
            read_mesh(tmp_path / name)


def test_a_refused_ending_names_what_the_caller_reads_itself(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"\.dat, \.tspline$"):
        read_mesh_file(tmp_path / "bone.prt", also=(".tspline",))
    with pytest.raises(FileError, match=r"bone: cannot be read \(No such file or directory\)"):
        read_mesh(tmp_path / "bone")


def test_faces_without_area_survive_reading_so_that_repair_can_tell_of_them(
    solid: Callable[..., TriangleMesh], tmp_path: Path
) -> None:
    mesh = solid(np.eye(3), np.array([[0, 1, 2], [0, 1, 1]]))
    write_mesh(mesh, tmp_path / "null.stl")
    assert len(read_mesh(tmp_path / "null.stl").faces) == 2


@pytest.mark.parametrize("ending", [".ply", ".stl"])
@pytest.mark.parametrize("lost", [1, 33, 5000])
def test_a_disk_that_is_full_leaves_no_mesh_cut_short(ending: str, lost: int, tmp_path: Path) -> None:
    mesh, file = read_mesh(shipped("phalanx")), tmp_path / f"bone{ending}"
    write_mesh(mesh, file)
    before, most = file.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) - lost, most[1]))
    try:
        with pytest.raises(FileError, match=rf"bone\{ending}: .*: make room there") as caught:
            write_mesh(mesh, file)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, most)
    assert "\n" not in str(caught.value)
    assert file.read_bytes() == before
    assert [item.name for item in tmp_path.iterdir()] == [file.name]


def test_meshes_are_written_and_read_where_names_are_not_in_utf_8(
    ellipsoid: Callable[..., TriangleMesh], tmp_path: Path
) -> None:
    folder = tmp_path / os.fsdecode(b"a\xff")
    folder.mkdir()
    mesh = ellipsoid(3, 2, 1)
    write_mesh(mesh, folder / os.fsdecode(b"b\xfe.ply"))
    assert read_mesh(folder / os.fsdecode(b"b\xfe.ply")).vertices.tobytes() == mesh.vertices.tobytes()
    assert [os.fsencode(path.name) for path in folder.iterdir()] == [b"b\xfe.ply"]
