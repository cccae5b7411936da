"""Files that end MeshLab's process, and what each format may hold besides plain triangles.

The anatomical axes that a file's header states are told, whatever the kind of file.

MeshLab reads files in a child: with all that it knows of them, and never to the harm of this process.

Points from text files, and surfaces round point clouds.
"""

import os
import resource
import struct

import numpy as np
import pytest
from bonecam_meshes import path as shipped
from mesh_bodies import check_refused, ellipsoid, is_closed, solid

from bonecam.errors import FileError, MeshError
from bonecam.job import MeshJob
from bonecam.mesh import prepare_part, read_mesh, write_mesh
from bonecam.mesh.files.cad import call_in_child
from bonecam.mesh.files.mesh_files import axes_text, read_mesh_file, stated_axes
from bonecam.mesh.files.points import read_blocks, reconstruct

CORNERS, FACES = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
POINTS, TRIPLES = (["{} {} {}".format(*row) for row in rows] for rows in (CORNERS, FACES))
TETRAHEDRON = "".join(f"{point}\n" for point in POINTS)
PLY = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
PLY += "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
OFF = "OFF\n4 4 0\n" + TETRAHEDRON + "".join(f"3 {face}\n" for face in TRIPLES)
OBJ = "".join(f"v {point}\n" for point in POINTS) + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def stl(name: str = "nan", end: str = "\n") -> str:
    lines = [f"solid {name}"]
    for face in FACES:
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {POINTS[k]}" for k in face), "endloop", "endfacet"]
    return end.join([*lines, f"endsolid {name}", ""])


GOOD = {
    "a.off": OFF,
    "a.obj": OBJ,
    "a.ply": PLY + TETRAHEDRON + "".join(f"3 {face}\n" for face in TRIPLES),
    "a.stl": stl(),
}


@pytest.mark.parametrize("ending", [".ply", ".stl"])
def test_what_is_written_is_read_back_and_is_the_same_bytes_twice(ending, tmp_path):
    mesh = ellipsoid(3, 4, 9)
    write_mesh(mesh, tmp_path / f"one{ending}")
    write_mesh(mesh, tmp_path / f"two{ending}")
    assert (tmp_path / f"one{ending}").read_bytes() == (tmp_path / f"two{ending}").read_bytes()
    again = read_mesh(tmp_path / f"one{ending}")
    assert (len(again.vertices), len(again.faces)) == (len(mesh.vertices), len(mesh.faces))
    assert again.volume == pytest.approx(mesh.volume, rel=1e-6)
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"one{ending}", f"two{ending}"]


def test_quality_is_written_to_ply(tmp_path):
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


def test_remarks_of_a_ply_are_passed_over(tmp_path):
    remarks = "comment " + "x" * 2**21 + "\nobj_info a scan\nend_header"
    (tmp_path / "a.ply").write_text(GOOD["a.ply"].replace("end_header", remarks))
    assert len(read_mesh(tmp_path / "a.ply").faces) == 4


def test_a_missing_file_and_a_missing_folder_are_named(tmp_path):
    with pytest.raises(FileError, match=r"xxx\.stl: cannot be read \(File name too long\)"):
        read_mesh("x" * 300 + ".stl")
    with pytest.raises(FileError, match=r"nowhere\.stl: cannot be read"):
        read_mesh(tmp_path / "nowhere.stl")
    with pytest.raises(FileError, match=r"a\.ply: No such file or directory: choose a folder that exists"):
        write_mesh(ellipsoid(1, 1, 2), tmp_path / "nowhere" / "a.ply")
    with pytest.raises(FileError, match="unknown ending"):
        write_mesh(ellipsoid(1, 1, 2), tmp_path / "a.obj")


def test_a_folder_is_no_part_whatever_its_name(tmp_path):
    for name in ("scans", "scans.stl"):
        (tmp_path / name).mkdir()
        with pytest.raises(FileError, match=rf"{name}: is a folder: give a file in it"):
            read_mesh(tmp_path / name)


def test_a_refused_ending_names_what_the_caller_reads_itself(tmp_path):
    with pytest.raises(FileError, match=r"\.dat,.* \.tspline$"):
        read_mesh_file(tmp_path / "bone.prt", also=(".tspline",))
    with pytest.raises(FileError, match=r"bone: cannot be read \(No such file or directory\)"):
        read_mesh(tmp_path / "bone")


