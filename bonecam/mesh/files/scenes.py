"""GLB and 3MF: scenes of meshes, each put where the scene has it.

trimesh, which read both, takes sparse accessors of a GLB for zeros and passes over primitives and compressions that it
does not know; of a 3MF it takes all objects of a part of the package for each component that names the part, and
nothing of what slicers say of an object's volumes. Both formats are JSON or XML round plain arrays.
"""

import base64
import io
import json
import re
import struct
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray
from scipy.spatial.transform import Rotation

from bonecam.mesh.files.polygons import (
    CUT_SHORT,
    TRIANGLES,
    Content,
    ContentError,
    left_out_note,
    refuse_others,
    strip_triangles,
)

PADDING = 4
"""Views of a GLB are filled up to multiples of so many bytes."""
INSTANCES = "EXT_mesh_gpu_instancing"
"""The extension of glTF that places a mesh many times."""
HARMLESS = ("KHR_materials", "KHR_texture", "KHR_lights", "KHR_xmp", "EXT_texture", "EXT_lights")
"""How names of extensions of glTF begin that change no triangle."""
COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Numbers of glTF accessors, by their codes."""
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Numbers of one element of an accessor."""
OTHER_MODES = {0: "points", 1: "lines", 2: "line loops", 3: "line strips"}
"""Primitives of glTF that are no faces."""
FACES = TRIANGLE, STRIP, FAN = 4, 5, 6
"""The modes of glTF primitives that are triangles, triangle strips and fans."""
MM_OF_3MF = {"micron": 0.001, "millimeter": 1.0, "centimeter": 10.0, "inch": 25.4, "foot": 304.8, "meter": 1000.0}
"""The units of 3MF (Core Specification 1.3, 3.4)."""
EXTENSIONS_3MF = ("production", "material", "trianglesets")
"""Extensions of 3MF that a model may require, by a word of their name spaces."""
MOST_PLACED = 10_000
"""Most objects that a 3MF may build, those in components counted each time."""
MOST_UNPACKED = 2**30
"""Most bytes of an unpacked 3MF."""
PART_VOLUMES = ("modelpart", "normal_part", "model", "surface", "other")
"""Volumes and objects of a 3MF that are the part: in files of PrusaSlicer and of Bambu Studio, and types of objects."""

Placed = tuple[Float[ndarray, "n 3"], Int64[ndarray, "m 3"], Float[ndarray, "4 4"]]
"""Vertices and triangles, and where they are put."""


def parse_glb(data: bytes) -> Content:
    """The vertices and triangles of a GLB, m (glTF 2.0, 3.4). ContentError where it needs an extension that is not
    known, moves its vertices by a skeleton, or holds primitives that are no faces."""
    try:
        magic, _, length, size, kind = struct.unpack_from("<4s2I I4s", data)
        if magic != b"glTF" or kind != b"JSON":
            remedy = "give a GLB, or name the file by its true kind"
            raise ContentError("cannot be read as GLB (no glTF 2 in it)", remedy)
        if length != len(data):
            raise ContentError(f"tells of {length} bytes, {len(data)} are there", CUT_SHORT)
        header = json.loads(data[20 : 20 + size])
        # the first buffer is its binary chunk if it is not written out in the header
        buffers = []
        for buffer in header.get("buffers", []):
            kind, comma, text = buffer.get("uri", "").partition(",")
            if kind and not (comma and kind.startswith("data:") and kind.endswith("base64")):
                raise ContentError("keeps its numbers in another file", "export it as one GLB")
            buffers.append(base64.b64decode(text) if kind else data[20 + size + 8 :])
        for name in header.get("extensionsRequired", []):
            if not name.startswith(HARMLESS):
                raise ContentError(f"needs {name}, which is not read", "export it without compression or extensions")
        meshes = header.get("meshes", [])
        modes = Counter(primitive.get("mode", TRIANGLE) for mesh in meshes for primitive in mesh["primitives"])
        refuse_others({OTHER_MODES.get(mode, f"of mode {mode}"): n for mode, n in modes.items() if mode not in FACES})
        nodes = header.get("nodes", [])
        if any("skin" in node for node in nodes) or any(any(each.get("weights", [])) for each in (*nodes, *meshes)):
            raise ContentError("moves its vertices by a skeleton or shape keys", "apply the pose and export it again")
        refuse_others({"instanced nodes": sum(INSTANCES in node.get("extensions", {}) for node in nodes)})
        _require_covered(header, buffers)
        placed = list(_glb_meshes(header, buffers))
    except ContentError:
        raise
    except Exception as error:  # damaged names, numbers and places raise all kinds
        raise ContentError(f"cannot be read as GLB ({type(error).__name__} {str(error)[:100]})", CUT_SHORT) from error
    shown = Counter(node["mesh"] for node in _nodes(header) if "mesh" in node)
    left_out = {
        "meshes that its scene does not place": len(meshes) - len(shown),
        "more places of its meshes in other scenes": sum(node.get("mesh") in shown for node in nodes) - shown.total(),
    }
    return _content(placed, "m", left_out_note(left_out))


