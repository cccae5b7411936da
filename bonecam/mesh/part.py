"""The part: a bone's mesh, read, scaled to mm, repaired, coarse facets smoothed, its pits filled, turned upright."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import MeshError, counted, place_name
from bonecam.job import MeshJob, SurfaceJob
from bonecam.job.tool_section import FINISHING
from bonecam.mesh.distance import MeshDistance, hausdorff
from bonecam.mesh.files.label_map import LABEL_MAPS
from bonecam.mesh.files.mesh_files import axes_text, bytes_of, ending_of, read_mesh_file, stated_axes
from bonecam.mesh.files.polygons import MeshFile
from bonecam.mesh.healing import Repair, decimate, repair, without
from bonecam.mesh.hollows import Fill, fill_pits
from bonecam.mesh.pose import settled_pose, upright
from bonecam.mesh.smooth_surface import (
    Coarseness,
    Smoothing,
    coarseness_of,
    label_surface,
    note_on_kept_facets,
    smooth_facets,
)
from bonecam.mesh.triangle_mesh import MeshLike, TriangleMesh, mesh_from, probes
from bonecam.mesh.units import mirror_and_scale, to_mm, unit_in
from bonecam.progress import Progress, report, silent
from bonecam.progress import part as share
from bonecam.text.numbers import told_apart


@dataclass(frozen=True, eq=False)
class TakenOff:
    """How far, mm, vertices and face middles of the mesh as given stand out of the repaired one at most, and where, in
    the frame of the mesh as given."""

    depth: float
    place: Float[ndarray, "3"]


def measure_taken_off(given: TriangleMesh, mesh: TriangleMesh) -> TakenOff:
    """What repairs that led from the mesh as `given` to the closed `mesh` took off it, by open3d's distances, which no
    repair uses."""
    points = probes(given)
    distance = MeshDistance(mesh)
    away = np.linalg.norm(distance.closest(points)[0] - points, axis=1)
    away[distance.inside(points)] = 0.0
    worst = int(np.argmax(away))
    return TakenOff(float(away[worst]), points[worst])


@dataclass(frozen=True, eq=False)
class Part:
    """The closed mesh to be machined, mm, and where it came from.

    `file`, `faces` and `units` are those of the input, `repairs` what was changed. `given` is the input in mm, mirrored
    and scaled as the job says, and `transform` (4, 4) leads from it to the frame of `mesh`. `notes` tell what else is
    to be known of it: that it is mirrored or scaled, the axes that its file states. `fill` tells of hollows that were
    filled, `taken_off` of what repairs took off, None where nothing was changed. `smoothing` tells of a smooth surface
    that took the place of coarse facets, whose measure is `coarseness`; None where the part came as a surface.
    """

    mesh: TriangleMesh
    file: str
    faces: int
    units: str
    repairs: tuple[Repair, ...]
    transform: Float[ndarray, "4 4"]
    given: TriangleMesh
    notes: tuple[str, ...] = ()
    fill: Fill | None = None
    taken_off: TakenOff | None = None
    coarseness: Coarseness | None = None
    smoothing: Smoothing | None = None

    def __repr__(self) -> str:
        return f"<Part of {self.file}: {self.mesh!r}, {counted(len(self.repairs), 'repair')}>"

    @cached_property
    def placed_given(self) -> TriangleMesh:
        """The mesh as given, without debris and inner shells that were left out, in the frame of `mesh`."""
        left_out = [each.move(self.transform) for each in self.left_out]
        return without(self.given.move(self.transform), left_out, self.mesh)

    @property
    def header_texts(self) -> tuple[str, ...]:
        """What a program's header tells of how the mesh came about."""
        return (self.smoothing.header_text,) if self.smoothing else ()

    @property
    def sagitta(self) -> float:
        """How far the facets of the repaired mesh lie off a smooth surface, mm; infinite where none came."""
        return self.coarseness.sagitta if self.coarseness else np.inf

    @property
    def left_out(self) -> tuple[TriangleMesh, ...]:
        """What the repairs left out of the mesh as given, in its frame."""
        return tuple(repair.left_out for repair in self.repairs if repair.left_out is not None)

    @property
    def guessed_share(self) -> float:
        """Share of the surface that repairs closed, dropped or made anew."""
        return sum(repair.guessed for repair in self.repairs) / self.mesh.area

    @property
    def widest_hole(self) -> float:
        """Width of the widest hole of the mesh that was closed, mm; 0 where it had none."""
        return max((repair.hole for repair in self.repairs), default=0.0)

    @cached_property
    def repair_deviation(self) -> float:
        """Largest distance (mm, both ways) between the mesh as given and `mesh`; 0 where nothing was
        changed."""
        return max(hausdorff(self.placed_given, self.mesh)) if self.repairs else 0.0

    @cached_property
    def given_distance(self) -> MeshDistance:
        """Distances to `placed_given`."""
        return MeshDistance(self.placed_given)

    def require_kept(self, allowed: float) -> "Part":
        """The part itself; MeshError where all that was done to its mesh, but for a smoothing, takes more than
        `allowed` mm off it."""
        taken = self.taken_off
        if taken is None or taken.depth <= allowed:
            return self
        depth, most = told_apart(taken.depth, allowed, decimals=2)
        raise MeshError(
            f"{self.file}: the repairs take {depth} mm off the mesh as given near {place_name(taken.place)}, "
            f"allowed {most}: mend it there in a mesh editor, or raise surface.largest_deviation",
            file=self.file,
            place=taken.place,
        )

    def move(self, pose: Float[ndarray, "4 4"]) -> "Part":
        """The part after a rigid transform (4, 4)."""
        return replace(self, mesh=self.mesh.move(pose), transform=pose @ self.transform)