def test_faces_without_area_survive_reading_so_that_repair_can_tell_of_them(tmp_path):
    mesh = solid(np.eye(3), np.array([[0, 1, 2], [0, 1, 1]]))
    write_mesh(mesh, tmp_path / "null.stl")
    assert len(read_mesh(tmp_path / "null.stl").faces) == 2


@pytest.mark.parametrize("ending", [".ply", ".stl"])
@pytest.mark.parametrize("lost", [1, 33, 5000])
def test_a_disk_that_is_full_leaves_no_mesh_cut_short(ending, lost, tmp_path):
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


def test_meshes_are_written_and_read_where_names_are_not_in_utf_8(tmp_path):
    folder = tmp_path / os.fsdecode(b"a\xff")
    folder.mkdir()
    mesh = ellipsoid(3, 2, 1)
    write_mesh(mesh, folder / os.fsdecode(b"b\xfe.ply"))
    assert read_mesh(folder / os.fsdecode(b"b\xfe.ply")).vertices.tobytes() == mesh.vertices.tobytes()
    assert [os.fsencode(path.name) for path in folder.iterdir()] == [b"b\xfe.ply"]


def ply(faces: bytes, lists: str = "uchar int", order: str = "little", count: int = 4) -> bytes:
    head = f"ply\nformat binary_{order}_endian 1.0\nelement vertex 4\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {count}\nproperty list {lists} vertex_indices\nend_header\n"
    points = np.array(CORNERS, "<f4" if order == "little" else ">f4")
    return head.encode() + points.tobytes() + faces


def rows(form: str, faces: tuple[tuple[int, ...], ...] = FACES) -> bytes:
    return b"".join(struct.pack(form, len(face), *face) for face in faces)


SOUND = {
    **{name: text.encode() for name, text in GOOD.items()},
    "cr.stl": stl("bone", "\r").encode(),
    "crlf.stl": stl("bone", "\r\n").encode(),
    "tab.obj": OBJ.encode().replace(b" ", b"\v"),
    "device.obj": b"mtllib /dev/zero\nusemtl bone\n" + OBJ.encode(),
    "cr.obj": OBJ.encode().replace(b"\n", b"\r"),
    "negative.obj": OBJ.encode().replace(b"f 2 3 4", b"f -3 -2 -1"),
    "big.ply": ply(rows(">Biii"), order="big"),
    "shorts.ply": ply(rows("<Hhhh"), "ushort short"),
    "doubles.ply": ply(b"".join(struct.pack("<ifff", 3, *face) for face in FACES), "int float"),
    "blanks.ply": ply(rows("<Biii")).replace(b"end_header\n", b"end_header  \n"),
    "pairs.ply": ply(rows("<Biii") + struct.pack("<Bii", 2, 0, 1), count=5),
    "solid.stl": b"solid facet".ljust(80)
    + struct.pack("<I", 4)
    + b"".join(bytes(12) + np.array([CORNERS[k] for k in face], "<f4").tobytes() + bytes(2) for face in FACES),
}


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
    "word.stl": (stl().replace("1 0 0", "1 zero 0", 1).encode(), "'zero' is not a number"),
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
    "digits.xyz": (b"0 0 0\n1_0 0 0\n", "digits.xyz line 2: '1_0 0 0' is no point"),
    "empty.xyz": (b"# nothing\n\n", "holds no points"),
    "word.xyz": (b"1 2 3\n4 five 6\n", "word.xyz line 2: '4 five 6' is no point"),
    "names.csv": (b"x,y,z\nx,y,z\n1,2,3\n", "names.csv line 2"),
    "polar.txt": (b"X R*THETA R\n1 2 3\n", "polar.txt line 1: 'X R*THETA R' is no point: write x y z"),
    "short.csv": (b"1,2,3\n4,5\n", "short.csv line 2: 2 numbers are no point"),
    "nan.xyz": (b"1 2 nan\n", "is not finite"),
    "inf head.xyz": (b"inf\n1 2 3\n", "line 1: 'inf' is not finite"),
    "nan head.xyz": (b"nan 3\n1 2 3\n", "line 1: 'nan 3' is not finite"),
    "far.xyz": (b"1 2 3\n4 -1e308 6\n", "far.xyz line 2: a coordinate of -1e+308: export the points again"),
    "binary.xyz": (b"\xff\xfe\x00\x80", "is no text"),
    "hole.csv": (b"1,2,3,4\n1,,2,3\n", "hole.csv line 2: '1,,2,3' is no point"),
    "wide.csv": (b"x,y,z\n0,1,2,3\n", "wide.csv line 2: 4 numbers under the names of 3 columns: name every column"),
    "stub.csv": (b"n,x,y,z\ninf,1\n", "stub.csv line 2: 'inf,1' is not finite"),
    "turned.csv": (b"x_normal,y_normal,z_normal\n0,1,2\n", "turned.csv line 1"),
    "cut.pts": (b"3\n1 2 3\n4 5 6\n", "cut.pts line 1: tells of 3 points, 2 follow it in one block"),
    "long.xyz": (b"2 3\n1 2 3\n4 5 6\n1\n\n7 8 9\n1 2 3\n", "long.xyz line 4: tells of 1 points, 2 follow"),
    "rows.csv": (b"1 2 3\n4 5 6\n\n1 2 4\n4 5 7\n", "holds 2 rows of points, no mesh"),
    "few.xyz": (b"1 2 3\n4 5 6\n", "2 points are no cloud"),
    "billion.ply": (ply(rows("<Biii", ((0, 2, 1), (0, 1, 3), (1, 2, 10**9), (0, 3, 2)))), "names a vertex"),
    "lists.ply": (ply(b"\xff" + rows("<Biii")), "early end-of-file"),
    "minus.ply": (ply(struct.pack("<bi", -3, 0) + rows("<Biii"), "char int"), "early end-of-file"),
    "none.ply": (ply(b"").replace(b"4\nproperty list uchar int vertex_indices", b"99999999999"), "more elements"),
    "types.ply": (ply(rows("<Biii"), "uchar quaternion"), "is no readable PLY file"),
    "signal.ply": (
        ply(rows("<Biii")).replace(b"end_header\n\0\0\0\0", b"end_header\n\x01\x00\x80\x7f", 1),
        "1 of 4 vertices with coordinates that are not numbers",
    ),
    "reals.ply": (
        ply(b"".join(struct.pack("<ifff", 3, *face) for face in ((0, 0.5, 1), *FACES[1:])), "int float"),
        "no whole numbers",
    ),
    "lone.stl": (stl("bone").encode().replace(b"vertex 0 0 1\n", b"", 1), "line 13: a triangle without three corners"),
    "cut.stl": (stl("bone").encode()[:-200], "is cut short"),
    "digits.obj": (OBJ.encode().replace(b"v 1 0 0", b"v 1_0 0 0"), "line 2: '1_0' is not a number"),
    "long.obj": (OBJ.encode().replace(b"f 2 3 4", b"f 2 3 99999999999999999999"), "line 7: has a word"),
    "many.off": (b"OFF\n4 2147483648 0\n" + b"0 0 0\n" * 4, "is cut short"),
}


