"""Work on a file in a process of its own, for libraries that end their process on damaged files.

The door to OpenCASCADE, which reads and writes STEP and IGES (the wheel `cadquery-ocp-novtk`, optional extra
`cad`).

STEP and IGES files as OpenCASCADE shapes: read, taken apart into faces, sewn together.

Both kinds state their unit, and OpenCASCADE converts it: a shape is in mm. Loose faces, which are usual in
IGES, are joined by `sew`.

Triangles of OpenCASCADE shapes, within a chord tolerance of their faces.

OpenCASCADE sometimes loses a part of a face, most often of a face that closes on itself. So the distance of
each triangle from its face and the area of all of them are measured, and a result that misses is computed
again, finer and with other faces. The triangles of neighbouring faces share the points of their common edge
and are welded there; triangles that collapse at a pole are dropped.

STEP and IGES files, read in a process of its own.

OpenCASCADE ends its process on some damaged files (measured: about one in ten that were damaged at random).
So that a bad file is one line and not a crash, it works in a child, which hands back the result.
"""

import re
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.errors import FileError, counted, file_error
from bonecam.files import input_bytes, library_name
from bonecam.mesh.files.polygons import MeshFile, left_out_note
from bonecam.mesh.healing import nearest_groups
from bonecam.mesh.solids import repeats_corner
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces
from bonecam.progress import Progress, silent
from bonecam.runtime.worker import WorkerError, call_in_worker


def call_in_child(
    work: str, file: str, *words: Any, library: str, remedy: str, seconds: float | None = None, memory: int = 0
) -> Any:
    """What a function, named "module:function", returns for `file`, `words` and a progress in a process of its own.

    FileError where the function raised one, or the process broke down, took longer than `seconds`, or wanted
    more than `memory` bytes (0: as many as there are); `library` is whose fault that is.
    """
    try:
        return call_in_worker(work, file, *words, seconds=seconds, memory=memory)
    except WorkerError as error:
        raise FileError(f"{file}: {library} {error}: {remedy}", file=file) from error


STEP = (".step", ".stp")
"""Endings of STEP files."""
IGES = (".iges", ".igs")
"""Endings of IGES files."""


def occ(task: str = "this") -> Any:
    """A name space of OpenCASCADE's packages, `occ().gp.gp_Pnt`; FileError names the extra where `task`
    cannot be done without it."""
    try:
        return _packages()
    except ModuleNotFoundError as error:
        raise missing(task) from error
    except ImportError as error:
        raise FileError(
            f"{task} needs OpenCASCADE, which cannot be loaded ({error}): install the system package libgl1"
        ) from error


def missing(task: str) -> FileError:
    """What is raised where OpenCASCADE is not installed."""
    return FileError(f"{task} needs OpenCASCADE: pip install 'bonecam[cad]'")


@cache
def _packages() -> Any:
    import OCP

    return _Packages(OCP.__name__)


class _Packages:
    """Imports OCP.X when X is asked for, and keeps OpenCASCADE's own messages off the terminal."""

    def __init__(self, name: str) -> None:
        self._name = name
        messenger = self.Message.Message.DefaultMessenger_s()
        for printer in list(messenger.Printers()):
            messenger.RemovePrinter(printer)

    def __getattr__(self, package: str) -> Any:
        module = import_module(f"{self._name}.{package}")
        setattr(self, package, module)
        return module


def is_failure(error: Exception) -> bool:
    """Whether OpenCASCADE raised an error: in Python its exceptions have no base of their own."""
    return type(error).__module__.partition(".")[0] == "OCP"


def kind_of(file: Path) -> str:
    """STEP or IGES, by the file's ending."""
    return "STEP" if file.suffix.lower() in STEP else "IGES"


IGES_FACES = re.compile(rb"^ {5}(?:144|510).{64}D *\d*[13579]\s*$", re.MULTILINE)
"""First lines of the entries of trimmed surfaces and faces in the directory of an IGES file."""


def read_shape(path: str | Path) -> Any:
    """The content of a STEP or IGES file as one OpenCASCADE shape in mm. FileError, or one of OpenCASCADE's own
    (`is_failure`), where it cannot be read."""
    file = Path(path)
    data = refuse_foreign(file)
    kind = kind_of(file)
    lib = occ(f"{file}: reading {kind}")
    reader = lib.STEPControl.STEPControl_Reader() if kind == "STEP" else lib.IGESControl.IGESControl_Reader()
    with library_name(file) as name:
        status = reader.ReadFile(name)
    roots = reader.TransferRoots() if status == lib.IFSelect.IFSelect_ReturnStatus.IFSelect_RetDone else 0
    shape = reader.OneShape() if roots else None
    if shape is None or shape.IsNull():
        raise unreadable(file, "cut short, or nothing in it")
    faces = faces_of(shape)
    alone = lib.TopLoc.TopLoc_Location()
    read = len(faces), len({hash(face.Located(alone)) for face in faces})  # of a part in two places its faces once
    told = _step_faces(file, data) if kind == "STEP" else (len(IGES_FACES.findall(data)), 0)
    for found, count in zip(read, told):
        if found < count:
            raise unreadable(file, f"{found} of its {count} faces could be read")
    return shape


