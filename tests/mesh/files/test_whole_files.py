"""Every face, cell or voxel of a file is in the mesh that is read or named, whatever is damaged in the middle."""

import base64
import gzip
import io
import json
import re
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable

import numpy as np
import pytest
from mesh_bodies import check_refused

from bonecam.errors import FileError, UnitsError
from bonecam.job import MeshJob
from bonecam.mesh import TriangleMesh, prepare_part, read_in_mm
from bonecam.mesh.files.mesh_files import read_mesh_file
from bonecam.mesh.smooth_surface import label_surface


def solid() -> TriangleMesh:
    """An octahedron of 12 mm, each face split in 16."""
    vertices = np.array([[6.0, 0, 0], [-6, 0, 0], [0, 6, 0], [0, -6, 0], [0, 0, 6], [0, 0, -6]])
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    for _ in range(2):
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        corners = np.stack([a, (a + b) / 2, (a + c) / 2, b, (b + c) / 2, c], axis=1)
        vertices, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        index = index.reshape(-1, 6)
        faces = np.concatenate([index[:, [0, 1, 2]], index[:, [1, 3, 4]], index[:, [2, 4, 5]], index[:, [1, 4, 2]]])
    return TriangleMesh(vertices, faces.astype(np.int32))


MESH = solid()
V, F = MESH.vertices, MESH.faces
N, M = len(V), len(F)


def rows(items: np.ndarray, head: str = "") -> str:
    return "".join(f"{head}{' '.join(map(str, item))}\n" for item in items.tolist())


def stl(count: int = M) -> bytes:
    facets = np.zeros(M, np.dtype([("n", "<f4", 3), ("c", "<f4", 9), ("r", "<u2")]))
    facets["c"] = V[F].reshape(-1, 9)
    return bytes(80) + struct.pack("<I", count) + facets.tobytes()


def text_stl() -> bytes:
    body = "".join(f"facet normal 0 0 0\nouter loop\n{rows(corners, 'vertex ')}endloop\nendfacet\n" for corners in V[F])
    return f"solid a\n{body}endsolid a\n".encode()


def ply(form: str, count: int = M, more: str = "", tail: bytes = b"") -> bytes:
    head = f"ply\nformat {form} 1.0\nelement vertex {N}\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {count}\nproperty list uchar int vertex_indices\n{more}end_header\n"
    if form == "ascii":
        return (head + rows(V) + rows(F, "3 ")).encode() + tail
    faces = np.zeros(M, np.dtype([("k", "u1"), ("f", "<i4", 3)]))
    faces["k"], faces["f"] = 3, F
    return head.encode() + V.astype("<f4").tobytes() + faces.tobytes() + tail


def off(count: int = M) -> bytes:
    return f"OFF\n{N} {count} 0\n{rows(V)}{rows(F, '3 ')}".encode()


def obj(more: str = "") -> bytes:
    return (rows(V, "v ") + rows(F + 1, "f ") + more).encode()


def vtk(binary: bool, count: int = M, more: bytes = b"") -> bytes:
    head = f"# vtk DataFile Version 3.0\na\n{'BINARY' if binary else 'ASCII'}\nDATASET POLYDATA\nPOINTS {N} float\n"
    points = V.astype(">f4").tobytes() + b"\n" if binary else rows(V).encode()
    cells = np.column_stack([np.full(M, 3), F])
    faces = cells.astype(">i4").tobytes() + b"\n" if binary else rows(cells).encode()
    return head.encode() + points + more + f"POLYGONS {count} {4 * count}\n".encode() + faces


def offsets_vtk(binary: bool) -> bytes:
    """As VTK 9 writes it: where each face begins, and the corners of all."""

    def put(values: np.ndarray, kind: str) -> bytes:
        return values.astype(kind).tobytes() if binary else " ".join(map(str, values.ravel())).encode()

    head = f"# vtk DataFile Version 5.1\na\n{'BINARY' if binary else 'ASCII'}\nDATASET POLYDATA\nPOINTS {N} double\n"
    between = f"\nMETADATA\nINFORMATION 0\n\nPOLYGONS {M + 1} {3 * M}\nOFFSETS vtktypeint64\n"
    begins = put(3 * np.arange(M + 1), ">i8") + b"\nCONNECTIVITY vtktypeint64\n"
    return head.encode() + put(V, ">f8") + between.encode() + begins + put(F, ">i8")


