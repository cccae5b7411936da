"""Files that end MeshLab's process, and what each format may hold besides plain triangles."""

import os
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bonecam.errors import FileError
from bonecam.mesh.files.mesh_files import read_mesh

CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))


def ply(faces: bytes, lists: str = "uchar int", order: str = "little", count: int = 4) -> bytes:
    head = f"ply\nformat binary_{order}_endian 1.0\nelement vertex 4\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {count}\nproperty list {lists} vertex_indices\nend_header\n"
    points = np.array(CORNERS, "<f4" if order == "little" else ">f4")
    return head.encode() + points.tobytes() + faces


def rows(form: str, faces: tuple[tuple[int, ...], ...] = FACES) -> bytes:
    return b"".join(struct.pack(form, len(face), *face) for face in faces)


def stl(end: str) -> bytes:
    lines = ["solid bone"]
    for face in FACES:
        points = [f"vertex {x} {y} {z}" for x, y, z in (CORNERS[k] for k in face)]
        lines += ["facet normal 0 0 0", "outer loop", *points, "endloop", "endfacet"]
    return end.join([*lines, "endsolid bone", ""]).encode()


OBJ = b"".join(b"v %d %d %d\n" % corner for corner in CORNERS)
OBJ += b"".join(b"f %d %d %d\n" % (a + 1, b + 1, c + 1) for a, b, c in FACES)
ODD_BUT_SOUND = {
    "cr.stl": stl("\r"),
    "crlf.stl": stl("\r\n"),
    "tab.obj": OBJ.replace(b" ", b"\v"),
    "device.obj": b"mtllib /dev/zero\nusemtl bone\n" + OBJ,
    "cr.obj": OBJ.replace(b"\n", b"\r"),
    "negative.obj": OBJ.replace(b"f 2 3 4", b"f -3 -2 -1"),
    "big.ply": ply(rows(">Biii"), order="big"),
    "shorts.ply": ply(rows("<Hhhh"), "ushort short"),
    "doubles.ply": ply(b"".join(struct.pack("<ifff", 3, *face) for face in FACES), "int float"),
    "blanks.ply": ply(rows("<Biii")).replace(b"end_header\n", b"end_header  \n"),
    "pairs.ply": ply(rows("<Biii") + struct.pack("<Bii", 2, 0, 1), count=5),
    "solid.stl": b"solid facet".ljust(80)
    + struct.pack("<I", 4)
    + b"".join(bytes(12) + np.array([CORNERS[k] for k in face], "<f4").tobytes() + bytes(2) for face in FACES),
}
DAMAGED = {
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
    "lone.stl": (stl("\n").replace(b"vertex 0 0 1\n", b"", 1), "line 13: a triangle without three corners"),
    "cut.stl": (stl("\n")[:-200], "is cut short"),
    "digits.obj": (OBJ.replace(b"v 1 0 0", b"v 1_0 0 0"), "line 2: '1_0' is not a number"),
    "long.obj": (OBJ.replace(b"f 2 3 4", b"f 2 3 99999999999999999999"), "line 7: has a word"),
    "many.off": (b"OFF\n4 2147483648 0\n" + b"0 0 0\n" * 4, "is cut short"),
}


@pytest.mark.parametrize("name", ODD_BUT_SOUND)
def test_odd_but_sound_files_give_the_same_solid(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(ODD_BUT_SOUND[name])
    mesh = read_mesh(tmp_path / name)
    assert (len(mesh.vertices), len(mesh.faces)) == (4, 4)
    assert mesh.volume == pytest.approx(1 / 6)


@pytest.mark.parametrize("name", DAMAGED)
def test_files_that_end_meshlab_are_refused_in_one_line(
    check_refused: Callable[[Path, bytes | str, str], None], name: str, tmp_path: Path
) -> None:
    check_refused(tmp_path / name, *DAMAGED[name])


@pytest.mark.parametrize("start", range(6))
@pytest.mark.parametrize("ending", [".obj", ".off", ".ply"])
def test_polygons_that_are_not_convex_keep_their_area(ending: str, start: int, tmp_path: Path) -> None:
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


def test_strips_become_triangles_of_one_side(tmp_path: Path) -> None:
    strip = struct.pack("<i7i", 7, 0, 1, 2, 3, -1, 0, 1)
    data = ply(strip, "int int", count=1).replace(b"element face", b"element tristrips")
    (tmp_path / "strip.ply").write_bytes(data)
    assert read_mesh(tmp_path / "strip.ply").faces.tolist() == [[0, 1, 2], [2, 1, 3]]


def test_special_files_are_refused_unopened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "zero.ply").symlink_to("/dev/zero")
    with pytest.raises(FileError, match=r"pipe\.stl: cannot be read \(it is a pipe\)"):
        read_mesh(tmp_path / "pipe.stl")
    with pytest.raises(FileError, match=r"zero\.ply: cannot be read \(it is a device\)"):
        read_mesh(tmp_path / "zero.ply")