def _require_covered(header: dict[str, Any], buffers: list[bytes]) -> None:
    """ContentError where accessors leave out more of a view than its padding, or go beyond it: a count is wrong."""
    spans: dict[int, list[tuple[int, int]]] = {}

    def cover(place: dict[str, Any], component: int, width: int, count: int) -> None:
        row = np.dtype(COMPONENTS[component]).itemsize * width
        start = place.get("byteOffset", 0)
        end = start + (count - 1) * header["bufferViews"][place["bufferView"]].get("byteStride", row) + row
        spans.setdefault(place["bufferView"], []).append((start, end))

    for accessor in header.get("accessors", []):
        if "bufferView" in accessor:
            cover(accessor, accessor["componentType"], WIDTHS[accessor["type"]], accessor["count"])
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            cover(sparse["indices"], sparse["indices"]["componentType"], 1, sparse["count"])
            cover(sparse["values"], accessor["componentType"], WIDTHS[accessor["type"]], sparse["count"])
    for number, places in spans.items():
        view = header["bufferViews"][number]
        stride, size = view.get("byteStride", 0), view["byteLength"]
        data = buffers[view["buffer"]][view.get("byteOffset", 0) :]
        end = 0
        for start, stop in [*sorted(places), (size, size)]:
            if start - end >= max(stride, PADDING) or (not stride and any(data[end:start])):
                raise ContentError(f"goes on for {start - end} bytes after the numbers that it tells of", CUT_SHORT)
            end = max(end, stop)
        if end > size:
            raise ContentError(f"is short by {end - size} bytes after the numbers that it tells of", CUT_SHORT)


def _nodes(header: dict[str, Any]) -> list[dict[str, Any]]:
    """The nodes of the scene that is shown, parents first, with the `place` of each."""
    nodes = header.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    scenes = header.get("scenes") or [{"nodes": sorted(set(range(len(nodes))) - children)}]
    shown = [(k, np.eye(4)) for k in scenes[header.get("scene", 0)].get("nodes", [])]
    seen = set()
    for k, above in shown:
        if k in seen:
            raise ContentError("has a node within itself or in two others")
        seen.add(k)
        shown += [(child, above @ _matrix(nodes[k])) for child in nodes[k].get("children", [])]
    return [nodes[k] | {"place": above @ _matrix(nodes[k])} for k, above in shown]


def _matrix(node: dict[str, Any]) -> Float[ndarray, "4 4"]:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    turned = Rotation.from_quat(node.get("rotation", [0, 0, 0, 1])).as_matrix()
    matrix[:3, :3] = turned * np.array(node.get("scale", [1, 1, 1]), dtype=np.float64)
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def _glb_meshes(header: dict[str, Any], buffers: list[bytes]) -> Iterator[Placed]:
    """Vertices, triangles and place of each primitive of the scene."""
    for node in _nodes(header):
        for primitive in header["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            with np.errstate(invalid="ignore"):  # of a signalling NaN
                points = _accessor(header, buffers, primitive["attributes"]["POSITION"]).astype(np.float64)
            given = "indices" in primitive
            corners = _accessor(header, buffers, primitive["indices"]).ravel() if given else np.arange(len(points))
            corners = corners.astype(np.int64, casting="safe")
            mode = primitive.get("mode", TRIANGLE)
            if mode == STRIP:
                corners = np.array(strip_triangles([corners]), dtype=np.int64)
            elif mode == FAN:
                corners = np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], axis=1)
            yield points, corners.reshape(-1, 3), node["place"]