def array(values: np.ndarray, name: str, kind: str, more: str = "") -> str:
    text = " ".join(map(str, values.ravel().tolist()))
    return f'<DataArray type="{kind}" Name="{name}" {more} format="ascii">{text}</DataArray>'


def packed_vtp() -> bytes:
    """The arrays of a VTP compressed by zlib, one block each."""

    def packed(found: re.Match) -> str:
        values = np.array(found[2].split(), dtype=found[1].lower())
        squeezed = zlib.compress(values.tobytes())
        head = base64.b64encode(struct.pack("<4I", 1, values.nbytes, 0, len(squeezed))).decode()
        return f'{found[0].split("format=")[0]}format="binary">{head}{base64.b64encode(squeezed).decode()}<'

    text = re.sub(r'<DataArray type="(\w+)"[^>]*>([^<]*)<', packed, vtp().decode())
    return text.replace("byte_order", 'header_type="UInt32" compressor="vtkZLibDataCompressor" byte_order', 1).encode()


def vtp(polygons: int = M, strips: int = 0, lines: int = 0) -> bytes:
    """The last `strips` faces as strips of one triangle, and as many lines as told."""
    points = array(V, "Points", "Float64", 'NumberOfComponents="3"')

    def cells(word: str, corners: np.ndarray) -> str:
        offsets = corners.shape[1] * np.arange(1, len(corners) + 1)
        text = array(corners, "connectivity", "Int64") + array(offsets, "offsets", "Int64")
        return f"<{word}>{text}</{word}>"

    kept = M - strips
    numbers = f'NumberOfVerts="0" NumberOfLines="{lines}" NumberOfStrips="{strips}" NumberOfPolys="{polygons - strips}"'
    parts = cells("Polys", F[:kept]) + (cells("Strips", F[kept:]) if strips else "")
    parts += cells("Lines", F[:lines, :2]) if lines else ""
    return (
        f'<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian"><PolyData><Piece NumberOfPoints="{N}" '
        f"{numbers}><Points>{points}</Points>{parts}</Piece></PolyData></VTKFile>"
    ).encode()


def vtu(count: int = M, kind: int = 5) -> bytes:
    types = np.full(M, kind)
    points = array(V, "Points", "Float64", 'NumberOfComponents="3"')
    cells = array(F, "connectivity", "Int64") + array(3 * np.arange(1, M + 1), "offsets", "Int64")
    return (
        '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>'
        f'<Piece NumberOfPoints="{N}" NumberOfCells="{count}">'
        f"<Points>{points}</Points>"
        f"<Cells>{cells}{array(types, 'types', 'UInt8')}</Cells></Piece></UnstructuredGrid></VTKFile>"
    ).encode()


def grid_vtk() -> bytes:
    head = f"# vtk DataFile Version 3.0\na\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {N} float\n{rows(V)}"
    cells = rows(np.column_stack([np.full(M, 3), F]))
    return (head + f"CELLS {M} {4 * M}\n{cells}CELL_TYPES {M}\n" + "5\n" * M).encode()


