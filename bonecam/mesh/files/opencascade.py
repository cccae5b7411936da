"""STEP and IGES parts through OpenCASCADE (the wheel `cadquery-ocp-novtk`, optional extra `cad`): read, sewn
and tessellated.

A STEP or IGES file states its unit, so what comes back is in mm whatever it was. Loose faces (the habit of
IGES) are sewn first. The triangles of neighbouring faces share the points of their common edge; they are
welded there, and what collapses at a pole is dropped.
"""

from functools import cache
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from bonecam.errors import FileError
from bonecam.mesh.triangle_mesh import TriangleMesh

STEP, IGES = (".step", ".stp"), (".iges", ".igs")
CHORD = 5e-4  # default chord tolerance, of the diagonal
ASKED = 0.6  # of the tolerance is asked of OpenCASCADE, which overshoots
TRIES = (1.0, 0.7, 0.4)  # of the deflection, one after the other where a face fails
LOST = 0.03  # of the area: where the triangles have so much less or more than the faces, OpenCASCADE has lost a part
MEASURED = np.array([[1, 1, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]]) / [
    [3],
    [2],
    [2],
    [2],
]  # shares of the corners at the measured points
SPLITS = 3  # closed faces are cut that often
ANGLE = 0.35  # between neighbouring triangles, radians
SEWN = 1e-5  # of the diagonal: loose edges nearer than this are one
WELDED = 1e-7  # of the diagonal: mesh points nearer than this are one


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
        found = import_module(f"{self._name}.{package}")
        setattr(self, package, found)
        return found


def kind_of(file: Path) -> str:
    """STEP or IGES, by the file's ending."""
    return "STEP" if file.suffix.lower() in STEP else "IGES"


def mesh_in(file: Path, chord_tolerance: float | None = None) -> TriangleMesh:
    """The part in a STEP or IGES file as triangles in mm: `mesh.cad_files` calls it in a process of its
    own."""
    shape = read_shape(file)
    if not faces_of(shape):
        raise FileError(f"{file}: holds no surfaces: export the part as a solid or as faces", file=str(file))
    try:
        return tessellated(shape, chord_tolerance)
    except FileError as error:
        raise FileError(f"{file}: {error}", file=str(file)) from error


def read_shape(path: str | Path) -> Any:
    """What a STEP or IGES file holds, as one OpenCASCADE shape in mm."""
    file, kind = Path(path), kind_of(Path(path))
    refuse_foreign(file)
    lib = occ(f"{file}: reading {kind}")
    reader = lib.STEPControl.STEPControl_Reader() if kind == "STEP" else lib.IGESControl.IGESControl_Reader()
    try:
        status = reader.ReadFile(str(file))
        found = reader.TransferRoots() if status == lib.IFSelect.IFSelect_ReturnStatus.IFSelect_RetDone else 0
        shape = reader.OneShape() if found else None
    except lib.Standard.Standard_Failure as error:
        raise FileError(
            f"{file}: is no readable {kind} file ({error}): export the part as {kind} again", file=str(file)
        ) from error
    if shape is None or shape.IsNull():
        raise FileError(
            f"{file}: is no readable {kind} file (cut short, or nothing in it): export the part as {kind} again",
            file=str(file),
        )
    return shape


def refuse_foreign(file: Path) -> None:
    """FileError where the first and the last words of a file are not those of its kind."""
    kind = kind_of(file)
    try:
        data = file.read_bytes()
    except OSError as error:
        raise FileError(
            f"{file}: cannot be read ({error.strerror}): give the path of a readable file", file=str(file)
        ) from error
    if kind == "STEP":
        begins, ends = b"ISO-10303-21" in data[:256], b"END-ISO-10303-21" in data[-256:]
    else:
        begins, ends = data[72:73] in (b"S", b"C"), data.rstrip()[-8:-7] == b"T"
    if not (begins and ends):
        what = "is empty" if not data else f"is no {kind} file" if not begins else "is cut short"
        raise FileError(f"{file}: {what}: export the part as {kind} again", file=str(file))


def faces_of(shape: Any) -> list[Any]:
    """The faces of a shape, in its order."""
    lib = occ()
    explorer, found = lib.TopExp.TopExp_Explorer(shape, lib.TopAbs.TopAbs_ShapeEnum.TopAbs_FACE), []
    while explorer.More():
        found.append(lib.TopoDS.TopoDS.Face(explorer.Current()))
        explorer.Next()
    return found


def diagonal_of(shape: Any) -> float:
    """Length of the diagonal of the box round a shape, mm; 0 where there is nothing in it."""
    lib = occ()
    box = lib.Bnd.Bnd_Box()
    lib.BRepBndLib.BRepBndLib.Add_s(shape, box, False)
    return 0.0 if box.IsVoid() else float(np.sqrt(box.SquareExtent()))


def sewn(shape: Any, tolerance: float) -> Any:
    """The shape with its loose faces joined along edges that are nearer than `tolerance`, mm."""
    sewing = occ().BRepBuilderAPI.BRepBuilderAPI_Sewing(tolerance)
    sewing.Add(shape)
    sewing.Perform()
    return sewing.SewedShape()


