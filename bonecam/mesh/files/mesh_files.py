"""The anatomical axes that a mesh file states in its header: `SPACE=LPS`, as 3D Slicer writes it.

The three letters tell where x, y and z point: Left or Right, Anterior or Posterior, Superior or Inferior. LPS (DICOM)
and RAS (3D Slicer inside) are right-handed; coordinates in left-handed axes are a mirror image of the bone.

Mesh files: STL (binary, ASCII), PLY, OBJ, OFF, VTK, VTP, VTU, GLB, 3MF in; PLY, STL and 3MF out, through MeshLab.

`read_mesh_file` reads every kind of part file: for STEP, IGES, SAT, DXF and point clouds it asks the modules that
know them. Coordinates are read and written as they stand in the file; `bonecam.mesh.units` gives them their
unit.
"""

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FileError, MeshError, file_error
from bonecam.files import input_bytes, library_name, require_room, whole_file
from bonecam.mesh.files.cad import IGES, STEP, read_cad_mesh
from bonecam.mesh.files.label_map import LABEL_MAPS
from bonecam.mesh.files.points import FEWEST, POINTS, read_blocks, reconstruct
from bonecam.mesh.files.polygons import (
    LEFT_OUT,
    ContentError,
    MeshFile,
    parse_obj,
    parse_off,
    parse_ply,
    parse_stl,
    triangles_of,
)
from bonecam.mesh.files.polyhedra import ACIS, DXF, read_polyhedra
from bonecam.mesh.files.scenes import parse_3mf, parse_glb
from bonecam.mesh.files.vtk import parse_vtk, parse_vtp, parse_vtu
from bonecam.mesh.meshlab import meshlab, quality_colours
from bonecam.mesh.triangle_mesh import LARGEST_COORDINATE, TriangleMesh
from bonecam.mesh.units import STATED, to_mm
from bonecam.plugins import Reader, added, reader_endings, run_added

STATED_AXES = re.compile(rb"\b(?:space|coordinate[ _-]?system)\s*[=:]\s*([a-z]+(?:-[a-z]+)*)", re.IGNORECASE)
"""A statement in a comment."""
POINTS_TO = {
    "L": (-1, 0, 0, "left"),
    "R": (1, 0, 0, "right"),
    "P": (0, -1, 0, "back"),
    "A": (0, 1, 0, "front"),
    "I": (0, 0, -1, "feet"),
    "S": (0, 0, 1, "head"),
}
"""Direction of each letter in RAS, and in plain words."""
COMMENTS = (b"comment", b"obj_info", b"#", b"solid")
"""How lines that hold comments begin, in PLY, OBJ, OFF and ASCII STL."""
STL_HEADER = 80
"""Bytes of the text that a binary STL begins with."""
LOOKED_AT = 2**16
"""Bytes from a file's beginning in which a comment is looked for."""


def stated_axes(data: bytes) -> str:
    """The three letters that the bytes of a mesh file state, like LPS; empty where they state none."""
    head = data[:LOOKED_AT]
    lines = [line for line in head.splitlines() if line.lstrip().lower().startswith(COMMENTS)]
    for match in STATED_AXES.finditer(b"\n".join([head[:STL_HEADER], *lines])):
        words = match[1].decode().upper()
        letters = "".join(word[0] for word in words.split("-")) if "-" in words else words
        if len(letters) == 3 and all(letter in POINTS_TO for letter in letters) and _directions(letters):
            return letters
    return ""


def _directions(letters: str) -> float:
    """1 where the axes are right-handed, -1 where left-handed, 0 where they are no axes of space."""
    return float(np.linalg.det([POINTS_TO[letter][:3] for letter in letters]))


def axes_text(letters: str) -> str:
    """What is told of stated axes."""
    where = ", ".join(f"{axis} to the {POINTS_TO[letter][3]}" for axis, letter in zip("xyz", letters, strict=True))
    message = f"its header states the axes {letters}: {where}"
    return message if _directions(letters) > 0 else f"{message}; they are left-handed: check that it is no mirror image"


PARSERS = {".stl": parse_stl, ".ply": parse_ply, ".obj": parse_obj, ".off": parse_off}
MESHES = tuple(PARSERS)
"""Endings of mesh files that MeshLab reads too."""
SCENES = {".vtk": parse_vtk, ".vtp": parse_vtp, ".vtu": parse_vtu, ".glb": parse_glb, ".3mf": parse_3mf}
"""Other files of surfaces; .vtp and .vtu need the extra `formats`."""
CAD = (*STEP, *IGES, *ACIS, *DXF)
"""Endings of CAD files, which need the extra `cad`."""
READABLE = (*MESHES, *SCENES, *CAD, *POINTS)
"""Endings of the files that `read_mesh` reads."""
UTF_8 = b"\xef\xbb\xbf"
"""Bytes that some programs begin a text with."""
WRITABLE = (".ply", ".stl", ".3mf")
"""Endings of the files that `write_mesh` writes."""