def glb(count: int = 3 * M, scale: float = 1e-3, sparse: bool = False, named: np.ndarray = F, **more: object) -> bytes:
    """A GLB in metres; `more` are entries of its header, and `mode` that of its primitive."""
    points, corners = (V * scale).astype("<f4").tobytes(), named.astype("<u4").tobytes()
    indices = np.arange(N, dtype="<u4").tobytes()
    views = [(0, len(points)), (len(points), len(corners)), (len(points) + len(corners), len(indices))]
    position: dict[str, object] = {"componentType": 5126, "count": N, "type": "VEC3"}
    if sparse:
        place = {"indices": {"bufferView": 2, "componentType": 5125}, "values": {"bufferView": 0}}
        position |= {"sparse": {"count": N, **place}}
    else:
        position |= {"bufferView": 0}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "mode": more.pop("mode", 4)}
    header = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [position, {"bufferView": 1, "componentType": 5125, "count": count, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteOffset": a, "byteLength": b} for a, b in views],
        "buffers": [{"byteLength": sum(b for _, b in views)}],
        **more,
    }
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    binary = points + corners + indices
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4s2I", b"glTF", 2, 12 + len(chunks)) + chunks


def three_mf(volume: str = "", unit: str = 'unit="millimeter"', components: bool = False, **extra: str) -> bytes:
    """A 3MF; the last eight triangles are a volume of the kind `volume` in PrusaSlicer's words."""
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in V.tolist())
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in F.tolist())
    core = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles>{extra.get('inside', '')}</mesh>"
    body = f'<object id="1" type="{extra.get("kind", "model")}">{mesh}</object>'
    item = '<item objectid="1"/>'
    if components:  # two components out of one file, the second a modifier in Bambu Studio's words
        bodies = body + body.replace('id="1"', 'id="2"')
        part = f'<model {unit} xmlns="{core}"><resources>{bodies}</resources></model>'
        paths = "".join(f'<component p:path="/3D/Objects/a.model" objectid="{k}"/>' for k in (1, 2))
        body = f'<object id="3" type="model"><components>{paths}</components></object>'
        item = '<item objectid="3" transform="1 0 0 0 1 0 0 0 1 100 0 0"/>'
    space = 'xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06"'
    model = f'<model {unit} xmlns="{core}" {space} {extra.get("root", "")}><resources>{body}</resources>'
    model += f"<build>{item}</build></model>"
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as package:
        package.writestr("3D/3dmodel.model", model)
        if components:
            package.writestr("3D/Objects/a.model", part)
            subtype = f'<part id="1" subtype="normal_part"/><part id="2" subtype="{volume}"/>'
            package.writestr("Metadata/model_settings.config", f'<config><object id="3">{subtype}</object></config>')
        elif volume:
            spans = [(0, M - 9, "ModelPart"), (M - 8, M - 1, volume)]
            text = "".join(
                f'<volume firstid="{a}" lastid="{b}"><metadata key="volume_type" value="{kind}"/></volume>'
                for a, b, kind in spans
            )
            package.writestr("Metadata/Slic3r_PE_model.config", f'<config><object id="1">{text}</object></config>')
    return stream.getvalue()