def prepare_part(
    source: str | Path | MeshLike,
    job: MeshJob,
    progress: Progress = silent,
    ball: float = FINISHING.radius,
    surface: SurfaceJob | None = None,
) -> Part:
    """The part of `repaired_part`, its pits filled up to the ball of a radius (mm), as `with_filled_pits` does."""
    return with_filled_pits(repaired_part(source, job, progress, surface=surface), ball)


def repaired_part(
    source: str | Path | MeshLike,
    job: MeshJob,
    progress: Progress = silent,
    also: tuple[str, ...] = (),
    surface: SurfaceJob | None = None,
    scripted: Callable[[TriangleMesh, str], TriangleMesh] | None = None,
) -> Part:
    """Read a mesh, run the job's filter script on it by `scripted`, scale it to mm, mirror it, decimate it where it has
    too many faces, repair it, smooth coarse facets and turn it upright, as the job says.

    `source` is a file, or a mesh in memory as `mesh_from` takes it. `surface` has the tolerance of the fit, beside
    which facets are coarse. `also` are endings of part files that the caller reads itself: a refusal names them too.
    MeshError, FileError and UnitsError name the file.
    """
    report(progress, 0.0, "reading the mesh")
    name = str(source) if isinstance(source, str | Path) else "the mesh"
    read = _read(source, job, also)
    raw = scripted(read.mesh, job.script) if job.script and scripted else read.mesh
    if not len(raw.faces):
        raise MeshError(f"{name}: the mesh has no faces: give a surface mesh", file=name)

    report(progress, 0.3, "repairing the mesh")
    scaled = mirror_and_scale(to_mm(raw, job.units, file=name, stated=read.unit), job.mirror, job.scale)
    axes = stated_axes(bytes_of(Path(source))) if isinstance(source, str | Path) else ""
    try:
        fewer, decimated = decimate(scaled, progress=share(progress, 0.3, 0.7))
        repaired, repairs = repair(fewer, progress=share(progress, 0.7, 1.0))
        coarseness = coarseness_of(repaired)
        tolerance = (surface or SurfaceJob()).tolerance_for(coarseness.sagitta)
        smoothing = smooth_facets(repaired, coarseness, job, tolerance)
    except MeshError as error:
        raise MeshError(f"{name}: {error}", file=name, **error.evidence) from error

    smooth = smoothing.mesh if smoothing else repaired
    kept = "" if smoothing else note_on_kept_facets(repaired, coarseness, job, tolerance)
    notes = tuple(filter(None, (*read.notes, *job.changes, axes_text(axes) if axes else "", kept)))
    done = decimated + repairs + ((smoothing.change,) if smoothing else ())
    transform = settled_pose(upright(smooth)[1]) if job.upright else np.eye(4)
    part = Part(
        mesh=smooth.move(transform),
        file=name,
        faces=len(raw.faces),
        units=unit_in(job.units, read.unit),
        repairs=done,
        transform=transform,
        given=scaled,
        notes=notes,
        coarseness=coarseness,
        smoothing=smoothing,
    )
    if not done:
        return part
    return replace(part, taken_off=measure_taken_off(without(scaled, part.left_out, smooth), repaired))


def with_filled_pits(part: Part, ball: float) -> Part:
    """The part with the hollows that a ball of a radius (mm) cannot reach filled up to it: the smallest one that will
    cut it (`Job.smallest_ball`)."""
    fill = fill_pits(part.mesh, ball)
    x, y, z, _ = np.linalg.solve(part.transform, [*fill.place, 1.0])
    fill = replace(fill, place=(float(x), float(y), float(z)))  # told in the frame of the mesh as given
    filled = replace(part, mesh=fill.mesh, fill=fill, repairs=part.repairs + fill.repairs)
    if part.taken_off is not None or not fill.repairs:
        return filled
    return replace(filled, taken_off=measure_taken_off(filled.placed_given, fill.mesh))


def _read(source: str | Path | MeshLike, job: MeshJob, also: tuple[str, ...]) -> MeshFile:
    """The mesh of a file or in memory as it is given, or that of a label, and what is to be known of it."""
    if not isinstance(source, str | Path):
        return MeshFile(mesh_from(source))
    if ending_of(Path(source)) not in LABEL_MAPS:
        return read_mesh_file(source, (*also, *LABEL_MAPS))
    surface = label_surface(Path(source), job.label, smooth=job.facets != "exact")
    return MeshFile(surface.mesh, surface.map.unit, surface.notes)