T = TypeVar("T")


def reader_of(path: str | Path) -> Reader | None:
    """What users or packages read a file with, by its ending; None where nothing is, or what ships reads it."""
    ending = ending_of(Path(path))
    if ending in (*READABLE, *LABEL_MAPS) or ending not in reader_endings():
        return None
    reader: Reader = added("readers", ending.removeprefix("."))
    return reader


def made_by(reader: Reader, file: Path, kind: type[T]) -> T:
    """What the reader of a file makes of it, a TriangleMesh or TSpline as `kind` says. FileError where it makes the
    other one or finds the file damaged, JobError where it fails."""
    wanted = "mesh" if kind is TriangleMesh else "surface"
    if reader.holds != wanted:
        raise file_error(file, f"is read as a {reader.holds}", f"give a {wanted}")
    with run_added("readers", ending_of(file).removeprefix(".")):
        try:
            made = reader.read(file)
        except ValueError as error:  # its JobError names the plugin alone
            raise ValueError(f"{file}: {error}") from error
        if not isinstance(made, kind):
            raise TypeError(f"it makes a {type(made).__name__} of {file}, no {kind.__name__}")
        return made


def ending_of(file: Path) -> str:
    """The ending of a file that tells its kind, in small letters: .nii.gz is one."""
    packed = file.suffix.lower() == ".gz"
    return (Path(file.stem).suffix * packed + file.suffix).lower()


def read_mesh(path: str | Path) -> TriangleMesh:
    """The triangles of a file, in its own unit; all that `read_mesh_file` says holds."""
    return read_mesh_file(path).mesh


def read_in_mm(path: str | Path, units: str = STATED) -> TriangleMesh:
    """The triangles of a file, mm. `units` is one of UNITS: that of its coordinates, or `stated`: the one that it
    states, mm where it states none. FileError as `read_whole`, UnitsError as `to_mm`."""
    given = read_whole(path)
    return to_mm(given.mesh, units, str(path), stated=given.unit)


def read_whole(path: str | Path) -> MeshFile:
    """What `read_mesh_file` gives where nothing can be told beside it; FileError where it left out any of the file."""
    given = read_mesh_file(path)
    for note in given.notes:
        if note.startswith(LEFT_OUT):
            what = f"holds {note.removeprefix(LEFT_OUT)}, which would be left out"
            raise file_error(path, what, "export its surface alone")
    return given


def read_mesh_file(path: str | Path, also: tuple[str, ...] = ()) -> MeshFile:
    """The triangles of a file, in the file's own unit; equal corners of an STL, VTK, VTP, VTU, GLB or 3MF are merged.

    STEP, IGES, SAT and DXF need the extra `cad`; where they state their unit the triangles are in mm. Curved
    faces are tessellated. `also` are other endings that the caller reads itself: a refusal names them too.
    A dense point cloud (PLY without faces, or text of one block) gets a surface round it, see
    `mesh.point_cloud`; what a plugin reads is in mm. FileError names the file, what is wrong with it and the remedy: it
    is missing, empty, cut short, of an unknown kind, holds coordinates that are not numbers, or no triangles.
    """
    file = Path(path)
    reader = reader_of(file)
    if reader is not None:
        bytes_of(file)
        return MeshFile(made_by(reader, file, TriangleMesh), "mm")
    known = file.suffix.lower() in READABLE or os.path.isdir(file)
    if not known and (file.suffix or os.path.exists(file)):
        ending = f"has the unknown ending {file.suffix!r}" if file.suffix else "has no ending that tells its kind"
        endings = ", ".join((*READABLE, *reader_endings(), *also))
        raise file_error(file, ending, f"give a file that ends in one of {endings}")
    data = bytes_of(file)
    ending = file.suffix.lower()
    if ending not in (*MESHES, *SCENES):
        return _read_other(file)
    given = read_content(file, data)
    if not len(given.mesh.faces):
        return replace(given, mesh=_round_points(file, given.mesh.vertices))
    if ending in MESHES and ending != ".stl":
        return given
    # Equal corners made one vertex, without vertices that no face has
    used, corners = np.unique(given.mesh.faces, return_inverse=True)
    vertices, index = np.unique(given.mesh.vertices[used] + 0.0, axis=0, return_inverse=True)
    return replace(given, mesh=TriangleMesh(vertices, index.ravel()[corners].reshape(-1, 3).astype(np.int32)))