def _accessor(header: dict[str, Any], buffers: list[bytes], number: int) -> ndarray:
    """The elements of an accessor, a row each, those of a sparse one put in."""
    accessor = header["accessors"][number]
    width = WIDTHS[accessor["type"]]
    count = accessor["count"]
    if "bufferView" in accessor:
        values = _view(header, buffers, accessor, COMPONENTS[accessor["componentType"]], width, count).copy()
    elif "sparse" in accessor:
        values = np.zeros((count, width), COMPONENTS[accessor["componentType"]])
    else:
        raise ContentError("has vertices without numbers", "export it without compression or extensions")
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        numbers = COMPONENTS[sparse["indices"]["componentType"]]
        rows = _view(header, buffers, sparse["indices"], numbers, 1, sparse["count"]).ravel()
        values[rows] = _view(header, buffers, sparse["values"], values.dtype, width, sparse["count"])
    return values


def _view(
    header: dict[str, Any], buffers: list[bytes], place: dict[str, Any], numbers: Any, width: int, count: int
) -> ndarray:
    """`count` rows of `width` numbers from where `place` names a view into a buffer."""
    view = header["bufferViews"][place["bufferView"]]
    row = np.dtype(numbers).itemsize * width
    start = view.get("byteOffset", 0) + place.get("byteOffset", 0)
    strides = (view.get("byteStride", row), np.dtype(numbers).itemsize)
    return np.ndarray((count, width), numbers, buffers[view["buffer"]], start, strides)