@pytest.mark.parametrize("name", SOUND)
def test_odd_but_sound_files_give_the_same_solid(name, tmp_path):
    (tmp_path / name).write_bytes(SOUND[name])
    mesh = read_mesh(tmp_path / name)
    assert (len(mesh.vertices), len(mesh.faces)) == (4, 4)
    assert mesh.volume == pytest.approx(1 / 6)


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line_that_names_it(name, tmp_path):
    check_refused(tmp_path / name, *BAD[name])


@pytest.mark.parametrize("start", range(6))
@pytest.mark.parametrize("ending", [".obj", ".off", ".ply"])
def test_polygons_that_are_not_convex_keep_their_area(ending, start, tmp_path):
    outline = ((0, 0, 0), (2, 0, 0), (2, 0, 1), (1, 0, 1), (1, 0, 2), (0, 0, 2))
    points = "".join("{} {} {}\n".format(*corner) for corner in outline)
    polygon = [(k + start) % 6 for k in range(6)]
    indices = " ".join(map(str, polygon))
    header = "ply\nformat ascii 1.0\nelement vertex 6\nproperty double x\nproperty double y\nproperty double z\n"
    header += "element face 1\nproperty list uchar int vertex_index\nend_header\n"
    corners = "v ".join(["", *points.splitlines(keepends=True)])
    text = {
        ".ply": f"{header}{points}6 {indices}\n",
        ".off": f"OFF\n6 1 0\n{points}6 {indices}\n",
        ".obj": f"{corners}f {' '.join(str(k + 1) for k in polygon)}\n",
    }
    (tmp_path / f"l{ending}").write_text(text[ending])
    mesh = read_mesh(tmp_path / f"l{ending}")
    assert len(mesh.faces) == 4
    assert mesh.area == pytest.approx(3)
    assert (mesh.face_vectors[:, 1] < 0).all()