WHOLE: dict[str, Callable[[], bytes]] = {
    "binary.stl": stl,
    "text.stl": text_stl,
    "ascii.ply": lambda: ply("ascii"),
    "binary.ply": lambda: ply("binary_little_endian"),
    "a.off": off,
    "a.obj": obj,
    "paths.obj": lambda: obj().replace(b"f ", b"# from C:\\models\\\nmtllib C:\\models\\\r\nf ", 1),
    "folded.obj": lambda: obj().replace(b"f ", b"f \\\n", 9),
    "normals.obj": lambda: b"vn nan nan nan\n" + obj(),
    "text.vtk": lambda: vtk(binary=False),
    "binary.vtk": lambda: vtk(binary=True),
    "small.vtk": lambda: vtk(binary=False).lower().replace(b"# vtk datafile", b"# vtk DataFile"),
    "grid.vtk": grid_vtk,
    "a.vtp": vtp,
    "strips.vtp": lambda: vtp(strips=M // 2),
    "quoted.vtp": lambda: vtp(strips=9).replace(b'NumberOfStrips="9"', b"NumberOfStrips = '9'"),
    "unsigned.vtp": lambda: vtp().replace(b"Int64", b"UInt64"),
    "only_strips.vtp": lambda: vtp(strips=M),
    "packed.vtp": packed_vtp,
    "offsets.vtk": lambda: offsets_vtk(binary=False),
    "offsets_binary.vtk": lambda: offsets_vtk(binary=True),
    "a.vtu": vtu,
    "a.glb": glb,
    "sparse.glb": lambda: glb(sparse=True),
    "placed.glb": lambda: glb(nodes=[{"mesh": 0, "translation": [0.1, 0, 0]}]),
    "noscene.glb": lambda: glb(scenes=[]),
    "a.3mf": three_mf,
    "nounit.3mf": lambda: three_mf(unit=""),
    "components.3mf": lambda: three_mf("normal_part", components=True),
}
SEVERAL = {"components.3mf": 2}
"""Files that hold the solid more than once."""


@pytest.mark.parametrize("name", WHOLE)
def test_every_face_of_a_file_is_read(name, tmp_path):
    (tmp_path / name).write_bytes(WHOLE[name]())
    given = read_mesh_file(tmp_path / name)
    assert len(given.mesh.faces) == SEVERAL.get(name, 1) * M
    assert given.notes == ()
    size = read_in_mm(tmp_path / name).volume / SEVERAL.get(name, 1)
    assert size == pytest.approx(MESH.volume, rel=1e-5)


@pytest.mark.parametrize("garbage", [b"\xffxq", b" %7", b"\n\n\n", b"999"])
@pytest.mark.parametrize("name", WHOLE)
def test_damage_in_the_middle_loses_no_face_unsaid(name, garbage, tmp_path):
    data = WHOLE[name]()
    for at in np.linspace(0.1 * len(data), 0.98 * len(data), 40).astype(int):
        (tmp_path / name).write_bytes(data[:at] + garbage + data[at + len(garbage) :])
        try:
            given = read_mesh_file(tmp_path / name)
        except FileError as error:
            outcome = str(error)
        else:
            outcome = f"{tmp_path / name}: read"
            assert len(given.mesh.faces) == SEVERAL.get(name, 1) * M or given.notes
        assert outcome.startswith(str(tmp_path / name))
        assert "\n" not in outcome


HALF = M // 2
COUNTS = {
    "less.stl": (stl(HALF), f"tells of {HALF} triangles, {M} are there"),
    "more.stl": (stl(2 * M), f"tells of {2 * M} triangles, {M} are there"),
    "none.stl": (stl(0), f"tells of 0 triangles, {M} are there"),
    "ascii.ply": (ply("ascii", HALF), "goes on after"),
    "binary.ply": (ply("binary_little_endian", HALF), "goes on after"),
    "a.off": (off(HALF), f"line {N + HALF + 3}: goes on after the {HALF} faces"),
    "text.vtk": (vtk(False, HALF), "goes on after"),
    "binary.vtk": (vtk(True, HALF), "goes on after"),
    "a.vtp": (vtp(HALF), "cannot be read as VTP"),
    "a.vtu": (vtu(HALF), "cannot be read as VTU"),
    "grid.vtk": (grid_vtk().replace(b"CELLS %d" % M, b"CELLS %d" % HALF), f"{HALF} cells whose {M} types do not fit"),
    "types.vtk": (grid_vtk().replace(b"TYPES %d" % M, b"TYPES %d" % HALF), f"{M} cells whose {HALF} types do not fit"),
    "kinds.vtk": (grid_vtk().replace(b"\n5\n", b"\n9\n"), "types do not fit"),
    "corners.vtu": (
        vtu().replace(
            b'</DataArray><DataArray type="Int64" Name="o', b' 0 1 2</DataArray><DataArray type="Int64" Name="o'
        ),
        f"tells of {M} cells and {3 * M + 3} corners, {M} and {3 * M} are there",
    ),
    "no_strips.vtp": (vtp(strips=9).replace(b'NumberOfStrips="9"', b""), "tells of 0 Strips, which are not"),
    "many.vtp": (vtp().replace(b'Polys="%d' % M, b'Polys="100000000'), "tells of 100000000 Polys, which are not"),
    "a.glb": (glb(3 * HALF), "goes on for"),
}


@pytest.mark.parametrize("name", COUNTS)
def test_a_count_that_is_too_small_or_large_is_refused(name, tmp_path):
    check_refused(tmp_path / name, *COUNTS[name])


UNREAD = {
    "lines.vtp": (vtp(lines=3), "holds 3 lines, which are no faces"),
    "lines.vtk": (vtk(False, more=b"LINES 2 6\n2 0 1\n2 1 2\n"), "holds 2 lines"),
    "tetrahedra.vtk": (grid_vtk().replace(b"\n5\n", b"\n10\n"), "cells of type 10, which are no faces"),
    "tetrahedra.vtu": (vtu(kind=10), "holds 128 tetra cells"),
    "points.glb": (glb(mode=0), "holds 1 points"),
    "nine.glb": (glb(mode=9), "holds 1 of mode 9, which are no faces that are read"),
    "twice.glb": (glb(nodes=[{"children": [1, 1]}, {"mesh": 0}]), "has a node within itself or in two others"),
    "itself.glb": (glb(nodes=[{"mesh": 0, "children": [0]}]), "has a node within itself or in two others"),
    "draco.glb": (
        glb(extensionsRequired=["KHR_draco_mesh_compression"]),
        "needs KHR_draco_mesh_compression, which is not read: export it without compression",
    ),
    "gap.glb": (
        glb(
            accessors=[
                {"bufferView": 0, "componentType": 5126, "count": N, "type": "VEC3"},
                *(
                    {"bufferView": 1, "byteOffset": at, "componentType": 5125, "count": 3, "type": "SCALAR"}
                    for at in (0, 12 * (M - 1))
                ),
            ]
        ),
        f"goes on for {12 * (M - 2)} bytes",
    ),
    "fewer.glb": (glb(sparse=True).replace(b'"sparse": {"count": %d' % N, b'"sparse": {"count": 33'), "goes on for"),
    "two_lists.ply": (
        ply("ascii").replace(b"end_header", b"property list uchar int vertex_index\nend_header").replace(
            rows(F, "3 ").encode(), rows(np.column_stack([F, np.full(M, 3), F]), "3 ").encode()
        ),
        "its element 'face' has 2 lists",
    ),
    "two_meshes.3mf": (three_mf(inside="</mesh><mesh>"), "two meshes in one object"),
    "two_ids.3mf": (three_mf(inside='</mesh></object><object id="1"><mesh>'), "has two objects with one id"),
    "units.3mf": (
        three_mf(components=True, unit="", root='unit="inch"'),
        "has models in inch and millimeter: export it in one unit",
    ),
    "negative.3mf": (three_mf("NegativeVolume"), "a volume to be subtracted (NegativeVolume)"),
    "negative_part.3mf": (three_mf("negative_part", components=True), "a volume to be subtracted (negative_part)"),
    "beams.3mf": (three_mf(inside='<beamlattice><beams><beam v1="0" v2="1"/></beams></beamlattice>'), "holds 1 beams"),
    "secured.3mf": (
        three_mf(root='xmlns:s="http://schemas.microsoft.com/3dm/securecontent/2019/04" requiredextensions="s"'),
        "needs the extension http://schemas.microsoft.com/3dm/securecontent",
    ),
    "range.ply": (
        ply("ascii", more="element range_grid 1\nproperty list uchar int vertex_indices\n", tail=b"1 0\n"),
        "holds 1 of the element 'range_grid', which lists vertices",
    ),
    "solid.vtk": (b"solid", "is no VTK file"),
    "grid.vtk": (
        b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\n",
        "holds no surface but STRUCT",
    ),
    "cut.vtk": (vtk(False)[: vtk(False).index(b"\n", 150)], "is cut short"),
    "cut_points.vtk": (vtk(True)[:150], "is cut short"),
    "cut_faces.vtk": (vtk(True)[:-40], "is cut short"),
    "far.vtk": (vtk(False).replace(b"\n3 ", b"\n3 9", 1), f"names a vertex outside 0..{N - 1}"),
    "type.vtp": (b"<VTKFile type='x'>", "is no VTP"),
    "cut.vtp": (packed_vtp()[:700], "cannot be read as VTP"),
    "points.vtp": (vtp().replace(b'NumberOfPoints="%d' % N, b'NumberOfPoints="%d' % (N + 1)), "cannot be read as VTP"),
    "head.glb": (b"glTF", "cannot be read as GLB"),
    "head.3mf": (b"PK", "cannot be read as 3MF"),
    "word.stl": (text_stl().replace(b"vertex", b"vortex", 3), "line 4: 'vortex 6.0 0.0 0.0' is nothing of an STL"),
}  # fmt: skip


@pytest.mark.parametrize("name", UNREAD)
def test_what_is_not_read_is_refused_by_its_name(name, tmp_path):
    check_refused(tmp_path / name, *UNREAD[name])


LEFT_OUT = {
    "lines.obj": (obj("l 1 2\nl 2 3\np 1\n"), M, "left out of its file: 2 lines, 1 points"),
    "edges.ply": (
        ply("ascii", more="element edge 2\nproperty int vertex1\nproperty int vertex2\n", tail=b"0 1\n1 2\n"),
        M,
        "left out of its file: 2 of 'edge'",
    ),
    "modifier.3mf": (three_mf("ParameterModifier"), M - 8, "left out of its file: 1 ParameterModifier"),
    "modifier_part.3mf": (three_mf("modifier_part", components=True), M, "left out of its file: 1 modifier_part"),
    "scenes.glb": (
        glb(
            nodes=[{"mesh": 0}, {"mesh": 0}, {"mesh": 1}],
            scenes=[{"nodes": [1]}, {"nodes": [0, 2]}],
            meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}] * 2,
        ),
        M,
        "left out of its file: 1 meshes that its scene does not place, 1 more places of its meshes in other scenes",
    ),
    "unplaced.glb": (
        glb(nodes=[{"mesh": 0}], meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}] * 2),
        M,
        "left out of its file: 1 meshes that its scene does not place",
    ),
}


