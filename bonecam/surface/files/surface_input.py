"""Whether a surface that is machined alone lies on the solids that are given with it.

A filter script (.mlx) that a part's mesh goes through before anything else.

A surface that is machined alone, from a file or a mesh: closed or open, in the parameters that its passes follow.

Parts that come as a surface and need no fit: rows of points that are skinned, or a T-spline that was saved
before.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FilterError, MeshError, SurfaceError, UnitsError, counted, file_error
from bonecam.job import Job, MeshJob, field_error
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.files.cad import IGES, STEP
from bonecam.mesh.files.mesh_files import MESHES, read_in_mm, read_mesh, reader_of, write_mesh
from bonecam.mesh.files.points import POINTS
from bonecam.mesh.part import Part, repaired_part
from bonecam.mesh.pose import upright
from bonecam.mesh.solids import self_intersections
from bonecam.mesh.triangle_mesh import MeshLike, TriangleMesh, mesh_from
from bonecam.mesh.units import LARGEST, mm_of, to_mm, unit_in
from bonecam.plugins import added, added_names, reader_endings
from bonecam.progress import Progress, silent
from bonecam.runtime.staging import temporary_folder
from bonecam.surface.files.bspline import from_bspline
from bonecam.surface.files.cad import read_bsplines
from bonecam.surface.files.tspline_text import TSPLINE, holds_tspline, load_surface
from bonecam.surface.fitting import Deviation
from bonecam.surface.growth import Fit
from bonecam.surface.skinning import holds_rows, patch_surface, read_rows
from bonecam.surface.tessellation import tessellate
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

SAMPLED = 20
"""Places along s and along t at which a surface is looked at from outside."""
ABOVE = 0.1
"""From so far, mm: ten times the gouge allowed by default."""
FLOATING = 1.0
"""A surface that lies farther from the solids, mm, is none of theirs: an allowance on a part is less."""


def check_on_solids(surface: TSpline, solid: TriangleMesh, file: str) -> None:
    """SurfaceError where most of a surface lies in the solid that it belongs to, faces into it, or lies off it: links
    would go through what it bounds."""
    shares = (np.arange(SAMPLED) + 0.5) / SAMPLED
    along = (low + shares * (high - low) for low, high in surface.domain)
    s, t = (places.ravel() for places in np.meshgrid(*along))
    places = surface.positions(s, t)
    distance = MeshDistance(solid)
    covered = float(distance.inside(places + ABOVE * surface.normals(s, t)).mean())
    if covered > 0.5:
        what = f"{covered:.0%} of it lies in the solids that must not be gouged, or faces into them"
        raise SurfaceError(f"{file}: {what}: reverse every row, or leave the solid out that covers it", file=file)
    away = distance.unsigned(places)
    if np.median(away) > FLOATING:
        what = f"half of it lies {np.median(away):.1f} to {away.max():.1f} mm off part and obstacles"
        raise SurfaceError(f"{file}: {what}: give the solid that it bounds (--part) beside them", file=file)


def scripted_mesh(mesh: TriangleMesh, script: str) -> TriangleMesh:
    """What a script leaves of a mesh, run by the plugin for its ending.

    FilterError where no plugin runs it, where it leaves more or less than one layer with faces, or what that raises.
    """
    ending = Path(script).suffix.lower().removeprefix(".")
    if ending not in added_names("scripts"):
        raise FilterError(f"{script}: no plugin that runs it is installed: leave mesh.script out", file=script)
    run_script = added("scripts", ending)
    with temporary_folder() as folder:
        write_mesh(mesh, folder / "mesh.ply")
        layers = map(read_mesh, run_script(script, [folder / "mesh.ply"], folder / "layers"))
        meshes = [layer for layer in layers if len(layer.faces)]
    if len(meshes) != 1:
        what = f"leaves {counted(len(meshes), 'layer')} with faces"
        raise FilterError(f"{script}: {what}: let it end with the part's mesh alone", file=script)
    return meshes[0]


def machined_surface(source: str | Path | MeshLike, units: str, tolerance: float) -> TSpline:
    """The surface in a file, mm: rows of points or an open mesh (in `units`), skinned within `tolerance` mm; a saved
    T-spline; or the B-spline of a STEP or IGES file with one face. Or that of an open mesh in memory.

    FileError or SurfaceError where the file holds no such surface, or one that closes on itself in t.
    """
    if not isinstance(source, str | Path):
        return patch_surface(to_mm(mesh_from(source), units), tolerance)
    file = Path(source)
    ending = file.suffix.lower()
    if holds_tspline(file):
        surface = load_surface(file)
    elif ending in (*STEP, *IGES):
        faces = read_bsplines(file)
        if len(faces) != 1:
            raise file_error(file, f"has {len(faces)} faces", "save the one to machine by itself")
        surface = from_bspline(faces[0])
    elif ending in (*POINTS, *MESHES) or reader_of(file) is not None:
        try:
            if ending in POINTS:
                surface = read_rows(file).scaled(mm_of(units)).skin(tolerance)
            else:
                surface = patch_surface(read_in_mm(file, units), tolerance)
        except (ValueError, SurfaceError) as error:
            raise SurfaceError(f"{file}: {error}", file=str(file)) from error
    else:
        endings = ", ".join((*POINTS, TSPLINE, *reader_endings(), *STEP, *IGES, *MESHES))
        remedy = f"give a surface that passes can follow ({endings})"
        raise file_error(file, f"has the ending {ending!r}", remedy)
    if surface.elements().period[1]:
        raise SurfaceError(f"{file}: closes on itself in t: cut it open there", file=str(file))
    return surface


CHORD = 0.01
"""Chord tolerance of the mesh that stands for the surface, mm."""
MOST_VERTICES = 1000
"""So many vertices a control point may that mesh have: the phalanx's has 81, those of damaged files took minutes."""
NO_VOLUME = 1e-3
"""A surface that encloses less, mm^3, encloses no part."""
SPARE = 2.0
"""By so much the control points of a surface's Bezier elements may be farther apart than its points."""