def _step_faces(file: Path, data: bytes) -> tuple[int, int]:
    """How many faces the shells of a STEP file name, and how many it has; FileError where an entity in it names one
    that is not there, or a part is scaled or mirrored into its place, which OpenCASCADE would not do."""
    text = re.sub(rb"'(?:[^']|'')*'", b"", data)
    missing = set(re.findall(rb"#\d+", text)) - set(re.findall(rb"(#\d+)\s*=", text))
    if missing:
        raise unreadable(file, f"{min(missing).decode()} is named in it and not there")
    in_shells = sum(shell.count(b"#") for shell in re.findall(rb"=\s*(?:CLOSED|OPEN)_SHELL\s*\(([^;]*);", text))
    axes = dict(re.findall(rb"(#\d+)\s*=\s*DIRECTION\s*\([^(]*\(([^)]*)\)", text))
    for words in re.findall(rb"CARTESIAN_TRANSFORMATION_OPERATOR_3D\s*\(([^;]*)\)\s*;", text):
        try:
            first, second, _, scale, third = [word.strip() for word in words.split(b",")][-5:]
            given = zip((first, second, third), (b"1,0,0", b"0,1,0", b"0,0,1"))
            turn = np.array([axes.get(axis, usual).split(b",") for axis, usual in given]).astype(np.float64)
            kept = (scale == b"$" or float(scale) == 1) and np.linalg.det(turn) >= 0
        except ValueError as error:
            raise unreadable(file, "a transformation without its numbers") from error
        if not kept:
            what = "scales or mirrors a part into its place (MAPPED_ITEM)"
            raise file_error(file, what, "export it with the part as it is to become")
    return in_shells, len(re.findall(rb"=\s*(?:ADVANCED_FACE|FACE_SURFACE)\s*\(", text))


def unreadable(file: Path, reason: str) -> FileError:
    """The error of a file that OpenCASCADE makes nothing of."""
    kind = kind_of(file)
    return file_error(file, f"is no readable {kind} file ({reason})", f"export the part as {kind} again")


def refuse_foreign(file: Path) -> bytes:
    """The bytes of a file; FileError where a file does not begin and end as STEP or IGES files do."""
    kind = kind_of(file)
    try:
        data = input_bytes(file)
    except OSError as error:
        what = f"cannot be read ({error.strerror})"
        raise file_error(file, what, "give the path of a readable file") from error
    if kind == "STEP":
        begins = b"ISO-10303-21" in data[:256]
        ends = b"END-ISO-10303-21" in data[-256:]
    else:
        begins = data[72:73] in (b"S", b"C")
        ends = data.rstrip()[-8:-7] == b"T"
    if not (begins and ends):
        what = "is empty" if not data else f"is no {kind} file" if not begins else "is cut short"
        raise file_error(file, what, f"export the part as {kind} again")
    return data


def parts_of(shape: Any, kind: str, outside: str = "SHAPE") -> list[Any]:
    """The parts of a kind (SOLID, FACE, EDGE, VERTEX) of a shape that lie in none of the kind `outside`, in the order
    of OpenCASCADE's explorer."""
    lib = occ()
    kinds = (getattr(lib.TopAbs.TopAbs_ShapeEnum, f"TopAbs_{name}") for name in (kind, outside))
    explorer = lib.TopExp.TopExp_Explorer(shape, *kinds)
    parts = []
    while explorer.More():
        parts.append(explorer.Current())
        explorer.Next()
    return parts


def faces_of(shape: Any) -> list[Any]:
    """The faces of a shape, in the order of OpenCASCADE's explorer."""
    return [occ().TopoDS.TopoDS.Face(face) for face in parts_of(shape, "FACE")]


def area_of(shape: Any) -> float:
    """Area of all faces of a shape, mm^2."""
    properties = occ().GProp.GProp_GProps()
    occ().BRepGProp.BRepGProp.SurfaceProperties_s(shape, properties)
    return float(properties.Mass())


def sew(shape: Any, tolerance: float) -> Any:
    """The shape with its loose faces joined along edges that are nearer than `tolerance`, mm."""
    sewing = occ().BRepBuilderAPI.BRepBuilderAPI_Sewing(tolerance)
    sewing.Add(shape)
    sewing.Perform()
    return sewing.SewedShape()


