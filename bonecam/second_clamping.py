"""The second program of a part that was parted: it stands turned over in its shell, and its stump is cut off.

The material at its start is what the simulation of the first program left above the middle of the groove, where the
bridge is broken or sawn. Its text is proved like the first one: read back, checked for gouges of part and shell, and
simulated, on the same rays and normal probes.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
from scipy.spatial import KDTree

from bonecam.files import check_files
from bonecam.job import Job, field_error
from bonecam.levels.measure import morph_surfaces
from bonecam.machine.machine import Machine
from bonecam.machining import post_and_prove
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.mesh.part import with_filled_pits
from bonecam.mesh.triangle_mesh import MeshLike, TriangleMesh, mesh_from
from bonecam.mesh.units import mm_of
from bonecam.nc.dialect import Dialect
from bonecam.nc.header import record_simulation, second_setup_texts
from bonecam.nc.path_words import machine_limits
from bonecam.nc.program import program_name, second_program_file
from bonecam.nc.requirements import second_job
from bonecam.planning.contacts import at_post
from bonecam.planning.scene import PART_CHORD
from bonecam.planning.stump import StumpPlaces, cut_groove, second_paths
from bonecam.progress import Progress, part, silent
from bonecam.report.kept import Result, SecondProgram
from bonecam.report.outputs import File
from bonecam.report.stage_reports import nc_report, toolpath_report
from bonecam.report.typed import SecondFigures
from bonecam.report.warnings import NOT_ASKED, with_warnings
from bonecam.setup.placement import place
from bonecam.surface.files.surface_input import read_part
from bonecam.tool.path import ToolPath
from bonecam.verify.findings import LEFT, given_surface
from bonecam.verify.removal import beside_given, check_removal_of_job, simulate_stump
from bonecam.verify.sweeping import NormalProbes, height_field_of_rays
from bonecam.workholding.post import post_below
from bonecam.workholding.shell import read_shell, shell_round, turned_over


def second_program(
    first: Result,
    machine: Machine,
    dialect: Dialect,
    program: File,
    progress: Progress = silent,
    *,
    mechanics: bool = True,
) -> SecondProgram:
    """The program that cuts the stump off a part that `first` parted, and whose job has a second clamping; `program` is
    the file of the first one, `dialect` has the work offset of `second_job`. Without `mechanics` force and bending are
    not asked.

    OrientationError, MachineError or VerifyError where there is no such program, or it is not proved.
    """
    job = second_job(first.job)

    # The part that `first` parted, turned over in its shell
    shell, groove = read_shell(first.job, first.part), cut_groove(first.paths)
    assert shell is not None
    assert groove is not None
    design = morph_surfaces(first.levels.levels)[0].tessellate(PART_CHORD)
    clamping = turned_over(design, shell, first.job.holding, groove.middle)

    # What stands, and its normal probes that a finishing ball left at the post
    assert first.removal is not None
    before = first.removal.remaining.probes
    post = post_below(first.part.mesh, first.job.holding)
    held = at_post(before.points, before.normals, post.alone, job.tool("finishing").radius)
    material = first.removal.remaining.above(clamping.cut_off).move(clamping.pose)
    planned = second_paths(
        clamping,
        StumpPlaces(material.probes.points[held], material.probes.normals[held]),
        top=clamping.top,
        fields=partial(height_field_of_rays, sets=material.sets, grid=material.grid),
        job=job,
        limits=machine_limits(machine),
        progress=part(progress, 0.0, 0.7),
    )
    file = second_program_file(program, dialect) if program else None
    given = given_surface(first.part, first.job, first.report).move(clamping.pose)
    proved = post_and_prove(
        planned,
        machine,
        dialect,
        job,
        MeshDistance(clamping.solids),
        given=given,
        name=program_name(file or "second", dialect),
        setup=partial(second_setup_texts, job, clamping.shell, clamping.top),
        touched=float(clamping.shell.bounds[1, 2]),
    )
    posted, solids = proved.program, (clamping.part, clamping.shell)
    cut = posted.text, machine, dialect, job, material, *solids, part(progress, 0.8, 1.0)
    removal = simulate_stump(*cut, mechanics=mechanics)
    removal = beside_given(removal, given, None, job)
    check_removal_of_job(removal, job)
    after = removal.remaining.probes
    paths = tuple(_told(path, after) for path in proved.paths)
    posted = record_simulation(posted, dialect, removal.cell, str(removal.mechanics or NOT_ASKED["skipped"]))
    reported = {
        "file": file.name if file else "",
        **nc_report(posted, proved.proof),
        # what kept more than LEFT at the post before and behind the second program
        "at_post_before_mm2": round(float(before.areas[held & (before.heights > LEFT)].sum()), 3),
        "at_post_after_mm2": round(float(after.areas[held & (after.heights > LEFT)].sum()), 3),
        "at_post_after_max_mm": round(float(after.heights[held].max(initial=0.0)), 4),
        "at_tailstock_mm2": round(first.removal.left.by_reason["tailstock"], 3) if first.removal.left else 0.0,
        "toolpath": toolpath_report(paths, float(np.radians(job.path.least_lead_deg))),
        "mechanics": NOT_ASKED,
        **removal.sections,
    }
    figures = cast(SecondFigures, with_warnings(reported, job))
    return SecondProgram(Path(first.part.file).name, clamping, paths, posted, removal, report=figures, job=job)


def clamping_shell(
    mesh: "str | Path | MeshLike",  # a text, as help() would write the union out
    job: Job | None = None,
    *,
    output: File = None,
    covered: float = 0.5,
    wall: float = 3.0,
    gap: float = 0.1,
) -> TriangleMesh:
    """A shell for `holding.second` of a part that is placed as the job says, in frame and unit of the part's file.

    It is a cylinder about the axis of the post round the upper `covered` share of the part, at least `wall` mm thick,
    `gap` mm off the part. It is written to the mesh file `output`. ValueError where these make no shell.
    """
    job = job or Job()
    check_files([output], [mesh])
    given = mesh if isinstance(mesh, str | Path) else mesh_from(mesh)
    part, _ = read_part(given, job)
    part = with_filled_pits(part, job.smallest_ball)
    placed = place(part, job).part
    back = np.linalg.inv(placed.transform)
    shell = shell_round(placed.mesh, covered, wall, gap).move(back)
    shell = TriangleMesh(shell.vertices / mm_of(job.mesh.units), shell.faces)
    if output is not None:
        write_mesh(shell, output)
    return shell


def check_simulated(job: Job, *, simulation: bool) -> None:
    """JobError where a job wants a second program, which begins with what the simulation of the first leaves, and no
    simulation."""
    if job.holding.second and not simulation:
        why = "the second program begins with what the simulation of the first leaves: simulate it"
        raise field_error("holding", "second", job.holding.second, why)


def _told(path: ToolPath, probes: NormalProbes) -> ToolPath:
    """The path without those of its hidden places that nothing stays on: the ball that cuts beside them took it."""
    hidden = np.array([reason == "hidden" for reason in path.reasons], dtype=bool)
    if not hidden.any():
        return path
    kept = ~hidden | (probes.heights[KDTree(probes.points).query(path.uncut)[1]] > LEFT)
    reasons = tuple(reason for reason, known in zip(path.reasons, kept, strict=True) if known)
    return replace(path, uncut=path.uncut[kept], reasons=reasons)