@pytest.mark.parametrize("name", LEFT_OUT)
def test_what_is_no_face_is_left_out_and_told(name, tmp_path):
    data, faces, note = LEFT_OUT[name]
    (tmp_path / name).write_bytes(data)
    given = read_mesh_file(tmp_path / name)
    assert len(given.mesh.faces) == faces
    assert given.notes == (note,)
    assert given.mesh.diagonal * (1000 if given.unit == "m" else 1) < 25  # vertices of what is left out are gone


@pytest.mark.parametrize("name", ["placed.glb", "components.3mf"])
def test_a_part_lies_where_its_scene_places_it(name, tmp_path):
    (tmp_path / name).write_bytes(
        WHOLE[name]() if name in WHOLE else glb(nodes=[{"mesh": 0, "translation": [0.1, 0, 0]}])
    )
    np.testing.assert_allclose(read_in_mm(tmp_path / name).bounds, [[94, -6, -6], [106, 6, 6]], atol=1e-4)


@pytest.mark.parametrize("name", ["a.vtp", "a.vtu"])
def test_without_its_library_one_line_names_the_extra(name, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "meshio.vtu", None)
    check_refused(tmp_path / name, vtp(), "needs meshio: pip install 'bonecam[formats]'")


@pytest.mark.parametrize(("mode", "named"), [(5, [4, 0, 2, 5, 1, 3]), (6, [4, 0, 2, 1, 3, 0])])
def test_strips_and_fans_of_a_glb_are_triangles_that_face_outward(mode, named, tmp_path):
    corners = np.array([[6.0, 0, 0], [-6, 0, 0], [0, 6, 0], [0, -6, 0], [0, 0, 6], [0, 0, -6]])[named]
    numbers = np.array([np.abs(V - corner).sum(axis=1).argmin() for corner in corners])
    (tmp_path / "a.glb").write_bytes(glb(len(named), named=numbers, mode=mode))
    mesh = read_mesh_file(tmp_path / "a.glb").mesh
    assert len(mesh.faces) == 4
    assert (np.linalg.det(mesh.vertices[mesh.faces]) > 0).all()


