"""T-splines as STEP and IGES for CAD systems, and B-spline surfaces back from them, through OpenCASCADE
(optional extra `cad`).

A surface over a rectangle of parameters is written as one face: the exact B-spline of `surface.nurbs`,
periodic round the part, each pole a degenerate edge; where it encloses a volume, as a solid. What has no
rectangular union of knots is written as its Bezier elements, each a face, sewn to a shell.

Files are in mm, with 17 digits (a double comes back as itself), and say nothing of the time, user or place:
the same surface gives the same bytes. STEP keeps the closed direction periodic; IGES as OpenCASCADE writes it
may hold the same surface open, with three columns twice.
"""

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bonecam.files import write_whole
from bonecam.mesh.files.cad_shapes import faces_of
from bonecam.mesh.files.opencascade import occ
from bonecam.surface.files.cad.shapes import shape_of
from bonecam.surface.tspline import TSpline

DIGITS = "%#.17G"


NAME = "bonecam T-spline"


NO_DATE = "1970-01-01T00:00:00"


def write_step(surface: TSpline, path: str | Path) -> int:
    """Write a STEP file (AP214, mm), whole or not at all. Returns the number of faces: 1 is the exact
    periodic B-spline.

    Raises FileError where OpenCASCADE is not installed, cannot build a valid shape, or the file cannot be
    written.
    """
    return _write(surface, Path(path), "STEP", _step_text)


def write_iges(surface: TSpline, path: str | Path) -> int:
    """Write an IGES file (5.3 with solids, mm), whole or not at all. Returns and raises as `write_step`."""
    return _write(surface, Path(path), "IGES", _iges_text)


def _write(surface: TSpline, path: Path, kind: str, text: Callable[[Any], str]) -> int:
    occ(f"{path}: writing {kind}")
    shape = shape_of(surface)
    write_whole(path, text(shape))
    return len(faces_of(shape))


def _step_text(shape: Any) -> str:
    lib = occ()
    writer = lib.STEPControl.STEPControl_Writer()
    lib.Interface.Interface_Static.SetCVal_s("write.step.product.name", NAME)
    writer.Transfer(shape, lib.STEPControl.STEPControl_StepModelType.STEPControl_AsIs)
    model = writer.Model(False)
    header = lib.APIHeaderSection.APIHeaderSection_MakeHeader(model)
    for put, word in ((header.SetName, NAME), (header.SetTimeStamp, NO_DATE), (header.SetOriginatingSystem, "bonecam")):
        put(_word(word))
    for i in range(1, model.NbEntities() + 1):  # OpenCASCADE numbers the products of a process
        if isinstance(model.Entity(i), lib.StepBasic.StepBasic_Product):
            model.Entity(i).SetName(_word(NAME))
            model.Entity(i).SetId(_word(NAME))
    text = lib.StepData.StepData_StepWriter(model)
    text.FloatWriter().SetFormat(DIGITS)
    text.SendModel(writer.WS().Protocol())
    head, data, body = _printed(text).partition("DATA;")
    return head + data + re.sub(r"(\.\d*?)0+(?=[,)E])", r"\1", body)


def _iges_text(shape: Any) -> str:
    lib = occ()
    writer = lib.IGESControl.IGESControl_Writer("MM", 1)
    writer.AddShape(shape)
    writer.ComputeModel()
    model = writer.Model()
    section = model.GlobalSection()
    for put in (section.SetDate, section.SetLastChangeDate):
        put(_word("19700101.000000"))
    for put in (section.SetSendName, section.SetFileName, section.SetAuthorName, section.SetReceiveName):
        put(_word(NAME))
    model.SetGlobalSection(section)
    text = lib.IGESData.IGESData_IGESWriter(model)
    text.FloatWriter().SetFormat(DIGITS)
    text.SendModel(lib.IGESSelect.IGESSelect_WorkLibrary.DefineProtocol_s())
    return _printed(text)


def _word(text: str) -> Any:
    return occ().TCollection.TCollection_HAsciiString(text)


def _printed(text: Any) -> str:
    stream = io.BytesIO()
    text.Print(stream)
    return stream.getvalue().decode("ascii")