def read_part(source: str | Path | MeshLike, job: Job, progress: Progress = silent) -> tuple[Part, Fit | None]:
    """The part of a mesh or file, upright, its pits open, and the surface, in the file's mm, where the file gives that.
    MeshError where repairs take more off the part than the job's largest deviation."""
    if not isinstance(source, str | Path) or not holds_surface(source):
        part = repaired_part(
            source, job.mesh, progress=progress, also=(TSPLINE,), surface=job.surface, scripted=scripted_mesh
        )
        return part.require_kept(job.surface.largest_deviation), None
    # The part whose surface is given by rows of points or a saved T-spline, upright, and that surface
    refuse_changes(job.mesh, str(source))
    fitted = read_surface(source, mm_of(job.mesh.units), job.surface.tolerance_for(), job.surface.max_control_points)
    mesh = closed_mesh(fitted.surface, str(source))
    posed, transform = upright(mesh) if job.mesh.upright else (mesh, np.eye(4))
    return (
        Part(
            mesh=posed,
            file=str(source),
            faces=len(mesh.faces),
            units=unit_in(job.mesh.units),
            repairs=(),
            transform=transform,
            given=mesh,
        ),
        fitted,
    )


def refuse_changes(job: MeshJob, name: str) -> None:
    """JobError where a surface, which is machined as it is given, is to be mirrored, scaled or filtered."""
    if job.changes:
        field = "script" if job.script else "mirror" if job.mirror != "none" else "scale"
        remedy = f"only meshes are: leave it out, and give {name} as it is to become"
        raise field_error("mesh", field, getattr(job, field), remedy)


def holds_surface(path: str | Path) -> bool:
    """Whether a file gives the surface itself: a T-spline, or two or more rows of points."""
    return holds_tspline(path) or holds_rows(path)


def read_surface(path: str | Path, scale: float, tolerance: float, max_control_points: int) -> Fit:
    """The closed surface in a file; rows are scaled by `scale` (mm a unit of the file) and skinned within
    `tolerance` mm.

    The deviation is that of the given points. Raises FileError, or SurfaceError where the surface does not
    enclose a part.
    """
    if holds_tspline(path):
        # The T-spline of a file, and no points.
        if scale != 1:
            raise UnitsError(
                f"{path}: states its unit itself and was read in mm: leave out --units (mesh.units)", file=str(path)
            )
        surface = load_surface(path)
        count = surface.tmesh.size
        if count > max_control_points:
            what = f"has {count} control points, {max_control_points} are allowed"
            raise SurfaceError(f"{path}: {what}: raise surface.max_control_points", file=str(path))
        check_surface_size(surface, path)
        points = np.empty((0, 3))
    else:
        # The surface through the rows of a file, and their points, mm
        rows = read_rows(path).scaled(scale)
        points = np.vstack([*rows.rows, *([] if rows.poles is None else [rows.poles])])
        _check_size(points, path)
        try:
            surface = rows.skin(tolerance, max_control_points)
        except (ValueError, SurfaceError) as error:
            raise SurfaceError(f"{path}: {error}", file=str(path)) from error
    if not (isinstance(surface.tmesh, RowTMesh) and all(surface.tmesh.poles)):
        remedy = (
            "give a pole (one point) as the first and the last block"
            if len(points)
            else "only closed rows between two poles do"
        )
        alone = "`bonecam finish` machines a surface alone"
        raise SurfaceError(f"{path}: encloses no part: {remedy}; {alone}", file=str(path))
    check_outward(surface, str(path))
    # The largest and the RMS distance of the points from the surface, mm, and the place of the largest
    deviation = Deviation(0.0, 0.0, 0.0, 0.0, surface.control_points[0])
    if len(points):
        distances = surface.project(points).distances
        worst = float(distances.max())
        rms = float(np.sqrt(np.mean(distances**2)))
        deviation = Deviation(worst, rms, 0.0, worst, points[np.argmax(distances)])
    return Fit(surface, deviation, tolerance, deviation.max <= tolerance)