def test_strips_become_triangles_of_one_side(tmp_path):
    strip = struct.pack("<i7i", 7, 0, 1, 2, 3, -1, 0, 1)
    data = ply(strip, "int int", count=1).replace(b"element face", b"element tristrips")
    (tmp_path / "strip.ply").write_bytes(data)
    assert read_mesh(tmp_path / "strip.ply").faces.tolist() == [[0, 1, 2], [2, 1, 3]]


def test_special_files_are_refused_unopened(tmp_path):
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "zero.ply").symlink_to("/dev/zero")
    with pytest.raises(FileError, match=r"pipe\.stl: cannot be read \(it is a pipe\)"):
        read_mesh(tmp_path / "pipe.stl")
    with pytest.raises(FileError, match=r"zero\.ply: cannot be read \(it is a device\)"):
        read_mesh(tmp_path / "zero.ply")


COMMENTED_PLY = b"ply\nformat ascii 1.0\ncomment %s\nelement vertex 0\nend_header\n"


@pytest.mark.parametrize(
    ("data", "letters"),
    [
        (COMMENTED_PLY % b"3D Slicer output. SPACE=LPS", "LPS"),
        (COMMENTED_PLY % b"space: right-anterior-superior", "RAS"),
        (COMMENTED_PLY % b"coordinate_system = LAS", "LAS"),
        (b"# 3D Slicer output. SPACE=RAS\nv 0 0 0\n", "RAS"),
        (b"solid bone SPACE=LPS\nfacet normal 0 0 1\n", "LPS"),
        (b"3D Slicer output. SPACE=LPS".ljust(80) + bytes(54), "LPS"),
        (COMMENTED_PLY % b"SPACE=PIR", "PIR"),
        (COMMENTED_PLY % b"colour space: sRGB", ""),
        (COMMENTED_PLY % b"SPACE=LRS", ""),
        (COMMENTED_PLY % b"exported by a scanner", ""),
        (b"ply\n" + bytes(200) + b"\nSPACE=LPS", ""),
        (b"", ""),
    ],
)
def test_the_axes_of_a_comment_are_read(data, letters):
    assert stated_axes(data) == letters


def test_left_handed_axes_are_told_to_make_a_mirror_image():
    assert axes_text("LPS") == ("its header states the axes LPS: x to the left, y to the back, z to the head")
    for letters in ("LPS", "RAS", "PIR", "ASR"):
        assert "mirror" not in axes_text(letters)
    for letters in ("LAS", "RPS", "RAI"):
        assert axes_text(letters).endswith("left-handed: check that it is no mirror image")


def test_the_part_tells_what_its_file_states(tmp_path):
    bone = ellipsoid(5, 4, 14, rings=8, columns=12)
    lines = [f"v {x} {y} {z}" for x, y, z in bone.vertices]
    lines += ["f " + " ".join(map(str, trio)) for trio in bone.faces + 1]
    file = tmp_path / "bone.obj"
    file.write_text("\n".join(["# SPACE=LPS", *lines]))
    part = prepare_part(file, MeshJob(mirror="x", scale=1.25))
    assert part.notes == ("mirrored in X of its file", "scaled by 1.25", axes_text("LPS"))
    assert np.allclose(part.given.vertices, bone.vertices * [-1.25, 1.25, 1.25])


BROKEN = """
import os

def hang(file, progress):
    while file:
        pass

def fill_memory(file, progress):
    bytearray(2**40)

def end_process(file, progress):
    os.abort()
"""


@pytest.mark.parametrize(
    ("work", "what"),
    [("hang", "took more than 2 s"), ("fill_memory", "wanted more than 2 GB of memory"), ("end_process", "exit -6")],
)
def test_a_child_that_breaks_down_is_one_line(work, what, tmp_path, monkeypatch):
    (tmp_path / "broken.py").write_text(BROKEN)
    monkeypatch.syspath_prepend(tmp_path)
    seconds = 2.0 if work == "hang" else 60.0
    with pytest.raises(FileError, match=f"^a.3ds: MeshLab .*{what}.*: try again$"):
        call_in_child(f"broken:{work}", "a.3ds", library="MeshLab", remedy="try again", seconds=seconds, memory=2**31)


