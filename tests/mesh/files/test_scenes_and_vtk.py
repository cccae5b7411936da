"""VTK, VTP, GLB and 3MF give the same solid as the mesh that they were written from; damaged ones are one line."""

import base64
import struct
import sys
import zlib
from collections.abc import Callable

import numpy as np
import pytest

from bonecam.errors import FileError
from bonecam.mesh import TriangleMesh, mesh_from, read_mesh

trimesh = pytest.importorskip("trimesh", reason="the extra `formats` is not installed")
POINTS = np.array([[x, y, z] for z in (0.0, 4.0) for y in (0.0, 3.0) for x in (0.0, 2.0)])
SIDES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
"""A box of 2 x 3 x 4 mm, its sides outward."""
HEAD = "# vtk DataFile Version {}\nbox\n{}\nDATASET POLYDATA\nPOINTS 8 double\n"


def legacy_text() -> bytes:
    rows = "\n".join(f"4 {' '.join(map(str, side))}" for side in SIDES)
    points = "\n".join(" ".join(map(str, point)) for point in POINTS)
    head = HEAD.format("3.0", "ASCII")
    return f"{head}{points}\nPOLYGONS 6 30\n{rows}\nPOINT_DATA 8\nSCALARS s float\n".encode()


def legacy_binary() -> bytes:
    rows = np.array([[4, *side] for side in SIDES]).astype(">i4").tobytes()
    return HEAD.format("4.2", "BINARY").encode() + POINTS.astype(">f8").tobytes() + b"\nPOLYGONS 6 30\n" + rows


def with_offsets(binary: bool) -> bytes:
    offsets, corners = np.arange(0, 25, 4), np.ravel(SIDES)
    head = HEAD.format("5.1", "BINARY" if binary else "ASCII").encode()

    def put(values: np.ndarray, kind: str) -> bytes:
        return values.astype(kind).tobytes() if binary else " ".join(map(str, values.ravel())).encode()

    between = b"\nMETADATA\nINFORMATION 0\n\nPOLYGONS 7 24\nOFFSETS vtktypeint64\n"
    return (
        head
        + put(POINTS, ">f8")
        + between
        + put(offsets, ">i8")
        + b"\nCONNECTIVITY vtktypeint64\n"
        + put(corners, ">i8")
    )


def vtp(packed: bool) -> bytes:
    def array(name: str, kind: str, values: np.ndarray, more: str = "") -> str:
        data = values.tobytes()
        if packed:
            squeezed = zlib.compress(data)
            text = base64.b64encode(struct.pack("<4I", 1, len(data), 0, len(squeezed))) + base64.b64encode(squeezed)
        else:
            text = " ".join(map(str, values.ravel().tolist())).encode()
        form = "binary" if packed else "ascii"
        return f'<DataArray type="{kind}" Name="{name}" {more} format="{form}">{text.decode()}</DataArray>'

    corners = array("connectivity", "Int64", np.ravel(SIDES).astype("<i8"))
    offsets = array("offsets", "Int64", np.arange(4, 25, 4).astype("<i8"))
    points = array("Points", "Float64", POINTS.astype("<f8"), 'NumberOfComponents="3"')
    packing = 'compressor="vtkZLibDataCompressor"' if packed else ""
    return (
        f'<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian" header_type="UInt32" {packing}><PolyData>'
        '<Piece NumberOfPoints="8" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="6">'
        f"<PointData></PointData><CellData/><Points>{points}</Points><Verts></Verts><Lines/>"
        f"<Polys>{corners}{offsets}</Polys></Piece></PolyData></VTKFile>"
    ).encode()


KINDS: dict[str, Callable[[], bytes]] = {
    "text.vtk": legacy_text,
    "binary.vtk": legacy_binary,
    "offsets.vtk": lambda: with_offsets(binary=False),
    "offsets_binary.vtk": lambda: with_offsets(binary=True),
    "text.vtp": lambda: vtp(packed=False),
    "packed.vtp": lambda: vtp(packed=True),
}


def box() -> TriangleMesh:
    return TriangleMesh(POINTS, np.array([[s[0], s[k], s[k + 1]] for s in SIDES for k in (1, 2)], dtype=np.int32))


@pytest.mark.parametrize("name", KINDS)
def test_a_surface_of_vtk_is_one_closed_solid(name, tmp_path):
    (tmp_path / name).write_bytes(KINDS[name]())
    mesh = read_mesh(tmp_path / name)
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 12)
    assert mesh.volume == pytest.approx(24.0)


@pytest.mark.parametrize("ending", ["glb", "3mf"])
def test_a_scene_is_one_solid_where_the_scene_has_it(ending, tmp_path):
    scene = trimesh.Scene()
    place = np.eye(4)
    place[:3, 3] = [10.0, 0.0, 0.0]
    scene.add_geometry(box().to_trimesh(), transform=place)
    scene.export(str(tmp_path / f"box.{ending}"))
    mesh = read_mesh(tmp_path / f"box.{ending}")
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 12)
    assert mesh.volume == pytest.approx(24.0, rel=1e-5)
    assert mesh.bounds[0] == pytest.approx([10.0, 0.0, 0.0], abs=1e-5)


@pytest.mark.parametrize(
    ("name", "data", "told"),
    [
        ("a.vtk", b"solid", "is no VTK file"),
        ("a.vtk", b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\n", "holds no surface but STRUCT"),
        ("a.vtk", legacy_text()[:150], "is cut short|a word where a number"),
        ("a.vtk", legacy_binary()[:150], "is cut short"),
        ("a.vtk", legacy_binary()[:-40], "is cut short"),
        ("a.vtk", legacy_text().replace(b"4 0 2 3 1", b"4 0 2 3 9"), "names a vertex outside 0..7"),
        ("a.vtp", b"<VTKFile type='x'>", "is no VTP"),
        ("a.vtp", vtp(packed=True)[:700], "cannot be read as VTP"),
        ("a.vtp", vtp(packed=False).replace(b'"8"', b'"9"'), "cannot be read as VTP"),
        ("a.glb", b"glTF", "cannot be read as GLB"),
        ("a.3mf", b"PK", "cannot be read as 3MF"),
    ],
)
def test_a_damaged_file_is_one_line(name, data, told, tmp_path):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FileError, match=told) as caught:
        read_mesh(tmp_path / name)
    assert str(caught.value).startswith(f"{tmp_path / name}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("library", "name"), [("meshio.vtu", "a.vtp"), ("meshio.vtu", "a.vtu")])
def test_without_its_library_one_line_names_the_extra(library, name, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / name).write_bytes(vtp(packed=False))
    with pytest.raises(FileError, match=r"needs \w+: pip install 'bonecam\[formats\]'"):
        read_mesh(tmp_path / name)


def test_a_mesh_of_pyvista_comes_in():
    class PolyData:
        """What pyvista 0.44 has of a surface of quadrangles, as its documentation says it."""

        points, faces = POINTS, np.ravel([[4, *side] for side in SIDES])

        def extract_surface(self):
            return self

        def triangulate(self):
            made = PolyData()
            made.faces = np.ravel([[3, *face] for face in box().faces])
            return made

    assert mesh_from(PolyData()).volume == pytest.approx(24.0)