def tessellated(shape: Any, chord_tolerance: float | None = None) -> TriangleMesh:
    """Triangles of all faces (one or more), outward as the faces say, welded along their edges.

    OpenCASCADE sometimes loses parts of a face, of one that closes on itself above all. So what it made is
    measured (distance of each triangle from the face, area) and tried again: closed faces cut up, as they
    are, finer. FileError where no try succeeds.
    """
    lib = occ()
    diagonal = diagonal_of(shape)
    tolerance = chord_tolerance or CHORD * diagonal
    solids = lib.TopExp.TopExp_Explorer(shape, lib.TopAbs.TopAbs_ShapeEnum.TopAbs_SOLID).More()
    whole = shape if solids else sewn(shape, SEWN * diagonal)
    area = _area(whole)
    for share, tried in product(TRIES, (_without_closed_faces(whole), whole)):
        lib.BRepTools.BRepTools.Clean_s(tried)
        lib.BRepMesh.BRepMesh_IncrementalMesh(tried, share * ASKED * tolerance, False, ANGLE, False)
        mesh = _mesh_of(tried, tolerance, WELDED * diagonal)
        if mesh is not None and abs(mesh.area - area) <= LOST * area:
            return mesh
    raise FileError(
        "a face of the part cannot be tessellated: heal the part in its CAD system and export it again"
    )


def _area(shape: Any) -> float:
    """Area of all faces, mm^2."""
    found = occ().GProp.GProp_GProps()
    occ().BRepGProp.BRepGProp.SurfaceProperties_s(shape, found)
    return float(found.Mass())


def _without_closed_faces(shape: Any) -> Any:
    divided = occ().ShapeUpgrade.ShapeUpgrade_ShapeDivideClosed(shape)
    divided.SetNbSplitPoints(SPLITS)
    divided.Perform()
    return divided.Result()


def _mesh_of(shape: Any, tolerance: float, weld: float) -> TriangleMesh | None:
    """The triangles of a tessellated shape; None where a face has none or is further than `tolerance` from
    them (mm)."""
    faces = faces_of(shape)
    parts = [part for face in faces if (part := _triangles(face, tolerance))]
    if len(parts) < len(faces):
        return None
    starts = np.cumsum([0, *[len(nodes) for nodes, _ in parts]])
    return _welded(
        np.concatenate([nodes for nodes, _ in parts]),
        np.concatenate([c + start for (_, c), start in zip(parts, starts)]),
        weld,
    )


def _triangles(face: Any, tolerance: float) -> tuple[Float[ndarray, "n 3"], Int64[ndarray, "m 3"]] | None:
    """Nodes and triangles of one face; None where there are none, or the face is further than `tolerance`
    from one of them (mm)."""
    lib = occ()
    place = lib.TopLoc.TopLoc_Location()
    mesh = lib.BRep.BRep_Tool.Triangulation_s(face, place)
    if mesh is None:
        return None
    matrix, count = place.Transformation(), range(1, mesh.NbNodes() + 1)
    nodes = np.array([(p.X(), p.Y(), p.Z()) for p in (mesh.Node(i).Transformed(matrix) for i in count)])
    parameters = np.array([(p.X(), p.Y()) for p in map(mesh.UVNode, count)])
    corners = (
        np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64).reshape(
            -1, 3
        )
        - 1
    )
    surface = lib.BRepAdaptor.BRepAdaptor_Surface(face)
    for shares in MEASURED:
        at = np.einsum("k,mkp->mp", shares, parameters[corners]).tolist()
        found = np.array([(p.X(), p.Y(), p.Z()) for p in (surface.Value(u, v) for u, v in at)])
        if _heights(nodes[corners], found).max() > tolerance:
            return None
    return nodes, corners[
        :, ::-1
    ] if face.Orientation() == lib.TopAbs.TopAbs_Orientation.TopAbs_REVERSED else corners


def _heights(triangles: Float[ndarray, "m 3 3"], points: Float[ndarray, "m 3"]) -> Float[ndarray, " m"]:
    """Distance of each point from its triangle's plane, 0 where the triangle is none."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normals, axis=1)
    flat = length > np.finfo(float).eps * np.ptp(triangles, axis=(0, 1)).max() ** 2
    heights = np.abs(np.einsum("mi,mi->m", points - triangles[:, 0], normals))
    return np.where(flat, heights / np.where(flat, length, 1.0), 0.0)


def _welded(nodes: Float[ndarray, "n 3"], faces: Int64[ndarray, "m 3"], tolerance: float) -> TriangleMesh:
    """Nodes nearer than `tolerance` made one (the first of them), null faces dropped."""
    pairs = cKDTree(nodes).query_pairs(tolerance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(nodes), len(nodes)))
    groups = connected_components(graph, directed=False)[1]
    _, first, index = np.unique(groups, return_index=True, return_inverse=True)
    kept = index[faces]
    kept = kept[(kept[:, 0] != kept[:, 1]) & (kept[:, 1] != kept[:, 2]) & (kept[:, 2] != kept[:, 0])]
    return TriangleMesh(nodes[first], kept.astype(np.int32))
