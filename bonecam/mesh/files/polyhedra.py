"""Polyhedra in SAT, SAB (ACIS) and DXF files through ezdxf (optional extra `cad`).

ezdxf is no ACIS kernel: it knows flat faces with straight edges. A body with curved faces, or with holes in
its faces, is refused whole rather than read in part. From a DXF come 3DFACE, MESH, POLYLINE meshes, 3DSOLID
and BODY, those inside inserted blocks too; blocks of other files and clipped ones are refused. Where the header
states a unit (SAT: mm a unit; DXF: $INSUNITS) the part comes back in mm; else its numbers stand.
"""

import re
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bonecam.errors import FileError, file_error
from bonecam.files import input_bytes
from bonecam.mesh.files.polygons import MeshFile, left_out_note
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.text.numbers import shortened

ACIS = (".sat", ".sab")
"""Endings of ACIS files."""
DXF = (".dxf",)
"""Endings of DXF files."""
SOLIDS = ("3DSOLID", "BODY", "REGION", "SURFACE")
"""Entities of a DXF that hold an ACIS body."""

MOST_INSERTED = 1_000_000
"""Most faces that a DXF may insert by blocks, those of blocks within blocks counted each time: 0.4 GB in ezdxf."""

SCALE_DIGITS = 1e-5
"""A transform whose scale is nearer to 1 has none: it is written with six digits."""

Polygon = Sequence[Any]


def read_polyhedra(path: str | Path) -> MeshFile:
    """The polyhedra of a .sat, .sab or .dxf file as triangles, equal corners merged; entities of a DXF that are no
    faces are left out and noted. FileError names the file and what is wrong with it."""
    file = Path(path)
    try:
        import ezdxf  # noqa: F401
    except ImportError as error:
        raise file_error(
            file, f"reading {file.suffix[1:].upper()} needs ezdxf", "pip install 'bonecam[cad]'"
        ) from error
    try:
        others: Counter[str] = Counter()
        polygons, scale = _from_dxf(file, others) if file.suffix.lower() in DXF else _from_acis(file)
        corners = np.array(
            [[tuple(corner) for corner in triangle] for triangle in _triangles(polygons)], dtype=np.float64
        )
    except FileError:
        raise
    except Exception as error:  # ezdxf raises all kinds on damaged files: StopIteration, ZeroDivisionError, KeyError
        kind = file.suffix[1:].upper()
        reason = shortened(" ".join(str(error).split()), 200) or type(error).__name__
        raise file_error(file, f"is no readable {kind} file ({reason})", "export the part again, or as STEP") from error
    if not len(corners):
        raise file_error(file, "holds no faces", "give a part with faces, not curves or points")
    vertices, index = np.unique(corners.reshape(-1, 3) * (scale or 1.0) + 0.0, axis=0, return_inverse=True)
    try:
        mesh = TriangleMesh(vertices, index.reshape(-1, 3).astype(np.int32))
    except ValueError as error:
        raise file_error(file, f"has coordinates that are not numbers ({error})", "export the part again") from error
    return MeshFile(mesh, "mm" if scale else "", left_out_note(others))


def _triangles(polygons: Iterable[Polygon]) -> Iterator[Polygon]:
    """The triangles of each polygon, concave ones too, by ear clipping.

    ezdxf returns rotated copies of the corners, with rounding errors; the corners themselves are put back.
    """
    from ezdxf.math.triangulation import mapbox_earcut_3d

    for polygon in polygons:
        if len(polygon) == 3:
            yield polygon
        elif len(polygon) > 3:
            for ear in mapbox_earcut_3d(polygon):
                yield [min(polygon, key=corner.distance) for corner in ear]


def _from_acis(file: Path) -> tuple[list[Polygon], float]:
    """Polygons of a .sat or .sab file and the mm of its unit, 0 where it states none."""
    from ezdxf.acis import api, sab, sat

    data = input_bytes(file)
    _refuse_scaled(file, data)
    if file.suffix.lower() == ".sab":
        bodies = api.load(data)
        header = sab.parse_sab(data).header
    else:
        text = data.decode("ascii", errors="replace").splitlines()
        bodies = api.load(text)
        header = sat.parse_sat(text).header
    return list(_body_polygons(file, bodies)), max(header.units_in_mm, 0.0)


def _refuse_scaled(file: Path, data: bytes) -> None:
    """FileError where a transform in ACIS data has a scale: ezdxf passes over it."""
    for scale in re.findall(rb"(\S+)\s+(?:no_)?rotate\b", data):
        if abs(float(scale) - 1) > SCALE_DIGITS:
            raise file_error(file, f"scales a body by {float(scale):g}", "apply the scale, and export it again")


def _body_polygons(file: Path, bodies: Iterable[Any]) -> Iterator[Polygon]:
    """The polygons of ACIS bodies. FileError where a face is curved, has a curved edge or a hole."""
    from ezdxf.acis.mesh import flat_polygon_faces_from_body

    for body in bodies:
        faces = list(_faces(body))
        polygons = [polygon for lump in flat_polygon_faces_from_body(body) for polygon in lump]
        curved = len(faces) - len(polygons)
        holed = sum(not face.loop.is_none and not face.loop.next_loop.is_none for face in faces)
        if curved or holed:
            what = f"has {curved} curved faces of {len(faces)}" if curved else f"has {holed} faces with holes"
            raise file_error(
                file, what, "only flat faces can be read from ACIS: export the part as STEP", curved=curved, holed=holed
            )
        yield from polygons