def test_a_stated_unit_is_used_and_another_one_refused_where_it_makes_a_part(tmp_path):
    (tmp_path / "m.glb").write_bytes(glb())
    part = prepare_part(tmp_path / "m.glb", MeshJob())
    assert part.units == "m"
    assert part.mesh.volume == pytest.approx(MESH.volume, rel=1e-5)
    with pytest.raises(UnitsError, match="states its unit itself and was read in m: leave out --units cm"):
        read_in_mm(tmp_path / "m.glb", "cm")

    (tmp_path / "mm.glb").write_bytes(glb(scale=1.0))  # against its standard, as many programs write it
    with pytest.raises(UnitsError, match=r"if its unit is m: is it in mm.*give --units mm"):
        read_in_mm(tmp_path / "mm.glb")
    assert read_in_mm(tmp_path / "mm.glb", "mm").volume == pytest.approx(MESH.volume, rel=1e-5)


def nrrd(directions: str, units: str = "", sizes: str = "12 12 12", pad: int = 1) -> bytes:
    head = "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: left-posterior-superior\n"
    head += f"sizes: {sizes}\nspace directions: {directions}\nkinds: domain domain domain\nencoding: raw\n"
    head += f"space origin: (0,0,0)\n{units}\n"
    return head.encode() + np.pad(np.ones((10, 10, 10), np.uint8), pad).tobytes()