SAME = {
    "a.xyz": "1 2 3\n4 5 6.5\n\n\n7 8 9\n",
    "a.csv": "x, y, z\n1,2,3\n4,5,6.5\n\n7,8,9",
    "tabs.txt": "# a comment\n1\t2\t3\t0 0 1\n4\t5\t6.5\t0 0 1\n\n7\t8\t9\t0 0 1\n",
    "turbo.dat": "# Profile 1 at 0%\n\t1 2 3\n4 5 6.5\n# Profile 2 at 20%\n7 8 9\n",
    "units.csv": '"X [mm]";"Y [mm]";"Z [mm]"\n1;2;3\n4;5;6,5\n\n7;8;9\n',
    "german.csv": "1,0;2,0;3,0\n4;5;6,5\n\n7;8;9\n",
    "german.asc": "1,0 2,0 3\n4 5\t6,5\n\n7,0E0 8 9\n",
    "narrow.csv": "1,2 ,3 ,4\n4, 5 ,6.5\n\n7,8  9\n",
    "heads.txt": "2 3\n1 2 3\n4 5 6.5\n1 3\n7 8 9\n",
    "count.pts": "2\n\n1 2 3\n4 5 6.5\n1\n# a comment\n7 8 9\n",
    "index.csv": ",x,y,z\n0,1,2,3\n1,4,5,6.5\n\n2,7,8,9\n",
    "quoted.csv": '"","x","y","z"\n0,1,2,3\n1,4,5,6.5\n\n2,7,8,9\n',
    "hash.csv": "#,x,y,z,\n0,1,2,3,\n1,4,5,6.5\n,,,\n2,7,8,9\n",
    "normals.csv": "x_normal;x;y;z\n0,5;1;2;3\n0,5;4;5;6,5\n\n0;7;8;9\n",
    "mark.asc": "\ufeff// a comment\n1 2 3\n4 5 6.5\n \n7 8 9",
}


@pytest.mark.parametrize("name", SAME)
def test_every_way_to_write_blocks_of_points_gives_the_same(name, tmp_path):
    (tmp_path / name).write_text(SAME[name], encoding="utf-8")
    first, second = read_blocks(tmp_path / name)
    assert first.tolist() == [[1, 2, 3], [4, 5, 6.5]]
    assert second.tolist() == [[7, 8, 9]]


def cloud(count: int) -> np.ndarray:
    """Points spread evenly on an ellipsoid of half axes 3, 4, 9."""
    k = np.arange(count) + 0.5
    height, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - height**2)
    return np.column_stack([3 * r * np.cos(angle), 4 * r * np.sin(angle), 9 * height])


def test_the_surface_round_a_cloud_is_closed_outward_near_and_twice_the_same(tmp_path):
    points = cloud(1500) + 100.0
    (tmp_path / "cloud.xyz").write_text("\n".join(" ".join(map(repr, point)) for point in points.tolist()))
    mesh = read_mesh(tmp_path / "cloud.xyz")
    assert is_closed(mesh)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 3 * 4 * 9, rel=0.01)
    assert reconstruct(points).vertices.tobytes() == mesh.vertices.tobytes()


def test_a_ply_without_faces_is_a_cloud(tmp_path):
    points = cloud(1000)
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
        + "".join(f"property double {x}\n" for x in "xyz")
        + "end_header\n"
    )
    (tmp_path / "cloud.ply").write_text(
        head + "\n".join(" ".join(map(repr, point)) for point in points.tolist()) + "\n"
    )
    assert read_mesh(tmp_path / "cloud.ply").volume == pytest.approx(ellipsoid(3, 4, 9).volume, rel=0.02)


def test_a_cloud_whose_surface_misses_a_point_is_refused():
    with pytest.raises(MeshError, match="misses one by"):
        reconstruct(np.vstack([cloud(400), [[0.0, 0.0, 0.0]]]))


@pytest.mark.parametrize(
    ("lines", "match"),
    [
        (["1 2 3"] * 500, "a.xyz: 1 different points are too few for a surface"),
        ([f"{k}e-320 1e-320 0" for k in range(300)], "so close together that they have no size: export them in mm"),
    ],
)
def test_a_cloud_without_extent_is_refused(lines, match, tmp_path):
    (tmp_path / "a.xyz").write_text("\n".join(lines))
    with pytest.raises(MeshError, match=match):
        read_mesh(tmp_path / "a.xyz")


def test_points_that_are_given_twice_count_once(tmp_path):
    once = reconstruct(cloud(2000))
    assert reconstruct(np.repeat(cloud(2000), 2, axis=0)).vertices.tobytes() == once.vertices.tobytes()