def _faces(body: Any) -> Iterator[Any]:
    """The faces of all shells of an ACIS body. ValueError where a list in it never ends: ezdxf would follow it for
    ever."""
    for lump in _linked(body.lump, "next_lump"):
        for shell in _linked(lump.shell, "next_shell"):
            for face in _linked(shell.face, "next_face"):
                if not face.loop.is_none:
                    deque(_linked(face.loop.coedge, "next_coedge", ring=True), maxlen=0)
                yield face


def _linked(first: Any, link: str, *, ring: bool = False) -> Iterator[Any]:
    """The entities of an ACIS list from the `first` on, each of which names the next one as `link`; of a `ring`, which
    comes back to the first, once round. ValueError where it comes back to another one."""
    entity = first
    seen = set[int]()
    while not entity.is_none and not (ring and seen and entity is first):
        if id(entity) in seen:
            raise ValueError(f"{link} of {entity.type} leads round for ever")
        seen.add(id(entity))
        yield entity
        entity = getattr(entity, link)


def _from_dxf(file: Path, others: Counter[str]) -> tuple[list[Polygon], float]:
    """Polygons of the model space of a .dxf file and the mm of its unit, 0 where it states none; `others` counts by
    their kinds what is no face, and blocks and layouts with faces that the model space does not show."""
    import ezdxf
    from ezdxf.units import MM, conversion_factor
    from ezdxf.xclip import XClip

    drawing = ezdxf.readfile(file)
    shown: dict[str, list[Polygon] | None] = {}
    """Polygons of each block, those of the blocks in it too; None of one that is being read."""
    inserted = 0

    def polygons_of(block: Any) -> list[Polygon]:
        nonlocal inserted
        polygons: list[Polygon] = []
        shown[block.block_record_handle] = None
        for entity in block:
            if entity.dxftype() != "INSERT":
                polygons += _entity_polygons(file, entity) if _is_surface(entity) else []
                others[entity.dxftype()] += not _is_surface(entity)
                continue
            inner = entity.block()
            if inner is None or inner.block_record.is_xref:
                what = f"shows the block {entity.dxf.name!r}, which is in another file"
                raise file_error(file, what, "bind it (XREF) and save the drawing")
            if XClip(entity).is_clipping_enabled:
                what = f"shows the block {inner.name!r} clipped (XCLIP)"
                raise file_error(file, what, "cut the part itself")
            key = inner.block_record_handle
            faces = shown[key] if key in shown else polygons_of(inner)
            if faces is None:
                raise file_error(file, f"has the block {inner.name!r} within itself", "export the part again")
            inserted += entity.mcount * len(faces)
            if inserted > MOST_INSERTED:
                what = f"inserts more than {MOST_INSERTED:,} faces by its blocks"
                raise file_error(file, what, "export the part alone")
            for copy in entity.multi_insert() if faces and entity.mcount > 1 else [entity]:
                matrix = copy.matrix44()
                way = -1 if matrix.determinant() < 0 else 1
                polygons += [list(matrix.transform_vertices(polygon))[::way] for polygon in faces]
        shown[block.block_record_handle] = polygons
        return polygons

    polygons = polygons_of(drawing.modelspace())
    others["blocks or layouts with faces that are not shown"] = sum(
        block.block_record_handle not in shown and any(map(_is_surface, block)) for block in drawing.blocks
    )
    return polygons, conversion_factor(drawing.units, MM) if drawing.units else 0.0


def _is_surface(entity: Any) -> bool:
    """Whether a DXF entity has faces."""
    kind = entity.dxftype()
    if kind == "POLYLINE":
        return bool(entity.is_poly_face_mesh or entity.is_polygon_mesh)
    return kind in ("3DFACE", "MESH", *SOLIDS) or kind.endswith("SURFACE")


def _entity_polygons(file: Path, entity: Any) -> list[Polygon]:
    """The polygons of one DXF entity that has faces. FileError where they are not read: a MESH or POLYLINE that is
    smoothed too."""
    from ezdxf.acis import api
    from ezdxf.render import MeshBuilder

    kind = entity.dxftype()
    if kind == "3DFACE":
        return [entity.wcs_vertices()]
    if kind == "MESH" and not entity.dxf.subdivision_levels:
        return list(MeshBuilder.from_mesh(entity).faces_as_vertices())
    if kind == "POLYLINE" and entity.is_poly_face_mesh:
        polygons = list(MeshBuilder.from_polyface(entity).faces_as_vertices())
        if entity.dxf.n_count not in (0, len(polygons)):
            what = f"has a POLYLINE of {len(polygons)} faces that tells of {entity.dxf.n_count}"
            raise file_error(file, what, "export the part again")
        return polygons
    if kind == "POLYLINE" and len(entity.vertices) == entity.dxf.m_count * entity.dxf.n_count:
        grid = np.arange(len(entity.vertices)).reshape(entity.dxf.m_count, -1)
        grid = np.pad(grid, ((0, entity.is_m_closed), (0, entity.is_n_closed)), mode="wrap")
        corners = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1)
        points = list(entity.points())
        return [[points[corner] for corner in quad] for quad in corners.reshape(-1, 4)]
    bodies = []
    if kind in SOLIDS:
        _refuse_scaled(file, entity.sab or "\n".join(entity.sat).encode())
        bodies = api.load_dxf(entity)
    if not bodies:
        raise file_error(file, f"holds a {kind} that cannot be read", "export the part as STEP")
    return list(_body_polygons(file, bodies))