TESSELLATED = re.compile(rb"=\s*(?:\w+_)?TRIANGULATED_(?:FACE|SURFACE_SET)\b")
"""Faces of a STEP file that have triangles and no surface (ISO 10303-42); OpenCASCADE passes over them."""
DEFAULT_CHORD_TOLERANCE = 5e-4
"""Chord tolerance where none is given, share of the diagonal."""
DEFLECTION = 0.6
"""Linear deflection that OpenCASCADE is given, share of the chord tolerance: its triangles exceed what it is
given."""
DEFLECTION_FACTORS = (1.0, 0.7, 0.4)
"""Factors on the deflection, tried in this order until the result keeps the tolerance."""
LEAST_DEFLECTION = 1e-7
"""OpenCASCADE takes no smaller one, mm (Precision::Confusion)."""
ANGULAR_DEFLECTION = 0.35
"""Largest angle between neighbouring triangles, radians."""
AREA_TOLERANCE = 0.03
"""Largest difference between the areas of triangles and faces, share of the latter: more is a lost part."""
CLOSED_FACE_CUTS = 3
"""Cuts of a face that closes on itself."""
MEASURED_POINTS = np.array([[1, 1, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]]) / [[3], [2], [2], [2]]
"""Barycentric coordinates of the points of a triangle whose distance from the face is measured: its middle
and the middles of its edges."""
SEWING_TOLERANCE = 1e-5
"""Largest distance of loose edges that are joined, share of the diagonal."""
WELDING_TOLERANCE = 1e-7
"""Largest distance of mesh points that become one vertex, share of the diagonal."""


def read_and_tessellate(
    path: str | Path, chord_tolerance: float | None = None, progress: Progress = silent
) -> MeshFile:
    """The part in a STEP or IGES file as triangles in mm. Curves, points and faces without a surface are left out and
    noted, faces beside solids are read with them and noted too. A damaged file may end the process, so
    `mesh.files.cad_files` calls this in a process of its own."""
    file = Path(path)
    shape = read_shape(file)
    if not faces_of(shape):
        raise file_error(file, "holds no surfaces", "export the part as a solid or as faces")
    try:
        mesh = tessellate_shape(shape, chord_tolerance)
    except FileError as error:
        raise FileError(f"{file}: {error}", file=str(file)) from error
    others = {
        "curves": len(parts_of(shape, "EDGE", "FACE")),
        "points": len(parts_of(shape, "VERTEX", "EDGE")),
        "tessellated faces": len(TESSELLATED.findall(input_bytes(file))),
    }
    loose = parts_of(shape, "FACE", "SOLID") if parts_of(shape, "SOLID") else []
    beside = (f"{counted(len(loose), 'face')} beside its solids, read with them",) if loose else ()
    return MeshFile(mesh, "mm", left_out_note(others) + beside)


def tessellate_shape(shape: Any, chord_tolerance: float | None = None) -> TriangleMesh:
    """Triangles of all faces (one or more), oriented as the faces are, welded along their edges.

    Faces without a solid are sewn first. `chord_tolerance` is in mm. FileError where it is too small, or
    no deflection keeps it.
    """
    lib = occ()
    box = lib.Bnd.Bnd_Box()
    lib.BRepBndLib.BRepBndLib.Add_s(shape, box, False)
    diagonal = 0.0 if box.IsVoid() else float(np.sqrt(box.SquareExtent()))
    tolerance = chord_tolerance or DEFAULT_CHORD_TOLERANCE * diagonal
    if not LEAST_DEFLECTION <= min(DEFLECTION_FACTORS) * DEFLECTION * tolerance < np.inf:
        what = f"{diagonal:g} mm from corner to corner: it cannot be tessellated within {tolerance:g} mm"
        raise FileError(f"{what}: export it in its true size, or give a larger tolerance")
    whole = shape if parts_of(shape, "SOLID") else sew(shape, SEWING_TOLERANCE * diagonal)
    area = area_of(whole)
    # The shape with each face that closes on itself cut into several
    divided = lib.ShapeUpgrade.ShapeUpgrade_ShapeDivideClosed(whole)
    divided.SetNbSplitPoints(CLOSED_FACE_CUTS)
    divided.Perform()
    for factor, candidate in product(DEFLECTION_FACTORS, (divided.Result(), whole)):
        lib.BRepTools.BRepTools.Clean_s(candidate)
        deflection = factor * DEFLECTION * tolerance
        lib.BRepMesh.BRepMesh_IncrementalMesh(candidate, deflection, False, ANGULAR_DEFLECTION, False)
        mesh = _mesh_of(candidate, tolerance, WELDING_TOLERANCE * diagonal)
        if mesh is not None and abs(mesh.area - area) <= AREA_TOLERANCE * area:
            return mesh
    raise FileError("a face of the part cannot be tessellated: heal the part in its CAD system and export it again")


