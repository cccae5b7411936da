"""T-splines in files of CAD systems: STEP and IGES.

A T-spline as a shape of OpenCASCADE: one face of its exact B-spline, or its Bezier elements sewn.

B-spline surfaces from the faces of STEP and IGES files, through OpenCASCADE (optional extra `cad`).

T-splines as STEP and IGES for CAD systems, and B-spline surfaces back from them, through OpenCASCADE
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
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FileError, SurfaceError, file_error
from bonecam.files import write_whole
from bonecam.mesh.files.cad import area_of, faces_of, in_child, occ, read_shape, sew
from bonecam.progress import Progress, silent
from bonecam.surface.files.bspline import BSplineSurface, Knots, to_bspline
from bonecam.surface.tspline import TSpline

EDGE = 1e-7
"""Tolerance of the faces' edges, mm: OpenCASCADE's own."""


JOINED = 1e-9
"""Share of the size: Bezier faces whose edges are nearer than this are joined."""


def shape_of(surface: TSpline) -> Any:
    """The surface as a valid OpenCASCADE solid, or as a shell where it encloses no volume. Raises
    SurfaceError where it is not valid."""
    lib = occ()
    try:
        spline = to_bspline(surface)
    except SurfaceError:
        # The Bezier elements as faces, sewn; a solid where no edge is free
        faces = []
        size = float(np.linalg.norm(np.ptp(surface.control_points, axis=0)))
        for patch in surface.patches.reshape(-1, 4, 4, 4).swapaxes(1, 2):
            grid = _grid(lib.collections.Array2_double, patch[..., 3].tolist())
            faces.append(_face_of(lib.Geom.Geom_BezierSurface(_points(patch[..., :3] / patch[..., 3:]), grid)))
        shape = sew(_compose("Compound", faces), max(EDGE, JOINED * size))
        is_shell = shape.ShapeType() == lib.TopAbs.TopAbs_ShapeEnum.TopAbs_SHELL
        if is_shell and lib.BRep.BRep_Tool.IsClosed_s(shape):
            shape = _solid_in(lib.TopoDS.TopoDS.Shell(shape))
    else:
        # OpenCASCADE's B-spline surface with u = s and v = t
        knots = (spline.s_knots, spline.t_knots)
        values = [_list(lib.collections.Array1_double, k.values) for k in knots]
        counts = [_list(lib.collections.Array1_int, k.multiplicities) for k in knots]
        closed = [k.closed for k in knots]
        weights = (_grid(lib.collections.Array2_double, spline.weights.tolist()),) if spline.rational else ()
        shell = _compose(
            "Shell",
            [_face_of(lib.Geom.Geom_BSplineSurface(_points(spline.poles), *weights, *values, *counts, 3, 3, *closed))],
        )
        shape = _solid_in(shell) if spline.watertight else shell
    if not lib.BRepCheck.BRepCheck_Analyzer(shape).IsValid():
        raise SurfaceError(
            "OpenCASCADE finds the shape of the surface invalid: look for folds with its self-intersections"
        )
    return shape


def _points(poles: Float[ndarray, "a b 3"]) -> Any:
    lib = occ()
    return _grid(lib.collections.Array2_gp_Pnt, [[lib.gp.gp_Pnt(*pole) for pole in row] for row in poles.tolist()])


def _list(kind: Any, values: ndarray) -> Any:
    array = kind(1, len(values))
    for i, value in enumerate(values.tolist(), 1):
        array.SetValue(i, value)
    return array


def _grid(kind: Any, rows: list[list[Any]]) -> Any:
    array = kind(1, len(rows), 1, len(rows[0]))
    for i, row in enumerate(rows, 1):
        for j, value in enumerate(row, 1):
            array.SetValue(i, j, value)
    return array


def _face_of(geometry: Any) -> Any:
    return occ().BRepBuilderAPI.BRepBuilderAPI_MakeFace(geometry, EDGE).Face()


def _compose(kind: str, parts: Iterable[Any]) -> Any:
    """The parts in a Compound, a Shell or a Solid."""
    lib = occ()
    build = lib.BRep.BRep_Builder()
    whole = getattr(lib.TopoDS, f"TopoDS_{kind}")()
    getattr(build, f"Make{kind}")(whole)
    for part in parts:
        build.Add(whole, part)
    return whole


def _solid_in(shell: Any) -> Any:
    """The solid inside a closed shell."""
    shell.Closed(True)
    return _compose("Solid", [shell])


def read_bsplines(path: str | Path) -> tuple[BSplineSurface, ...]:
    """The bicubic (or lower) B-spline surfaces of the faces of a STEP or IGES file, in mm, in the file's
    order.

    Raises FileError as `mesh.files.cad_files` does, and where a face is trimmed or lies on another kind of surface:
    read such a part with `read_mesh`.
    """
    surfaces: tuple[BSplineSurface, ...] = in_child(f"{__name__}:bsplines_in", Path(path))
    return surfaces


def bsplines_in(file: str | Path, progress: Progress = silent) -> tuple[BSplineSurface, ...]:
    """As `read_bsplines`, in this process, which a damaged file may end."""
    return tuple(_bspline_of(face, Path(file)) for face in faces_of(read_shape(file)))


def _bspline_of(face: Any, file: Path) -> BSplineSurface:
    """The surface under a face; FileError where it is no B-spline of degree 3 or less."""
    lib = occ()
    spline = lib.BRep.BRep_Tool.Surface_s(face)
    if not isinstance(spline, lib.Geom.Geom_BSplineSurface) or max(spline.UDegree(), spline.VDegree()) > 3:
        kind = type(spline).__name__.removeprefix("Geom_")
        raise FileError(
            f"{file}: a face lies on a {kind}, no bicubic B-spline: read the part as a mesh", file=str(file), kind=kind
        )
    whole = area_of(_face_of(spline))
    if abs(area_of(face) - whole) > TRIMMED * whole:
        what = f"a face is trimmed: {area_of(face):.4g} of the {whole:.4g} mm^2 of its surface are in it"
        raise file_error(file, what, "cut the surface itself to its borders, or read the part as a mesh")
    spline.IncreaseDegree(3, 3)
    loose = (not spline.IsUPeriodic() and spline.UMultiplicity(1) < 4) or (
        not spline.IsVPeriodic() and spline.VMultiplicity(1) < 4
    )
    if loose:
        spline.Segment(*spline.Bounds(), EDGE, EDGE)  # end knots four times, by knot insertion
    size = spline.NbUPoles(), spline.NbVPoles()
    poles = [[spline.Pole(i, j) for j in range(1, size[1] + 1)] for i in range(1, size[0] + 1)]
    weights = [[spline.Weight(i, j) for j in range(1, size[1] + 1)] for i in range(1, size[0] + 1)]
    s_knots, t_knots = (_knots_along(spline, way) for way in "UV")
    return BSplineSurface(
        s_knots, t_knots, np.array([[(p.X(), p.Y(), p.Z()) for p in row] for row in poles]), np.array(weights)
    )


def _knots_along(spline: Any, way: str) -> Knots:
    """The knots of OpenCASCADE's B-spline along "U" or "V"."""
    count, knot, multiplicity, closed = (
        getattr(spline, name) for name in (f"Nb{way}Knots", f"{way}Knot", f"{way}Multiplicity", f"Is{way}Periodic")
    )
    numbers = range(1, count() + 1)
    return Knots(np.array([knot(i) for i in numbers]), np.array([multiplicity(i) for i in numbers]), closed())


DIGITS = "%#.17G"


TRIMMED = 1e-4
"""A face whose area differs more from that of its surface, share of it, is trimmed."""


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