def test_a_label_map_is_read_in_the_unit_that_it_states(tmp_path):
    pytest.importorskip("SimpleITK")
    micrometres = "(1000,0,0) (0,1000,0) (0,0,1000)"
    (tmp_path / "um.nrrd").write_bytes(nrrd(micrometres, 'space units: "um" "um" "um"\n'))
    assert prepare_part(tmp_path / "um.nrrd", MeshJob(facets="exact")).mesh.volume == pytest.approx(1000, rel=0.1)
    (tmp_path / "none.nrrd").write_bytes(nrrd(micrometres))
    with pytest.raises(UnitsError, match="give --units um"):
        prepare_part(tmp_path / "none.nrrd", MeshJob())
    part = prepare_part(tmp_path / "none.nrrd", MeshJob(units="um", facets="exact"))
    assert part.mesh.volume == pytest.approx(1000, rel=0.1)
    (tmp_path / "odd.nrrd").write_bytes(nrrd(micrometres, 'space units: "um" "mm" "um"\n'))
    with pytest.raises(FileError, match="states the units mm, um"):
        prepare_part(tmp_path / "odd.nrrd", MeshJob())


def test_a_sheared_label_map_is_refused(tmp_path):
    itk = pytest.importorskip("SimpleITK")
    told = r"axes of voxels are 3\.00 deg from perpendicular \(a tilted gantry\): resample"
    (tmp_path / "a.nrrd").write_bytes(nrrd("(1,0,0) (0,1,0) (0,0.05240778,1)"))
    with pytest.raises(FileError, match=told):
        label_surface(tmp_path / "a.nrrd", 0, smooth=False)
    itk.WriteImage(itk.GetImageFromArray(np.pad(np.ones((10, 10, 10), np.uint8), 1)), str(tmp_path / "a.nii"))
    data = bytearray((tmp_path / "a.nii").read_bytes())
    assert len(label_surface(tmp_path / "a.nii", 0, smooth=False).steps.faces)
    data[252:256] = struct.pack("<2h", 0, 1)
    data[280:328] = struct.pack("<12f", 1, 0, 0, 0, 0, 1, 0.05240778, 0, 0, 0, 1, 0)
    (tmp_path / "a.nii").write_bytes(data)
    with pytest.raises(FileError, match=told):
        label_surface(tmp_path / "a.nii", 0, smooth=False)


STATED = ("space directions: (1,0,0) (0,1,0) (0,0,1)", "space: left-posterior-superior\n", "space origin: (0,0,0)\n")
UNSTATED = {
    "nothing": ("", "does not state how far apart its voxels are along every axis: state it"),
    "one axis": ("spacings: 1 1 nan\n", "does not state how far apart"),
    "its ends": ("axis mins: 0 0 0\naxis maxs: 12 12 12\n", "does not state how far apart"),
    "left": (f"space: 3D-left-handed\n{STATED[0]}\n", "states left-handed axes.*: save it in LPS or RAS"),
}


@pytest.mark.parametrize("name", UNSTATED)
def test_an_nrrd_without_its_voxels_size_or_in_left_handed_axes_is_refused(name, tmp_path):
    pytest.importorskip("SimpleITK")
    text = nrrd("(1,0,0) (0,1,0) (0,0,1)")
    for line in (STATED[0] + "\n", *STATED[1:]):
        text = text.replace(line.encode(), b"")
    (tmp_path / "a.nrrd").write_bytes(text.replace(b"kinds", UNSTATED[name][0].encode() + b"kinds"))
    with pytest.raises(FileError, match=UNSTATED[name][1]):
        label_surface(tmp_path / "a.nrrd", 0, smooth=False)
    (tmp_path / "b.nrrd").write_bytes(text.replace(b"kinds", b'spacings: 1 1 1\nspace units:="cm"\nkinds'))
    assert label_surface(tmp_path / "b.nrrd", 0, smooth=False).map.unit == ""