def read_content(file: Path, data: bytes) -> MeshFile:
    """The vertices and triangles of a file of MESHES or SCENES as they stand in its bytes `data`; equal corners
    are not merged, there may be no triangles. FileError as `read_mesh`."""
    try:
        with np.errstate(all="ignore"):  # of numbers that are none, which are told below
            content = {**PARSERS, **SCENES}[file.suffix.lower()](data.removeprefix(UTF_8))
        largest = np.abs(content.vertices).max(initial=0.0)
        if not largest <= LARGEST_COORDINATE:
            raise ContentError(f"has a coordinate of {largest:.3g}", "export it again")
        mesh = TriangleMesh(content.vertices, triangles_of(content).astype(np.int32))
        return MeshFile(mesh, content.unit, content.notes)
    except ContentError as error:
        raise FileError(f"{file}: {error}", file=str(file), **error.evidence) from error
    except (OverflowError, MemoryError) as error:
        raise file_error(file, "tells of numbers that are too large", "copy or export it again") from error


def _read_other(file: Path) -> MeshFile:
    """The triangles of a CAD file or of text with points, which MeshLab does not read."""
    ending = file.suffix.lower()
    if ending in (*STEP, *IGES):
        return read_cad_mesh(file)
    if ending in (*ACIS, *DXF):
        return read_polyhedra(file)
    blocks = read_blocks(file)
    if len(blocks) > 1:
        raise file_error(
            file, f"holds {len(blocks)} rows of points, no mesh", "skin them with bonecam.surface.skinning.read_rows"
        )
    return MeshFile(_round_points(file, blocks[0]))


def _round_points(file: Path, points: Float[ndarray, "n 3"]) -> TriangleMesh:
    """The surface round a point cloud; FileError where the points are too few, MeshError where it misses
    them."""
    if len(points) < FEWEST:
        raise file_error(
            file,
            f"holds no triangles, and {len(points)} points are no cloud",
            "give a surface mesh, not points or curves",
        )
    try:
        return reconstruct(points)
    except MeshError as error:
        raise MeshError(f"{file}: {error}", file=str(file), **error.evidence) from error


def write_mesh(
    mesh: TriangleMesh, path: str | Path, quality: Float[ndarray, " n"] | None = None, largest: float = 0.0
) -> None:
    """Write `mesh` as binary PLY or STL, or as 3MF, which says that it is in mm, whole or not at all.

    `quality` is a number a vertex (PLY only), coloured from 0 to `largest` where that is given.
    """
    target = Path(path)
    if target.suffix.lower() not in WRITABLE:
        raise file_error(
            target, f"has the unknown ending {target.suffix!r}", f"end the name in one of {', '.join(WRITABLE)}"
        )
    if quality is not None and (len(quality) != len(mesh.vertices) or target.suffix.lower() != ".ply"):
        raise ValueError(
            f"quality needs a .ply and one number for each of {len(mesh.vertices)} vertices, not {len(quality)}"
        )
    extra: dict[str, Any] = {} if quality is None else {"v_scalar_array": np.asarray(quality, dtype=np.float64)}
    meshset = meshlab().MeshSet()
    meshset.add_mesh(meshlab().Mesh(mesh.vertices, mesh.faces, **extra))
    shown = quality is not None and largest > 0
    options: dict[str, Any] = {} if target.suffix.lower() == ".3mf" else {"binary": True}
    if target.suffix.lower() == ".ply":
        options |= {"save_vertex_quality": quality is not None, "save_vertex_color": shown}
    if shown:
        meshset.compute_color_from_scalar_per_vertex(**quality_colours(largest))
    with whole_file(target) as work:
        saved = work.with_name(f"mesh{target.suffix.lower()}")  # a name that MeshLab can write
        try:
            with library_name(saved.parent) as folder:
                meshset.save_current_mesh(str(Path(folder) / saved.name), **options)
        except meshlab().PyMeshLabException as error:  # which says only that the output failed: the disk is full
            raise file_error(
                target, "cannot be written (is the disk full?)", "make room there or choose another folder"
            ) from error
        require_room(saved)
        os.replace(saved, work)


def bytes_of(file: Path) -> bytes:
    """The bytes of a part's file; FileError where it is a folder or another special file, empty or cannot be
    read."""
    if not file.name:
        raise file_error(file, "is no name of a file", "give the path of a mesh file")
    if os.path.isdir(file):  # that of a path raises where the name is too long
        raise file_error(file, "is a folder", "give a file in it, or all of them to `bonecam batch`")
    try:
        data = input_bytes(file)
    except OSError as error:
        raise file_error(file, f"cannot be read ({error.strerror})", "give the path of a readable mesh file") from error
    if not data:
        raise file_error(file, "is empty", "write it anew from its source")
    return data