def check_surface_size(surface: TSpline, name: str | Path) -> None:
    """UnitsError where a surface is far larger than a part; messages say `name` for it."""
    patches = surface.patches.reshape(-1, 4)
    _check_size(patches[:, :3] / patches[:, 3:], name)


def _check_size(points: Float[ndarray, "n 3"], path: str | Path) -> None:
    """UnitsError where points whose hull holds the surface, or which it passes, are far larger than a part: before
    the surface is tessellated, which would take a time that grows with its size.
    """
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not size <= SPARE * LARGEST:
        what = f"{size:.3g} mm from corner to corner: parts have {LARGEST:g} mm at most"
        raise UnitsError(f"{path}: {what}: scale it first", size_mm=size)


def check_outward(surface: TSpline, file: str) -> None:
    """SurfaceError where a closed surface encloses no volume, or its normals point inward."""
    volume = surface.volume
    if abs(volume) <= NO_VOLUME:
        raise SurfaceError(f"{file}: encloses no volume: give rows that go round a part", file=file, volume=volume)
    if not volume > 0:
        remedy = "its normals S_s x S_t point inward: reverse every row"
        raise SurfaceError(f"{file}: {remedy}", file=file, volume=volume)


def closed_mesh(surface: TSpline, file: str) -> TriangleMesh:
    """The surface as a closed mesh.

    Raises UnitsError where it has not the size of a part, MeshError where it intersects itself, SurfaceError where no
    mesh comes near it: a weight is far larger than the others, or it is creased.
    """
    mesh = to_mm(mesh_of_surface(surface, file), "mm", file)
    faces = self_intersections(mesh)
    if len(faces):
        place = mesh.vertices[mesh.faces[faces[0]]].mean(axis=0)
        at = f"near {np.round(place, 2).tolist()}"
        raise MeshError(
            f"{file}: its surface cuts itself {at}: mend the rows there, or give a mesh",
            file=file,
            faces=faces,
            place=place,
        )
    return mesh


def mesh_of_surface(surface: TSpline, file: str) -> TriangleMesh:
    """The surface of a file as a mesh. SurfaceError where that takes more vertices than its control points can need."""
    try:
        return tessellate(surface, CHORD, most_vertices=MOST_VERTICES * surface.tmesh.size).mesh
    except SurfaceError as error:
        what = f"{file}: {str(error).partition(':')[0]}"
        remedy = "correct weights and points there, or give a mesh"
        raise SurfaceError(f"{what}: {remedy}", **{**error.evidence, "file": file}) from error


def move_with_part(given: Fit, transform: Float[ndarray, "4 4"]) -> Fit:
    """The given surface under the rigid transform (4, 4) of its part, with t from the lower to the upper
    pole.
    """
    rotation = transform[:3, :3]
    shift = transform[:3, 3]
    surface = given.surface.with_control_points(given.surface.control_points @ rotation.T + shift)
    if surface.control_points[0, 2] > surface.control_points[-1, 2]:
        surface = reverse_parameters(surface)
    deviation = replace(given.deviation, place=rotation @ given.deviation.place + shift)
    return replace(given, surface=surface, deviation=deviation)


def reverse_parameters(surface: TSpline) -> TSpline:
    """The row-structured surface with both parameters reversed, S(-s, low + high - t): its normals stay
    outward.
    """
    tmesh = surface.tmesh
    if not isinstance(tmesh, RowTMesh):
        raise ValueError("only row-structured surfaces can be reverse_parameters")
    starts = tmesh.row_starts
    orders = [np.argsort(np.mod(-row, 1.0)) for row in tmesh.s_knots]
    rows = [np.mod(-row, 1.0)[order] for row, order in zip(tmesh.s_knots, orders)]
    index = np.concatenate([starts[j] + orders[j] for j in range(len(rows))[::-1]])
    t_knots = (tmesh.t_knots[0] + tmesh.t_knots[-1] - tmesh.t_knots)[::-1]
    return TSpline(RowTMesh.from_rows(t_knots, rows[::-1]), surface.control_points[index], surface.weights[index])


def read_solid(solid: str | Path | MeshLike, units: str) -> TriangleMesh:
    """The triangles of a solid in a file or in memory, mm."""
    if isinstance(solid, str | Path):
        return read_in_mm(solid, units)
    return to_mm(mesh_from(solid), units)