def parse_3mf(data: bytes) -> Content:
    """The vertices and triangles of a 3MF, mm. What slicers call a modifier, and objects that only support, are left
    out and noted; ContentError where a volume is to be subtracted, or the file holds what is no triangle."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as package:
            if sum(entry.file_size for entry in package.infolist()) > MOST_UNPACKED:
                raise ContentError(f"is larger than {MOST_UNPACKED:,} bytes unpacked", "export the part alone")
            files = {name.lstrip("/").lower(): package.read(name) for name in package.namelist()}
        return _build(files)
    except ContentError:
        raise
    except Exception as error:  # zipfile and the decoders of its methods raise all kinds on damaged bytes
        raise ContentError(f"cannot be read as 3MF ({type(error).__name__} {str(error)[:100]})", CUT_SHORT) from error


def _build(files: dict[str, bytes]) -> Content:
    """What the files of a 3MF package build."""
    named = re.findall(rb'Target="/?([^"]+\.model)"', files.get("_rels/.rels", b""))
    names = [*(name.decode().lower() for name in named), *(name for name in files if name.endswith("3dmodel.model"))]
    root = next(name for name in names if name in files)
    models = {name: ElementTree.fromstring(text) for name, text in files.items() if name.endswith(".model")}
    for name, model in models.items():
        _require_known(model, files[name])
    bodies = [(name, each) for name, model in models.items() for each in model.findall(".//{*}object")]
    objects = {(name, each.get("id")): each for name, each in bodies}
    if len(objects) < len(bodies) or any(len(each.findall("{*}mesh")) > 1 for _, each in bodies):
        raise ContentError("has two objects with one id, or two meshes in one object")
    units = {model.get("unit", "millimeter") for model in models.values()}
    if len(units) > 1:
        raise ContentError(f"has models in {' and '.join(sorted(units))}", "export it in one unit")
    ranges, parts = _volumes(files)
    left_out: Counter[str] = Counter()
    counted: Counter[str] = Counter()
    built: set[tuple[str, str | None]] = set()

    def path_of(element: ElementTree.Element, file: str) -> str:
        """The file that an item or component names, else the one that it stands in."""
        path = next((value for name, value in element.attrib.items() if name.endswith("}path")), file)
        return path.lstrip("/").lower()

    def is_part(kind: str) -> bool:
        if "negative" in kind.lower():
            raise ContentError(f"has a volume to be subtracted ({kind})", "subtract it, and export the result")
        if kind.lower() not in PART_VOLUMES:
            left_out[kind] += 1
        return kind.lower() in PART_VOLUMES

    def placed(file: str, number: str, matrix: Float[ndarray, "4 4"]) -> Iterator[Placed]:
        body = objects[file, number]
        built.add((file, number))
        counted["objects"] += 1
        if counted["objects"] > MOST_PLACED:
            raise ContentError(f"builds more than {MOST_PLACED:,} objects", "export the part alone")
        mesh = body.find("{*}mesh")
        if mesh is None and body.find("{*}components") is None:
            raise ContentError(f"has an object {number} that is no mesh", TRIANGLES)
        if mesh is not None and is_part(body.get("type", "model")):
            points = [[float(vertex.attrib[axis]) for axis in "xyz"] for vertex in mesh.findall("{*}vertices/*")]
            faces = [[int(face.attrib[v]) for v in ("v1", "v2", "v3")] for face in mesh.findall("{*}triangles/*")]
            kept = np.ones(len(faces), dtype=bool)
            for kind, first, last in ranges.get(number, []):
                kept[first : last + 1] = is_part(kind)
            triangles = np.array(faces, dtype=np.int64).reshape(-1, 3)[kept]
            yield np.array(points, dtype=np.float64).reshape(-1, 3), triangles, matrix
        for part in body.findall("{*}components/*"):
            own = part.attrib["objectid"]
            built.add((path_of(part, file), own))
            if is_part(parts.get((number, own), "model")):
                yield from placed(path_of(part, file), own, matrix @ _transform(part))

    items = models[root].findall("{*}build/*")
    meshes = [mesh for item in items for mesh in placed(path_of(item, root), item.attrib["objectid"], _transform(item))]
    left_out["objects that are not built"] = len(objects.keys() - built)
    scale = np.diag([*[MM_OF_3MF[units.pop()]] * 3, 1.0])
    scaled = [(points, faces, scale @ matrix) for points, faces, matrix in meshes]
    return _content(scaled, "mm", left_out_note(left_out))


def _require_known(model: ElementTree.Element, text: bytes) -> None:
    """ContentError where a model of a 3MF needs an extension that is not read, or holds beams."""
    spaces = {name: uri for _, (name, uri) in ElementTree.iterparse(io.BytesIO(text), ["start-ns"])}
    for name in model.get("requiredextensions", "").split():
        space = spaces.get(name, name)
        if not any(f"/{word}/" in space for word in EXTENSIONS_3MF):
            raise ContentError(f"needs the extension {space} of 3MF, which is not read", TRIANGLES)
    refuse_others({"beams": len(model.findall(".//{*}beam"))})


def _volumes(files: dict[str, bytes]) -> tuple[dict[str, list[tuple[str, int, int]]], dict[tuple[str, str], str]]:
    """What slicers say of volumes: kinds of ranges of triangles of an object (PrusaSlicer), and kinds of components
    of an object (Bambu Studio)."""
    ranges: dict[str, list[tuple[str, int, int]]] = {}
    parts = {}
    for name in files:
        if not (name.startswith("metadata/") and name.endswith(".config") and files[name].lstrip()[:1] == b"<"):
            continue
        for body in ElementTree.fromstring(files[name]).findall("object"):
            for volume in body.findall("volume"):
                kinds = (data.attrib["value"] for data in volume if data.get("key") == "volume_type")
                span = int(volume.attrib["firstid"]), int(volume.attrib["lastid"])
                ranges.setdefault(body.attrib["id"], []).append((next(kinds, "ModelPart"), *span))
            for part in body.findall("part"):
                parts[body.attrib["id"], part.attrib["id"]] = part.get("subtype", "normal_part")
    return ranges, parts


def _transform(element: ElementTree.Element) -> Float[ndarray, "4 4"]:
    """The transform of an item or component of a 3MF, whose twelve numbers stand in columns."""
    matrix = np.eye(4)
    if "transform" in element.attrib:
        matrix[:3] = np.array(element.attrib["transform"].split(), dtype=np.float64).reshape(4, 3).T
    return matrix


def _content(placed: Sequence[Placed], unit: str, notes: tuple[str, ...]) -> Content:
    """All meshes as one; where one is placed as its mirror image its faces go round the other way."""
    for vertices, corners, matrix in placed:
        if not (np.isfinite(vertices).all() and np.isfinite(matrix).all()):
            raise ContentError("has coordinates that are not numbers")
        if corners.size and not 0 <= corners.min() <= corners.max() < len(vertices):
            raise ContentError(f"has a face that names a vertex outside 0..{len(vertices) - 1}")
    points = [vertices @ matrix[:3, :3].T + matrix[:3, 3] for vertices, _, matrix in placed]
    starts = np.cumsum([0, *map(len, points)])
    faces = [
        (corners if np.linalg.det(matrix[:3, :3]) > 0 else corners[:, ::-1]) + start
        for start, (_, corners, matrix) in zip(starts, placed)
    ]
    corners = np.concatenate([*faces, np.empty((0, 3), dtype=np.int64)]).ravel()
    return Content(np.concatenate([*points, np.empty((0, 3))]), corners, np.full(len(corners) // 3, 3), unit, notes)
