"""Triangles of OpenCASCADE shapes, within a chord tolerance of their faces.

OpenCASCADE sometimes loses a part of a face, most often of a face that closes on itself. So the distance of
each triangle from its face and the area of all of them are measured, and a result that misses is computed
again, finer and with other faces. The triangles of neighbouring faces share the points of their common edge
and are welded there; triangles that collapse at a pole are dropped.
"""

import re
from collections.abc import Iterable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.errors import FileError, counted, file_error
from bonecam.files import input_bytes
from bonecam.mesh.files.cad_shapes import area_of, diagonal_of, faces_of, parts_of, read_shape, sew
from bonecam.mesh.files.formats.content import MeshFile, left_out_note
from bonecam.mesh.files.opencascade import occ
from bonecam.mesh.healing.seams import nearest_groups
from bonecam.mesh.healing.topology import repeats_corner
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces
from bonecam.progress import Progress, silent

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
    diagonal = diagonal_of(shape)
    tolerance = chord_tolerance or DEFAULT_CHORD_TOLERANCE * diagonal
    if not LEAST_DEFLECTION <= min(DEFLECTION_FACTORS) * DEFLECTION * tolerance < np.inf:
        what = f"{diagonal:g} mm from corner to corner: it cannot be tessellated within {tolerance:g} mm"
        raise FileError(f"{what}: export it in its true size, or give a larger tolerance")
    whole = shape if parts_of(shape, "SOLID") else sew(shape, SEWING_TOLERANCE * diagonal)
    area = area_of(whole)
    for factor, candidate in product(DEFLECTION_FACTORS, (_cut_closed_faces(whole), whole)):
        lib.BRepTools.BRepTools.Clean_s(candidate)
        deflection = factor * DEFLECTION * tolerance
        lib.BRepMesh.BRepMesh_IncrementalMesh(candidate, deflection, False, ANGULAR_DEFLECTION, False)
        mesh = _mesh_of(candidate, tolerance, WELDING_TOLERANCE * diagonal)
        if mesh is not None and abs(mesh.area - area) <= AREA_TOLERANCE * area:
            return mesh
    raise FileError("a face of the part cannot be tessellated: heal the part in its CAD system and export it again")


def _cut_closed_faces(shape: Any) -> Any:
    """The shape with each face that closes on itself cut into several."""
    divided = occ().ShapeUpgrade.ShapeUpgrade_ShapeDivideClosed(shape)
    divided.SetNbSplitPoints(CLOSED_FACE_CUTS)
    divided.Perform()
    return divided.Result()


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
    return _weld(nodes, corners, welding)


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
        if _plane_distances(nodes[corners], points).max() > tolerance:
            return None
    reversed_face = face.Orientation() == lib.TopAbs.TopAbs_Orientation.TopAbs_REVERSED
    return nodes, corners[:, ::-1] if reversed_face else corners


def _coordinates(points: Iterable[Any]) -> Float[ndarray, "n 3"]:
    return np.array([(p.X(), p.Y(), p.Z()) for p in points])


def _plane_distances(triangles: Float[ndarray, "m 3 3"], points: Float[ndarray, "m 3"]) -> Float[ndarray, " m"]:
    """Distance of each point from the plane of its triangle; 0 for a triangle without area."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    has_area = lengths > np.finfo(float).eps * np.ptp(triangles, axis=(0, 1)).max() ** 2
    heights = np.abs(np.einsum("mi,mi->m", points - triangles[:, 0], normals))
    return np.where(has_area, heights / np.where(has_area, lengths, 1.0), 0.0)


def _weld(nodes: Float[ndarray, "n 3"], faces: Int64[ndarray, "m 3"], tolerance: float) -> TriangleMesh:
    """The mesh with nodes nearer than `tolerance` made one (the first of them) and null faces dropped."""
    welded = nearest_groups(nodes, tolerance)[faces]
    return keep_faces(TriangleMesh(nodes, welded.astype(np.int32)), ~repeats_corner(welded))