@pytest.mark.parametrize(
    ("at", "values", "told"),
    [
        (70, (0.0,), "has voxels of the type 0, or no size: save it with whole numbers"),
        (80, (2, 2, 2), r"voxels of 2 x 2 x 2 by pixdim and 1 x 1 x 1 by its transform: write it anew with one transf"),
        (80, (-1, 1, 1), "voxels of -1 x 1 x 1 by pixdim"),
        (280, (2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0), "voxels of 1 x 1 x 1 by pixdim and 2 x 2 x 2"),
    ],
)
def test_a_nifti_with_two_sizes_of_a_voxel_is_refused(at, values, told, tmp_path):
    itk = pytest.importorskip("SimpleITK")
    itk.WriteImage(itk.GetImageFromArray(np.pad(np.ones((10, 10, 10), np.uint8), 1)), str(tmp_path / "a.nii"))
    data = bytearray((tmp_path / "a.nii").read_bytes())
    struct.pack_into(f"<{len(values)}f", data, at, *values)
    (tmp_path / "a.nii").write_bytes(data)
    with pytest.raises(FileError, match=told):
        label_surface(tmp_path / "a.nii", 0, smooth=False)


SQUARE = "(1,0,0) (0,1,0) (0,0,1)"
ENCODED: dict[str, Callable[[bytes], bytes]] = {
    "raw": bytes,
    "gzip": gzip.compress,
    "hex": lambda voxels: voxels.hex("\n", 30).encode(),
    "text": lambda voxels: b" ".join(b"%d" % voxel for voxel in voxels),
}


@pytest.mark.parametrize("slices", [6, 11, 12, 13, 24])
@pytest.mark.parametrize("encoding", [*ENCODED, "nii", "nii.gz", "scaled.nii"])
def test_a_label_map_has_the_voxels_that_its_header_tells_of(encoding, slices, tmp_path):
    itk = pytest.importorskip("SimpleITK")
    if encoding in ENCODED:
        file = tmp_path / "a.nrrd"
        head, voxels = nrrd(SQUARE, sizes=f"12 12 {slices}").split(b"\n\n", 1)
        head = head.replace(b"encoding: raw", f"Encoding: {encoding}".encode())
        file.write_bytes(head + b"\n\n" + ENCODED[encoding](voxels.lstrip(b"\n")))
    else:
        file = tmp_path / f"a.{encoding}"
        image = itk.GetImageFromArray(np.pad(np.ones((10, 10, 10), np.int16), 1))
        itk.WriteImage(image, str(tmp_path / "whole.nii"))
        data = bytearray((tmp_path / "whole.nii").read_bytes())
        data[46:48] = struct.pack("<h", slices)  # dim[3]
        if encoding == "scaled.nii":
            data[112:120] = struct.pack("<2f", 3, 0)  # slope and intercept: ITK returns numbers of 8 bytes
        file.write_bytes(gzip.compress(data) if encoding == "nii.gz" else data)
    if slices == 12:
        assert len(label_surface(file, 0, smooth=False).steps.faces)
    else:
        with pytest.raises(FileError, match=r"holds \d+ bytes of voxels, its header tells of \d+|cannot be read"):
            label_surface(file, 0, smooth=False)


def test_a_label_map_in_two_files_or_with_an_offset_that_is_no_number_is_refused(tmp_path):
    itk = pytest.importorskip("SimpleITK")
    (tmp_path / "a.nrrd").write_bytes(nrrd(SQUARE, "data file: a.raw\n"))
    with pytest.raises(FileError, match="keeps its voxels in another file: save it as one NRRD"):
        label_surface(tmp_path / "a.nrrd", 0, smooth=False)
    itk.WriteImage(itk.GetImageFromArray(np.ones((3, 3, 3), np.uint8)), str(tmp_path / "a.nii"))
    data = bytearray((tmp_path / "a.nii").read_bytes())
    data[108:112] = struct.pack("<f", np.nan)
    (tmp_path / "a.nii").write_bytes(data)
    with pytest.raises(FileError, match="sizes or axes of voxels that are not numbers"):
        label_surface(tmp_path / "a.nii", 0, smooth=False)


@pytest.mark.parametrize("name", ["lines.obj", "modifier.3mf", "unplaced.glb"])
def test_what_cannot_be_told_is_not_left_out(name, tmp_path):
    data, _, note = LEFT_OUT[name]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FileError, match=f"{name}: holds {note.removeprefix('left out of its file: ')}, which would be"):
        read_in_mm(tmp_path / name)
