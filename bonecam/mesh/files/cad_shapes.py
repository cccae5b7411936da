"""STEP and IGES files as OpenCASCADE shapes: read, taken apart into faces, sewn together.

Both kinds state their unit, and OpenCASCADE converts it: a shape is in mm. Loose faces, which are usual in
IGES, are joined by `sew`.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from bonecam.errors import FileError, file_error
from bonecam.files import input_bytes, library_name
from bonecam.mesh.files.opencascade import kind_of, occ

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
    told = _step_faces(file, data) if kind == "STEP" else len(IGES_FACES.findall(data))
    if len(faces_of(shape)) < told:
        raise unreadable(file, f"{len(faces_of(shape))} of its {told} faces could be read")
    return shape


def _step_faces(file: Path, data: bytes) -> int:
    """How many faces the text of a STEP file has; FileError where an entity in it names one that is not there."""
    text = re.sub(rb"'(?:[^']|'')*'", b"", data)
    missing = set(re.findall(rb"#\d+", text)) - set(re.findall(rb"(#\d+)\s*=", text))
    if missing:
        raise unreadable(file, f"{min(missing).decode()} is named in it and not there")
    in_shells = sum(shell.count(b"#") for shell in re.findall(rb"=\s*(?:CLOSED|OPEN)_SHELL\s*\(([^;]*);", text))
    return max(in_shells, len(re.findall(rb"=\s*(?:ADVANCED_FACE|FACE_SURFACE)\s*\(", text)))


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


def diagonal_of(shape: Any) -> float:
    """Length of the diagonal of the bounding box of a shape, mm; 0 where the shape is empty."""
    lib = occ()
    box = lib.Bnd.Bnd_Box()
    lib.BRepBndLib.BRepBndLib.Add_s(shape, box, False)
    return 0.0 if box.IsVoid() else float(np.sqrt(box.SquareExtent()))


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