def _mesh_of(shape: Any, tolerance: float, welding: float) -> TriangleMesh | None:
    """The triangles of a tessellated shape, points nearer than `welding` (mm) made one; None where there is no
    face, or one has no triangles or is further than `tolerance` (mm) from one of them."""
    faces = faces_of(shape)
    parts = [part for part in (_triangles(face, tolerance) for face in faces) if part]
    if not parts or len(parts) < len(faces):
        return None
    starts = np.cumsum([0, *[len(nodes) for nodes, _ in parts]])
    nodes = np.concatenate([nodes for nodes, _ in parts])
    corners = np.concatenate([corners + start for (_, corners), start in zip(parts, starts)])
    welded = nearest_groups(nodes, welding)[corners]
    return keep_faces(TriangleMesh(nodes, welded.astype(np.int32)), ~repeats_corner(welded))


def _triangles(face: Any, tolerance: float) -> tuple[Float[ndarray, "n 3"], Int64[ndarray, "m 3"]] | None:
    """Nodes and triangles of one face; None where it has none, or is further than `tolerance` (mm) from
    one."""
    lib = occ()
    place = lib.TopLoc.TopLoc_Location()
    mesh = lib.BRep.BRep_Tool.Triangulation_s(face, place)
    if mesh is None:
        return None
    matrix = place.Transformation()
    numbers = range(1, mesh.NbNodes() + 1)
    nodes = _coordinates(mesh.Node(i).Transformed(matrix) for i in numbers)
    parameters = np.array([(p.X(), p.Y()) for p in map(mesh.UVNode, numbers)])
    triples = [mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]
    corners = np.array(triples, dtype=np.int64).reshape(-1, 3) - 1

    surface = lib.BRepAdaptor.BRepAdaptor_Surface(face)
    for weights in MEASURED_POINTS:
        measured = np.einsum("k,mkp->mp", weights, parameters[corners]).tolist()
        points = _coordinates(surface.Value(u, v) for u, v in measured)
        # Distance of each point from the plane of its triangle; 0 for a triangle without area
        triangles = nodes[corners]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        has_area = lengths > np.finfo(float).eps * np.ptp(triangles, axis=(0, 1)).max() ** 2
        heights = np.abs(np.einsum("mi,mi->m", points - triangles[:, 0], normals))
        if np.where(has_area, heights / np.where(has_area, lengths, 1.0), 0.0).max() > tolerance:
            return None
    reversed_face = face.Orientation() == lib.TopAbs.TopAbs_Orientation.TopAbs_REVERSED
    return nodes, corners[:, ::-1] if reversed_face else corners


def _coordinates(points: Iterable[Any]) -> Float[ndarray, "n 3"]:
    return np.array([(p.X(), p.Y(), p.Z()) for p in points])


SECONDS = 60.0
"""Time that OpenCASCADE has for a file, and 100 s more for each MB."""
MEMORY = 2**31
"""Memory that OpenCASCADE has for its data, bytes, and 500 more for each byte of the file."""


def read_cad_mesh(path: str | Path, chord_tolerance: float | None = None) -> MeshFile:
    """The part in a STEP or IGES file as triangles in mm, within `chord_tolerance` (mm; default 5e-4 of its
    diagonal) of its faces.

    FileError names the file and what is wrong: not installed, no such file, no STEP or IGES, cut short,
    damaged, no surfaces in it.
    """
    work = read_and_tessellate
    given: MeshFile = in_child(f"{work.__module__}:{work.__name__}", Path(path), chord_tolerance)
    return given


def in_child(work: str, file: Path, *values: Any) -> Any:
    """What a function returns for a STEP or IGES file, run in a process of its own.

    `work` names the function as "module:function"; it is called with the file's name, `values` and a progress.
    FileError where the function raised one, or the process broke down or went beyond SECONDS or MEMORY.
    """
    data = refuse_foreign(file)
    if find_spec("OCP") is None:
        raise missing(f"{file}: reading {kind_of(file)}")
    try:
        return call_in_child(
            work,
            str(file),
            *values,
            library="OpenCASCADE",
            remedy=f"it may be damaged: export the part as {kind_of(file)} again",
            seconds=SECONDS + len(data) / 1e4,
            memory=MEMORY + 500 * len(data),
        )
    except Exception as error:
        if not is_failure(error):
            raise
        raise unreadable(file, str(error)) from error
