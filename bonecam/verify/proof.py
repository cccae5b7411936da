"""The proof of a posted text: read back (`nc/reading`), judged as its control would run it (`control`), compared with
the tool paths (`readback.py`), and checked for gouges of the part (`gouge.py`).

And the removal of one surface that is machined alone, from the solids and as much material on it as its finishing cut
is deep.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bonecam.errors import ToolPathError, VerifyError, knowing
from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.material.rays import lay_solids
from bonecam.mechanics.loads import workpiece_of
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.solids import cylinder, half_edges
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.reading import read_program
from bonecam.planning.post_length import carrying_solid
from bonecam.progress import Progress, report, silent
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import ToolPath
from bonecam.verify.control import check_control
from bonecam.verify.findings import GivenSurface, Removal
from bonecam.verify.gouge import Distances, Gouge, measure_gouge
from bonecam.verify.readback import Tolerances, compare_moves
from bonecam.verify.removal import ACCURACY, check_removal_of_job, cutters_of, simulate_removal
from bonecam.verify.sweeping import NormalProbes, SimulatedStock, normal_probes_on
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import Column, Post, post_below

CHORD = 0.01
"""Chord tolerance of the layer on the surface, of the post, and of the surface on which is told what stands, mm."""
SUNK = 0.02
"""The layer reaches so far into the solid below it, mm: both are tessellated."""


def prove_surface_removal(
    text: str,
    machine: Machine,
    dialect: Dialect,
    job: Job,
    surface: TSpline,
    solid: TriangleMesh,
    progress: Progress = silent,
    *,
    mechanics: bool = True,
) -> tuple[Removal, str]:
    """What the posted `text` removes from the stock before it, where a `surface` and the `solid` of everything that
    must not be gouged stand on the post of the job; and why force and bending are not known, "" where they are. Errors
    as in `check_removal_of_job`, for an assumed stock."""
    carrying = carrying_solid(surface, solid)
    clamping = clamping_of(job.holding, machine.table)
    post = Post(job.holding.diameter / 2, float(solid.bounds[0, 2]))
    shown = surface.tessellate(CHORD)
    unknown, work = "", None
    if mechanics:
        try:
            post = post_below(carrying, job.holding)
            work = replace(workpiece_of(job, post, clamping), body=carrying)
        except ToolPathError as error:
            unknown = f"force and bending are not known, since {error}"

    # What stands before the surface is finished, on post and stub, with the normal probes of the surface
    # The closed mesh of a layer of material that is `depth` mm thick on a surface, along its normals.
    tessellation = surface.tessellate_with_parameters(CHORD)
    s, t = tessellation.parameters.T
    normals = surface.normals(s, t)
    faces = tessellation.mesh.faces
    points = tessellation.mesh.vertices
    count = len(tessellation.mesh.vertices)
    edges = half_edges(tessellation.mesh).reshape(-1, 2).astype(np.int64)
    forward, backward = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    a, b = edges[~np.isin(forward, backward)].T
    walls = np.vstack([np.column_stack([a + count, b + count, b]), np.column_stack([a + count, b, a])])
    closed = np.vstack([faces, faces[:, ::-1] + count, walls])
    both = np.vstack([points + job.levels.finishing_depth * normals, points - SUNK * normals])
    solids = [solid, TriangleMesh(both, closed.astype(np.int32))]
    material = solids_stock(solids, clamping.carried(post), normal_probes_on(surface))
    removal = simulate_removal(
        text,
        machine,
        dialect,
        material,
        post,
        cutters_of(job, machine),
        clamping=clamping,
        limits={0: job.levels.finishing_depth},
        surfaces={0: shown},
        workpiece=work,
        progress=progress,
    )
    over = float(MeshDistance(solid).signed(shown.vertices).max(initial=0.0))
    with knowing(removal.sections):
        check_removal_of_job(removal, job, over, assumed=True)
    return removal, unknown


def solids_stock(solids: Sequence[TriangleMesh], carried: Sequence[Column], probes: NormalProbes) -> SimulatedStock:
    """Solids and the columns of their material that carry them, in rays."""
    columns = [cylinder(column.radius, column.bottom, column.top, CHORD) for column in carried]
    sets, grid = lay_solids([*solids, *columns], ACCURACY.cell, ACCURACY.memory_mb)
    return SimulatedStock(sets, grid, probes)


DESIGN_CHORD = 0.001
"""Largest chord tolerance (mm) of the tessellated design surface: DESIGN_SHARE of the gouge allowed by
default."""
DESIGN_SHARE = 0.1
"""Part of the gouge allowed that the tessellated design surface may deviate by."""


@dataclass(frozen=True)
class Verification:
    """What was measured on the text; `gouge`: where the ball enters the part deepest, or least clears it; `given`: the
    same of the mesh as given, None where none was."""

    moves: int
    rows: int
    readback_tip_error_mm: float
    readback_axis_error_deg: float
    gouge: Gouge
    given: Gouge | None = None

    def __str__(self) -> str:
        """What was proved, in the words of the program's header."""
        tip = f"tip within {1000 * self.readback_tip_error_mm:.2f} um"
        axis = f"axis within {self.readback_axis_error_deg:.4f} deg of the path"
        gouge = f"gouge {1000 * max(self.gouge.depth, 0.0):.2f} um"
        if self.given is not None:
            gouge += f", {1000 * max(self.given.depth, 0.0):.1f} um of the mesh as given"
        return f"text read back, {tip}, {axis}, {gouge}"


def verify(
    text: str,
    paths: Sequence[ToolPath],
    machine: Machine,
    dialect: Dialect,
    part: TSpline | Distances,
    *,
    job: Job | None = None,
    given: GivenSurface | None = None,
    progress: Progress = silent,
) -> Verification:
    """Read `text` back and prove that the control runs it as the `job` means, against the paths and the part.

    `part` is the design surface, or the distances to what must not be gouged. A surface is tessellated finely: the
    tessellation's own deviation is not seen, but in the gouge of the mesh as `given`.
    ProgramError where the text cannot be read, VerifyError (with `line`, `place`, `error`) where it is wrong.
    """
    report(progress, 0.0, "reading the program back")
    allowed = Tolerances(gouge=job.path.gouge_tolerance) if job else Tolerances()
    if isinstance(part, TSpline):
        part = MeshDistance(part.tessellate(min(DESIGN_CHORD, DESIGN_SHARE * allowed.gouge)))
    motions = read_program(text, machine, dialect)
    check_control(motions, machine, dialect, job)
    checked = compare_moves(motions, paths, dialect, allowed)
    gouge = measure_gouge(motions, part)
    if gouge.depth > allowed.gouge:
        place = ", ".join(f"{value:.3f}" for value in gouge.place)
        raise VerifyError(
            f"line {gouge.line}: the ball enters the part by {gouge.depth:.4f} mm at ({place}), "
            f"allowed {allowed.gouge:g}: make path.chord_tolerance smaller",
            line=gouge.line,
            place=gouge.place,
            error=gouge.depth,
        )
    into_given = None
    if given is not None:
        into_given = measure_gouge(motions, given)
        given.check_gouge(into_given)
    return Verification(
        moves=motions.blocks,
        rows=checked.rows,
        readback_tip_error_mm=float(checked.tip_error.max(initial=0.0)),
        readback_axis_error_deg=float(np.degrees(checked.axis_error.max(initial=0.0))),
        gouge=gouge,
        given=into_given,
    )
